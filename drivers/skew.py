"""By how much later one gauge is read than the other, and how well that is known."""

import math
from collections import deque
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from drivers.clock import DELIVERY_UNCERTAINTY_S

_STRETCH_S = 0.25
"""Lags that change within it average out over a swing of the stand, slower ones do not."""
_STRETCHES = 4 * 3600 * 4


@dataclass(frozen=True, slots=True)
class Skew:
    """Of the rows of a run.

    Attributes
    ----------
    mean_s : float
        By how much later gauge 2 was read than gauge 1, on average.
    standard_uncertainty_s : float
        Of that as a property of each swing: how the lag drifts, how punctual both devices' bytes came, and
        what ports deliver late without anybody seeing it (1 ms each, evenly distributed).
    """

    mean_s: float
    standard_uncertainty_s: float

    @property
    def description(self) -> str:
        """In a sentence that is kept with the run."""
        later = "later" if self.mean_s >= 0 else "earlier"
        return (
            f"gauge 2 was read {1e3 * abs(self.mean_s):.2f} ms {later} than gauge 1,"
            f" \u00b1{1e3 * self.standard_uncertainty_s:.2f} ms; the analysis allows for it"
        )


@runtime_checkable
class HasSkew(Protocol):
    """A source whose gauges are read one after the other, and not by one converter at once."""

    def skew(self, first_index: int, end_index: int) -> Skew | None:
        """Skew of the samples first_index <= index < end_index; None where there is none to tell."""


class SkewStatistics:
    """Lags of rows, averaged over stretches of 0.25 s; the latest 4 hours are remembered.

    Parameters
    ----------
    rate_hz : float
        Rows a second.
    """

    def __init__(self, rate_hz: float) -> None:
        self._rows = max(1, round(_STRETCH_S * rate_hz))
        self._stretches: deque[_Window] = deque(maxlen=_STRETCHES)

    def add(self, first_index: int, lag_s: NDArray[np.float64], scatter_s: float) -> None:
        """Take the lags of consecutive rows (n,), NaN where a reading is missing.

        `scatter_s` is how punctual the bytes of both devices came (s).
        """
        numbers = (first_index + np.arange(len(lag_s))) // self._rows
        is_known = np.isfinite(lag_s)
        for number in np.unique(numbers[is_known]).tolist():
            inside = lag_s[is_known & (numbers == number)]
            self._window(number).add(float(inside.sum()), len(inside), scatter_s)

    def skew(self, first_index: int, end_index: int) -> Skew | None:
        """Skew of rows first_index <= row < end_index, to a stretch; None where none has both readings."""
        first, last = first_index // self._rows, (end_index - 1) // self._rows
        stretches = [stretch for stretch in self._stretches if first <= stretch.number <= last]
        if not stretches:
            return None
        weights = np.array([stretch.rows for stretch in stretches], dtype=np.float64)
        means_s = np.array([stretch.sum_s for stretch in stretches]) / weights
        mean_s = float(np.average(means_s, weights=weights))
        drift_s = math.sqrt(float(np.average((means_s - mean_s) ** 2, weights=weights)))
        scatter_s = float(np.average([stretch.scatter_s for stretch in stretches], weights=weights))
        return Skew(mean_s, math.hypot(drift_s, scatter_s, DELIVERY_UNCERTAINTY_S))

    def _window(self, number: int) -> "_Window":
        if not self._stretches or self._stretches[-1].number != number:
            self._stretches.append(_Window(number))
        return self._stretches[-1]


@dataclass(slots=True)
class _Window:
    number: int
    sum_s: float = 0.0
    rows: int = 0
    scatter_s: float = 0.0

    def add(self, sum_s: float, rows: int, scatter_s: float) -> None:
        self.sum_s += sum_s
        self.rows += rows
        self.scatter_s = max(self.scatter_s, scatter_s)
