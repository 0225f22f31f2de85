"""Scatter between repeats beyond their stated uncertainties, and outliers."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.special import digamma, polygamma, stdtr

from analysis.arrays import Floats

_PRECISION = 1e-9  # of the standard deviation between runs


@dataclass(frozen=True, eq=False, slots=True)
class RepeatedValues:
    """Values of one quantity from several series."""

    values: Floats  # (n,) float64
    variances: Floats  # (n,) float64: of each run by itself
    scales: Floats  # (n,) float64: size of a unit deviation between runs, for each value
    series: NDArray[np.intp]  # (n,) int: index of the series of each value, from 0 without gaps

    @property
    def degrees_of_freedom(self) -> int:
        return len(self.values) - len(np.unique(self.series))

    def select(self, chosen: NDArray[np.bool_]) -> Self:
        _, series = np.unique(self.series[chosen], return_inverse=True)
        return type(self)(self.values[chosen], self.variances[chosen], self.scales[chosen], series)

    def weights(self, between: float) -> Floats:
        """Inverse variances (n,) with a standard deviation between runs of `between` scales."""
        return 1.0 / (self.variances + (between * self.scales) ** 2)

    def means(self, between: float) -> Floats:
        weights = self.weights(between)
        sums = np.bincount(self.series, weights * self.values)
        return np.asarray(sums / np.bincount(self.series, weights), dtype=np.float64)

    def chi_squares(self, between: float) -> Floats:
        """Chi-square of each series (m,) about its own mean."""
        deviations = self.values - self.means(between)[self.series]
        return np.asarray(np.bincount(self.series, self.weights(between) * deviations**2), dtype=np.float64)

    def between_run_deviation(self) -> float:
        """Standard deviation between runs, in scales, at which chi-square equals its degrees of freedom.

        0 where the runs agree. Estimator of Mandel and Paule (Analytical Chemistry 42 (1970) 1194, and 54
        (1982) 2486), with the sums over all series.
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


_ALIKE = 1e-6  # excess variance of the logarithms below which all series count as alike
_LEAST = 1e-5  # over the median: smaller scatters are chance, and would dominate the logarithms
_TRUST = 1.0  # degrees of freedom lent by a kind, over those that estimate how alike its series are
_LOG_HALVES = (-15.0, 20.0)  # search range of the logarithm of half the degrees of freedom


@dataclass(frozen=True, slots=True)
class SeriesScatter:
    """Scatter of the runs of one series."""

    between: float  # standard deviation between runs, in scales, from all series of the kind
    factor: float  # multiplies the variances with `between` for this series
    degrees_of_freedom: float  # 0 where there are no repeats


def estimate_scatter(kinds: Sequence[RepeatedValues]) -> list[list[SeriesScatter]]:
    """Scatter of every series of each kind (contact).

    Three repeats determine the scatter of their series poorly, and series scatter differently. The variance
    of each is drawn towards that of its kind, as far as the series of all kinds are alike (moderated
    variances: Smyth, Statistical Applications in Genetics and Molecular Biology 3 (2004) 3, section 6). The
    degrees of freedom are those of the series plus those lent by its kind.
    """
    betweens, degrees, squares, logs = [], [], [], []
    for repeats in kinds:
        betweens.append(repeats.between_run_deviation())
        degrees.append(np.bincount(repeats.series).astype(np.float64) - 1.0)
        squares.append(np.asarray(repeats.chi_squares(betweens[-1]) / np.maximum(degrees[-1], 1.0)))
        logs.append(_logs(squares[-1], degrees[-1]))
    lent = _lent(logs, [counts[counts > 0.0] for counts in degrees])
    known = sum(max(0, len(some) - 1) for some in logs)
    return [
        _moderated(between, some, counts, float(log.mean()) if len(log) else 0.0, lent, known)
        for between, some, counts, log in zip(betweens, squares, degrees, logs, strict=True)
    ]


def _logs(squares: Floats, degrees: Floats) -> Floats:
    """Logarithms of the mean squares of series with repeats, free of the bias by degrees of freedom."""
    some, halves = squares[degrees > 0.0], degrees[degrees > 0.0] / 2.0
    if not some.any():
        return np.zeros(0)
    least = max(_LEAST * float(np.median(some)), 1e-300)
    return np.asarray(np.log(np.maximum(some, least)) - digamma(halves) + np.log(halves), dtype=np.float64)


def _lent(logs: Sequence[Floats], degrees: Sequence[Floats]) -> float:
    """Degrees of freedom lent by a kind to each series; infinite where all series are alike."""
    taken = [(some, counts) for some, counts in zip(logs, degrees, strict=True) if len(some) > 1]
    if not taken:
        return 0.0
    left = sum(len(some) - 1 for some, _ in taken)
    seen = sum(float(np.sum((some - some.mean()) ** 2)) for some, _ in taken) / left
    chance = float(np.mean(np.concatenate([polygamma(1, counts / 2.0) for _, counts in taken])))
    if seen - chance <= _ALIKE:
        return math.inf
    low, high = _LOG_HALVES
    excess = min(seen - chance, 0.99 * float(polygamma(1, math.exp(low))))
    return 2.0 * math.exp(brentq(lambda log: float(polygamma(1, math.exp(log))) - excess, low, high))


