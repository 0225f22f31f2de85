"""Short averages of both gauges over a sliding window: level, noise, drift, and the zero."""

import itertools
import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from drivers.arrays import Floats

BIN_S = 0.002  # length of a short average: a longer one has less noise, and a release is noticed later
_KEPT_S = 1.6  # a release is confirmed within 1.5 s, and then dated by the readings about its beginning
_PARTS = 4  # a stretch is compared in quarters: their means differ if it moves
_LEAST_READINGS = 2 * _PARTS  # of a stretch
_START_GRID = 200  # trial beginnings of the parabola over the stretch
_NORMAL_MEDIAN = 0.6744897501960817  # median of |x| for a standard normal x
_RESOLUTION_M = 0.5e-6  # least value of the noise: readings of a coarse or quiet gauge repeat exactly
_LEVEL_ERRORS = 6.0  # standard errors by which the quarters of a stretch that stands still may differ
_DRIFT_ERRORS = 4.0  # standard errors above which a drift is taken as real


@dataclass(frozen=True, eq=False, slots=True)
class BinAverages:
    """Averages over consecutive bins of equal length; bins without a single reading are left out."""

    center: Floats  # (n,) sample index of the middle of each bin
    table_m: Floats
    relative_m: Floats  # (n,) mean displacements (m), NaN where gauge 2 has no reading

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
        """Bins that samples (n,) complete; NaN is no reading. Blocks must join those before."""
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
    present = sums[1] > 0
    center: Floats = (np.flatnonzero(present).astype(np.float64) + first + 0.5) * samples_per_bin - 0.5
    with np.errstate(invalid="ignore"):  # 0 / 0 where gauge 2 has no reading: NaN, as promised
        means: Floats = sums[::2, present] / sums[1::2, present]
    return BinAverages(center, means[0], means[1])


@dataclass(frozen=True, slots=True)
class StationaryLevel:
    """A stretch that stood still: its mean and noise (m), and the index of its first reading."""

    mean_m: float
    noise_m: float
    since: float


class SlidingWindow:
    """Readings of one gauge of the last `span_s`, one for each `spacing` indices at most."""

    def __init__(self, span_s: float, spacing: float, rate_hz: float = 1.0) -> None:
        self._rate_hz = rate_hz
        self._kept = math.ceil(span_s * rate_hz / spacing) + 2
        self._rows = np.empty((4 * self._kept, 2))
        self._count = 0

    def add(self, index: Floats, value_m: Floats) -> None:
        index, value_m = index[-self._kept :], value_m[-self._kept :]
        end = self._count + len(index)
        if end > len(self._rows):
            self._rows[: self._kept] = self._rows[self._count - self._kept : self._count]
            self._count, end = self._kept, self._kept + len(index)
        self._rows[self._count : end, 0] = index
        self._rows[self._count : end, 1] = value_m
        self._count = end

    def latest(self, duration_s: float) -> Floats:
        """Indices and values (n, 2) of the readings of the last `duration_s`."""
        rows = self._all()
        if not len(rows):
            return rows
        return rows[rows[:, 0].searchsorted(rows[-1, 0] - duration_s * self._rate_hz) :]

    def between(self, first: float, last: float) -> Floats:
        """Indices and values (n, 2) of the readings with first <= index <= last."""
        rows = self._all()
        start, end = np.searchsorted(rows[:, 0], first), np.searchsorted(rows[:, 0], last, side="right")
        return rows[start:end]

    def mean(self, duration_s: float, now: float) -> float:
        """Mean of the latest readings (m); NaN if there were none for so long before index `now`."""
        rows = self.latest(duration_s)
        is_current = len(rows) > 0 and rows[0, 0] >= now - 2.0 * duration_s * self._rate_hz
        return mean_m(rows) if is_current else math.nan

    def stationary(self, duration_s: float, tolerance_m: float) -> StationaryLevel | None:
        """Level of the last `duration_s`, or of the last eight readings where it has fewer; None if it moved.

        These may take twice as long as at the nominal rate: slow devices leave readings out too.
        """
        span = duration_s * self._rate_hz
        stretch = self.latest(duration_s)
        if len(stretch) < _LEAST_READINGS:
            stretch = self._all()[-_LEAST_READINGS:]
            if len(stretch) and stretch[-1, 0] - stretch[0, 0] > 2.0 * max(span, _LEAST_READINGS):
                return None
        return stationary_level(stretch, span, tolerance_m)

    def drift_m_per_s(self, duration_s: float, bound_m_per_s: float, noise: float | None = None) -> float:
        """Rate of drift; 0 as long as that is within a bound, or hidden in the noise (m), where known."""
        rate, error = (self._rate_hz * value for value in drift(self.latest(duration_s), noise))
        return rate if abs(rate) > bound_m_per_s + _DRIFT_ERRORS * error else 0.0

    def _all(self) -> Floats:
        return self._rows[max(0, self._count - self._kept) : self._count]


class RecentAverages:
    """Short averages of the last 1.6 s: of the table, and of the plate against the table."""

    def __init__(self, rate_hz: float, samples_per_bin: int) -> None:
        self.table = SlidingWindow(_KEPT_S, samples_per_bin, rate_hz)
        self.relative = SlidingWindow(_KEPT_S, samples_per_bin, rate_hz)

    def add(self, bins: BinAverages) -> None:
        self.table.add(bins.center, bins.table_m)
        present = ~np.isnan(bins.relative_m)
        self.relative.add(bins.center[present], bins.relative_m[present])


