"""Dynamic friction from the plate alone: needs no model of the table, the springs or the release.

While the plate slides, only friction, gravity and tilt act on it: u2'' = -g (s f_d - alpha), with s the sign
of its velocity relative to the table.
"""

import math
from dataclasses import dataclass

import numpy as np

from analysis.arrays import Floats
from analysis.laws.parameters import TILT_MAX_RAD
from analysis.plate.slips import Sliding, Slip, find_slips, part_slips
from analysis.plate.spline import (
    GAIN,
    LAG,
    SHARED_COUNT,
    Covariate,
    NormalEquations,
    Readings,
    inverse,
    normal_equations,
)
from analysis.preparation.free_decay import FreeDecay, relative_to_table
from analysis.quantities import BudgetSource, Source
from analysis.record import Record

_EDGES_S = (0.005, 0.012, 0.03)
"""Left out at both ends of a slip, where friction changes sign: longer where filters round more than this."""
_EDGE_READINGS = 3
_FILTER_LAGS = 3.0  # edges behind a filter, over its lag: what is left of a step is less than 5 %
_MISFIT_SIGMAS = 5.0  # by which chi-square may be too large before edges grow
_STICKS_MAX = 1 / 3  # share of reversals with a stick: where more contradict, it is something else
_READINGS_MIN = 50
_SLIPS_MIN = 3  # scatter between fewer slips is not known
_FRICTION_UNCERTAINTY_MAX = 0.5  # of a slip, as a share of the median: others tell nothing
_LAG_STEPS = 4
_LAG_SIGMAS = 2.0
_SMALL_LAG_S = 4e-3
"""A lag this small that stands out, where none is stated, may be friction that varies instead."""
_LAG_TYPICAL_S = 1e-3  # of gauges that differ in lag ...
_NO_LAG_S = 3e-5  # ... and of those that do not
_VARIATION_TYPICAL = 0.2  # of friction over the range of a covariate, where it varies
_LAG_SETTLED_S = 3e-5  # what is left of second order moves u1 by nanometres
_SLOPE_SIGMAS = 3.0
_VARYING_MAX = 2  # covariates at once: slips are few
_EVIDENCE_MIN = 10.0
"""Fall of -2 ln L for which friction is taken to vary: BIC of 1,000 readings, and three looks."""
_SCATTERS = (0.0, 1e-3, 2e-3, 4e-3, 8e-3, 1.6e-2, 3.2e-2, 6.4e-2, 0.13, 0.26)  # shares of friction

COVARIATES = "sliding velocity", "position", "slid path"
_TIME = len(COVARIATES)
"""Place after those of the covariates: friction that changes from slip to slip, and not within."""


@dataclass(frozen=True, slots=True)
class Variation:
    """Slope of friction in a covariate, all else constant."""

    per_unit: float
    standard_uncertainty: float
    is_significant: bool


@dataclass(frozen=True, eq=False, slots=True)
class PlateFriction:
    """Friction from the plate's parabolas."""

    friction_dynamic: float  # mean over the path that the plate slid
    contributions: dict[Source, float]  # to its standard uncertainty
    tilt_rad: float  # in the frame of the decay
    tilt_standard_uncertainty_rad: float
    lag_s: float  # by which gauge 2 is later than gauge 1
    lag_standard_uncertainty_s: float
    relative_gain_error: float  # of gauge 2 against gauge 1
    time_s: Floats
    """(k,) float64: middle of each slip, in the base of `Record.time_s`."""
    friction: Floats
    """(k,) float64: friction of each slip, with `tilt_rad` taken off, and its standard uncertainty by noise,
    given lag, gain and tilt."""
    friction_standard_uncertainty: Floats
    position_m: Floats
    """(k,) float64: where on the table, and how fast, the friction of each slip is that of the trend: means
    with the weight that a parabola gives to friction, largest in the middle."""
    speed_m_per_s: Floats
    path_m: Floats  # (k,) float64: slid in each slip
    scatter: float  # standard deviation of friction between slips beyond noise
    variation: dict[str, Variation]
    """By covariate: per m/s of sliding velocity, per m of position, per m of slid path."""
    change_per_s: Variation  # from slip to slip
    misfit: float  # chi-square of the readings over its expectation

    @property
    def standard_uncertainty(self) -> float:
        return math.hypot(*self.contributions.values())


