"""The last seconds of live samples, and readings averaged over them."""

import math
from collections import deque
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from analysis.formatting import typeset
from app.acquisition.averaged_counts import OVERLOAD_FLAGS, AveragedCounts, compute_average
from app.acquisition.ring import RingRows
from drivers.samples import ABSENT_BY_GAUGE
from messages.i18n import gettext

_MIN_VALID_FRACTION: Final = 0.5
"""Least fraction of valid samples in a window: below it the gauge is hardly in range."""
WINDOW_S: Final = 1.0
"""Length of an averaging window: 1 s averages whole periods of 50 and 60 Hz hum."""
MAX_WINDOWS: Final = 5
"""A reading waits at most this many windows until the gauge is at rest, then it is taken with a warning."""
_STALE_S: Final = 0.1
"""Samples older than the request may still be queued for so long."""


@dataclass(frozen=True, slots=True)
class InvalidWindow:
    """A window without an average, and the reason."""

    reason: str


class RecentSamples:
    """The newest rows of the live ring, `seconds` long."""

    def __init__(self, seconds: float) -> None:
        self._seconds = seconds
        self._parts: deque[RingRows] = deque()

    @property
    def end_s(self) -> float:
        """Time of the newest row; NaN without any."""
        return float(self._parts[-1].time_s[-1]) if self._parts else float("nan")

    @property
    def length_s(self) -> float:
        """Time from the oldest row to the newest; 0 without any."""
        return self.end_s - float(self._parts[0].time_s[0]) if self._parts else 0.0

    def append(self, rows: RingRows) -> None:
        if not len(rows):
            return
        self._parts.append(rows)
        while rows.time_s[-1] - self._parts[0].time_s[-1] > self._seconds:
            self._parts.popleft()

    def clear(self) -> None:
        self._parts.clear()

    def since(self, start_s: float) -> RingRows | None:
        """Rows from a time on, concatenated; None without any."""
        parts = [rows for rows in self._parts if rows.time_s[-1] >= start_s]
        if not parts:
            return None
        names = ("counts", "readings", "relative_m", "status", "time_s")
        columns: dict[str, Any] = {
            name: np.concatenate([getattr(rows, name) for rows in parts]) for name in names
        }
        skipped = int(np.searchsorted(columns["time_s"], start_s))
        return RingRows(
            parts[0].first_index + skipped, **{name: column[skipped:] for name, column in columns.items()}
        )


def average_counts(rows: RingRows, channel: int) -> AveragedCounts | InvalidWindow:
    """Average the counts of gauge 1 (channel 0) or gauge 2 (channel 1) over rows."""
    valid = (rows.status & int(ABSENT_BY_GAUGE[channel] | OVERLOAD_FLAGS[channel])) == 0
    counts = rows.counts[valid, channel].astype(np.float64)
    if len(counts) < max(_MIN_VALID_FRACTION * len(rows), 2):
        return InvalidWindow(
            gettext(
                "Gauge {number} is overloaded or its samples are damaged: {bad} of {all}."
                " Move it back into its range, or check the cable",
                number=channel + 1,
                bad=len(rows) - len(counts),
                all=len(rows),
            )
        )
    return compute_average(counts)


@dataclass(frozen=True, slots=True)
class StillMoving:
    """The gauge is not at rest yet."""

    text: str


class ReadingAverager:
    """Averages one reading of live samples once the gauge is at rest."""

    def __init__(self, recent: RecentSamples) -> None:
        self._recent = recent
        self._since_s = math.nan
        self._windows = 0

    @property
    def is_active(self) -> bool:
        return self._windows > 0

    def start(self) -> bool:
        """Begin a reading; False without samples."""
        if not math.isfinite(self._recent.end_s):
            return False
        self._windows, self._since_s = 1, self._recent.end_s + _STALE_S
        return True

    def stop(self) -> None:
        self._windows = 0

    def poll(self, gauge: int) -> AveragedCounts | InvalidWindow | StillMoving | None:
        """Evaluate the current window once it is complete; None before.

        The last window is accepted even if the gauge still creeps.
        """
        if not self.is_active or self._recent.end_s < self._since_s + WINDOW_S:
            return None
        rows = self._recent.since(self._since_s)
        if rows is None:
            return None
        average = average_counts(rows, gauge)
        if isinstance(average, InvalidWindow) or average.is_steady or self._windows == MAX_WINDOWS:
            self.stop()
            return average
        self._windows, self._since_s = self._windows + 1, self._recent.end_s
        creep = typeset(f"{average.creep_counts:.3g}")
        return StillMoving(gettext("Still moving by {creep} counts, waiting", creep=creep))
