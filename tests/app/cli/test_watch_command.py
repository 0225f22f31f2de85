"""Files of a folder become runs, results, a table and a report."""

from pathlib import Path

import numpy as np
import pytest

from analysis.synthetic import Truth, simulate_readings
from app.cli import watch as watch_module

READ = ("--time", "t", "--table", "u1", "--relative", "rel", "--unit", "mm", "--series", "1FFM0")


@pytest.fixture
def incoming(tmp_path):
    folder = tmp_path / "incoming"
    folder.mkdir()
    return folder


def write_record(folder, name: str, seed: int) -> None:
    time_s, table, relative = simulate_readings(Truth(rate_hz=500.0, duration_s=8.0, seed=seed))
    cells = np.column_stack([time_s, 1e3 * table, 1e3 * relative])
    np.savetxt(folder / name, cells, delimiter=",", header="t,u1,rel", comments="")


def test_files_are_imported_identified_and_tabulated_once(slipstand, tmp_path, incoming) -> None:
    write_record(incoming, "a.csv", 1)
    (incoming / "broken.csv").write_text("t,u1,rel\n1,2,3\n")
    slipstand("simulate", "--series", "1FFM0", "-o", incoming / "recorded.h5")
    table, report = tmp_path / "table.csv", tmp_path / "report.pdf"
    made = ("--write-table", table, "--write-report", report, "--once")
    outcome = slipstand("watch", incoming, *READ, *made)
    assert outcome.code == 0, outcome.err
    assert sorted(line.partition(":")[0] for line in outcome.out.splitlines()) == ["a.h5", "recorded.h5"]
    assert "broken.csv holds 1 readings" in outcome.err
    assert [path.name for path in (incoming / "runs").glob("*")] == ["a.h5"]
    assert table.read_text().splitlines()[1].startswith("1FFM0,FF,0.012,131.6,2,")
    assert report.read_bytes().startswith(b"%PDF")
    (kept,) = slipstand("analyze", incoming / "runs" / "a.h5", "--save", "--json").json
    assert kept["results"]["friction_dynamic"]["value"] == pytest.approx(0.1, rel=0.01)

    write_record(incoming, "b.csv", 2)
    again = slipstand("watch", incoming, *READ, *made, "--json").json
    assert [Path(document["run"]).name for document in again if "run" in document] == [
        "recorded.h5", "b.h5",
    ]  # fmt: skip
    assert table.read_text().splitlines()[1].startswith("1FFM0,FF,0.012,131.6,3,")


def test_ctrl_c_ends_it_with_130_and_what_came_is_there(slipstand, incoming, monkeypatch) -> None:
    looks = []

    def sleep(seconds: float) -> None:
        looks.append(seconds)
        if len(looks) == 1:
            write_record(incoming, "late.csv", 3)
        if len(looks) == 4:
            raise KeyboardInterrupt

    monkeypatch.setattr(watch_module.time, "sleep", sleep)
    outcome = slipstand("watch", incoming, *READ, "--every", 0.5)
    assert outcome.code == 130
    assert outcome.out.startswith("late.h5: f_d 0.1000")
    assert looks == [0.5] * 4


def test_a_file_that_grew_after_it_was_taken_counts_once(slipstand, tmp_path, incoming) -> None:
    """A logger paused for longer than two looks. Another record under the same name is another test."""
    write_record(incoming, "a.csv", 1)
    whole = (incoming / "a.csv").read_text()
    (incoming / "a.csv").write_text("\n".join(whole.splitlines()[:-500]) + "\n")
    table = tmp_path / "table.csv"
    assert slipstand("watch", incoming, *READ, "--once").code == 0
    (incoming / "a.csv").write_text(whole)
    outcome = slipstand("watch", incoming, *READ, "--once", "--write-table", table)
    assert "a.h5 does not count any more: a.csv was not complete; a-2.h5 is of the whole file" in outcome.err
    assert table.read_text().splitlines()[1].startswith("1FFM0,FF,0.012,131.6,1,")

    write_record(incoming, "a.csv", 2)
    assert slipstand("watch", incoming, *READ, "--once", "--write-table", table).out.startswith("a-3.h5: ")
    assert table.read_text().splitlines()[1].startswith("1FFM0,FF,0.012,131.6,2,")


def test_a_table_that_an_interrupted_start_did_not_write_is_written_by_the_next(
    slipstand, tmp_path, incoming
) -> None:
    write_record(incoming, "a.csv", 1)
    table = tmp_path / "table.csv"
    assert slipstand("watch", incoming, *READ, "--once").code == 0
    outcome = slipstand("watch", incoming, *READ, "--once", "--write-table", table)
    assert (outcome.code, outcome.out) == (0, "")
    first = table.stat().st_mtime_ns
    assert table.read_text().splitlines()[1].startswith("1FFM0,FF,0.012,131.6,1,")
    slipstand("watch", incoming, *READ, "--once", "--write-table", table)
    assert table.stat().st_mtime_ns == first


def test_what_cannot_be_watched_or_written_is_told(slipstand, tmp_path, incoming) -> None:
    assert "is no folder" in slipstand("watch", tmp_path / "absent", *READ).err
    wrong = slipstand("watch", incoming, *READ, "--write-table", tmp_path / "table.odt")
    assert wrong.code == 1
    assert "--write-table table.odt has no known ending" in wrong.err
