"""What is done to one run, wherever it is done: its analysis as a small document, or why there is none."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TypeVar

import h5py
import msgspec

from app.runs.analysis_request import AnalysisRequest
from app.runs.analyze import Analysis, Progress, analyze_run
from app.runs.batch.executors import Executor, FailedItem, ordered_map
from app.runs.columns import check_samples, signal_paths
from app.runs.errors import internal_error, one_line
from app.runs.fields import read_text
from app.runs.metadata import RunMetadata
from app.runs.metadata_io import read_identifier, read_metadata
from app.runs.reader import check_openable, read_file
from app.runs.saved_analyses import Document, SavedAnalysis, is_stale, read_all_analyses
from app.runs.schema import ENDED
from app.runs.validator import Validator, shared_validator
from config.schema import ConfigError
from messages.message import Message, MessageError, lacking_resource, message


class AnalysisTask(msgspec.Struct, frozen=True):
    """One run to analyse."""

    path: str
    request: AnalysisRequest = AnalysisRequest()
    save: bool = False
    """Keep the result in the run, unless one of the same request is kept there that still stands."""
    force: bool = False


class AnalysisOutcome(msgspec.Struct, frozen=True):
    """What became of one run."""

    run: str
    document: Document | None = None
    """As `analyze --json` says it; None where the run could not be analysed."""
    error: Message = Message("")
    up_to_date: bool = False
    """The document is the one that was kept in the run."""
    unit: str = "m"
    ended: str = ""


def analyze_one(
    task: AnalysisTask, progress: Progress | None = None, validator: Validator | None = None
) -> AnalysisOutcome:
    """Analyse one run. Never raises: what goes wrong is in the outcome."""
    path = Path(task.path).expanduser().absolute()
    try:
        kept = validate_and_count(path, validator or shared_validator())
        if kept and task.save and not task.force:
            outcome = read_file(path, lambda file: _kept(file, path, task.request))
            if outcome is not None:
                return outcome
        return build_outcome(analyze_run(path, task.request, save=task.save, progress=progress, trusted=True))
    except Exception as error:
        return AnalysisOutcome(str(path), error=error_message(error))


def build_outcome(analysis: Analysis) -> AnalysisOutcome:
    """Outcome of an analysis that was made here."""
    run = analysis.run
    ended = run.end.ended if run.end else ""
    return AnalysisOutcome(analysis.document["run"], analysis.document, unit=run.metadata.unit, ended=ended)


def error_message(error: Exception) -> Message:
    """Message of an error with a run; a fault of the program itself is named one."""
    if isinstance(error, MessageError):
        return error.message
    if lacking := lacking_resource(error):
        return lacking
    if isinstance(error, OSError | ConfigError):
        return message("{error}", error=one_line(error))
    return internal_error(error)


def validate_and_count(path: Path, validator: Validator) -> int:
    """Examine a run, once for all that is then read of it, and count its analyses. Raises RunError."""
    check_openable(path)
    return validator.validate(path).analyses


def latest_valid_in_file(
    file: h5py.File, metadata: RunMetadata, wanted: Callable[[SavedAnalysis], bool]
) -> tuple[SavedAnalysis | None, bool, tuple[int, ...]]:
    """Newest analysis kept in a run that is wanted and not stale, whether newer ones are stale, damaged ones.

    Raises DamagedRunError where the samples that it was made of are not what was stored.
    """
    stale = False
    analyses, damaged = read_all_analyses(file)
    for saved in reversed(analyses):
        if not wanted(saved):
            continue
        if not is_stale(file, metadata, saved):
            check_samples(file)
            return saved, stale, damaged
        stale = True
    return None, stale, damaged


def kept_document(file: h5py.File, saved: SavedAnalysis, metadata: RunMetadata) -> Document:
    """Document of an analysis that is kept in an open run and still stands."""
    has_gauge_2 = len(signal_paths(file)) > 1
    return saved.document_of(Path(file.filename), metadata, read_identifier(file), has_gauge_2=has_gauge_2)


def _kept(file: h5py.File, path: Path, wanted: AnalysisRequest) -> AnalysisOutcome | None:
    """The analysis kept in a run that was asked for in the same words, if it still stands."""
    metadata = read_metadata(file)
    saved, *_ = latest_valid_in_file(
        file, metadata, lambda saved: AnalysisRequest.of_settings(saved.settings) == wanted
    )
    if saved is None:
        return None
    document = kept_document(file, saved, metadata)
    return AnalysisOutcome(
        str(path), document, up_to_date=True, unit=metadata.unit, ended=read_text(file, ENDED)
    )


Task = TypeVar("Task")
Outcome = TypeVar("Outcome")


def analyze_runs(
    tasks: Sequence[AnalysisTask], executor: Executor, progress: Progress = lambda _share, _what: None
) -> Iterator[AnalysisOutcome]:
    """Analyse runs; one that fails has its error as outcome and does not stop the rest.

    A caller cancels by asking for no more outcomes and closing the executor.
    """
    for outcome in map_runs(tasks, analyze_one, executor, progress):
        yield (
            AnalysisOutcome(outcome.item.path, error=outcome.message)
            if isinstance(outcome, FailedItem)
            else outcome
        )


def map_runs(
    tasks: Sequence[Task], work: Callable[..., Outcome], executor: Executor, progress: Progress
) -> Iterator[Outcome | FailedItem[Task]]:
    """Do `work(task)` on runs by an executor; in this process `work(task, progress)`."""
    done = 0

    def within(share: float, what: str) -> None:
        progress((done + share) / len(tasks), what)

    at_hand = (lambda task: work(task, within)) if executor.in_process else work
    for outcome in ordered_map(executor, at_hand, tasks):
        done += 1
        progress(done / len(tasks), f"{done} of {len(tasks)} runs")
        yield outcome
