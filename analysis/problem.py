"""What is fitted to what: the readings of one test, their noise, and the motion that should explain them."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from analysis.channels import Channel, FloatArray
from analysis.chi_square import Readings, costs, open_costs, relative_system, table_system
from analysis.fitted_motion import sample_motion, sample_with_derivatives
from analysis.least_squares import Minimum, Quadratic, minimise
from analysis.models import MOTION_PARAMETERS, STRIBECK_PARAMETERS, Model, Place

Places = NDArray[np.int64]
_REACH_DEVIATIONS = 10.0
"""Known parameters are not looked for farther from what is known of them."""
_FRICTION_MIN = 1e-4
_STIFFNESS_MIN = 1.0
_DAMPING_RATIO_MAX = 0.5
_VELOCITY_MIN, _VELOCITY_MAX = 1e-4, 1.0


@dataclass(frozen=True, eq=False, slots=True)
class Problem:
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
    """

    table: Channel
    relative: Channel | None
    noise_m: tuple[float, float]
    prior_mean: FloatArray
    prior_deviation: FloatArray
    absolute: bool = False

    @property
    def samples(self) -> int:
        """Number of readings of both channels."""
        return len(self.table) + (0 if self.relative is None else len(self.relative))

    @property
    def same_times(self) -> bool:
        """Whether both gauges were read at the same times."""
        return self.relative is not None and np.array_equal(self.relative.time_s, self.table.time_s)

    def knowing(self, place: Place, mean: float, deviation: float) -> Self:
        """The same with prior knowledge of one more parameter."""
        means, deviations = self.prior_mean.copy(), self.prior_deviation.copy()
        means[place], deviations[place] = mean, deviation
        return replace(self, prior_mean=means, prior_deviation=deviations)

    def thinned(self, samples: int, dense_until_s: float) -> Self:
        """About `samples` readings a channel, nine in ten of them before `dense_until_s`: slips are short."""
        return replace(
            self,
            table=_thinned(self.table, samples, dense_until_s),
            relative=None if self.relative is None else _thinned(self.relative, samples, dense_until_s),
        )

    def until(self, end_s: float) -> Self:
        """Readings before `end_s`."""
        return replace(
            self,
            table=self.table.between(-np.inf, end_s),
            relative=None if self.relative is None else self.relative.between(-np.inf, end_s),
        )

    def free(self, model: Model) -> Places:
        """Places of the free parameters of `model`, calibration and masses with an uncertainty included."""
        known = self.prior_deviation
        informed = np.flatnonzero((known > 0.0) & np.isfinite(known))
        free = set(model.free) | set(informed.tolist())
        if self.relative is None:
            free -= {Place.RELATIVE_OFFSET, Place.RELATIVE_GAIN, Place.LAG}
        return np.array(sorted(free), dtype=np.int64)

    @property
    def readings(self) -> Readings:
        """Arrays for the compiled evaluations."""
        table, relative = self.table, self.relative or Channel(np.empty(0), np.empty(0))
        options = np.array([int(self.absolute), int(self.same_times)])
        noise = np.array(self.noise_m)
        return table.time_s, table.value_m, relative.time_s, relative.value_m, noise, options

    def residuals(self, parameters: FloatArray, model: Model) -> tuple[FloatArray, FloatArray]:
        """Reading minus curve of each channel (m); the second is empty without gauge 2."""
        table = self.table.value_m - gauge_1(parameters, self.table.time_s, model)
        if self.relative is None:
            return table, np.empty(0)
        return table, self.relative.value_m - gauge_2(parameters, self.relative.time_s, model, self.absolute)

    def costs(self, points: FloatArray, *, zero_open: bool = False) -> FloatArray:
        """Chi-square of points (m, 16) without the priors' terms; gauge 2's zero at its best if `zero_open`.

        Stribeck friction is not for searching: f_s of `points` is that of laws without it.
        """
        return (open_costs if zero_open else costs)(points, self.readings)

    def quadratic(self, parameters: FloatArray, model: Model, free: Places) -> Quadratic:
        """Chi-square, its descent and its Gauss-Newton curvature over the `free` parameters."""
        system = np.sum(self.systems(parameters, model, free), axis=0)
        deviation = self.prior_deviation[free]
        informed = (deviation > 0.0) & np.isfinite(deviation)
        weight = np.where(informed, 1.0 / np.where(informed, deviation, 1.0) ** 2, 0.0)
        away = np.where(informed, self.prior_mean[free] - parameters[free], 0.0)
        normal = system[:-1, :-1] + np.diag(weight)
        return Quadratic(float(system[-1, -1] + weight @ away**2), system[:-1, -1] + weight * away, normal)

    def systems(self, parameters: FloatArray, model: Model, free: Places) -> list[FloatArray]:
        """Normal matrix, descent (last column) and cost (corner) of each channel over `free`."""
        directions = _directions(model, free)
        extra = free[free >= STRIBECK_PARAMETERS]
        motion, slopes = sample_with_derivatives(parameters, self.table.time_s, model, directions)
        table = table_system(motion, slopes, parameters, extra, self.table.value_m, self.noise_m[0])
        if self.relative is None:
            return [table]
        if not self.same_times:
            motion, slopes = sample_with_derivatives(parameters, self.relative.time_s, model, directions)
        later = int(np.flatnonzero(free == Place.RELEASE)[0])
        readings, noise = self.relative.value_m, self.noise_m[1]
        absolute = float(self.absolute)
        return [table, relative_system(motion, slopes, later, parameters, extra, readings, noise, absolute)]

    def minimise(
        self, start: FloatArray, model: Model, steps_max: int = 30, *, held: Place | None = None
    ) -> Minimum:
        """Refine `start` for `model`, one parameter `held` where it is."""
        free = self.free(model)
        free = free if held is None else free[free != held]

        def evaluate(parameters: FloatArray) -> Quadratic:
            return self.quadratic(parameters, model, free)

        known = free[self.prior_deviation[free] < np.inf]
        reach = _REACH_DEVIATIONS * self.prior_deviation[known]

        def project(parameters: FloatArray) -> FloatArray:
            near = parameters.copy()
            near[known] = np.clip(near[known], self.prior_mean[known] - reach, self.prior_mean[known] + reach)
            return allowed(near, model)

        return minimise(evaluate, project, start, free, steps_max)


