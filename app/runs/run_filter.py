"""Which runs of a library to show; it loads no HDF5."""

import datetime
import os
from pathlib import Path

import msgspec

from app.runs.summary import RunSummary


class RunFilter(msgspec.Struct, frozen=True):
    """Which runs of a library to show. Of a file with a fault, its name and date of change decide.

    A run whose start is not known, as of an imported record, is of no day.
    """

    series: str | None = None
    since: datetime.date | None = None
    until: datetime.date | None = None
    operator: str | None = None
    text: str | None = None
    """Occurs in file name, title, note, operator, series or origin, whatever the case; or is the source."""
    stale: bool | None = None

    def matches(self, run: RunSummary) -> bool:
        return (
            (self.series is None or self.series.strip().upper() in _series(run))
            and (self.since is None or ((day := _day(run)) is not None and day >= self.since))
            and (self.until is None or ((day := _day(run)) is not None and day <= self.until))
            and (self.operator is None or self.operator.casefold() == run.operator.casefold())
            and (self.text is None or _holds(run, self.text.casefold()))
            and (self.stale is None or self.stale == run.stale)
        )


def _series(run: RunSummary) -> list[str]:
    """Series codes that a run answers to, in capitals."""
    return Path(run.path).stem.upper().split("_") if run.fault else [(run.series or "").upper()]


def _holds(run: RunSummary, text: str) -> bool:
    """Tell whether a text in small letters occurs in a run, or is its source."""
    parts = (run.path.rpartition(os.sep)[2], run.title, run.note, run.operator, run.series or "", run.origin)
    return text == run.source or text in "\n".join(parts).casefold()


def _day(run: RunSummary) -> datetime.date | None:
    """Day of a run; of a file with a fault that of its last change. None where the start is not known."""
    if run.start_time is not None:
        return run.start_time.astimezone().date()
    if not run.fault:
        return None
    try:
        return datetime.datetime.fromtimestamp(Path(run.path).stat().st_mtime).astimezone().date()
    except OSError:
        return datetime.date.min
