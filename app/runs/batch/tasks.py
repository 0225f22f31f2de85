"""What is done to one run, wherever it is done: its analysis as a small document, or why there is none."""

from collections.abc import Callable
from pathlib import Path

import h5py
import msgspec

from analysis.record import AnalysisError
from app.runs.analyses import Document, SavedAnalysis, read_analyses
from app.runs.analysing import Analysis, AnalysisRequest, Progress, analyze_run
from app.runs.errors import RunError, own_fault
from app.runs.examiner import Examiner, standing_examiner
from app.runs.facts import read_metadata
from app.runs.format import ENDED, get_text
from app.runs.metadata import RunMetadata
from app.runs.reader import check_openable, read_file
from app.runs.staleness import facts_hash
from config.schema import ConfigError


class RunTask(msgspec.Struct, frozen=True):
    """One run to analyse.

    Attributes
    ----------
    path : str
    request : AnalysisRequest
    save : bool
        Keep the result in the run, unless one of the same request is kept there that still stands.
    anew : bool
        Analyse and save in any case.
    """

    path: str
    request: AnalysisRequest = AnalysisRequest()
    save: bool = False
    anew: bool = False


class RunOutcome(msgspec.Struct, frozen=True):
    """What became of one run.

    Attributes
    ----------
    run : str
        Absolute path.
    document : Document or None
        As `analyze --json` says it; None where the run could not be analysed.
    error : str
        Why not, in one line; "" otherwise.
    up_to_date : bool
        The document is the one that was kept in the run.
    unit : str
        Of the readings.
    ended : str
        Why the recording ended; "" for a run that was never closed.
    """

    run: str
    document: Document | None = None
    error: str = ""
    up_to_date: bool = False
    unit: str = "m"
    ended: str = ""


def analyze_one(
    task: RunTask, progress: Progress | None = None, examiner: Examiner | None = None
) -> RunOutcome:
    """Analyse one run. Never raises: what goes wrong is in the outcome."""
    path = Path(task.path).expanduser().absolute()
    try:
        return _analyzed(path, task, progress, examiner or standing_examiner())
    except Exception as error:
        return RunOutcome(str(path), error=in_words(error))


def outcome_of(analysis: Analysis) -> RunOutcome:
    """Outcome of an analysis that was made here."""
    run = analysis.run
    ended = run.ending.ended if run.ending else ""
    return RunOutcome(analysis.document["run"], analysis.document, unit=run.metadata.unit, ended=ended)


def in_words(error: Exception) -> str:
    """One line on what went wrong with a run; a fault of the program itself is called one."""
    known = (RunError, AnalysisError, ConfigError, OSError)
    return " ".join(str(error).split()) if isinstance(error, known) else own_fault(error)


def look_over(path: Path, examiner: Examiner) -> int:
    """Examine a run, once for all that is then read of it, and count its analyses. Raises RunError."""
    check_openable(path)
    return examiner.examine(path).analyses


def newest_standing(
    file: h5py.File, metadata: RunMetadata, wanted: Callable[[SavedAnalysis], bool]
) -> tuple[SavedAnalysis | None, bool]:
    """Newest analysis kept in an open run that is wanted and not stale; and whether newer ones are stale.

    Masses that were given for an analysis count as those of the run.
    """
    stale = False
    for saved in reversed(read_analyses(file)):
        if not wanted(saved):
            continue
        masses = {name: saved.settings.get(name) for name in ("table_mass_kg", "plate_mass_kg")}
        if saved.facts == facts_hash(file, metadata, **masses):
            return saved, stale
        stale = True
    return None, stale


def _analyzed(path: Path, task: RunTask, progress: Progress | None, examiner: Examiner) -> RunOutcome:
    kept = look_over(path, examiner)
    if kept and task.save and not task.anew:
        wanted = msgspec.to_builtins(task.request)
        outcome = read_file(path, lambda file: _kept(file, path, wanted))
        if outcome is not None:
            return outcome
    return outcome_of(analyze_run(path, task.request, save=task.save, progress=progress, trusted=True))


def _kept(file: h5py.File, path: Path, wanted: dict[str, object]) -> RunOutcome | None:
    """The analysis kept in a run that was asked for in the same words, if it still stands."""
    metadata = read_metadata(file)
    saved, _ = newest_standing(file, metadata, lambda saved: saved.settings == wanted)
    if saved is None:
        return None
    document = saved.document | {"run": str(path)}
    return RunOutcome(str(path), document, up_to_date=True, unit=metadata.unit, ended=get_text(file, ENDED))
