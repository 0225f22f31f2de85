"""`slipstand import` of several files: each becomes a run, a table tells what they hold."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.runs.reader import open_run

RATE_HZ = 500


def write_record(path: Path, *, swings: bool) -> None:
    """A table that is held for a second and let go, or one that only rests."""
    time_s = np.arange(6 * RATE_HZ) / RATE_HZ
    since = np.maximum(time_s - 1.0, 0.0)
    table = 12.0 * np.exp(-0.2 * since) * np.cos(9.0 * since) if swings else np.zeros(len(time_s))
    table = table + np.random.default_rng(1).normal(0.0, 0.01, len(time_s))
    lines = "".join(f"{t};{u:.4f}\n" for t, u in zip(time_s, table, strict=True))
    path.write_text(f"t;u1 [mm]\n{lines}")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write_record(tmp_path / "a.csv", swings=True)
    write_record(tmp_path / "b.csv", swings=False)
    (tmp_path / "c.csv").write_text("t;u1 [mm]\n0;1\n1;2\n")
    return tmp_path


def test_each_file_becomes_a_run_and_a_fault_stops_none(slipstand: Any, folder: Path) -> None:
    files = [folder / name for name in ("a.csv", "c.csv", "b.csv")]
    outcome = slipstand("import", *files, "--table", 1, "--series", "1FFM0", "-o", folder / "runs", "--json")
    assert outcome.code == 1
    first, short, last = outcome.json
    assert "c.csv holds 2 readings of gauge 1, too few" in short["error"]
    assert "error:" in outcome.err
    assert (first["samples"], first["rate_hz"]) == (3000, pytest.approx(500.0))
    assert first["duration_s"] == pytest.approx(5.998)
    assert first["table_range"] == pytest.approx([-0.0112, 0.012], abs=2e-4)
    assert first["release_s"] == pytest.approx(1.0, abs=0.02)
    assert last["release_s"] is None
    assert [Path(one["run"]).name for one in (first, last)] == ["a.h5", "b.h5"]
    assert open_run(Path(first["run"]), trusted=True).metadata.series == "1FFM0"


def test_a_pattern_is_expanded_and_a_table_told(slipstand: Any, folder: Path) -> None:
    (folder / "c.csv").unlink()
    for names in (["a.h5", "b.h5"], ["a-2.h5", "b-2.h5"]):
        outcome = slipstand("import", folder / "*.csv", "--table", 1, "-o", folder)
        assert outcome.code == 0
        header, *rows = outcome.out.splitlines()
        assert header.split() == ["run", "length", "rate", "gauge", "1", "gauge", "2", "release"]
        assert [row.split()[0] for row in rows] == names
        assert "released at" in rows[0]
        assert "no release found" in rows[1]


def test_one_file_is_told_in_a_line(slipstand: Any, folder: Path) -> None:
    outcome = slipstand("import", folder / "b.csv", "--table", 1, "-o", folder / "b.h5")
    assert outcome.code == 0
    told = outcome.out.rpartition(": ")[2].strip()
    assert told.split(", ")[:3] == ["3000 samples", "5.998 s", "500 Hz"]
    assert all(told.split(", "))


def test_several_files_need_a_folder(slipstand: Any, folder: Path) -> None:
    outcome = slipstand("import", folder / "a.csv", folder / "b.csv", "--table", 1, "-o", folder / "x.h5")
    assert outcome.code == 1
    assert "several files become several runs. Give a folder" in outcome.err


def test_a_size_that_is_unlikely_is_refused_unless_it_is_insisted_on(slipstand: Any, tmp_path: Path) -> None:
    write_record(tmp_path / "a.csv", swings=True)
    lines = (tmp_path / "a.csv").read_text().replace("u1 [mm]", "u1")
    (tmp_path / "a.csv").write_text(lines)
    arguments = ("import", tmp_path / "a.csv", "--table", "u1", "-o", tmp_path / "a.h5")
    refused = slipstand(*arguments)
    assert refused.code == 1
    assert refused.err == (
        f"error: {tmp_path / 'a.csv'}: gauge 1 moves by 23.24 m, more than its range of 33 mm."
        " If it is in mm, set --unit mm; if it is right, set --any-size\n"
    )
    assert not (tmp_path / "a.h5").exists()
    by_gain = slipstand(*arguments, "--gain", "1e-6")
    assert "gauge 1 moves by 23.24 µm only. Check --unit and --gain; if it is right, set" in by_gain.err
    assert slipstand(*arguments, "--unit", "mm").code == 0
    assert slipstand(*arguments, "--any-size", "--force").code == 0
    assert np.ptp(open_run(tmp_path / "a.h5", trusted=True).table_reading) == pytest.approx(23.24, abs=0.01)


@pytest.mark.parametrize(
    "options", [("--quantity", "velocity"), ("--gain", "2", "--unit-name", "V"), ("--unit", "mm")]
)
def test_no_size_is_unlikely_of_what_is_no_displacement(
    slipstand: Any, tmp_path: Path, options: tuple[str, ...]
) -> None:
    write_record(tmp_path / "a.csv", swings=True)
    (tmp_path / "a.csv").write_text((tmp_path / "a.csv").read_text().replace("u1 [mm]", "u1"))
    assert (
        slipstand("import", tmp_path / "a.csv", "--table", "u1", *options, "-o", tmp_path / "a.h5").code == 0
    )
