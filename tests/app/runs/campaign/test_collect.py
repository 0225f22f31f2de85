"""Runs collected for a campaign: kept results, stale ones, faults, and what the runs share."""

import shutil
from pathlib import Path

import pytest

from analysis.campaign.campaign import Excluded
from app.runs.analysis_request import AnalysisRequest
from app.runs.batch.executors import ExecutorOptions
from app.runs.campaign.collect import (
    CollectedRuns,
    CollectOptions,
    RunCollection,
    collect_runs,
    iter_collected,
)
from app.runs.edits import edit_run, undo_edit
from app.runs.errors import RunNotFoundError
from app.runs.file_operations import move_to_trash
from app.runs.reader import open_run

HERE = ExecutorOptions(jobs=1)
QUICKLY = AnalysisRequest("static", classical=False)


@pytest.fixture
def folder(short_runs: list[Path], tmp_path: Path) -> Path:
    """Copies of the short runs, one of them twice under other names."""
    place = tmp_path / "campaign"
    place.mkdir()
    for name, run in (("a.h5", short_runs[0]), ("b.h5", short_runs[1])):
        shutil.copy(run, place / name)
    return place


def taken(folder: Path, *, save: bool = False) -> CollectedRuns:
    return collect_runs([folder], CollectOptions(HERE, save=save, request=QUICKLY))


def codes(gathered: CollectedRuns) -> list[str]:
    return [caution.code for caution in gathered.warnings]


def test_results_are_kept_once_and_taken_from_there(folder, monkeypatch):
    first = taken(folder, save=True)
    assert [Path(run.name).name for run in first.runs] == ["a.h5", "b.h5"]
    assert [run.series.code for run in first.runs] == ["1FFM0", "2SSM1"]
    assert [run.series.contact for run in first.runs] == ["FF", "SS"]
    assert first.details[first.runs[0].name].metadata.truth["friction_dynamic"] == 0.1
    monkeypatch.setattr("app.runs.campaign.run_result.analyze_run", None)
    again = taken(folder)
    assert [run.results for run in again.runs] == [run.results for run in first.runs]
    assert [run.budget for run in again.runs] == [run.budget for run in first.runs]
    assert [again.details[run.name].analysis for run in again.runs] == [1, 1]


def test_a_stale_result_is_made_anew_and_said(folder):
    taken(folder, save=True)
    edit_run(folder / "a.h5", "Ada", table_mass_kg=140.0)
    gathered = taken(folder)
    run = gathered.runs[0]
    assert gathered.details[run.name].stale
    assert gathered.details[run.name].analysis is None
    assert run.results["stiffness_n_per_m"].value == pytest.approx(
        (2.0 * 3.141592653589793 / 0.32) ** 2 * (140.0 + 22.4), rel=2e-3
    )
    (said,) = (str(caution.message) for caution in gathered.warnings if caution.code == "results-stale")
    assert "a.h5" in said
    assert "--save" in said
    assert len(open_run(folder / "a.h5").analyses) == 1


def test_a_run_that_fails_does_not_stop_the_rest(folder):
    (folder / "c.h5").write_text("not a run")
    gathered = collect_runs([folder, folder / "nix.h5"], CollectOptions(HERE, request=QUICKLY))
    assert len(gathered.runs) == 2
    assert [Path(failure.run).name for failure in gathered.failures] == ["c.h5", "nix.h5"]
    assert "not an HDF5 file" in str(gathered.failures[0].error)


def test_a_copy_of_a_run_does_not_count_twice(folder):
    shutil.copy(folder / "a.h5", folder / "z.h5")
    gathered = taken(folder)
    assert [bool(run.excluded) for run in gathered.runs] == [False, False, True]
    assert "a.h5" in gathered.runs[2].excluded