def estimate_plate_friction(record: Record, decay: FreeDecay) -> PlateFriction | None:
    """Estimate f_d from the curvature of u2 in each slip.

    Returns None without gauge 2, with fewer than three slips that are long enough, where all of them have
    one direction, and where the estimate is not above its uncertainty.
    """
    if decay.relative is None:
        return None
    relative = relative_to_table(decay.table, decay.relative, decay.gauge_2_absolute)
    relative = relative.between(decay.release.time_s, decay.dense_until_s)
    if len(relative) < _READINGS_MIN:
        return None
    sliding = Sliding.of(relative, decay)
    readings = Readings.of(record, decay, sliding)
    lags_s = [gauge.lateness_s for gauge in (record.table_gauge, record.relative_gauge) if gauge.filter]
    least_s = max(_EDGE_READINGS * decay.channels.interval_s, _FILTER_LAGS * max(lags_s, default=0.0))
    best = None
    for edge_s in _EDGES_S:
        fitted = _fit(sliding, readings, max(edge_s, least_s))
        if fitted is None:
            break
        best = fitted
        if best.misfit < 1.0 + _MISFIT_SIGMAS * np.sqrt(2.0 / best.freedom):
            break
    if best is not None and best.equations.sticks:
        parted = _fit(sliding, readings, best.edge_s, with_sticks=True)
        best = best if parted is None or parted.equations.sticks else parted
    found = (
        None
        if best is None
        else _summarise(best, record, decay, sliding, lag_is_stated=readings.lag_is_stated)
    )
    return found if found is not None and found.friction_dynamic > found.standard_uncertainty else None


@dataclass(frozen=True, eq=False, slots=True)
class _Fitted:
    slips: list[Slip]
    equations: NormalEquations
    equations_without_lag: NormalEquations
    lag_s: float
    extents: tuple[float, ...]  # ranges of the covariates
    edge_s: float

    @property
    def sign(self) -> Floats:
        return np.array([slip.sign for slip in self.slips], dtype=np.float64)

    @property
    def middle_s(self) -> Floats:
        """Middle of each slip, about their mean."""
        middle_s = np.array([0.5 * (slip.begin_s + slip.end_s) for slip in self.slips])
        return np.asarray(middle_s - middle_s.mean())

    @property
    def freedom(self) -> int:
        equations = self.equations
        return max(equations.reading_count - equations.eliminated - len(equations.right), 1)

    @property
    def misfit(self) -> float:
        """Chi-square over its expectation, with all friction free."""
        found = inverse(self.equations.matrix) @ self.equations.right
        return (self.equations.squares - float(found @ self.equations.right)) / self.freedom


def _slip_friction(equations: NormalEquations, shared: Floats) -> tuple[Floats, Floats]:
    """Friction of slips, times sign, less tilt, and its covariance, given the `shared` parameters."""
    k = len(equations.right) - SHARED_COUNT - len(COVARIATES)
    own, common = slice(0, k), slice(k, k + SHARED_COUNT)
    covariance = inverse(equations.matrix[own, own])
    return covariance @ (equations.right[own] - equations.matrix[own, common] @ shared), covariance


def _fit(sliding: Sliding, readings: Readings, edge_s: float, *, with_sticks: bool = False) -> _Fitted | None:
    slips = find_slips(sliding, edge_s)
    if len(slips) < _SLIPS_MIN or len({slip.sign for slip in slips}) < 2:
        return None
    time_s, speed = sliding.relative.time_s, np.abs(sliding.speed_m_per_s)
    weight = np.zeros(len(time_s))
    for slip in slips:
        within = slice(*np.searchsorted(time_s, (slip.begin_s, slip.end_s)))
        weight[within] = speed[within]
    path = np.concatenate(([0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(time_s))))
    made = [Covariate.of(time_s, value, weight) for value in (speed, sliding.relative.value_m, path)]
    covariates = [covariate for covariate, _ in made]
    lag_s = 0.0
    equations = normal_equations(readings, slips, covariates, lag_s, edge_s)
    allowed = max(1.0, _STICKS_MAX * sum(slip.joins for slip in slips)) if with_sticks else 0.0
    parted = 0
    while equations.sticks:
        parted += 1
        if parted > allowed:
            break
        slips = part_slips(slips, equations.sticks[0], sliding)
        equations = normal_equations(readings, slips, covariates, lag_s, edge_s)
    without_lag = equations
    for _ in range(_LAG_STEPS):
        fitted = _Fitted(slips, equations, without_lag, lag_s, tuple(extent for _, extent in made), edge_s)
        left_s = float(_pool(fitted, None, ()).shared[LAG])
        if abs(left_s) < _LAG_SETTLED_S:
            break
        lag_s += left_s
        equations = normal_equations(readings, slips, covariates, lag_s, edge_s)
    return fitted


