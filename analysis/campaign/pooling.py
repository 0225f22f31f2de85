"""Repeats pooled: weighted means whose uncertainty knows what repeats share and how much they differ."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import f, t

from analysis.campaign.between_runs import Repeats
from analysis.campaign.outliers import outliers
from analysis.campaign.readings import Reading
from analysis.quantities import Quantity
from analysis.uncertainty import NORMAL_95

_ODD = 0.01
"""A series whose scatter would come by chance in fewer cases than these is judged by itself."""


@dataclass(frozen=True, slots=True)
class Pooled:
    """One quantity of one series, pooled over its runs.

    Attributes
    ----------
    quantity : Quantity
        Weighted mean with what it is worth, errors that repeats share included.
    runs : int
        How many runs determined it.
    repeatable : float
        Part of the standard uncertainty that repeats make smaller.
    common : dict of float
        The other parts, by source and what shares it.
    between_runs : float or None
        Standard deviation from run to run beyond what the readings' noise explains; None without repeats.
    scatter : float or None
        Standard deviation of the runs' values; None without repeats.
    birge_ratio : float or None
        Root of chi-square over degrees of freedom of the runs about their mean, by the uncertainties that
        each run states for itself; None without repeats.
    degrees_of_freedom : int
        Of the scatter that was taken for this series: its own, or that of all series of its contact.
    outliers : tuple of str
        Runs too far from the others; they count all the same.
    """

    quantity: Quantity
    runs: int
    repeatable: float
    common: dict[str, float]
    between_runs: float | None
    scatter: float | None
    birge_ratio: float | None
    degrees_of_freedom: int
    outliers: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class _Scatter:
    """What is known of the differences between the runs of a series.

    `factor` is by how much the stated uncertainties are too large, 1 at most.
    """

    between: float
    factor: float
    degrees_of_freedom: int


def pool(series: Sequence[Sequence[Reading]], *, proportional: bool) -> list[Pooled]:
    """Pool one quantity of the series of one contact, each with one reading at least.

    Weights are the inverse of each run's own variance and that between runs. With few repeats the latter
    is poorly known, so it is taken over all `series`, as a share of the value if `proportional`; a series
    whose scatter does not fit the others is judged by its own. The interval has the coverage factor of
    Student for the degrees of freedom of that scatter, and is never narrower than the runs' own
    uncertainties make it. What the runs share is added at its full size (JCGM 100, 5.2.4).
    """
    repeats = _repeats(series, proportional)
    scatters = _scatters(repeats)
    far = outliers(repeats)
    pooled, first = [], 0
    for readings, scatter in zip(series, scatters, strict=True):
        chosen = np.zeros(len(repeats.values), dtype=bool)
        chosen[first : first + len(readings)] = True
        named = tuple(one.run for one, is_far in zip(readings, far[chosen], strict=True) if is_far)
        pooled.append(_pooled(readings, repeats.only(chosen), scatter, named))
        first += len(readings)
    return pooled


def _repeats(series: Sequence[Sequence[Reading]], proportional: bool) -> Repeats:
    readings = [one for each in series for one in each]
    sizes = [abs(float(np.mean([one.value for one in each]))) or 1.0 for each in series]
    counts = [len(each) for each in series]
    return Repeats(
        np.array([one.value for one in readings]),
        np.array([one.repeatable for one in readings]) ** 2,
        np.repeat(sizes, counts) if proportional else np.ones(len(readings)),
        np.repeat(np.arange(len(series)), counts),
    )


def _scatters(repeats: Repeats) -> list[_Scatter]:
    """Scatter that counts for each series."""
    squares = repeats.chi_squares(repeats.between_runs())
    degrees = np.bincount(repeats.series) - 1
    odd = np.array(
        [
            square > count and _is_odd(repeats, number)
            for number, (square, count) in enumerate(zip(squares, degrees, strict=True))
        ]
    )
    alike = ~odd[repeats.series]
    shared = _scatter(repeats.only(alike)) if alike.any() else _Scatter(0.0, 1.0, 0)
    return [
        _scatter(repeats.only(repeats.series == number)) if is_odd else shared
        for number, is_odd in enumerate(odd)
    ]


def _scatter(repeats: Repeats) -> _Scatter:
    degrees, between = repeats.degrees_of_freedom, repeats.between_runs()
    if degrees == 0:
        return _Scatter(0.0, 1.0, 0)
    return _Scatter(between, min(1.0, float(repeats.chi_squares(between).sum()) / degrees), degrees)


def _is_odd(repeats: Repeats, number: int) -> bool:
    """Tell whether a series scatters more than the others do (F test)."""
    mine = repeats.series == number
    own, others = repeats.only(mine), repeats.only(~mine) if not mine.all() else None
    if others is None or own.degrees_of_freedom == 0 or others.degrees_of_freedom == 0:
        return False
    between = others.between_runs()
    squares = [float(part.chi_squares(between).sum()) / part.degrees_of_freedom for part in (own, others)]
    if squares[1] == 0.0:
        return squares[0] > 0.0
    share = float(f.sf(squares[0] / squares[1], own.degrees_of_freedom, others.degrees_of_freedom))
    return share < _ODD


def _pooled(
    readings: Sequence[Reading], repeats: Repeats, scatter: _Scatter, named: tuple[str, ...]
) -> Pooled:
    weights = repeats.weights(scatter.between)
    shares = weights / weights.sum()
    value, own = float(shares @ repeats.values), float(1.0 / math.sqrt(weights.sum()))
    common = _common(readings, shares.tolist())
    shared = math.hypot(*common.values())
    below, above = _reach(readings, own, shared, scatter)
    degrees = len(readings) - 1
    return Pooled(
        Quantity(value, math.hypot(own, shared), (value - below, value + above), readings[0].unit),
        len(readings),
        own,
        common,
        scatter.between * float(repeats.scales[0]) if scatter.degrees_of_freedom else None,
        float(np.std(repeats.values, ddof=1)) if degrees else None,
        math.sqrt(float(repeats.chi_squares(0.0)[0]) / degrees) if degrees else None,
        scatter.degrees_of_freedom,
        named,
    )


def _common(readings: Sequence[Reading], shares: Sequence[float]) -> dict[str, float]:
    """Error of the mean from each shared source: readings with the same key err alike."""
    common: dict[str, float] = {}
    for one, share in zip(readings, shares, strict=True):
        for key, deviation in one.common.items():
            common[key] = common.get(key, 0.0) + share * deviation
    return common


def _reach(readings: Sequence[Reading], own: float, shared: float, scatter: _Scatter) -> tuple[float, float]:
    """Distance of both ends of the 95 % interval from the mean."""
    if len(readings) == 1 and scatter.between == 0.0:
        return readings[0].reach
    half = NORMAL_95 * own
    if scatter.degrees_of_freedom:
        student = float(t.ppf(0.975, scatter.degrees_of_freedom))
        half = max(half, student * math.sqrt(scatter.factor) * own)
    both = math.hypot(half, NORMAL_95 * shared)
    return both, both