def _moderated(
    between: float, squares: Floats, degrees: Floats, mean_log: float, lent: float, known: int
) -> list[SeriesScatter]:
    """Mean squares drawn towards that of the kind; `known` limits the weight of the kind."""
    total = float(degrees.sum())
    if total == 0.0:
        return [SeriesScatter(0.0, 1.0, 0.0)] * len(squares)
    of_kind = float(squares @ degrees) / total
    if 0.0 < lent < math.inf:
        of_kind = math.exp(mean_log + float(digamma(lent / 2.0)) - math.log(lent / 2.0))
    weight = min(lent, _TRUST * known)
    found = []
    for square, count in zip(squares.tolist(), degrees.tolist(), strict=True):
        of_others = weight if count else weight or total  # a single run has nothing else to go by
        both = of_others + count
        found.append(SeriesScatter(between, (of_others * of_kind + count * square) / both, min(both, total)))
    return found


_CHANCE = 0.01  # chance that a quantity without outliers has one named
_DOUBT = 0.003
"""Chance up to which a suspect is an outlier of its own series too. Where series scatter by factors of 3, one
is named wrongly in one of six sets of 12 x 3; a run 20 standard deviations off is found in 96 %."""
_TIE = 1e-6  # relative difference of distances that rounding makes


def find_outliers(repeats: RepeatedValues) -> NDArray[np.bool_]:
    """Tell which values (n,) lie too far from the mean of the others of their series.

    The farthest value is tested by its externally studentised residual, with Bonferroni's correction over
    all runs. If it is an outlier, the search continues without it. Each suspect is then tested against the
    scatter of its own series (`estimate_scatter`). Of two runs that differ, both are named.
    """
    suspects = _suspects(repeats)
    far = np.zeros(len(suspects), dtype=bool)
    for place in np.flatnonzero(suspects).tolist():
        far[place] = _own_series_chance(repeats, suspects, place) < _DOUBT
    return far


def _suspects(repeats: RepeatedValues) -> NDArray[np.bool_]:
    far = np.zeros(len(repeats.values), dtype=bool)
    while True:
        places = np.flatnonzero(~far)
        some = repeats.select(~far)
        distances = _distances(some)
        farthest = int(np.argmax(distances))
        mine = some.series == some.series[farthest]
        ties = np.flatnonzero((distances >= (1.0 - _TIE) * distances[farthest]) & mine)
        if distances[farthest] == 0.0 or not _is_outlier(some, farthest, len(repeats.values)):
            return far
        far[places[ties if len(ties) == int(mine.sum()) else farthest]] = True


def _own_series_chance(repeats: RepeatedValues, suspects: NDArray[np.bool_], place: int) -> float:
    """Chance of a value so far from the others of its series, by the scatter of all series."""
    mates = (repeats.series == repeats.series[place]) & ~suspects
    if not mates.any():  # two runs that differ: each is compared with the other
        mates = (repeats.series == repeats.series[place]) & (np.arange(len(suspects)) != place)
    kept = ~suspects | mates
    rest = repeats.select(kept)
    number = int(rest.series[np.flatnonzero(mates[kept])[0]])
    scatter = estimate_scatter([rest])[0][number]
    if scatter.degrees_of_freedom == 0.0:
        return 1.0
    # The runs scatter by their own variances at least.
    stated = float(repeats.variances[place] * repeats.weights(scatter.between)[place])
    distance = _distance(repeats, place, mates, scatter.between) / math.sqrt(max(scatter.factor, stated))
    return 2.0 * float(stdtr(scatter.degrees_of_freedom, -distance))


def _distance(repeats: RepeatedValues, place: int, mates: NDArray[np.bool_], between: float) -> float:
    """Distance of a value from the mean of its `mates` (n,) in standard deviations."""
    weights = repeats.weights(between)
    mean = float(np.average(repeats.values[mates], weights=weights[mates]))
    deviation = math.sqrt(1.0 / weights[place] + 1.0 / float(weights[mates].sum()))
    return abs(float(repeats.values[place]) - mean) / deviation


def _distances(repeats: RepeatedValues) -> Floats:
    """Distance of each value from the mean of its series in standard deviations; 0 for a single run."""
    between = repeats.between_run_deviation()
    weights = repeats.weights(between)
    left = 1.0 / weights - 1.0 / np.bincount(repeats.series, weights)[repeats.series]
    alone = np.bincount(repeats.series)[repeats.series] == 1
    deviations = np.abs(repeats.values - repeats.means(between)[repeats.series])
    return np.where(alone, 0.0, deviations / np.sqrt(np.where(alone, 1.0, left)))


def _is_outlier(repeats: RepeatedValues, place: int, count: int) -> bool:
    """Test one value against the mean of the others of its series, and the scatter of all others."""
    others = np.arange(len(repeats.values)) != place
    rest = repeats.select(others)
    degrees = rest.degrees_of_freedom
    if degrees == 0:
        return False
    mates = others & (repeats.series == repeats.series[place])
    distance = _distance(repeats, place, mates, rest.between_run_deviation())
    return 2.0 * float(stdtr(degrees, -distance)) < _CHANCE / count
