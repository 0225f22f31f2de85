"""Work on files for the Record screen, done in its worker's process."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from app.presenters.worker import ReportProgress
from app.runs.next_tests import NextTests


@dataclass(frozen=True, slots=True)
class LoadPlan:
    """What is planned in a folder, and what is there."""

    folder: str


@dataclass(frozen=True, slots=True)
class LoadedPlan:
    """What was found in it.

    Attributes
    ----------
    tests : NextTests
    done : tuple of (str, str)
        Path and series of each run that counts as a test done.
    """

    tests: NextTests
    done: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True, slots=True)
class CountCompletedRuns:
    """Look again which runs count as tests done."""

    folder: str


@dataclass(frozen=True, slots=True)
class SavePlan:
    """Keep what is planned."""

    folder: str
    tests: NextTests


@dataclass(frozen=True, slots=True)
class KeepRun:
    """Store the note of a run if it is another one, and its analysis where anything was `found`."""

    path: str
    author: str
    note: str | None = None
    has_results: bool = False


@dataclass(frozen=True, slots=True)
class MoveToTrash:
    """Move a run to the trash, with the reason as its note if one was given."""

    path: str
    author: str
    note: str | None = None


@dataclass(frozen=True, slots=True)
class RestoreFromTrash:
    """Bring a run back from the trash."""

    path: str


RecordTask = LoadPlan | CountCompletedRuns | SavePlan | KeepRun | MoveToTrash | RestoreFromTrash


def execute(task: RecordTask, _report: ReportProgress) -> Any:
    """Do a task; the answer is the path of the run where one was moved. Raises RunError."""
    match task:
        case LoadPlan(folder):
            return _look_up(Path(folder))
        case CountCompletedRuns(folder):
            return _done(Path(folder))
        case SavePlan(folder, tests):
            return _save(Path(folder), tests)
        case KeepRun():
            return _keep(task)
        case MoveToTrash():
            return _put_aside(task)
        case RestoreFromTrash(path):
            return _bring_back(Path(path))


def _look_up(folder: Path) -> LoadedPlan:
    from app.runs.next_tests import load_next_tests

    return LoadedPlan(load_next_tests(folder), _done(folder))


def _done(folder: Path) -> tuple[tuple[str, str], ...]:
    from app.runs.listing import list_runs
    from app.runs.next_tests import counts_as_done

    if not folder.exists():  # the recordings folder is made by the first run
        return ()
    return tuple((run.path, run.series or "") for run in list_runs(folder) if counts_as_done(run))


def _save(folder: Path, tests: NextTests) -> None:
    from app.runs.next_tests import save_next_tests

    save_next_tests(folder, tests)


def _keep(task: KeepRun) -> str:
    """As `analyze --save` does it, so that a run holds the same whoever kept it."""
    from app.runs.batch.tasks import AnalysisTask, analyze_one
    from app.runs.errors import RunError

    _write_note(Path(task.path), task.author, task.note)
    if task.has_results and (error := analyze_one(AnalysisTask(task.path, save=True)).error):
        raise RunError(error)
    return task.path


def _put_aside(task: MoveToTrash) -> str:
    from app.runs.trash import move_to_trash

    path = Path(task.path)
    _write_note(path, task.author, task.note)
    return str(move_to_trash(path))


def _bring_back(path: Path) -> str:
    from app.runs.trash import restore_from_trash

    return str(restore_from_trash(path))


def _write_note(path: Path, author: str, note: str | None) -> None:
    from app.runs.edits import edit_run
    from app.runs.reader import open_run

    if note is not None and note != open_run(path).metadata.note:
        edit_run(path, author, note=note)


Submit = Callable[[RecordTask], None]
