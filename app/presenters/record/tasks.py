"""Tasks of the Record screen, carried out in a worker process."""

from collections.abc import Collection
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
from app.runs.next_tests import counts_as_done, load_next_tests, save_next_tests
from app.runs.reader import open_run


def execute(task: RecordTask) -> Any:
    """Carry out a task; its class says what the answer is. Raises RunError."""
    match task:
        case LoadPlan(folder):
            return _load_plan(Path(folder))
        case CountCompletedRuns(folder):
            return _completed_runs(Path(folder), _undecided(Path(folder)))
        case SavePlan(folder, tests):
            return save_next_tests(Path(folder), tests)
        case KeepRun():
            return _keep(task)
        case MoveToTrash(path, author, note):
            _store_note(Path(path), author, note)
            return str(move_to_trash(Path(path)))
        case RestoreFromTrash(path):
            return str(restore_from_trash(Path(path)))


def _load_plan(folder: Path) -> LoadedPlan:
    """Read the stored plan; runs that were decided about elsewhere, or are gone, are no longer undecided."""
    tests = load_next_tests(folder)
    completed = _completed_runs(folder, tests.undecided)
    done = {Path(path).name for path, _ in completed}
    undecided = tuple(name for name in tests.undecided if name not in done and (folder / name).exists())
    return LoadedPlan(tests.replace(undecided=undecided), completed)


def _undecided(folder: Path) -> tuple[str, ...]:
    try:
        return load_next_tests(folder).undecided
    except MetadataError:  # an unreadable plan was reported when it was loaded
        return ()


def _completed_runs(folder: Path, undecided: Collection[str]) -> tuple[tuple[str, str], ...]:
    if not folder.exists():  # the first run creates it
        return ()
    runs = list_runs(folder)
    return tuple((run.path, run.series or "") for run in runs if counts_as_done(run, undecided))


def _keep(task: KeepRun) -> str:
    """Store the same analysis as `analyze --save`."""
    _store_note(Path(task.path), task.author, task.note)
    if task.has_results and (error := analyze_one(AnalysisTask(task.path, save=True)).error):
        raise RunError(error)
    return task.path


def _store_note(path: Path, author: str, note: str | None) -> None:
    if note is not None and note != open_run(path).metadata.note:
        edit_run(path, author, note=note)