def test_a_run_that_says_so_itself_does_not_count_until_it_is_taken_in_again(folder):
    edit_run(folder / "a.h5", "Ada", excluded="the plate was touched")
    assert [run.excluded for run in taken(folder).runs] == ["the plate was touched", ""]
    undo_edit(folder / "a.h5", "Ada")
    assert [run.excluded for run in taken(folder).runs] == ["", ""]


def test_what_is_kept_in_a_run_that_is_left_out_still_stands(folder):
    taken(folder, save=True)
    edit_run(folder / "a.h5", "Ada", excluded="the plate was touched")
    gathered = taken(folder)
    assert [gathered.details[run.name].analysis for run in gathered.runs] == [1, 1]
    assert "results-stale" not in codes(gathered)


def test_the_copy_of_a_run_that_is_left_out_counts_in_its_place(folder):
    shutil.copy(folder / "a.h5", folder / "z.h5")
    edit_run(folder / "a.h5", "Ada", excluded="cut short")
    assert [run.excluded for run in taken(folder).runs] == ["cut short", "", ""]


def test_a_run_without_a_result_is_no_failure_where_it_is_left_out(folder):
    edit_run(folder / "a.h5", "Ada", excluded="nothing slipped")
    gathered = collect_runs([folder], CollectOptions(HERE, request=AnalysisRequest("nonsense")))
    assert [Path(failure.run).name for failure in gathered.failures] == ["b.h5"]
    assert gathered.excluded == (Excluded(str(folder / "a.h5"), "nothing slipped"),)
    assert gathered.campaign().excluded == gathered.excluded


def test_accounts_take_in_again_what_has_changed(folder):
    accounts = RunCollection()
    options = CollectOptions(HERE, save=True, request=QUICKLY)
    files = sorted(folder.iterdir())
    for account in iter_collected(files, options):
        accounts.update(account)
    accounts.exclude(str(files[0]), "touched")
    assert [run.excluded for run in accounts.collected_runs([folder], options).runs] == ["touched", ""]
    for account in iter_collected(files[:1], options):
        accounts.update(account)
    accounts.keep_only([str(files[0])])
    gathered = accounts.collected_runs([folder], options)
    assert [(run.name, run.excluded) for run in gathered.runs] == [(str(files[0]), "")]
    assert len(gathered.stands) == len(gathered.gauges) == 1


def test_what_does_not_fit_together_is_said_with_a_remedy(folder):
    shutil.copy(folder / "b.h5", folder / "c.h5")
    edit_run(folder / "a.h5", "Ada", plate_mass_kg=25.0)
    stand = open_run(folder / "b.h5").metadata.stand
    edit_run(folder / "b.h5", "Ada", stand={"name": "another stand", **_others(stand)})
    move_to_trash(folder / "c.h5")
    gathered = taken(folder)
    assert {"mass-not-of-series", "different-stands", "runs-in-trash"} <= set(codes(gathered))
    for caution in gathered.warnings:
        assert "\n" not in str(caution.message)
        assert any(word in str(caution.message) for word in ("Give", "Correct", "Record", "Bring", "Rebuild"))


def test_runs_of_one_series_with_other_masses_contradict_each_other(folder, short_runs):
    edit_run(folder / "b.h5", "Ada", series="1FFM0", pullback_m=0.012, plate_mass_kg=23.0)
    (said,) = (str(c.message) for c in taken(folder).warnings if c.code == "contradictory-masses")
    assert "22.4 kg: a.h5" in said
    assert "23 kg: b.h5" in said


def test_series_that_lack_runs_are_named(folder):
    (said,) = (str(c.message) for c in taken(folder).warnings if c.code == "series-without-runs")
    assert "34 of the stand's 36" in said
    assert "1FFM1" in said


def test_a_folder_without_runs_is_said(tmp_path):
    with pytest.raises(RunNotFoundError, match="no runs"):
        collect_runs([tmp_path])


def _others(stand) -> dict[str, object]:
    import msgspec

    return {name: value for name, value in msgspec.to_builtins(stand).items() if name != "name"}
