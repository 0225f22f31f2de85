"""Tasks of the Record screen, carried out in a worker process."""

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
from app.runs.errors import RunError
from app.runs.file_operations import move_to_trash, restore_from_trash
from app.runs.listing import list_runs
from app.runs.next_tests import counts_as_done, load_next_tests, save_next_tests
from app.runs.reader import open_run


def execute(task: RecordTask) -> Any:
    """Carry out a task; its class says what the answer is. Raises RunError."""
    match task:
        case LoadPlan(folder):
            return LoadedPlan(load_next_tests(Path(folder)), _completed_runs(Path(folder)))
        case CountCompletedRuns(folder):
            return _completed_runs(Path(folder))
        case SavePlan(folder, tests):
            return save_next_tests(Path(folder), tests)
        case KeepRun():
            return _keep(task)
        case MoveToTrash(path, author, note):
            _store_note(Path(path), author, note)
            return str(move_to_trash(Path(path)))
        case RestoreFromTrash(path):
            return str(restore_from_trash(Path(path)))


def _completed_runs(folder: Path) -> tuple[tuple[str, str], ...]:
    if not folder.exists():  # the first run creates it
        return ()
    return tuple((run.path, run.series or "") for run in list_runs(folder) if counts_as_done(run))


def _keep(task: KeepRun) -> str:
    """Store the same analysis as `analyze --save`."""
    _store_note(Path(task.path), task.author, task.note)
    if task.has_results and (error := analyze_one(AnalysisTask(task.path, save=True)).error):
        raise RunError(error)
    return task.path


def _store_note(path: Path, author: str, note: str | None) -> None:
    if note is not None and note != open_run(path).metadata.note:
        edit_run(path, author, note=note)
