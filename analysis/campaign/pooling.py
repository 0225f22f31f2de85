"""Pooling of repeats: weighted means, with errors that repeats share and the scatter between runs."""

import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from analysis.arrays import Floats
from analysis.campaign.scatter import RepeatedValues, SeriesScatter, estimate_scatter, find_outliers
from analysis.campaign.series import RunResult
from analysis.quantities import COVERAGE_FACTOR_95, BudgetLine, BudgetSource, Quantity, SharedBy, Source

_SMALLEST = 1e-9  # relative uncertainty below which rounding errors decide
_LARGEST = 1e100  # larger values have no square in double precision
_UNSTATED_GAINS = (BudgetSource.GAUGE_1_GAIN_NOT_STATED, BudgetSource.GAUGE_2_GAIN_NOT_STATED)


@dataclass(frozen=True, slots=True)
class SharedError:
    """An error that several values have in common."""

    source: Source
    shared_by: str

    def __str__(self) -> str:
        """Name in JSON: `gauge 1 gain of A`."""
        return f"{self.source} of {self.shared_by}"


@dataclass(frozen=True, eq=False, slots=True)
class RunValue:
    """A quantity of one run, with its uncertainty split by what repeats average."""

    run: str
    value: float
    repeatable: float  # standard uncertainty of this run alone; above 0
    common: dict[SharedError, float]  # standard uncertainties of errors shared with other runs
    half_widths: tuple[float, float]  # of the 95 % interval, below and above the value
    unit: str
    model: float = 0.0  # the part of `common` that the run's model leaves unexplained
    of_run: float = 0.0  # the part of `repeatable` that all quantities of the run share

    @property
    def of_quantity(self) -> float:
        """The part of `repeatable` that no other quantity of the run shares."""
        return math.sqrt(max(0.0, self.repeatable**2 - self.of_run**2))


def run_value(run: RunResult, name: str) -> RunValue | None:
    """Return one quantity of a run; None where the run has no finite value.

    The uncertainty of a quantity without a budget counts as shared between all runs.
    """
    quantity = run.results.get(name)
    if quantity is None or not abs(quantity.value) < _LARGEST:
        return None
    lines = [line for line in run.budget if line.contribution_to == name]
    stated = quantity.standard_uncertainty if quantity.standard_uncertainty < _LARGEST else 0.0
    if not lines and stated:
        lines = [BudgetLine(BudgetSource.UNDIVIDED, name, stated)]
    common, of_run, own = _split_budget(run, lines)
    low, high = quantity.interval_95
    reach = quantity.value - low, high - quantity.value
    own = max(own, _own_by_interval(sum(reach) / 2.0 / COVERAGE_FACTOR_95, stated, common))
    smallest = max(_SMALLEST * abs(quantity.value), 1.0 / _LARGEST)
    model = math.hypot(*(share for error, share in common.items() if error.source is BudgetSource.MODEL))
    own = max(own, smallest)
    return RunValue(run.name, quantity.value, own, common, reach, quantity.unit, model, of_run)


def run_ratio(run: RunResult, above: str, below: str) -> RunValue | None:
    """Return the quotient of two quantities of a run; equal relative errors that both share cancel."""
    top, bottom = run_value(run, above), run_value(run, below)
    if top is None or bottom is None or top.value == 0.0 or bottom.value == 0.0:
        return None
    value = top.value / bottom.value
    own = abs(value) * math.hypot(
        top.of_quantity / top.value,
        bottom.of_quantity / bottom.value,
        top.of_run / top.value - bottom.of_run / bottom.value,
    )
    if not max(abs(value), own) < _LARGEST:
        return None
    common = {
        key: abs(value)
        * abs(top.common.get(key, 0.0) / top.value - bottom.common.get(key, 0.0) / bottom.value)
        for key in top.common | bottom.common
    }
    reach = COVERAGE_FACTOR_95 * math.hypot(own, *common.values())
    return RunValue(run.name, value, own, common, (reach, reach), "1")


def has_stated_gains(run: RunResult, name: str) -> bool:
    """Tell whether every gain that a quantity depends on has a stated uncertainty."""
    return not any(line.contribution_to == name and line.source in _UNSTATED_GAINS for line in run.budget)


def _split_budget(run: RunResult, lines: list[BudgetLine]) -> tuple[dict[SharedError, float], float, float]:
    """Errors shared with other runs, those shared by the results of this run, and all of this run alone."""
    shared_by = {
        SharedBy.CALIBRATION: run.calibration_id,
        SharedBy.STAND: run.stand_id,
        SharedBy.SERIES: run.series.label,
    }
    common: dict[SharedError, float] = {}
    of_run, own = 0.0, 0.0
    for line in lines:
        if not line.standard_uncertainty < _LARGEST:
            continue
        if line.source.shared_by in shared_by:
            key = SharedError(line.source, shared_by[line.source.shared_by])
            common[key] = math.hypot(common.get(key, 0.0), line.standard_uncertainty)
            continue
        own = math.hypot(own, line.standard_uncertainty)
        if line.source.shared_by is SharedBy.RUN:
            of_run = math.hypot(of_run, line.standard_uncertainty)
    return common, of_run, own


def _own_by_interval(deviation: float, stated: float, common: dict[SharedError, float]) -> float:
    """Own uncertainty of a run whose interval is wider than a normal one; 0 otherwise."""
    if not deviation < _LARGEST or deviation <= stated * (1.0 + 1e-9):
        return 0.0
    return math.sqrt(max(0.0, deviation**2 - sum(share**2 for share in common.values())))


