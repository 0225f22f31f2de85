"""The latest readings of both gauges, asked about in seconds."""

import math

import numpy as np

from app.acquisition.bins import BinAverages, Floats
from app.acquisition.pullback.steadiness import SlidingWindow, StationaryLevel, drift, stationary_level

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
