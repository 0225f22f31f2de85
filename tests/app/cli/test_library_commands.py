"""`slipstand runs`, `edit` and `trash`: an operator keeps the library in order."""

import sys
from pathlib import Path
from typing import Any

import pytest
from cli_kit import assert_one_error_line


@pytest.fixture
def run(slipstand: Any, tmp_path: Path) -> Path:
    """A simulated test with a result, alone in its library."""
    path = tmp_path / "library" / "run.h5"
    path.parent.mkdir()
    slipstand("simulate", "--series", "1FFM0", "--friction", 0.1, "--rate", 500, "-o", path)
    slipstand("analyze", path, "--save")
    return path


def test_an_edit_makes_the_result_stale_and_undo_makes_it_good(slipstand: Any, run: Path) -> None:
    assert "stale" not in slipstand("runs", run.parent).out
    assert slipstand("edit", run, "--series", "1ffm2", "--condition", "temperature_c=21.5").code == 0
    (listed,) = slipstand("runs", run.parent, "--series", "1FFM2", "--json").json
    assert (listed["stale"], listed["plate_mass_kg"], listed["edits"]) == (True, 32.4, 1)
    assert "(stale)" in slipstand("runs", run.parent, "--stale").out
    assert "temperature_c" in slipstand("edit", run, "--history").out
    assert slipstand("edit", run, "--undo").code == 0
    assert slipstand("runs", run.parent, "--stale", "--json").json == []
    assert_one_error_line(slipstand("edit", run, "--undo"), "no edit to undo")


def test_a_condition_of_ones_own_stands_beside_the_others(slipstand: Any, run: Path) -> None:
    assert slipstand("edit", run, "--condition", "lab=B2", "--condition", "plate_id=P1").code == 0
    assert slipstand("edit", run, "--condition", "floor=3", "--condition", "plate_id=P2").code == 0
    (listed,) = slipstand("runs", run.parent, "--json").json
    assert listed["conditions"]["other"] == {"lab": "B2", "floor": "3"}
    assert listed["conditions"]["plate_id"] == "P2"


def test_paths_are_relative_to_the_present_folder_and_a_fault_has_a_column(
    slipstand: Any, run: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (run.parent / "broken.h5").write_text("no run")
    assert str(run) in slipstand("runs", run.parent).out
    monkeypatch.chdir(run.parent.parent)
    header, good, bad = slipstand("runs", run.parent).out.splitlines()
    assert header.split() == ["run", "series", "begun", "seconds", "ended", "source", "f_d", "fault"]
    assert good.split()[:2] == [str(Path("library", "run.h5")), "1FFM0"]
    assert bad.split()[0] == str(Path("library", "broken.h5"))
    assert header.index("fault") == len(bad[: bad.index("is not an HDF5 file")].rpartition("  ")[0]) + 2
    assert "fault" not in slipstand("runs", run.parent, "--series", "1FFM0").out
    (listed, _) = slipstand("runs", run.parent, "--json").json
    assert listed["path"] == str(run)


def test_columns_and_order_are_chosen(slipstand: Any, run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(run.parent)
    for name, friction in (("a", 0.12), ("b", 0.08)):
        slipstand("simulate", "--series", "1FFM0", "--friction", friction, "--rate", 500, "-o", f"{name}.h5")
        slipstand("analyze", f"{name}.h5", "--save")
    slipstand("simulate", "--series", "1FFM0", "--rate", 500, "-o", "c.h5")

    def names(*options: object) -> list[str]:
        header, *rows = slipstand("runs", ".", "--columns", "run,T,source", *options).out.splitlines()
        assert header.split() == ["run", "T", "source"]
        assert "ms  simulated" in rows[0]
        return [row.split()[0] for row in rows]

    assert names("--sort", "f_d") == ["b.h5", "run.h5", "a.h5", "c.h5"]
    assert names("--sort", "f_d", "--reverse") == ["a.h5", "run.h5", "b.h5", "c.h5"]
    ordered = slipstand("runs", ".", "--sort", "f_d", "--json").json
    assert [Path(one["path"]).name for one in ordered] == ["b.h5", "run.h5", "a.h5", "c.h5"]
    assert_one_error_line(slipstand("runs", ".", "--columns", "run,x"), "--columns 'x' is not known")
    assert_one_error_line(slipstand("runs", ".", "--sort", "x"), "--sort 'x' is not known")


def test_runs_that_a_filter_leaves_out_are_not_said_to_be_missing(slipstand: Any, run: Path) -> None:
    said = slipstand("runs", run.parent, "--stale").out
    assert "is of that kind" in said
    assert "Record one" not in said
    slipstand("trash", run)
    assert "Record one" in slipstand("runs", run.parent).out


def test_one_edit_is_told_as_one(slipstand: Any, run: Path) -> None:
    slipstand("edit", run, "--note", "cleaned")
    assert f"{run}: 1 edit\n" in slipstand("edit", run, "--history").out
    slipstand("edit", run, "--undo")
    assert f"{run}: 2 edits\n" in slipstand("edit", run, "--history").out


def test_each_command_is_told_in_a_whole_sentence_or_cut_where_it_says_so(slipstand: Any) -> None:
    listed = slipstand("--help").out.split("Commands:")[1]
    assert "(Fig." not in listed


def test_a_run_goes_to_the_trash_and_comes_back(slipstand: Any, run: Path) -> None:
    lies = slipstand("trash", run).out.strip()
    assert slipstand("runs", run.parent, "--json").json == []
    assert slipstand("trash", "--list", run.parent).out.strip() == lies
    assert slipstand("trash", "--restore", lies).out.strip() == str(run)
    assert len(slipstand("runs", run.parent, "--json").json) == 1


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ([], "--undo or --history"),
        (["--undo", "--note", "x"], "--undo or --history"),
        (["--plate-mass", "0"], "--plate-mass 0"),
        (["--series", "9XXM0"], "9XXM0"),
        (["--condition", "temperature_c=warm"], "warm"),
        (["--condition", "warm"], "--condition 'warm'"),
        (["--calibration", "nix.toml"], "nix.toml"),
    ],
)
def test_an_edit_that_cannot_be_is_one_line(
    slipstand: Any, run: Path, arguments: list[str], said: str
) -> None:
    before = run.read_bytes()
    assert_one_error_line(slipstand("edit", run, *arguments), said)
    assert run.read_bytes() == before


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere names of files are always text")
def test_a_file_name_that_is_no_text_is_listed(slipstand: Any, run: Path) -> None:
    odd = run.rename(run.with_name("run\udcff.h5"))
    (listed,) = slipstand("runs", run.parent, "--json").json
    assert listed["path"] == str(odd)
    assert "run\\udcff.h5" in slipstand("runs", run.parent).out


def test_the_trash_of_a_folder_that_is_not_there_is_one_line(slipstand: Any, tmp_path: Path) -> None:
    assert_one_error_line(slipstand("trash", "--list", tmp_path / "absent"), "no such folder")


def test_a_folder_is_no_run_for_the_trash(slipstand: Any, run: Path) -> None:
    assert_one_error_line(slipstand("trash", run.parent), "is a folder. Give a run file in it")
    assert run.exists()
