"""The least-squares problem of a record, and Levenberg-Marquardt on its normal equations."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Self

import numpy as np
from numpy.typing import NDArray

from analysis.arrays import Floats, Indices
from analysis.compiled import compiled, compiled_part
from analysis.laws.closed_form import (
    GAUGE_1,
    GAUGE_2,
    GAUGE_2_BASE,
    GaugeReadings,
    chi_squares,
    chi_squares_with_fitted_zero,
)
from analysis.laws.law import IDEAL_STAND, FrictionLaw, Gauge, StandPart
from analysis.laws.parameters import MOTION_PARAMETER_COUNT, SHARED_PARAMETER_COUNT, Parameter
from analysis.motion.events import DURATION_MIN_S
from analysis.preparation.channels import Channel
from analysis.record import RecordError

_FIRST_DAMPING = 1e-4
"""Over the diagonal of the normal matrix, scaled to ones: a step of Gauss and Newton at first."""
_DAMPING_MAX = 1e8  # with more, steps are lost in rounding
_UNDETERMINED = 1e-11  # eigenvalue of the scaled normal matrix below which rounding decides
_PIVOT_MIN = 1e-14
_TINY = 1e-300
_ACCURACY = 1e-4
"""A step that promises a smaller fall of chi-square is not taken: a hundredth of a standard deviation."""


@dataclass(frozen=True, eq=False, slots=True)
class QuadraticModel:
    """Chi-square at a point, its descent direction and curvature: cost - 2 b.d + d.A.d nearby."""

    cost: float
    descent: Floats
    normal: Floats


@dataclass(frozen=True, eq=False, slots=True)
class Minimum:
    """Where the search ended."""

    parameters: Floats
    quadratic: QuadraticModel
    steps: int
    """Evaluations."""
    converged: bool
    """No step promised a lower chi-square. Otherwise it was low enough, the steps ran out, or all rose: at a
    jump."""

    @property
    def cost(self) -> float:
        """Chi-square, priors included."""
        return self.quadratic.cost


def minimise(
    evaluate: Callable[[Floats], QuadraticModel],
    project: Callable[[Floats], Floats],
    start: Floats,
    free: NDArray[np.int64],
    steps_max: int = 30,
    cost: Callable[[Floats], float] | None = None,
    enough: float = -math.inf,
) -> Minimum:
    """Minimise chi-square from `start` (p,) over the parameters at the places `free` (k,).

    `evaluate` gives chi-square with its quadratic form over them; `project` moves a point into the allowed
    region. Where chi-square alone is far cheaper, `cost` gives it. The search ends below `enough`.
    """
    point = project(start)
    here = evaluate(point)
    damping, steps, settled = _FIRST_DAMPING, 1, False
    while steps < steps_max and damping < _DAMPING_MAX and here.cost >= enough:
        move, promise = levenberg_marquardt_step(here.normal, here.descent, damping)
        if not promise >= _ACCURACY:  # nor when it is not a number
            settled = True
            break
        trial = point.copy()
        trial[free] += move
        trial = project(trial)
        steps += 1
        there = evaluate(trial) if cost is None or cost(trial) < here.cost else here
        if there.cost < here.cost:
            point, here, damping = trial, there, max(1e-9, 0.1 * damping)
        else:
            damping *= 10.0 if damping > 1e-3 else 100.0
    return Minimum(point, here, steps, settled)


def covariance(normal: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    """Invert a normal matrix, leaving out combinations of parameters that it does not determine.

    Returns the covariance (k, k) within the determined ones, and which parameters (k,) take part in others.
    """
    curvature = np.diag(normal)
    scale = np.sqrt(np.where(curvature > 0.0, curvature, 1.0))  # a parameter without any is loose
    values, vectors = np.linalg.eigh(normal / np.outer(scale, scale))
    loose = values < _UNDETERMINED
    kept = vectors[:, ~loose]
    result = (kept / values[~loose]) @ kept.T / np.outer(scale, scale)
    return np.asarray(result), (np.abs(vectors[:, loose]) > 0.01).any(axis=1)


@compiled
def levenberg_marquardt_step(normal: Floats, descent: Floats, damping: float) -> tuple[Floats, float]:
    """Step (k,) of Levenberg and Marquardt, and the fall of chi-square that it promises.

    `damping` is added to the diagonal of the normal matrix, scaled to ones.
    """
    scale, scaled, move = np.empty(len(descent)), np.empty(normal.shape), np.empty(len(descent))
    for k in range(len(descent)):
        scale[k] = math.sqrt(max(normal[k, k], _TINY))
    for k in range(len(descent)):
        move[k] = descent[k] / scale[k]
        for j in range(len(descent)):
            scaled[k, j] = normal[k, j] / (scale[k] * scale[j])
        scaled[k, k] += damping + _PIVOT_MIN
    _solve_cholesky(scaled, move)
    promise = 0.0
    for k in range(len(descent)):
        move[k] /= scale[k]
    for k in range(len(descent)):
        promise += 2.0 * descent[k] * move[k]
        for j in range(len(descent)):
            promise -= move[k] * normal[k, j] * move[j]
    return move, promise


@compiled_part
def _solve_cholesky(matrix: Floats, right: Floats) -> None:
    """Solve a symmetric, positive system in place (Cholesky); no pivot is taken for less than rounding."""
    for i in range(len(matrix)):
        for j in range(i + 1):
            total = matrix[i, j]
            for k in range(j):
                total -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = math.sqrt(max(total, _PIVOT_MIN)) if i == j else total / matrix[j, j]
    for i in range(len(matrix)):
        for k in range(i):
            right[i] -= matrix[i, k] * right[k]
        right[i] /= matrix[i, i]
    for i in range(len(matrix) - 1, -1, -1):
        for k in range(i + 1, len(matrix)):
            right[i] -= matrix[k, i] * right[k]
        right[i] /= matrix[i, i]


_REACH_DEVIATIONS = 10.0  # known parameters are not fitted farther from what is known of them
_GAUGE_2_PARAMETERS = frozenset((Parameter.RELATIVE_OFFSET, Parameter.RELATIVE_GAIN, Parameter.LAG))
_RELEASE = int(Parameter.RELEASE)


@dataclass(frozen=True, eq=False, slots=True)
class FitProblem:
    """Readings, noise and prior knowledge; a friction law is given with each call."""

    table: Channel
    relative: Channel | None
    noise_m: tuple[float, float]
    """Standard deviation of each channel's white noise."""
    prior_mean: Floats
    """(p,) float64: what is known of each parameter beforehand; a deviation of 0 fixes it, inf leaves it
    open."""
    prior_deviation: Floats
    gauge_2_absolute: bool = False
    """Gauge 2 measures the plate against the base."""
    earliest_release_s: float = -math.inf  # the release is not looked for before, nor after the last reading
    stand: tuple[StandPart, ...] = IDEAL_STAND
    """Suspension, release and gauges, which every law is composed with."""
    readings: GaugeReadings = field(init=False, repr=False)
    """Arrays for the compiled evaluations, see `analysis.laws.closed_form`."""

    def __post_init__(self) -> None:
        table, relative = self.table, self.relative or Channel(np.empty(0), np.empty(0))
        channels = table.time_s, table.value_m, relative.time_s, relative.value_m
        object.__setattr__(self, "readings", (*channels, np.array(self.noise_m), self._second_gauge))

    @property
    def _second_gauge(self) -> int:
        return GAUGE_2_BASE if self.gauge_2_absolute else GAUGE_2

    @property
    def sample_count(self) -> int:
        return len(self.table) + (0 if self.relative is None else len(self.relative))

    def with_prior(self, parameter: Parameter, mean: float, deviation: float) -> Self:
        means, deviations = self.prior_mean.copy(), self.prior_deviation.copy()
        means[parameter], deviations[parameter] = mean, deviation
        return replace(self, prior_mean=means, prior_deviation=deviations)

    def decimated(self, samples: int, dense_until_s: float) -> Self:
        """About `samples` readings a channel, nine in ten of them before `dense_until_s`: slips are short."""
        return replace(
            self,
            table=_decimate(self.table, samples, dense_until_s),
            relative=None if self.relative is None else _decimate(self.relative, samples, dense_until_s),
        )

    def before(self, end_s: float) -> Self:
        return replace(
            self,
            table=self.table.between(-np.inf, end_s),
            relative=None if self.relative is None else self.relative.between(-np.inf, end_s),
        )

    def model_parameters(self, law: FrictionLaw) -> set[int]:
        """Places that law and stand leave free, without those fitted only because they are uncertain."""
        return {*law.free_parameters, *(int(place) for part in self.stand for place in part.free)}

    def free_parameters(self, law: FrictionLaw) -> Indices:
        """Free places, masses and gauges with a known uncertainty included; those of the motion first."""
        known = self.prior_deviation
        informed = np.flatnonzero((known > 0.0) & np.isfinite(known))
        free = self.model_parameters(law) | set(informed.tolist())
        if self.relative is None:
            free -= _GAUGE_2_PARAMETERS
        return np.array(sorted(free, key=lambda place: (not _moves(place), place)), dtype=np.int64)

    def prior_weights(self, places: Indices) -> Floats:
        """Inverse variances (k,) of what is known beforehand of parameters; 0 for those without a prior."""
        deviation = self.prior_deviation[places]
        informed = (deviation > 0.0) & np.isfinite(deviation)
        return np.where(informed, 1.0 / np.where(informed, deviation, 1.0) ** 2, 0.0)

    def residuals(self, parameters: Floats, law: FrictionLaw) -> tuple[Floats, Floats]:
        """Reading minus curve of each channel (m); the second is empty without gauge 2."""
        table = self.table.value_m - predict_gauge_1(parameters, self.table.time_s, law)
        if self.relative is None:
            return table, np.empty(0)
        expected = predict_gauge_2(parameters, self.relative.time_s, law, self.gauge_2_absolute)
        return table, self.relative.value_m - expected

    def chi_square(self, parameters: Floats, law: FrictionLaw) -> float:
        """Chi-square of the readings alone, without priors."""
        table, relative = self.residuals(parameters, law)
        return float(table @ table / self.noise_m[0] ** 2 + relative @ relative / self.noise_m[1] ** 2)

    def cost(self, parameters: Floats, law: FrictionLaw) -> float:
        """Chi-square of the readings and of what is known beforehand."""
        return self.chi_square(parameters, law) + self.departure(parameters)

    def departure(self, parameters: Floats) -> float:
        """Chi-square of parameters (p,) about what is known of them beforehand."""
        informed = (self.prior_deviation > 0.0) & np.isfinite(self.prior_deviation)
        away = (parameters - self.prior_mean)[informed] / self.prior_deviation[informed]
        return float(away @ away)

    def chi_squares(self, points: Floats, *, fit_zero: bool = False) -> Floats:
        """Chi-square of points (m, p) of laws in closed form; gauge 2's zero at its best if `fit_zero`."""
        return (chi_squares_with_fitted_zero if fit_zero else chi_squares)(points, self.readings)

    def quadratic_model(self, parameters: Floats, law: FrictionLaw, free: Indices) -> QuadraticModel:
        """Chi-square with priors, its descent and its Gauss-Newton curvature over the `free` parameters."""
        return GaussNewton(self, law, free).evaluate(parameters)

    def normal_equations(self, parameters: Floats, law: FrictionLaw, free: Indices) -> list[Floats]:
        """Normal matrix, descent (last column) and chi-square (corner) of each gauge over `free`."""
        return GaussNewton(self, law, free).normal_equations(parameters)

    def minimise(
        self,
        start: Floats,
        law: FrictionLaw,
        steps_max: int = 30,
        *,
        fixed: int | None = None,
        enough: float = -math.inf,
    ) -> Minimum:
        """Minimise chi-square over what `law` leaves free but for `fixed`, or until it is below `enough`."""
        free = self.free_parameters(law)
        free = free if fixed is None else free[free != fixed]
        if not len(self.table) or (self.relative is not None and not len(self.relative)):
            raise RecordError("no reading is left to fit near the release that was found. Check the gauges.")

        def project(parameters: Floats) -> Floats:
            return self.project(parameters, law, free)

        cost = None if law.solver.is_closed_form else partial(self.cost, law=law)
        return minimise(GaussNewton(self, law, free).evaluate, project, start, free, steps_max, cost, enough)

    def project(self, parameters: Floats, law: FrictionLaw, free: Indices) -> Floats:
        """The nearest point that law and stand allow, not far from what is known of the `free` parameters."""
        point, latest_s = parameters.copy(), float(self.table.time_s[-1])
        point[_RELEASE] = min(max(point[_RELEASE], self.earliest_release_s), latest_s)
        _apply_prior_bounds(point, free, self.prior_mean, self.prior_deviation)
        _apply_bounds(point, law, self.stand)
        return point

    def gauges(self) -> list[Gauge]:
        gauges = [(self.table.time_s, self.table.value_m, GAUGE_1, self.noise_m[0])]
        if self.relative is not None:
            second = self.relative
            gauges.append((second.time_s, second.value_m, self._second_gauge, self.noise_m[1]))
        return gauges


