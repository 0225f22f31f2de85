"""`analyze` over many runs and `demo --campaign`: kept results are reused; results agree with the truth."""

import datetime
import shutil
from pathlib import Path
from typing import Any

import pytest
from cli_kit import assert_one_error_line

from app.runs.reader import open_run


@pytest.fixture
def folder(short_runs: list[Path], tmp_path: Path) -> Path:
    place = tmp_path / "runs"
    place.mkdir()
    for run in short_runs:
        shutil.copy(run, place)
    return place


def test_a_second_pass_leaves_out_what_is_up_to_date(slipstand: Any, folder: Path, monkeypatch: Any) -> None:
    options = ("--save", "--model", "static", "--json")
    first = slipstand("analyze", folder, *options)
    assert [document["series"] for document in first.json] == ["1FFM0", "2SSM1"]
    monkeypatch.setattr("app.runs.batch.tasks.analyze_run", None)
    assert slipstand("analyze", folder, *options).json == first.json
    monkeypatch.undo()
    kept = sorted(folder.iterdir())
    assert [len(open_run(run).analyses) for run in kept] == [1, 1]
    slipstand("edit", kept[0], "--table-mass", 131.7)
    slipstand("analyze", folder, *options)
    slipstand("analyze", kept[1], *options, "--anew")
    assert [len(open_run(run).analyses) for run in kept] == [2, 2]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--jobs", 0), "--jobs 0"),
        (("--jobs", 2, "--dask", "tcp://localhost:1"), "Give one of them"),
        (("--dask", "nonsense"), "'nonsense'"),
    ],
)
def test_who_cannot_work_is_said_in_a_line(
    slipstand: Any, folder: Path, options: tuple[Any, ...], said: str
) -> None:
    assert_one_error_line(slipstand("analyze", folder, *options), said)


def test_an_empty_folder_is_said_in_a_line(slipstand: Any, tmp_path: Path) -> None:
    assert_one_error_line(slipstand("analyze", tmp_path), "no runs")


def test_a_campaign_is_held_against_its_truth(slipstand: Any, tmp_path: Path) -> None:
    place = tmp_path / "campaign"
    command = ("demo", "--campaign", "--series", "1FFM0", "--repeats", 2, "--directory", place, "--json")
    found = slipstand(*command).json
    assert len(found["runs"]) == 2
    assert found["failures"] == []
    (row,) = found["rows"]
    friction = row["friction_dynamic"]
    assert friction["truth"] == 0.1
    assert abs(friction["value"] - 0.1) < 4.5 * friction["standard_uncertainty"]
    assert found["compared"] == 10
    runs = [open_run(Path(path)) for path in found["runs"]]
    ends = [run.metadata.start_time + datetime.timedelta(seconds=11.0) for run in runs]
    assert max(ends) <= datetime.datetime.now().astimezone(), "a run was recorded before now"
    run = runs[0]
    assert len(run.analyses) == 1
    assert run.metadata.truth["friction_dynamic"] == 0.1
    assert_one_error_line(slipstand(*command), "holds runs already")
    assert_one_error_line(slipstand("demo", "--campaign", "--friction", 0.1), "--friction")
