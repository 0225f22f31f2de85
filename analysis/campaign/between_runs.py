"""How much repeats differ beyond what their stated uncertainties explain."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from analysis.arrays import Floats

_PRECISION = 1e-9
"""Of the standard deviation between runs."""


@dataclass(frozen=True, eq=False, slots=True)
class RepeatedValues:
    """Values of one quantity from several series.

    Attributes
    ----------
    values, variances : (n,) float64
        And the square of the standard uncertainty that each has for itself.
    scales : (n,) float64
        What a deviation between runs of size 1 means for each value.
    series : (n,) int
        Number of the series that each belongs to, from 0 without gaps.
    """

    values: Floats
    variances: Floats
    scales: Floats
    series: NDArray[np.intp]

    @property
    def degrees_of_freedom(self) -> int:
        """Number of values beyond one a series."""
        return len(self.values) - len(np.unique(self.series))

    def select(self, chosen: NDArray[np.bool_]) -> Self:
        """Return those that are chosen."""
        _, series = np.unique(self.series[chosen], return_inverse=True)
        return type(self)(self.values[chosen], self.variances[chosen], self.scales[chosen], series)

    def weights(self, between: float) -> Floats:
        """Inverse variances (n,) where runs differ by a standard deviation of `between` scales."""
        return 1.0 / (self.variances + (between * self.scales) ** 2)

    def means(self, between: float) -> Floats:
        """Weighted mean of each series (m,)."""
        weights = self.weights(between)
        sums = np.bincount(self.series, weights * self.values)
        return np.asarray(sums / np.bincount(self.series, weights), dtype=np.float64)

    def chi_squares(self, between: float) -> Floats:
        """Chi-square of each series (m,) about its own mean."""
        deviations = self.values - self.means(between)[self.series]
        return np.asarray(np.bincount(self.series, self.weights(between) * deviations**2), dtype=np.float64)

    def between_run_deviation(self) -> float:
        """Standard deviation between runs, in scales, that makes chi-square what it should be; 0 or above.

        The estimator of Mandel and Paule (Analytical Chemistry 42 (1970) 1194, and 54 (1982) 2486), with
        the sums over all series: chi-square equals its degrees of freedom.
        """
        degrees = self.degrees_of_freedom
        if degrees == 0 or self._excess(0.0) <= 0.0:
            return 0.0
        far = float(np.max(np.abs(self.values - self.means(0.0)[self.series]) / self.scales))
        while self._excess(far) > 0.0:
            far *= 2.0
        return float(brentq(self._excess, 0.0, far, xtol=_PRECISION * far, rtol=_PRECISION))

    def _excess(self, between: float) -> float:
        return float(self.chi_squares(between).sum()) - self.degrees_of_freedom