@dataclass(frozen=True, slots=True)
class PooledQuantity:
    """One quantity of one series, pooled over its runs."""

    quantity: Quantity  # weighted mean; its uncertainty includes errors that repeats share
    runs: int
    repeatable: float  # part of the standard uncertainty that repeats reduce
    common: dict[SharedError, float]  # other parts, by shared error
    between_runs: float | None  # standard deviation beyond the readings' noise; None without repeats
    scatter: float | None  # standard deviation of the runs' values; None without repeats
    birge_ratio: float | None
    """Root of chi-square over degrees of freedom of the runs about their mean, by the uncertainties that each
    run states for itself; None without repeats."""
    degrees_of_freedom: float  # of the scatter: own plus those lent by the contact; 0 without repeats
    outliers: tuple[str, ...] = ()  # runs too far from the others; they are not left out


def pool(
    series: Sequence[Sequence[RunValue]], *, proportional: bool, kinds: Sequence[str] | None = None
) -> list[PooledQuantity]:
    """Pool one quantity of several series, each with one reading at least.

    Weights are the inverse sum of each run's own variance, that of its model and that between runs. Few
    repeats determine the latter poorly: series of one kind (contact) determine it together, relative to the
    value if `proportional` (`estimate_scatter`). The interval has Student's coverage factor, and is never
    narrower than the runs' own uncertainties give. Shared errors, those of models among them, are added at
    full size (JCGM 100, 5.2.4).

    `kinds` is the kind of each series; by default all are of one kind. The result has the order of `series`.
    """
    of_kind: dict[str, list[int]] = {}
    for place, kind in enumerate(kinds or [""] * len(series)):
        of_kind.setdefault(kind, []).append(place)
    repeats = [_repeats([series[place] for place in places], proportional) for places in of_kind.values()]
    pooled: dict[int, PooledQuantity] = {}
    for places, values, scatters in zip(of_kind.values(), repeats, estimate_scatter(repeats), strict=True):
        far = find_outliers(values)
        for number, (place, scatter) in enumerate(zip(places, scatters, strict=True)):
            own = values.series == number
            pooled[place] = _pooled(series[place], values.select(own), scatter, far[own])
    return [pooled[place] for place in range(len(series))]


def _repeats(series: Sequence[Sequence[RunValue]], proportional: bool) -> RepeatedValues:
    readings = [one for each in series for one in each]
    sizes = [abs(float(np.mean([one.value for one in each]))) or 1.0 for each in series]
    counts = [len(each) for each in series]
    return RepeatedValues(
        np.array([one.value for one in readings]),
        np.array([one.repeatable for one in readings]) ** 2,
        np.repeat(sizes, counts) if proportional else np.ones(len(readings)),
        np.repeat(np.arange(len(series)), counts),
    )


def _pooled(
    readings: Sequence[RunValue], repeats: RepeatedValues, scatter: SeriesScatter, far: NDArray[np.bool_]
) -> PooledQuantity:
    model = np.array([one.model for one in readings])
    shares, seen = _shares(repeats.weights(scatter.between), model)
    _, stated = _shares(repeats.weights(0.0), model)
    value, seen = float(shares @ repeats.values), math.sqrt(scatter.factor) * seen
    common = defaultdict[SharedError, float](float)
    for one, share in zip(readings, shares.tolist(), strict=True):
        for key, deviation in one.common.items():
            common[key] += share * deviation
    own = max(stated, seen)
    shared = math.hypot(*common.values())
    below, above = _half_widths(readings, stated, seen, shared, scatter)
    degrees = len(readings) - 1
    return PooledQuantity(
        Quantity(value, math.hypot(own, shared), (value - below, value + above), readings[0].unit),
        len(readings),
        own,
        dict(common),
        _between_runs(repeats, scatter) if scatter.degrees_of_freedom else None,
        float(np.std(repeats.values, ddof=1)) if degrees else None,
        math.sqrt(float(repeats.chi_squares(0.0)[0]) / degrees) if degrees else None,
        scatter.degrees_of_freedom,
        tuple(one.run for one, is_far in zip(readings, far, strict=True) if is_far),
    )


def _shares(weights: Floats, model: Floats) -> tuple[Floats, float]:
    """Share (n,) of each run in the mean, and the mean's standard uncertainty without what runs share.

    A run that its model explains badly counts less, although all runs share what is left.
    """
    shares = 1.0 / (1.0 / weights + model**2)
    shares /= shares.sum()
    return shares, math.sqrt(float(np.sum(shares**2 / weights)))


def _between_runs(repeats: RepeatedValues, scatter: SeriesScatter) -> float:
    """Standard deviation between runs of this series beyond noise."""
    noise = 1.0 / float(np.mean(repeats.weights(0.0)))
    run = noise + (scatter.between * float(repeats.scales[0])) ** 2
    return math.sqrt(max(0.0, scatter.factor * run - noise))


def _half_widths(
    readings: Sequence[RunValue], stated: float, seen: float, shared: float, scatter: SeriesScatter
) -> tuple[float, float]:
    half = COVERAGE_FACTOR_95 * stated
    if scatter.degrees_of_freedom:
        half = max(half, float(stdtrit(scatter.degrees_of_freedom, 0.975)) * seen)
    if len(readings) == 1 and half == COVERAGE_FACTOR_95 * stated:
        return readings[0].half_widths
    both = math.hypot(half, COVERAGE_FACTOR_95 * shared)
    return both, both