@dataclass(frozen=True, eq=False, slots=True)
class _Pooled:
    """Means over all slips."""

    mean: float
    tilt: float
    covariance: Floats  # of mean and tilt
    shared: Floats
    shared_deviation: Floats
    slopes: Floats  # of the covariates that were let vary, with ...
    slopes_deviation: Floats
    deviations: Floats  # (k,) of slips from the mean
    scatter: float
    cost: float  # -2 ln L


def _pool(
    fitted: _Fitted, weights: Floats | None, varying: tuple[int, ...], *, without_lag: bool = False
) -> _Pooled:
    """Mean friction over `weights` and tilt, with friction that varies at random between slips.

    Friction of a slip is the mean, its own deviation, and a slope in each of the `varying` covariates, of
    which `_TIME` is one. The variance of the deviations is the likeliest.
    """
    equations = fitted.equations_without_lag if without_lag else fitted.equations
    k, sign, misfit = len(fitted.slips), fitted.sign, max(1.0, fitted.misfit)
    columns = np.zeros((len(equations.right), 2 + k + SHARED_COUNT + len(varying)))
    columns[:k, 0], columns[:k, 1], columns[range(k), range(2, 2 + k)] = sign, -1.0, sign
    columns[range(k, k + SHARED_COUNT), range(2 + k, 2 + k + SHARED_COUNT)] = 1.0
    for place, covariate in enumerate(varying, start=2 + k + SHARED_COUNT):
        if covariate == _TIME:
            columns[:k, place] = sign * fitted.middle_s
        else:
            columns[k + SHARED_COUNT + covariate, place] = 1.0
    normal, right = columns.T @ equations.matrix @ columns / misfit, columns.T @ equations.right / misfit
    typical = abs(float(inverse(normal[:1, :1])[0, 0] * right[0]))
    scatters = np.maximum(_SCATTERS, 1e-5) * typical
    priors = np.zeros((len(scatters), len(normal)))
    priors[:, 1], priors[:, 2 : 2 + k] = TILT_MAX_RAD**-2, scatters[:, None] ** -2
    priors[:, 2 + k + LAG] = _NO_LAG_S**-2 if without_lag else 0.0
    precisions = normal + priors[:, None] * np.eye(len(normal))
    covariances = inverse(precisions)
    found_by = covariances @ right
    costs = equations.squares / misfit - found_by @ right + np.linalg.slogdet(precisions)[1]
    costs += 2.0 * k * np.log(scatters)
    likeliest = int(np.argmin(costs))
    scatter, found, covariance = float(scatters[likeliest]), found_by[likeliest], covariances[likeliest]
    mean = np.zeros((2, len(found)))
    mean[0, 0] = mean[1, 1] = 1.0
    if weights is not None:
        mean[0, 2 : 2 + k] = weights / weights.sum()
    values, deviation = mean @ found, np.sqrt(np.diag(covariance))
    return _Pooled(
        float(values[0]),
        float(values[1]),
        mean @ covariance @ mean.T,
        found[2 + k : 2 + k + SHARED_COUNT],
        deviation[2 + k : 2 + k + SHARED_COUNT],
        found[2 + k + SHARED_COUNT :],
        deviation[2 + k + SHARED_COUNT :],
        found[2 : 2 + k],
        scatter if likeliest else 0.0,
        float(costs[likeliest]),
    )


