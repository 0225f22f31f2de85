"""What is fitted to what: the readings of one test, their noise, and the motion that should explain them."""

import math
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np

from analysis.arrays import Floats, Indices
from analysis.compiled import compiled_part
from analysis.fitting.chi_square import GaugeReadings, chi_squares, chi_squares_with_fitted_zero
from analysis.fitting.fitted_motion import sample_motion
from analysis.fitting.gauss_newton import GaussNewton
from analysis.fitting.least_squares import Minimum, QuadraticModel, minimise
from analysis.fitting.models import FrictionLaw, Parameter
from analysis.preparation.channels import Channel
from analysis.preparation.plausibility import FRICTION_MAX, PERIOD_MAX_S, PERIOD_MIN_S, TRAVEL_MAX_M
from analysis.record import RecordError

_REACH_DEVIATIONS = 10.0
"""Known parameters are not looked for farther from what is known of them."""
_FRICTION_MIN, _FRICTION_MAX = 1e-4, 10.0 * FRICTION_MAX
"""Of f_d, f_s. A fit may go beyond what is refused as its result, not beyond all reason."""
_ANGULAR_MIN, _ANGULAR_MAX = 2.0 * math.pi / (3.0 * PERIOD_MAX_S), 2.0 * math.pi * 3.0 / PERIOD_MIN_S
"""Of the joint motion (rad/s)."""
_DAMPING_RATIO_MAX = 0.5
"""Over the critical one."""
_PULLBACK_MAX_M = TRAVEL_MAX_M
_TILT_MAX = 1.0
_VELOCITY_MIN, _VELOCITY_MAX = 1e-4, 1.0
_DYNAMIC, _STATIC, _TILT = (
    int(Parameter.FRICTION_DYNAMIC),
    int(Parameter.FRICTION_STATIC),
    int(Parameter.TILT),
)
_STIFFNESS, _DAMPING, _PULLBACK = int(Parameter.STIFFNESS), int(Parameter.DAMPING), int(Parameter.PULLBACK)
_TABLE_MASS, _PLATE_MASS = int(Parameter.TABLE_MASS), int(Parameter.PLATE_MASS)
_VELOCITY, _RELEASE = int(Parameter.STRIBECK_VELOCITY), int(Parameter.RELEASE)


@dataclass(frozen=True, eq=False, slots=True)
class FitProblem:
    """Readings, noise and prior knowledge.

    Attributes
    ----------
    table : Channel
    relative : Channel or None
    noise_m : (float, float)
        Standard deviation of each channel's white noise.
    prior_mean, prior_deviation : (16,) float64
        What is known of each parameter beforehand; a deviation of 0 fixes it, inf leaves it open.
    absolute : bool
        Gauge 2 measures the plate against the base.
    earliest_release_s : float
        The release is not looked for before, nor after the last reading.
    readings : tuple
        Arrays for the compiled evaluations, see `analysis.fitting.chi_square`.
    """

    table: Channel
    relative: Channel | None
    noise_m: tuple[float, float]
    prior_mean: Floats
    prior_deviation: Floats
    gauge_2_absolute: bool = False
    earliest_release_s: float = -math.inf
    readings: GaugeReadings = field(init=False, repr=False)

    def __post_init__(self) -> None:
        table, relative = self.table, self.relative or Channel(np.empty(0), np.empty(0))
        gauges = table.time_s, table.value_m, relative.time_s, relative.value_m
        object.__setattr__(
            self, "readings", (*gauges, np.array(self.noise_m), 2 if self.gauge_2_absolute else 1)
        )

    @property
    def sample_count(self) -> int:
        """Number of readings of both channels."""
        return len(self.table) + (0 if self.relative is None else len(self.relative))

    def with_prior(self, parameter: Parameter, mean: float, deviation: float) -> Self:
        """The same with prior knowledge of one more parameter."""
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
        """Readings before `end_s`."""
        return replace(
            self,
            table=self.table.between(-np.inf, end_s),
            relative=None if self.relative is None else self.relative.between(-np.inf, end_s),
        )

    def free_parameters(self, law: FrictionLaw) -> Indices:
        """Places of the free parameters of `model`, calibration and masses with an uncertainty included."""
        known = self.prior_deviation
        informed = np.flatnonzero((known > 0.0) & np.isfinite(known))
        free = set(law.free_parameters) | set(informed.tolist())
        if self.relative is None:
            free -= {Parameter.RELATIVE_OFFSET, Parameter.RELATIVE_GAIN, Parameter.LAG}
        return np.array(sorted(free), dtype=np.int64)

    def residuals(self, parameters: Floats, law: FrictionLaw) -> tuple[Floats, Floats]:
        """Reading minus curve of each channel (m); the second is empty without gauge 2."""
        table = self.table.value_m - predict_gauge_1(parameters, self.table.time_s, law)
        if self.relative is None:
            return table, np.empty(0)
        return table, self.relative.value_m - predict_gauge_2(
            parameters, self.relative.time_s, law, self.gauge_2_absolute
        )

    def chi_squares(self, points: Floats, *, fit_zero: bool = False) -> Floats:
        """Chi-square of points (m, 16) without the priors' terms; gauge 2's zero at its best if `zero_open`.

        Stribeck friction is not for searching: f_s of `points` is that of laws without it.
        """
        return (chi_squares_with_fitted_zero if fit_zero else chi_squares)(points, self.readings)

    def quadratic_model(self, parameters: Floats, law: FrictionLaw, free: Indices) -> QuadraticModel:
        """Chi-square, its descent and its Gauss-Newton curvature over the `free` parameters."""
        return self._gauss_newton(law, free).evaluate(parameters)

    def normal_equations(self, parameters: Floats, law: FrictionLaw, free: Indices) -> list[Floats]:
        """Normal matrix, descent (last column) and cost (corner) of each gauge over `free`."""
        return self._gauss_newton(law, free).normal_equations(parameters)

    def minimise(
        self, start: Floats, law: FrictionLaw, steps_max: int = 30, *, fixed: Parameter | None = None
    ) -> Minimum:
        """Refine `start` for `model`, one parameter `held` where it is."""
        free = self.free_parameters(law)
        free = free if fixed is None else free[free != fixed]
        has_static, has_tilt = law.has_static_friction, law.has_tilt
        if not len(self.table) or (self.relative is not None and not len(self.relative)):
            raise RecordError("no reading is left to fit near the release that was found. Check the gauges.")
        earliest_s, latest_s = self.earliest_release_s, float(self.table.time_s[-1])

        def project(parameters: Floats) -> Floats:
            near = parameters.copy()
            near[_RELEASE] = min(max(near[_RELEASE], earliest_s), latest_s)
            _apply_prior_bounds(near, free, self.prior_mean, self.prior_deviation)
            _apply_bounds(near, has_static, has_tilt)
            return near

        return minimise(self._gauss_newton(law, free).evaluate, project, start, free, steps_max)

    def _gauss_newton(self, law: FrictionLaw, free: Indices) -> GaussNewton:
        prior = self.prior_mean, self.prior_deviation
        return GaussNewton.build(
            (self.table, self.relative), self.noise_m, prior, (law, free, self.gauge_2_absolute)
        )