class GaussNewton:
    """Chi-square of a law over its free parameters, with its derivatives, at as many points as wanted."""

    def __init__(self, problem: FitProblem, law: FrictionLaw, free: Indices) -> None:
        self.law, self._gauges, self._free = law, problem.gauges(), free
        self._directions = law.directions(
            np.array([place for place in free if _moves(place)], dtype=np.int64)
        )
        self._readings = problem.readings
        self._known = problem.prior_mean[free], problem.prior_weights(free)

    def evaluate(self, point: Floats) -> QuadraticModel:
        """Chi-square at `point` (p,), priors included, its descent and its curvature."""
        solver, vector, gauges = self.law.solver, self.law.vector(point), (self._gauges, self._readings)
        form = solver.quadratic_form(point, vector, self._free, self._directions, *gauges, self._known)
        return QuadraticModel(*form)

    def normal_equations(self, point: Floats) -> list[Floats]:
        """Normal equations of each gauge, priors aside."""
        solver, vector = self.law.solver, self.law.vector(point)
        return solver.normal_equations(point, vector, self._free, self._directions, self._gauges)


def project_to_bounds(parameters: Floats, law: FrictionLaw) -> Floats:
    """Return the nearest vector that law and stand allow: f_d > 0, f_s >= f_d, no tilt where it has none."""
    point = parameters.copy()
    _apply_bounds(point, law, IDEAL_STAND)
    return point


