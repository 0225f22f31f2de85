"""Work on run files for Record, done on real ones: kept, put aside, brought back, counted."""

import contextlib
import shutil
import sys
from pathlib import Path

import pytest

from analysis.motion.two_mass import TwoMassParameters
from app.__main__ import main
from app.presenters.analysis_task import analyse_run
from app.presenters.record.state import (
    CountCompletedRuns,
    KeepRun,
    LoadedPlan,
    LoadPlan,
    MoveToTrash,
    RecordTask,
    RestoreFromTrash,
    SavePlan,
)
from app.presenters.record.tasks import execute
from app.runs.errors import RunError
from app.runs.next_tests import NextTests, PlannedSeries
from app.runs.reader import open_run
from app.runs.simulated import write_simulated_run

PARAMETERS = TwoMassParameters.from_free_decay(
    period_s=0.32,
    damping_n1_per_s=0.12,
    table_mass_kg=131.6,
    plate_mass_kg=22.4,
    friction_dynamic=0.1,
    pullback_m=0.012,
)


@pytest.fixture
def run(tmp_path: Path) -> Path:
    path = tmp_path / "20260112_1FFM0_001.h5"
    write_simulated_run(path, PARAMETERS.simulate(6.0), PARAMETERS, series="1FFM0", rate_hz=500.0)
    return path


def done(task: RecordTask) -> object:
    return execute(task)


def test_what_was_shown_is_what_is_kept(run: Path) -> None:
    folder = str(run.parent)
    assert done(CountCompletedRuns(folder)) == ()
    analysed = analyse_run(str(run), lambda _: None)
    assert done(KeepRun(str(run), "me", "hand trembled", has_results=True)) == str(run)
    kept = open_run(run, trusted=True)
    (analysis,) = kept.analyses
    found = analysis.document["results"]["friction_dynamic"]["value"]
    assert found == analysed.results["friction_dynamic"].value == pytest.approx(0.1, rel=1e-3)
    assert kept.metadata.note == "hand trembled"
    assert [change.author for change in kept.changes] == ["me"]
    assert done(CountCompletedRuns(folder, counts_simulated=True)) == ((str(run), "1FFM0"),)


def test_a_kept_run_holds_what_the_command_line_would_have_kept(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = tmp_path / "other" / run.name
    other.parent.mkdir()
    shutil.copy(run, other)
    done(KeepRun(str(run), "me", has_results=True))
    monkeypatch.setattr(sys, "argv", ["slipstand", "analyze", "--save", "--json", str(other)])
    with contextlib.suppress(SystemExit):
        main()
    (here,), (there,) = (open_run(path, trusted=True).analyses for path in (run, other))
    assert here.settings == there.settings
    origin = there.document["origin"] | {
        name: here.document["origin"][name] for name in ("date", "reproduce")
    }
    assert here.document == there.document | {"run": str(run), "origin": origin}
    assert here.document["classical"]["period_s"] == pytest.approx(0.32, rel=1e-3)


def test_keeping_again_changes_nothing_that_still_holds(run: Path) -> None:
    done(KeepRun(str(run), "me", "hand trembled", has_results=True))
    done(KeepRun(str(run), "me", "hand trembled", has_results=True))
    kept = open_run(run, trusted=True)
    assert (len(kept.analyses), len(kept.changes)) == (1, 1)


def test_what_cannot_be_analysed_is_said(run: Path) -> None:
    run.write_bytes(run.read_bytes()[:2000])
    with pytest.raises(RunError, match=run.name):
        done(KeepRun(str(run), "me", has_results=True))


def test_a_run_without_a_new_note_is_not_edited(run: Path) -> None:
    done(KeepRun(str(run), "me"))
    assert open_run(run, trusted=True).changes == ()


def test_what_is_put_aside_does_not_count_and_comes_back_whole(run: Path) -> None:
    done(KeepRun(str(run), "me", has_results=True))
    trashed = str(done(MoveToTrash(str(run), "me", "stand was touched")))
    assert not run.exists()
    assert open_run(Path(trashed), trusted=True).metadata.note == "stand was touched"
    assert done(CountCompletedRuns(str(run.parent))) == ()
    assert done(RestoreFromTrash(trashed)) == str(run)
    assert done(CountCompletedRuns(str(run.parent), counts_simulated=True)) == ((str(run), "1FFM0"),)


def test_a_folder_that_is_not_there_yet_holds_nothing_and_takes_a_plan(tmp_path: Path) -> None:
    folder = str(tmp_path / "recordings")
    assert done(LoadPlan(folder)) == LoadedPlan(NextTests())
    tests = NextTests(plan=(PlannedSeries("1FFM0", 3),), operator="N. N.")
    done(SavePlan(folder, tests))
    assert done(LoadPlan(folder)) == LoadedPlan(tests)


def test_runs_that_wait_for_a_decision_do_not_count_until_they_are_analysed_or_gone(run: Path) -> None:
    folder = str(run.parent)
    tests = NextTests(undecided=(run.name, "20260101_1FFM0_009.h5"))
    done(SavePlan(folder, tests))
    loaded = done(LoadPlan(folder))
    assert isinstance(loaded, LoadedPlan)
    assert loaded.tests.undecided == (run.name,), "the other one is gone"
    done(KeepRun(str(run), "me", has_results=True))
    assert done(CountCompletedRuns(folder, counts_simulated=True)) == ((str(run), "1FFM0"),)
    loaded = done(LoadPlan(folder, counts_simulated=True))
    assert isinstance(loaded, LoadedPlan)
    assert (loaded.tests.undecided, loaded.completed) == ((), ((str(run), "1FFM0"),))
    assert done(LoadPlan(folder)) == LoadedPlan(NextTests()), "it is simulated, and decided about"


def test_simulated_runs_count_in_the_plan_only_if_they_are_chosen(run: Path) -> None:
    done(KeepRun(str(run), "me", has_results=True))
    folder = str(run.parent)
    assert done(CountCompletedRuns(folder)) == ()
    assert done(LoadPlan(folder)).completed == ()
    chosen = ((str(run), "1FFM0"),)
    assert done(CountCompletedRuns(folder, counts_simulated=True)) == chosen
    assert done(LoadPlan(folder, counts_simulated=True)).completed == chosen
