"""Work on run files, done in the worker's process: one small value says what, its answer what came of it."""

import itertools
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from app.presenters.base import Progress
from app.presenters.runs import import_tasks
from app.presenters.runs.import_tasks import ImportFile, PreviewImport, SurveyFile
from app.presenters.runs.overlay import load_overlay
from app.presenters.worker import ReportProgress
from messages.i18n import gettext

if TYPE_CHECKING:
    from app.runs.summary import RunSummary

_TEXT_SUFFIXES = {".csv", ".json", ".latex", ".uff58"}
_PREVIEW_LINES, _PREVIEW_WIDTH = 12, 160


@dataclass(frozen=True, slots=True)
class ListRuns:
    """Look into a folder."""

    folder: str


@dataclass(frozen=True, slots=True)
class LoadOverlay:
    """Read runs for drawing."""

    paths: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class EditRuns:
    """Give a field of `RunMetadata` a new value; a series brings its pullback and plate mass along."""

    paths: tuple[str, ...]
    field: str
    value: Any
    author: str


@dataclass(frozen=True, slots=True)
class UndoEdits:
    """Take back the last edit of a field in each run."""

    paths: tuple[str, ...]
    author: str
    field: str


@dataclass(frozen=True, slots=True)
class TrashRuns:
    """Put runs aside."""

    paths: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class RestoreRuns:
    """Bring runs back from the trash."""

    paths: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class CopyRuns:
    """Copy run files into the library, under a free name."""

    paths: tuple[str, ...]
    folder: str


@dataclass(frozen=True, slots=True)
class ExportRuns:
    """Write runs for other programs, as `app.runs.exchange.exporting.ExportRequest` says."""

    paths: tuple[str, ...]
    output: str
    format: str
    content: str
    replace: bool


@dataclass(frozen=True, slots=True)
class PreviewExport:
    """Show how the export of a run would look."""

    path: str
    format: str
    content: str


@dataclass(frozen=True, slots=True)
class ExportPreview:
    """The files that would be written, with the first lines of those that are text."""

    text: str


@dataclass(frozen=True, slots=True)
class BatchOutcome:
    """What became of several runs: those done (where they lie now), and a line for each that was not."""

    done: tuple[str, ...] = ()
    faults: tuple[str, ...] = ()


RunsTask = (
    ListRuns
    | LoadOverlay
    | EditRuns
    | UndoEdits
    | TrashRuns
    | RestoreRuns
    | CopyRuns
    | ExportRuns
    | PreviewExport
    | SurveyFile
    | PreviewImport
    | ImportFile
)


def execute(task: RunsTask, report: ReportProgress) -> Any:
    """Do a task. Raises RunError where nothing of it can be done."""
    match task:
        case ListRuns(folder):
            return _list(folder, report)
        case LoadOverlay(paths):
            return load_overlay(paths)
        case EditRuns(paths):
            return _each(paths, lambda path: _edit(path, task), report, gettext("Editing"))
        case UndoEdits(paths, author, field):
            return _each(paths, lambda path: _undo(path, author, field), report, gettext("Undoing"))
        case TrashRuns(paths):
            return _each(paths, _trash, report, gettext("Moving to the trash"))
        case RestoreRuns(paths):
            return _each(paths, _bring_back, report, gettext("Bringing back"))
        case CopyRuns(paths, folder):
            return _each(paths, lambda path: _copy(path, Path(folder)), report, gettext("Copying"))
        case ExportRuns():
            return _export(task, report)
        case PreviewExport():
            return _preview(task)
        case SurveyFile() | PreviewImport() | ImportFile():
            return import_tasks.execute(task)


def _list(folder: str, report: ReportProgress) -> "tuple[RunSummary, ...]":
    from app.runs.listing import list_runs

    path = Path(folder)
    if not path.exists():  # the recordings folder is made by the first run
        return ()
    return tuple(
        list_runs(
            path, progress=lambda done, count: report(Progress(gettext("Looking at new files"), done / count))
        )
    )


def _each(
    paths: tuple[str, ...], act: Callable[[Path], Path], report: ReportProgress, what: str
) -> BatchOutcome:
    """Do the same to every run; one that fails does not stop the rest."""
    from analysis.record import AnalysisError
    from app.runs.errors import RunError
    from config.schema import ConfigError

    done, faults = [], []
    for number, path in enumerate(paths):
        report(Progress(f"{what} {Path(path).name}", number / len(paths)))
        try:
            done.append(str(act(Path(path))))
        except (RunError, AnalysisError, ConfigError, ValueError) as error:
            faults.append(f"{Path(path).name}: {error}")
    return BatchOutcome(tuple(done), tuple(faults))


def _edit(path: Path, task: EditRuns) -> Path:
    from app.runs.edits import edit_run, series_fields
    from app.runs.reader import open_run

    fields = {task.field: task.value}
    if task.field == "series":
        fields = series_fields(open_run(path).metadata.stand, task.value)
    edit_run(path, task.author, **fields)
    return path


def _undo(path: Path, author: str, field: str) -> Path:
    from app.runs.edits import undo_edit

    undo_edit(path, author, (field,))
    return path


def _trash(path: Path) -> Path:
    from app.runs.trash import move_to_trash

    return move_to_trash(path)


def _bring_back(path: Path) -> Path:
    from app.runs.trash import restore_from_trash

    return restore_from_trash(path)


def _copy(path: Path, folder: Path) -> Path:
    from app.runs.copying import copy_run_into

    return copy_run_into(path, folder)


def _export(task: ExportRuns, report: ReportProgress) -> BatchOutcome:
    import msgspec

    from app.runs.exchange.exporting import ExportRequest, export_runs

    request = msgspec.convert(
        {"format": task.format, "content": task.content, "replace": task.replace}, ExportRequest
    )
    outcomes = export_runs(
        [Path(path) for path in task.paths],
        Path(task.output),
        request,
        progress=lambda done, name: report(
            Progress(gettext("Exporting {name}", name=name), done / len(task.paths))
        ),
    )
    return BatchOutcome(
        tuple(file for outcome in outcomes for file in outcome.files),
        tuple(f"{Path(outcome.run).name}: {outcome.error}" for outcome in outcomes if outcome.error),
    )


def _preview(task: PreviewExport) -> ExportPreview:
    """Export the run into a folder that goes again, and take the first lines of each file."""
    with tempfile.TemporaryDirectory(prefix="slipstand-") as folder:
        output = Path(folder) / Path(task.path).stem
        outcome = _export(
            ExportRuns((task.path,), f"{output}.{task.format}", task.format, task.content, replace=True),
            lambda _progress: None,
        )
        parts = [_first_lines(Path(file)) for file in outcome.done]
    return ExportPreview("\n\n".join([*parts, *outcome.faults]))


def _first_lines(path: Path) -> str:
    size = f"{path.stat().st_size / 1e3:,.0f} kB"
    if path.suffix not in _TEXT_SUFFIXES:
        return f"{path.name}, {size}"
    with path.open(encoding="utf-8", errors="replace") as file:
        lines = [line.rstrip("\n")[:_PREVIEW_WIDTH] for line in itertools.islice(file, _PREVIEW_LINES)]
    return "\n".join([f"{path.name}, {size}", *lines])