def project_to_bounds(parameters: Floats, law: FrictionLaw) -> Floats:
    """Return the nearest vector that the model allows: f_d > 0, f_s >= f_d, no tilt where it has none."""
    point = parameters.copy()
    _apply_bounds(point, law.has_static_friction, law.has_tilt)
    return point


@compiled_part
def _apply_bounds(point: Floats, has_static: bool, has_tilt: bool) -> None:
    """Move `point` to the nearest that a law allows.

    A table that does not swing (damping near critical) is no stand, and no motion of the kernels. What is
    far beyond any stand's only costs time: a fit without hope goes there, and its motions have no end.
    """
    point[_DYNAMIC] = min(max(point[_DYNAMIC], _FRICTION_MIN), _FRICTION_MAX)
    static = min(max(point[_STATIC], point[_DYNAMIC]), _FRICTION_MAX)
    point[_STATIC] = static if has_static else point[_DYNAMIC]
    mass = point[_TABLE_MASS] + point[_PLATE_MASS]
    point[_STIFFNESS] = min(max(point[_STIFFNESS], mass * _ANGULAR_MIN**2), mass * _ANGULAR_MAX**2)
    critical = 2.0 * math.sqrt(point[_STIFFNESS] * point[_TABLE_MASS])
    point[_DAMPING] = min(max(point[_DAMPING], 0.0), _DAMPING_RATIO_MAX * critical)
    point[_PULLBACK] = min(max(point[_PULLBACK], -_PULLBACK_MAX_M), _PULLBACK_MAX_M)
    point[_VELOCITY] = min(max(point[_VELOCITY], _VELOCITY_MIN), _VELOCITY_MAX)
    point[_TILT] = min(max(point[_TILT], -_TILT_MAX), _TILT_MAX) if has_tilt else 0.0


@compiled_part
def _apply_prior_bounds(point: Floats, free: Indices, mean: Floats, deviation: Floats) -> None:
    """Keep the free ones of known parameters near what is known of them."""
    for k in range(len(free)):
        place = free[k]
        if deviation[place] < math.inf:
            reach = _REACH_DEVIATIONS * deviation[place]
            point[place] = min(max(point[place], mean[place] - reach), mean[place] + reach)


def predict_gauge_1(parameters: Floats, time_s: Floats, law: FrictionLaw) -> Floats:
    """What gauge 1 should read (n,)."""
    u1, _ = sample_motion(parameters, time_s, law)
    return np.asarray(parameters[Parameter.TABLE_OFFSET] + (1.0 + parameters[Parameter.TABLE_GAIN]) * u1)


def predict_gauge_2(parameters: Floats, time_s: Floats, law: FrictionLaw, gauge_2_absolute: bool) -> Floats:
    """What gauge 2 should read (n,), against the table or against the base."""
    u1, moved = sample_motion(parameters, time_s - parameters[Parameter.LAG], law)
    if gauge_2_absolute:
        moved = moved + u1
    return np.asarray(
        parameters[Parameter.RELATIVE_OFFSET] + (1.0 + parameters[Parameter.RELATIVE_GAIN]) * moved
    )


def _decimate(channel: Channel, samples: int, dense_until_s: float) -> Channel:
    dense = int(np.searchsorted(channel.time_s, dense_until_s))
    first = np.arange(0, dense, max(1, dense // round(0.9 * samples)))
    rest = np.arange(dense, len(channel), max(1, (len(channel) - dense) // round(0.1 * samples)))
    kept = np.concatenate((first, rest))
    return Channel(channel.time_s[kept], channel.value_m[kept])