def _summarise(
    best: _Fitted, record: Record, decay: FreeDecay, sliding: Sliding, *, lag_is_stated: bool
) -> PlateFriction:
    slips, relative = best.slips, sliding.relative
    ends = np.array([(slip.begin_s, slip.end_s) for slip in slips])
    at = np.interp(ends, relative.time_s, relative.value_m)
    path_m = np.abs(np.diff(at, axis=1)[:, 0])
    chosen = _pool(best, path_m, ())
    varying: tuple[int, ...] = ()
    variation = {}
    alone = {number: _pool(best, path_m, (number,)) for number in range(len(COVARIATES))}
    while len(varying) < _VARYING_MAX:
        others = [number for number in alone if number not in varying]
        tried = {number: _pool(best, path_m, (*varying, number)) for number in others} if varying else alone
        likeliest = min(others, key=lambda number: tried[number].cost)
        found = tried[likeliest]
        is_clear = abs(found.slopes[-1]) > _SLOPE_SIGMAS * found.slopes_deviation[-1]
        if not is_clear or chosen.cost - found.cost < _EVIDENCE_MIN:
            break
        varying, chosen = (*varying, likeliest), found
    instead = _varying_instead_of_lag(best, path_m, chosen) if not (varying or lag_is_stated) else {}
    mean, uncertainty, between = _average(chosen, instead)
    lag_s = best.lag_s
    for number, other in instead.items():
        if chosen.cost - other.cost > _EVIDENCE_MIN:
            varying, chosen, lag_s = (number,), other, 0.0
    for number, name in enumerate(COVARIATES):
        if number in varying:
            pooled, place = chosen, varying.index(number)
        else:  # beside those in use, which would show in it
            pooled, place = alone[number], -1
            if varying:
                pooled = _pool(best, path_m, (*varying, number), without_lag=lag_s != best.lag_s)
        extent = best.extents[number]
        variation[name] = Variation(
            float(pooled.slopes[place]) / extent,
            float(pooled.slopes_deviation[place]) / extent,
            number in varying,
        )
    rising = _pool(best, path_m, (*varying, _TIME), without_lag=lag_s != best.lag_s)
    equations = best.equations if lag_s == best.lag_s else best.equations_without_lag
    friction, covariance = _slip_friction(equations, chosen.shared)
    return PlateFriction(
        friction_dynamic=mean,
        contributions=_contributions(mean, uncertainty, between, record),
        tilt_rad=chosen.tilt,
        tilt_standard_uncertainty_rad=float(np.sqrt(chosen.covariance[1, 1])),
        lag_s=lag_s + float(chosen.shared[LAG]),
        lag_standard_uncertainty_s=float(chosen.shared_deviation[LAG]),
        relative_gain_error=float(chosen.shared[GAIN]),
        time_s=decay.channels.to_record_time(ends.mean(axis=1)),
        friction=best.sign * (friction + chosen.tilt),
        friction_standard_uncertainty=np.sqrt(np.diag(covariance)),
        position_m=_means(slips, relative.time_s, relative.value_m),
        speed_m_per_s=_means(slips, relative.time_s, np.abs(sliding.speed_m_per_s)),
        path_m=path_m,
        scatter=chosen.scatter,
        variation=variation,
        change_per_s=Variation(float(rising.slopes[-1]), float(rising.slopes_deviation[-1]), False),
        misfit=best.misfit,
    )


def _means(slips: list[Slip], time_s: Floats, value: Floats) -> Floats:
    """Mean of a covariate (n,) over each slip (k,), as its friction is the mean of friction in time.

    Least squares of a parabola take u2'' with the weight (1 - x^2)^2, x from -1 to 1 over the slip.
    """
    means = []
    for slip in slips:
        x = (2.0 * time_s[slip.readings] - slip.begin_s - slip.end_s) / (slip.end_s - slip.begin_s)
        means.append(float(np.average(value[slip.readings], weights=(1.0 - x * x) ** 2)))
    return np.array(means)


def _varying_instead_of_lag(fitted: _Fitted, path_m: Floats, chosen: _Pooled) -> dict[int, _Pooled]:
    """Explanations of a small lag by friction that varies, by covariate; none where no lag stands out."""
    lag_s = fitted.lag_s + float(chosen.shared[LAG])
    if not _LAG_SIGMAS * chosen.shared_deviation[LAG] < abs(lag_s) < _SMALL_LAG_S:
        return {}
    return {
        number: _pool(fitted, path_m, (number,), without_lag=True) for number in range(len(fitted.extents))
    }


def _average(chosen: _Pooled, others: dict[int, _Pooled]) -> tuple[float, float, float]:
    """Mean of explanations by their likelihood, its standard uncertainty, and that between explanations."""
    costs = [chosen.cost + 2.0 * np.log(_LAG_TYPICAL_S)]
    narrow = _NO_LAG_S * _VARIATION_TYPICAL
    costs += [other.cost + 2.0 * np.log(narrow * abs(other.mean)) for other in others.values()]
    explanations = [chosen, *others.values()]
    weights = np.exp(-0.5 * (np.array(costs) - min(costs)))
    weights /= weights.sum()
    means = np.array([explanation.mean for explanation in explanations])
    mean = float(weights @ means)
    variance = float(weights @ np.array([explanation.covariance[0, 0] for explanation in explanations]))
    return mean, float(np.sqrt(variance)), float(np.sqrt(weights @ (means - mean) ** 2))


def _contributions(mean: float, noise: float, by_lag: float, record: Record) -> dict[Source, float]:
    masses = record.masses
    return {
        BudgetSource.NOISE: noise,
        BudgetSource.GAUGE_2_LAG: by_lag,
        BudgetSource.GAUGE_1_GAIN: mean * (record.table_gauge.gain_relative or 0.0),
        BudgetSource.TIME_BASE: 2.0 * mean * record.clock_scale_uncertainty / record.clock_scale,
        BudgetSource.GRAVITY: mean * masses.gravity_uncertainty_m_per_s2 / masses.gravity_m_per_s2,
    }
