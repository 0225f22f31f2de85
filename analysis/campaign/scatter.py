"""How far runs differ, where each series alone has too few of them to tell."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq
from scipy.special import digamma, polygamma

from analysis.arrays import Floats
from analysis.campaign.between_runs import RepeatedValues

_ALIKE = 1e-6
"""Excess of the variance of the logarithms under which all series scatter alike."""
_LEAST = 1e-5
"""Of the median: smaller scatters are chance, and would rule the logarithms."""
_TRUST = 1.0
"""Degrees of freedom that a kind may lend a series for each that tells whether series are alike."""
_LOG_HALVES = (-15.0, 20.0)
"""Between which the logarithm of half the degrees of freedom lies."""


@dataclass(frozen=True, slots=True)
class SeriesScatter:
    """What is known of the differences between the runs of one series.

    Attributes
    ----------
    between : float
        Standard deviation from run to run, in scales, by all series of the kind.
    factor : float
        What the variances with `between` are to be multiplied by for this series.
    degrees_of_freedom : float
        0 where nothing tells.
    """

    between: float
    factor: float
    degrees_of_freedom: float


def estimate_scatter(kinds: Sequence[RepeatedValues]) -> list[list[SeriesScatter]]:
    """Scatter of every series of each kind (contact).

    Three repeats tell little of the scatter of their series, and series scatter differently: the variance of
    each is drawn towards that of its kind, as far as the series of all kinds are alike (moderated
    variances: Smyth, Statistical Applications in Genetics and Molecular Biology 3 (2004) 3, section 6). The
    degrees of freedom are those of the series, and the ones that its kind lends it.
    """
    betweens = [repeats.between_run_deviation() for repeats in kinds]
    degrees = [np.bincount(repeats.series).astype(np.float64) - 1.0 for repeats in kinds]
    squares = [
        np.asarray(repeats.chi_squares(between) / np.maximum(counts, 1.0), dtype=np.float64)
        for repeats, between, counts in zip(kinds, betweens, degrees, strict=True)
    ]
    logs = [_logs(some, counts) for some, counts in zip(squares, degrees, strict=True)]
    lent = _lent(logs, [counts[counts > 0.0] for counts in degrees])
    known = sum(max(0, len(some) - 1) for some in logs)
    return [
        _moderated(between, some, counts, mean, lent, known)
        for between, some, counts, mean in zip(betweens, squares, degrees, map(_mean, logs), strict=True)
    ]


def _logs(squares: Floats, degrees: Floats) -> Floats:
    """Logarithms of the mean squares of series with repeats, without what their degrees of freedom do."""
    some, halves = squares[degrees > 0.0], degrees[degrees > 0.0] / 2.0
    if not some.any():
        return np.zeros(0)
    least = max(_LEAST * float(np.median(some)), 1e-300)
    return np.asarray(np.log(np.maximum(some, least)) - digamma(halves) + np.log(halves), dtype=np.float64)


def _mean(logs: Floats) -> float:
    return float(logs.mean()) if len(logs) else 0.0


def _lent(logs: Sequence[Floats], degrees: Sequence[Floats]) -> float:
    """Degrees of freedom of what a kind tells of each of its series; infinite where all are alike."""
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
    """Mean squares drawn towards that of the kind, by no more than it is `known` how alike series are."""
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
