"""`slipstand export`: samples and coefficients for other programs."""

import errno
import io
import json
import shutil
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from cli_kit import assert_one_error_line

from app.cli.errors import error_text


@pytest.fixture
def run(slipstand: Any, tmp_path: Path) -> Path:
    """A simulated test as a run."""
    path = tmp_path / "run.h5"
    assert slipstand("simulate", "--series", "1FFM0", "--friction", 0.1, "--rate", 500, "-o", path).code == 0
    return path


def test_coefficients_of_two_runs_are_one_table(slipstand: Any, run: Path, tmp_path: Path) -> None:
    table, other = tmp_path / "table.csv", shutil.copy(run, tmp_path / "other.h5")
    outcome = slipstand(
        "export", run, other, "--format", "csv", "--content", "coefficients", "-o", table, "--json"
    )
    assert [document["files"] for document in outcome.json] == [[str(table)]] * 2
    f_d = pd.read_csv(table).query("quantity == 'friction_dynamic'")
    assert f_d["value"].tolist() == pytest.approx([0.1, 0.1], rel=1e-3)
    (analysed,) = slipstand("analyze", run, "--json").json
    assert f_d["value"].iloc[0] == analysed["results"]["friction_dynamic"]["value"]


def test_a_kept_analysis_is_exported_until_it_is_stale(slipstand: Any, run: Path, tmp_path: Path) -> None:
    slipstand("analyze", run, "--model", "static+tilt", "--save")
    slipstand("export", run, "--format", "json", "-o", tmp_path / "run.json")
    document = json.loads((tmp_path / "run.json").read_text())
    assert document["analysis"]["model"]["name"] == "static+tilt"
    assert len(document["samples"]["time_s"]["values"]) == document["ending"]["losses"]["samples"]


@pytest.fixture
def folder(run: Path, short_runs: list[Path]) -> Path:
    """A folder of two runs; the simulated one without a converter has no counts."""
    shutil.copy(short_runs[0], run.with_name("other.h5"))
    return run.parent


def test_samples_of_a_folder_are_one_table(slipstand: Any, folder: Path, tmp_path: Path) -> None:
    table = tmp_path / "all.csv"
    outcome = slipstand("export", folder, "-o", table, "--json")
    beside = tmp_path / "all.coefficients.csv"
    assert [document["files"] for document in outcome.json] == [[str(table), str(beside)]] * 2
    samples = pd.read_csv(table)
    assert list(samples["run"].unique()) == ["other", "run"]
    for name, of_run in samples.groupby("run"):
        alone = tmp_path / f"{name}.csv"
        slipstand("export", folder / f"{name}.h5", "--content", "samples", "-o", alone)
        own = pd.read_csv(alone)
        pd.testing.assert_frame_equal(of_run[own.columns].reset_index(drop=True), own, check_dtype=False)
    assert set(pd.read_csv(beside)["run"]) == {"other", "run"}
    assert samples.loc[samples["run"] == "run", "table_count"].isna().all()


def test_runs_of_a_folder_are_one_workbook_one_parquet_file_or_one_json(
    slipstand: Any, folder: Path, tmp_path: Path
) -> None:
    for name in ("all.xlsx", "all.parquet", "all.json"):
        assert slipstand("export", folder, "-o", tmp_path / name).code == 0
    sheets = pd.read_excel(tmp_path / "all.xlsx", sheet_name=None)
    assert list(sheets) == ["Coefficients", "Runs", "other", "run"]
    assert set(sheets["Coefficients"]["run"]) == {"other", "run"}
    frame = pd.read_parquet(tmp_path / "all.parquet")
    assert frame.groupby("run").size().to_dict() == {name: len(sheets[name]) for name in ("other", "run")}
    documents = json.loads((tmp_path / "all.json").read_text())["runs"]
    assert [document["name"] for document in documents] == ["other", "run"]
    assert documents[1]["analysis"]["results"]["friction_dynamic"]["value"] == pytest.approx(0.1, rel=1e-3)


def test_several_runs_go_to_a_folder_with_a_file_each(slipstand: Any, folder: Path, tmp_path: Path) -> None:
    place = tmp_path / "exported"
    assert slipstand("export", folder, "--format", "mat", "-o", place).code == 0
    assert sorted(path.name for path in place.iterdir()) == ["other.mat", "run.mat"]
    outcome = slipstand("export", folder, "-o", tmp_path / "all.mat")
    assert_one_error_line(outcome, "mat holds one run a file, but 2 runs are given")


def test_text_goes_to_stdout(slipstand: Any, run: Path) -> None:
    shown = slipstand("export", run, "--format", "csv", "--content", "coefficients")
    table = pd.read_csv(io.StringIO(shown.out))
    assert table.query("quantity == 'friction_dynamic'")["run"].tolist() == ["run"]
    assert slipstand("export", run, "--format", "json", "-o", "-").json["name"] == "run"
    assert slipstand("export", run, "--format", "latex").out.startswith("% by slipstand")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ([], "nothing says what to write"),
        (["-o", "found.doc"], "-o found.doc has no known ending. Use .csv"),
        (["--format", "csv"], "csv has samples and coefficients in two tables"),
        (["--format", "xlsx"], "--format xlsx is no text for stdout"),
        (["--format", "json", "--json"], "--json lists the files that are written"),
    ],
)
def test_what_has_no_place_is_one_line(slipstand: Any, run: Path, arguments: list[str], said: str) -> None:
    assert_one_error_line(slipstand("export", run, *arguments), said)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--format", "doc"], "'doc'"),
        (["--format", "csv", "--content", "all"], "'all'"),
        (["--format", "uff58", "--content", "coefficients"], "uff58"),
    ],
)
def test_what_cannot_be_is_one_line(
    slipstand: Any, run: Path, tmp_path: Path, arguments: list[str], said: str
) -> None:
    assert_one_error_line(slipstand("export", run, *arguments, "-o", tmp_path / "out"), said)


def test_a_missing_run_and_an_existing_file_are_one_line(slipstand: Any, run: Path, tmp_path: Path) -> None:
    outcome = slipstand("export", tmp_path / "nix.h5", "--format", "csv", "-o", tmp_path / "o.csv")
    assert_one_error_line(outcome, "nix.h5")
    assert_one_error_line(slipstand("export", run, "--format", "csv", "-o", run), "exists already")
    assert not (tmp_path / "o.csv").exists()


def test_what_the_system_refuses_names_the_path_and_a_remedy() -> None:
    said = error_text(PermissionError(errno.EACCES, "Permission denied", "/far/runs"))
    assert said == "/far/runs: Permission denied. Check the path, its rights and its disk"
