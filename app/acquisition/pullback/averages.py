"""The latest readings of both gauges, asked about in seconds."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.acquisition.pullback.stationarity import SlidingWindow, StationaryLevel, drift, stationary_level

Floats = NDArray[np.float64]

BIN_S = 0.002


@dataclass(frozen=True, eq=False, slots=True)
class BinAverages:
    """Averages over consecutive bins of equal length; bins without a single reading are left out.

    Attributes
    ----------
    middle : (n,) float64
        (n,) float64: sample index of the middle of each bin.
    """

    center: Floats
    table_m: Floats
    """(n,) float64: mean displacements (m); `relative_m` is NaN where gauge 2 has no reading."""
    relative_m: Floats

    def __len__(self) -> int:
        return len(self.center)

    def __getitem__(self, part: slice) -> "BinAverages":
        return BinAverages(self.center[part], self.table_m[part], self.relative_m[part])


class BinAverager:
    """Averages samples over bins of 2 ms, or of one sample at slow rates, whatever blocks they come in."""

    def __init__(self, rate_hz: float) -> None:
        self.samples_per_bin = max(1, round(rate_hz * BIN_S))
        self._bin: int | None = None
        self._sums = np.zeros((4, 1))

    def add(self, first_index: int, table_m: Floats, relative_m: Floats) -> BinAverages:
        """Bins that these consecutive samples (n,) complete; NaN is no reading.

        Blocks must join: `first_index` is where the block before ended.
        """
        if not len(table_m):
            return _bins(np.zeros((4, 0)), 0, 1)
        n = self.samples_per_bin
        first = first_index // n if self._bin is None else self._bin
        keys = np.arange(first_index, first_index + len(table_m)) // n - first
        end = (first_index + len(table_m)) // n
        sums = np.zeros((4, end - first + 1))
        sums[:, :1] = self._sums
        for row, values in ((0, table_m), (2, relative_m)):
            present = ~np.isnan(values)
            sums[row] += np.bincount(keys[present], values[present], minlength=sums.shape[1])
            sums[row + 1] += np.bincount(keys[present], minlength=sums.shape[1])
        self._bin, self._sums = end, sums[:, -1:]
        return _bins(sums[:, :-1], first, n)


def _bins(sums: Floats, first: int, samples_per_bin: int) -> BinAverages:
    """Means from rows table sum, table count, relative sum, relative count."""
    there = sums[1] > 0
    middle: Floats = (np.flatnonzero(there).astype(np.float64) + first + 0.5) * samples_per_bin - 0.5
    with np.errstate(invalid="ignore"):  # 0 / 0 where gauge 2 has no reading: NaN, as promised
        means: Floats = sums[::2, there] / sums[1::2, there]
    return BinAverages(middle, means[0], means[1])


_DRIFT_ERRORS = 4.0
_KEPT_S = 1.6
"""A release is confirmed within 1.5 s, and then dated by the readings about its beginning."""


class RecentAverages:
    """Short averages of the table's and the plate's displacement, of the last 1.6 s.

    Parameters
    ----------
    rate_hz : float
        Sample indices a second.
    spacing : float
        Samples in an average.
    """

    def __init__(self, rate_hz: float, spacing: float) -> None:
        self._rate_hz = rate_hz
        self._table = SlidingWindow(_KEPT_S * rate_hz, spacing)
        self._relative = SlidingWindow(_KEPT_S * rate_hz, spacing)

    def add(self, bins: BinAverages) -> None:
        """Take the next averages, at least one; where gauge 2 has no reading, its is NaN."""
        self._table.add(bins.center, bins.table_m)
        there = ~np.isnan(bins.relative_m)
        if there.all():
            self._relative.add(bins.center, bins.relative_m)
        else:
            self._relative.add(bins.center[there], bins.relative_m[there])

    def table(self, duration_s: float) -> Floats:
        """Indices and displacements (n, 2) of the table, not older than `duration_s`."""
        return self._table.latest(duration_s * self._rate_hz)

    def table_between(self, first: float, last: float) -> Floats:
        """Indices and displacements (n, 2) of the table with first <= index <= last."""
        return self._table.between(first, last)

    def relative(self, duration_s: float) -> Floats:
        """Indices and displacements (n, 2) of the plate against the table."""
        return self._relative.latest(duration_s * self._rate_hz)

    def relative_mean(self, duration_s: float, now: float) -> float:
        """Mean of the plate against the table (m); NaN if gauge 2 gave nothing for so long before `now`."""
        rows = self.relative(duration_s)
        is_there = len(rows) > 0 and rows[0, 0] >= now - 2.0 * duration_s * self._rate_hz
        return float(rows[:, 1].mean()) if is_there else math.nan

    def stationary_table(self, duration_s: float, tolerance_m: float) -> StationaryLevel | None:
        """Level of the table if it stood still, or within a tolerance, for so long."""
        return stationary_level(self.table(duration_s), duration_s * self._rate_hz, tolerance_m)

    def stationary_relative(self, duration_s: float, tolerance_m: float) -> StationaryLevel | None:
        """Level of the plate against the table if it stood still for so long."""
        return stationary_level(self.relative(duration_s), duration_s * self._rate_hz, tolerance_m)

    def table_drift_m_per_s(self, duration_s: float, bound_m_per_s: float) -> float:
        """How fast the table drifts; 0 as long as that is within a bound, or hidden in the noise."""
        rate, error = (self._rate_hz * value for value in drift(self.table(duration_s)))
        return rate if abs(rate) > bound_m_per_s + _DRIFT_ERRORS * error else 0.0
