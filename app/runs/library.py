"""The library: where runs are kept, and what is there."""

import datetime
from collections.abc import Iterator
from pathlib import Path

import msgspec

from app.runs.errors import RunError, RunNotFoundError
from app.runs.examiner import Examiner
from app.runs.format import SUFFIX
from app.runs.places import recordings_directory
from app.runs.reader import check_openable
from app.runs.summary import RunSummary


def list_runs(
    folder: Path | None = None, *, series: str | None = None, since: datetime.date | None = None
) -> list[RunSummary]:
    """Summaries of all runs in a folder and those below it, oldest first, files with a fault last.

    Parameters
    ----------
    folder
        By default the recordings folder, which counts as empty while it does not exist.
    series, since
        Keep runs of one series, or begun on a day or later. Of a file with a fault, its name and
        date of change decide.

    Raises
    ------
    RunNotFoundError
        There is no such folder.
    """
    if folder is not None and not folder.is_dir():
        raise RunNotFoundError(f"{folder}: there is no such folder. Give a folder with runs")
    with Examiner() as examiner:
        found = [_summary(path, examiner) for path in find_runs(folder or recordings_directory())]
    kept = [summary for summary in found if _matches(summary, series, since)]
    return sorted(kept, key=_order)


def find_runs(folder: Path) -> Iterator[Path]:
    """Paths of all run files in a folder and those below it; hidden ones are left out."""
    for path in folder.rglob(f"*{SUFFIX}"):
        if not any(part.startswith(".") for part in path.relative_to(folder).parts):
            yield path.absolute()


def _summary(path: Path, examiner: Examiner) -> RunSummary:
    try:
        check_openable(path)
        return msgspec.structs.replace(examiner.examine(path), path=str(path))
    except RunError as error:
        return RunSummary(path=str(path), fault=str(error))


def _matches(summary: RunSummary, series: str | None, since: datetime.date | None) -> bool:
    if summary.fault:
        named = series is None or series.upper() in Path(summary.path).stem.upper().split("_")
        return named and (since is None or _changed(summary) >= since)
    of_series = series is None or (summary.series or "").upper() == series.strip().upper()
    begun = summary.start_time.astimezone().date() if summary.start_time else None
    return of_series and (since is None or (begun is not None and begun >= since))


def _changed(summary: RunSummary) -> datetime.date:
    try:
        seconds = Path(summary.path).stat().st_mtime
    except OSError:
        return datetime.date.min
    return datetime.datetime.fromtimestamp(seconds).astimezone().date()


def _order(summary: RunSummary) -> tuple[bool, float, str]:
    start = summary.start_time
    return bool(summary.fault), start.timestamp() if start else 0.0, summary.path
