"""`slipstand export`: samples and coefficients for other programs."""

import errno
import json
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
    table = tmp_path / "table.csv"
    outcome = slipstand(
        "export", run, run, "--format", "csv", "--content", "coefficients", "-o", table, "--json"
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
