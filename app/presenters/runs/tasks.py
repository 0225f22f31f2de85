"""Tasks of the Runs screen and its dialogs; the worker process executes them in `work`."""

from dataclasses import dataclass, field
from typing import Any, Final

from app.presenters.base import Progress
from app.presenters.runs.import_form import ImportForm, TextFormat
from app.presenters.runs.state import Overlay
from app.presenters.worker import LazyFunction
from messages.i18n import N_

EXECUTE: Final = LazyFunction("app.presenters.runs.work", "execute")
ANALYSE_RUNS: Final = LazyFunction("app.presenters.runs.work", "analyse_runs")
ANALYSING = N_("Analysing {name}, {number} of {all}")


@dataclass(frozen=True, slots=True)
class ListRuns:
    """List the runs of a folder."""

    folder: str


@dataclass(frozen=True, slots=True)
class LoadOverlay:
    """Read and decimate runs for drawing."""

    paths: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class EditRuns:
    """Set a field of `RunMetadata`; a series also sets its pullback and plate mass."""

    paths: tuple[str, ...]
    field: str
    value: Any
    author: str


@dataclass(frozen=True, slots=True)
class UndoEdits:
    """Undo the last edit of a field in each run."""

    paths: tuple[str, ...]
    author: str
    field: str


@dataclass(frozen=True, slots=True)
class TrashRuns:
    """Move runs to the trash."""

    paths: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class RestoreRuns:
    """Restore runs from the trash."""

    paths: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class CopyRuns:
    """Copy run files into a folder, under free names."""

    paths: tuple[str, ...]
    folder: str


@dataclass(frozen=True, slots=True)
class ExportRuns:
    """Export runs; fields as in `app.runs.exchange.exporting.ExportRequest`."""

    paths: tuple[str, ...]
    output: str
    format: str
    content: str
    replace: bool


@dataclass(frozen=True, slots=True)
class PreviewExport:
    """Preview the export of one run."""

    path: str
    format: str
    content: str


@dataclass(frozen=True, slots=True)
class ExportPreview:
    """Names and sizes of the exported files, with the first lines of text files."""

    text: str


@dataclass(frozen=True, slots=True)
class BatchOutcome:
    """Paths of the runs that were processed, and a line for each that failed."""

    done: tuple[str, ...] = ()
    faults: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class SurveyFile:
    """Read the columns and first lines of a file."""

    path: str
    text_format: TextFormat = field(default_factory=TextFormat)


@dataclass(frozen=True, slots=True)
class PreviewImport:
    """Read a file as it would be imported."""

    path: str
    form: ImportForm


@dataclass(frozen=True, slots=True)
class ImportFile:
    """Import a file as a run, under a free name in the folder; the answer is its path."""

    path: str
    form: ImportForm
    folder: str


@dataclass(frozen=True, eq=False, slots=True)
class ImportPreview:
    """The record for drawing, and its length and rate as text."""

    overlay: Overlay
    summary: str


ImportTask = SurveyFile | PreviewImport | ImportFile


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


@dataclass(frozen=True, slots=True)
class AnalyseRuns:
    """Analyse runs and save the results; with `reanalyse`, also those that are up to date."""

    paths: tuple[str, ...]
    reanalyse: bool = False


@dataclass(frozen=True, slots=True)
class RunAnalysed(Progress):
    """Progress of `AnalyseRuns`: one run is done; `fault` says in one line why it failed."""

    path: str = ""
    is_up_to_date: bool = False
    fault: str = ""