def _apply_bounds(point: Floats, law: FrictionLaw, stand: tuple[StandPart, ...]) -> None:
    law.apply_bounds(point)
    for part in stand:
        part.apply_bounds(point)


def _moves(place: int) -> bool:
    """Whether a parameter moves the motion: all do but those of the gauges."""
    return place < MOTION_PARAMETER_COUNT or place >= SHARED_PARAMETER_COUNT


@compiled_part
def _apply_prior_bounds(point: Floats, free: Indices, mean: Floats, deviation: Floats) -> None:
    """Keep the free ones of known parameters near what is known of them."""
    for k in range(len(free)):
        place = free[k]
        if deviation[place] < math.inf:
            reach = _REACH_DEVIATIONS * deviation[place]
            point[place] = min(max(point[place], mean[place] - reach), mean[place] + reach)


def sample_motion(parameters: Floats, time_s: Floats, law: FrictionLaw) -> Floats:
    """Displacements (2, n) of the table, and of the plate against it, at rising `time_s`."""
    duration_s = max(DURATION_MIN_S, float(time_s[-1]) - float(parameters[Parameter.RELEASE]))
    return law.solver.displacements(law.vector(parameters), time_s, duration_s)


def motion_phases(parameters: Floats, law: FrictionLaw, duration_s: float) -> Floats:
    """Phases (m, 5) from release: start, sign of slip (0 stick), and u1, u1', u2 - u1 there."""
    return law.solver.phases(law.vector(parameters), max(DURATION_MIN_S, duration_s))


