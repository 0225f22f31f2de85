"""Tasks of the Record screen, carried out in a worker process."""

from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any

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
from app.runs.batch.tasks import AnalysisTask, analyze_one
from app.runs.edits import edit_run
from app.runs.errors import MetadataError, RunError
from app.runs.file_operations import move_to_trash, restore_from_trash
from app.runs.listing import list_runs
from app.runs.metadata import RunSource
from app.runs.next_tests import counts_as_done, load_next_tests, save_next_tests
from app.runs.reader import open_run
from app.runs.summary import RunSummary


def execute(task: RecordTask) -> Any:
    """Carry out a task; its class says what the answer is. Raises RunError."""
    match task:
        case LoadPlan(folder, counts_simulated):
            return _load_plan(Path(folder), counts_simulated=counts_simulated)
        case CountCompletedRuns(folder, counts_simulated):
            done = _done_runs(Path(folder), _undecided(Path(folder)))
            return _completed_runs(done, counts_simulated=counts_simulated)
        case SavePlan(folder, tests):
            return save_next_tests(Path(folder), tests)
        case KeepRun():
            return _keep(task)
        case MoveToTrash(path, author, note):
            _store_note(Path(path), author, note)
            return str(move_to_trash(Path(path)))
        case RestoreFromTrash(path):
            return str(restore_from_trash(Path(path)))


def _load_plan(folder: Path, *, counts_simulated: bool) -> LoadedPlan:
    """Read the stored plan; runs that were decided about elsewhere, or are gone, are no longer undecided."""
    tests = load_next_tests(folder)
    done = _done_runs(folder, tests.undecided)
    names = {Path(run.path).name for run in done}
    undecided = tuple(name for name in tests.undecided if name not in names and (folder / name).exists())
    completed = _completed_runs(done, counts_simulated=counts_simulated)
    return LoadedPlan(tests.replace(undecided=undecided), completed)


def _undecided(folder: Path) -> tuple[str, ...]:
    try:
        return load_next_tests(folder).undecided
    except MetadataError:  # an unreadable plan was reported when it was loaded
        return ()


def _done_runs(folder: Path, undecided: Collection[str]) -> list[RunSummary]:
    if not folder.exists():  # the first run creates it
        return []
    return [run for run in list_runs(folder) if counts_as_done(run, undecided)]


def _completed_runs(done: Sequence[RunSummary], *, counts_simulated: bool) -> tuple[tuple[str, str], ...]:
    counted = (run for run in done if counts_simulated or run.source is not RunSource.SIMULATED)
    return tuple((run.path, run.series or "") for run in counted)


def _keep(task: KeepRun) -> str:
    """Store the same analysis as `analyze --save`."""
    _store_note(Path(task.path), task.author, task.note)
    if task.has_results and (error := analyze_one(AnalysisTask(task.path, save=True)).error):
        raise RunError(error)
    return task.path


def _store_note(path: Path, author: str, note: str | None) -> None:
    if note is not None and note != open_run(path).metadata.note:
        edit_run(path, author, note=note)
