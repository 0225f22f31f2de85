"""Is it still, and how noisy is it: questions about the latest stretch of a stream."""

import itertools
import math
from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_PARTS = 4
_START_GRID = 200
_NORMAL_MEDIAN = 0.6744897501960817
"""Median of |x| for a standard normal x."""
_RESOLUTION_M = 0.5e-6
"""Noise is never taken for less: readings of a coarse or quiet gauge repeat exactly."""


@dataclass(frozen=True, slots=True)
class StationaryLevel:
    """A stretch that stood still: its mean and noise (m), and the index of its first reading."""

    mean_m: float
    noise_m: float
    since: float


class SlidingWindow:
    """The latest readings, one each `spacing` sample indices at most, as far back as `span`."""

    def __init__(self, span: float, spacing: float) -> None:
        self._kept = math.ceil(span / spacing) + 2
        self._rows = np.empty((4 * self._kept, 2))
        self._count = 0

    def add(self, index: Floats, value_m: Floats) -> None:
        """Add readings (n,), later than all before."""
        index, value_m = index[-self._kept :], value_m[-self._kept :]
        end = self._count + len(index)
        if end > len(self._rows):
            self._rows[: self._kept] = self._rows[self._count - self._kept : self._count]
            self._count, end = self._kept, self._kept + len(index)
        self._rows[self._count : end, 0] = index
        self._rows[self._count : end, 1] = value_m
        self._count = end

    def latest(self, span: float) -> Floats:
        """Indices and values (n, 2) of the readings not older than `span` before the latest one."""
        rows = self._all()
        return rows[np.searchsorted(rows[:, 0], rows[-1, 0] - span) :] if len(rows) else rows

    def between(self, first: float, last: float) -> Floats:
        """Indices and values (n, 2) of the readings with first <= index <= last."""
        rows = self._all()
        start, end = np.searchsorted(rows[:, 0], first), np.searchsorted(rows[:, 0], last, side="right")
        return rows[start:end]

    def _all(self) -> Floats:
        return self._rows[max(0, self._count - self._kept) : self._count]


def noise_m(values_m: Floats) -> float:
    """Standard deviation (m) of the noise of readings (n,), whatever slow motion they show.

    From the median step between neighbours, so that few jumps do not count either.
    """
    if len(values_m) < _PARTS:
        return _RESOLUTION_M
    step = median(np.abs(values_m[1:] - values_m[:-1]))
    return max(step / (_NORMAL_MEDIAN * math.sqrt(2.0)), _RESOLUTION_M)


def stationary_level(stretch: Floats, span: float, tolerance_m: float) -> StationaryLevel | None:
    """Level of a stretch (n, 2) that stood still for `span` indices; None if it moved or is too short.

    It stood still when the means of its quarters agree within six standard errors, or `tolerance_m`.
    """
    if len(stretch) < 2 * _PARTS or stretch[-1, 0] - stretch[0, 0] < 0.9 * span:
        return None
    values = stretch[:, 1]
    edges = [len(values) * part // _PARTS for part in range(_PARTS + 1)]
    quarters = [values[start:end].sum() / (end - start) for start, end in itertools.pairwise(edges)]
    noise = noise_m(values)
    error_m = noise / math.sqrt(len(values) / _PARTS)
    if max(quarters) - min(quarters) > max(6.0 * error_m, tolerance_m):
        return None
    return StationaryLevel(float(values.mean()), noise, float(stretch[0, 0]))


def median(values: Floats) -> float:
    """Median of values (n,), n >= 1: numpy's own takes three times as long for so few."""
    middle = len(values) // 2
    if len(values) % 2:
        return float(np.partition(values, middle)[middle])
    low, high = np.partition(values, (middle - 1, middle))[middle - 1 : middle + 1]
    return float(low + high) / 2.0


def drift(stretch: Floats) -> tuple[float, float]:
    """Rate of a stretch (n, 2), in its values for one index, and its standard error from the noise.

    Least squares; of fewer than eight readings nothing is known, so the error is infinite.
    """
    if len(stretch) < 2 * _PARTS:
        return 0.0, math.inf
    index = stretch[:, 0] - stretch[:, 0].mean()
    spread = float(index @ index)
    return float(index @ stretch[:, 1]) / spread, noise_m(stretch[:, 1]) / math.sqrt(spread)


def fit_parabola_start(falling: Floats) -> float:
    """Index at which a rise from zero, growing with the square of time, began (least squares).

    Parameters
    ----------
    falling : (n, 2) float64
        Ascending indices, and the distance (m) from where it began. One alone is its own beginning.
    """
    index, distance_m = falling[:, 0], falling[:, 1]
    if len(index) == 1:
        return float(index[0])
    starts = np.linspace(index[0], index[-1], _START_GRID, endpoint=False)
    shape = np.maximum(index - starts[:, None], 0.0) ** 2
    growth = np.maximum(shape @ distance_m, 0.0) / (shape**2).sum(axis=1)
    misfit = ((distance_m - growth[:, None] * shape) ** 2).sum(axis=1)
    return float(starts[np.argmin(misfit)])


_KEPT_S = 10.0
_KNOWN_S = 0.15
"""The zero is known when the levels of so long a time agree; each is itself a mean over 0.3 s."""
_BEFORE_S = 1.3
"""The zero is taken so long before the pull is noticed: a smooth pull begins unnoticed."""


@dataclass(frozen=True, slots=True)
class ZeroLevel:
    """A moment of rest: sample at which it began, and what both gauges read (m)."""

    since: float
    table_m: float
    relative_m: float


class ZeroEstimator:
    """Moments of rest, of the last ten seconds at most."""

    def __init__(self, rate_hz: float, tick_s: float) -> None:
        self._rate_hz = rate_hz
        self._zeros: deque[ZeroLevel] = deque(maxlen=round(_KEPT_S / tick_s))

    def add(self, zero: ZeroLevel) -> None:
        """Take the latest moment of rest."""
        self._zeros.append(zero)

    def reset(self) -> None:
        """Begin anew: table or plate were moved."""
        self._zeros.clear()

    @property
    def has_levels(self) -> bool:
        """Tell whether there was any moment of rest."""
        return bool(self._zeros)

    @property
    def is_known(self) -> bool:
        """Tell whether there was rest enough for a zero."""
        return self.has_levels and self._zeros[-1].since - self._zeros[0].since >= _KNOWN_S * self._rate_hz

    @property
    def latest(self) -> ZeroLevel:
        """The last moment of rest. Raises IndexError before any."""
        return self._zeros[-1]

    def pulled_m(self, table_m: float) -> float:
        """How far (m) the table is from where it rested; 0 before any rest.

        From the oldest rest that is remembered, so that a slow pull is noticed as well.
        """
        return abs(table_m - self._zeros[0].table_m) if self._zeros else 0.0

    def level_before(self, index: float, noticed_m: float) -> ZeroLevel:
        """The rest before a pull that was noticed at `index`, at `noticed_m` from it. Raises IndexError."""
        latest = index - _BEFORE_S * self._rate_hz
        chosen = next((zero for zero in reversed(self._zeros) if zero.since <= latest), self._zeros[0])
        is_slow = math.fabs(chosen.table_m - self._zeros[0].table_m) > 0.5 * noticed_m
        return self._zeros[0] if is_slow else chosen