def mean_m(rows: Floats) -> float:
    """Mean of the values of rows (n, 2), n >= 1: numpy's own takes three times as long for so few."""
    return rows[:, 1].sum().item() / len(rows)  # type: ignore[no-any-return]


def noise_m(values_m: Floats) -> float:
    """Noise of readings (n,) in m, from the median step of neighbours: slow motion does not change it."""
    if len(values_m) < _PARTS:
        return _RESOLUTION_M
    step = _median(np.abs(values_m[1:] - values_m[:-1]))
    return max(step / (_NORMAL_MEDIAN * math.sqrt(2.0)), _RESOLUTION_M)


def stationary_level(stretch: Floats, span: float, tolerance_m: float) -> StationaryLevel | None:
    """Level of a stretch (n, 2) whose quarters agree within six standard errors; None if it moved."""
    if len(stretch) < _LEAST_READINGS or stretch[-1, 0] - stretch[0, 0] < 0.9 * span:
        return None
    values = stretch[:, 1]
    edges = [len(values) * part // _PARTS for part in range(_PARTS + 1)]
    sums = np.add.reduceat(values, edges[:-1]).tolist()
    quarters = [
        total / (end - start) for total, (start, end) in zip(sums, itertools.pairwise(edges), strict=True)
    ]
    noise = noise_m(values)
    error_m = noise / math.sqrt(len(values) / _PARTS)
    if max(quarters) - min(quarters) > max(_LEVEL_ERRORS * error_m, tolerance_m):
        return None
    return StationaryLevel(mean_m(stretch), noise, float(stretch[0, 0]))


def drift(stretch: Floats, noise: float | None = None) -> tuple[float, float]:
    """Slope of a stretch (n, 2) by least squares, and its standard error: infinite below eight readings."""
    if len(stretch) < _LEAST_READINGS:
        return 0.0, math.inf
    index = stretch[:, 0] - stretch[:, 0].mean()
    spread = float(index @ index)
    noise = noise_m(stretch[:, 1]) if noise is None else noise
    return float(index @ stretch[:, 1]) / spread, noise / math.sqrt(spread)


def fit_parabola_start(falling: Floats) -> float:
    """Index at which a rise (n, 2) from zero with the square of time began, by least squares."""
    index, distance_m = falling[:, 0], falling[:, 1]
    if len(index) == 1:
        return float(index[0])
    starts = np.linspace(index[0], index[-1], _START_GRID, endpoint=False)
    shape = np.maximum(index - starts[:, None], 0.0) ** 2
    growth = np.maximum(shape @ distance_m, 0.0) / (shape**2).sum(axis=1)
    misfit = ((distance_m - growth[:, None] * shape) ** 2).sum(axis=1)
    return float(starts[np.argmin(misfit)])


def _median(values: Floats) -> float:
    """Median of values (n,), n >= 1: numpy's own takes three times as long for so few."""
    middle = len(values) // 2
    if len(values) % 2:
        return float(np.partition(values, middle)[middle])
    low, high = np.partition(values, (middle - 1, middle))[middle - 1 : middle + 1]
    return float(low + high) / 2.0


_ZEROS_KEPT_S = 10.0
_KNOWN_S = 0.15  # the zero is known when the levels of so long a time agree; each is itself a mean over 0.3 s
_BEFORE_S = 1.3  # the zero is taken so long before the pull is noticed: a smooth pull begins unnoticed


@dataclass(frozen=True, slots=True)
class ZeroLevel:
    """A moment of rest: sample at which it began, and what both gauges read (m)."""

    since: float
    table_m: float
    relative_m: float


class ZeroEstimator:
    """Moments of rest, of the last ten seconds at most."""

    def __init__(self, rate_hz: float) -> None:
        self._rate_hz = rate_hz
        self._levels: deque[ZeroLevel] = deque()

    def add(self, level: ZeroLevel) -> None:
        self._levels.append(level)
        while self._levels[0].since < level.since - _ZEROS_KEPT_S * self._rate_hz:
            self._levels.popleft()

    def reset(self) -> None:
        self._levels.clear()

    @property
    def has_levels(self) -> bool:
        return bool(self._levels)

    @property
    def is_known(self) -> bool:
        levels = self._levels
        return self.has_levels and levels[-1].since - levels[0].since >= _KNOWN_S * self._rate_hz

    @property
    def latest(self) -> ZeroLevel:
        return self._levels[-1]

    def farthest_m(self, table_m: Floats) -> float:
        """Largest distance (m) of averages (n,), n >= 1, from the oldest rest: a slow pull is noticed too."""
        return float(np.abs(table_m - self._levels[0].table_m).max()) if self._levels else 0.0

    def level_before(self, index: float, noticed_m: float) -> ZeroLevel:
        """The rest before a pull that was noticed at `index`, at `noticed_m` from it. Raises IndexError."""
        oldest, latest = self._levels[0], index - _BEFORE_S * self._rate_hz
        chosen = next((level for level in reversed(self._levels) if level.since <= latest), oldest)
        is_slow = math.fabs(chosen.table_m - oldest.table_m) > 0.5 * noticed_m
        return oldest if is_slow else chosen