def predict_gauge_1(parameters: Floats, time_s: Floats, law: FrictionLaw) -> Floats:
    """What gauge 1 should read (n,)."""
    u1, _ = sample_motion(parameters, time_s, law)
    u1 *= 1.0 + parameters[Parameter.TABLE_GAIN]
    u1 += parameters[Parameter.TABLE_OFFSET]
    return np.asarray(u1)


def predict_gauge_2(parameters: Floats, time_s: Floats, law: FrictionLaw, gauge_2_absolute: bool) -> Floats:
    """What gauge 2 should read (n,), against the table or against the base."""
    u1, moved = sample_motion(parameters, time_s - parameters[Parameter.LAG], law)
    if gauge_2_absolute:
        moved += u1
    moved *= 1.0 + parameters[Parameter.RELATIVE_GAIN]
    moved += parameters[Parameter.RELATIVE_OFFSET]
    return np.asarray(moved)


def _decimate(channel: Channel, samples: int, dense_until_s: float) -> Channel:
    dense = int(np.searchsorted(channel.time_s, dense_until_s))
    first = np.arange(0, dense, max(1, dense // round(0.9 * samples)))
    rest = np.arange(dense, len(channel), max(1, (len(channel) - dense) // round(0.1 * samples)))
    kept = np.concatenate((first, rest))
    return Channel(channel.time_s[kept], channel.value_m[kept])
