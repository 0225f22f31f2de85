"""Live samples kept for some seconds: as counts of a gauge again, and in one piece for its health."""

from collections import deque
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from app.acquisition.gauge_samples import AveragedCounts, compute_average
from app.acquisition.ring import RingRows
from config.schema import Gauge, Gauges
from drivers.samples import ABSENT_BY_GAUGE, SampleStatus
from messages.i18n import gettext

Floats = NDArray[np.float64]

_OVERLOADS: Final = (SampleStatus.OVERLOAD_TABLE, SampleStatus.OVERLOAD_RELATIVE)
_SOUND_SHARE: Final = 0.5
_NEWTON_STEPS: Final = 6


@dataclass(frozen=True, slots=True)
class InvalidWindow:
    """A window that gives no average, and why."""

    reason: str


class RecentSamples:
    """The newest rows of the ring.

    Parameters
    ----------
    seconds : float
        How much of them is kept.
    """

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
        """Take new rows, and forget those that are too old."""
        if not len(rows):
            return
        self._parts.append(rows)
        while rows.time_s[-1] - self._parts[0].time_s[-1] > self._seconds:
            self._parts.popleft()

    def clear(self) -> None:
        """Forget everything."""
        self._parts.clear()

    def since(self, start_s: float) -> RingRows | None:
        """All rows from a time on, in one piece; None without any."""
        parts = [rows for rows in self._parts if rows.time_s[-1] >= start_s]
        if not parts:
            return None
        columns = ("time_s", "table_m", "relative_m", "status")
        time_s, table_m, relative_m, status = (
            np.concatenate([getattr(rows, name) for rows in parts]) for name in columns
        )
        first = int(np.searchsorted(time_s, start_s))
        return RingRows(
            parts[0].first_row + first, time_s[first:], table_m[first:], relative_m[first:], status[first:]
        )


def average_counts(rows: RingRows, channel: int, gauges: Gauges) -> AveragedCounts | InvalidWindow:
    """Average counts of a gauge over rows, as a calibration against a dial gauge takes them.

    Parameters
    ----------
    rows : RingRows
    channel : int
        0 for gauge 1, 1 for gauge 2.
    gauges : Gauges
        Calibrations by which the rows came to be displacements.
    """
    unsound = (rows.status & int(ABSENT_BY_GAUGE[channel] | _OVERLOADS[channel])) != 0
    seen_m = rows.table_m if channel == 0 else gauge_2_displacement_m(rows, gauges)
    sound_m = seen_m[~unsound & np.isfinite(seen_m)]
    if len(sound_m) < max(_SOUND_SHARE * len(rows), 2):
        bad = len(rows) - len(sound_m)
        return InvalidWindow(
            gettext(
                "Gauge {number} is overloaded or its samples are damaged: {bad} of {all}."
                " Move it back into its range, or check the cable",
                number=channel + 1,
                bad=bad,
                all=len(rows),
            )
        )
    return compute_average(counts_from_displacement(sound_m, (gauges.table, gauges.relative)[channel]))


def gauge_2_displacement_m(rows: RingRows, gauges: Gauges) -> Floats:
    """Displacements (n,) as gauge 2 reads them (m), which may be against the base."""
    return rows.relative_m + rows.table_m if gauges.relative.measures == "plate" else rows.relative_m


def counts_from_displacement(displacement_m: Floats, gauge: Gauge) -> Floats:
    """Counts (n,) that stand for displacements (n,): the inverse of `Gauge.displacement_m`.

    The bends of a gauge are small against its line, so that Newton's method from the line converges.
    """
    linear = displacement_m.copy()
    if gauge.polynomial:
        terms = np.polynomial.Polynomial((0.0, 1.0, *gauge.polynomial))
        slope = terms.deriv()
        for _ in range(_NEWTON_STEPS):
            linear -= (terms(linear) - displacement_m) / slope(linear)
    return linear / gauge.gain_m_per_count + gauge.zero_count