def allowed(parameters: FloatArray, model: Model) -> FloatArray:
    """Return the nearest vector that the model allows: f_d > 0, f_s >= f_d, no tilt where it has none.

    A table that does not swing (damping near critical) is no stand, and no motion of the kernels.
    """
    point = parameters.copy()
    point[Place.FRICTION_DYNAMIC] = max(point[Place.FRICTION_DYNAMIC], _FRICTION_MIN)
    point[Place.STIFFNESS] = max(point[Place.STIFFNESS], _STIFFNESS_MIN)
    critical = 2.0 * float(np.sqrt(point[Place.STIFFNESS] * point[Place.TABLE_MASS]))
    point[Place.DAMPING] = min(max(point[Place.DAMPING], 0.0), _DAMPING_RATIO_MAX * critical)
    floor = point[Place.FRICTION_DYNAMIC]
    point[Place.FRICTION_STATIC] = max(point[Place.FRICTION_STATIC], floor) if model.has_static else floor
    velocity = float(point[Place.STRIBECK_VELOCITY])
    point[Place.STRIBECK_VELOCITY] = min(max(velocity, _VELOCITY_MIN), _VELOCITY_MAX)
    if not model.has_tilt:
        point[Place.TILT] = 0.0
    return point


def gauge_1(parameters: FloatArray, time_s: FloatArray, model: Model) -> FloatArray:
    """What gauge 1 should read (n,)."""
    u1, _ = sample_motion(parameters, time_s, model)
    return np.asarray(parameters[Place.TABLE_OFFSET] + (1.0 + parameters[Place.TABLE_GAIN]) * u1)


def gauge_2(parameters: FloatArray, time_s: FloatArray, model: Model, absolute: bool) -> FloatArray:
    """What gauge 2 should read (n,), against the table or against the base."""
    u1, moved = sample_motion(parameters, time_s - parameters[Place.LAG], model)
    if absolute:
        moved = moved + u1
    return np.asarray(parameters[Place.RELATIVE_OFFSET] + (1.0 + parameters[Place.RELATIVE_GAIN]) * moved)


def _directions(model: Model, free: Places) -> FloatArray:
    """Directions (q, 10 or 11) of the `free` places that move the motion; a tied f_s moves with f_d."""
    count = STRIBECK_PARAMETERS if model is Model.STRIBECK_TILT else MOTION_PARAMETERS
    places = free[free < count]
    directions = np.zeros((len(places), count))
    directions[np.arange(len(places)), places] = 1.0
    if not model.has_static:
        directions[places == Place.FRICTION_DYNAMIC, Place.FRICTION_STATIC] = 1.0
    return directions


def _thinned(channel: Channel, samples: int, dense_until_s: float) -> Channel:
    dense = int(np.searchsorted(channel.time_s, dense_until_s))
    first = np.arange(0, dense, max(1, dense // round(0.9 * samples)))
    rest = np.arange(dense, len(channel), max(1, (len(channel) - dense) // round(0.1 * samples)))
    kept = np.concatenate((first, rest))
    return Channel(channel.time_s[kept], channel.value_m[kept])
