"""What is fitted to what: the readings of one test, their noise, and the motion that should explain them."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from analysis.channels import Channel, FloatArray
from analysis.fitted_motion import sample_motion, sample_with_derivatives
from analysis.least_squares import Minimum, Quadratic, minimise
from analysis.models import MOTION_PARAMETERS, Model, Place

Places = NDArray[np.int64]
_MOTION = slice(0, MOTION_PARAMETERS)
_FRICTION_MIN = 1e-4
_STIFFNESS_MIN = 1.0
_DAMPING_RATIO_MAX = 0.5


@dataclass(frozen=True, eq=False, slots=True)
class Problem:
    """Readings, noise and prior knowledge.

    Attributes
    ----------
    table : Channel
    relative : Channel or None
    noise_m : (float, float)
        Standard deviation of each channel's white noise.
    prior_mean, prior_deviation : (15,) float64
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

    def curves(self, parameters: FloatArray) -> tuple[FloatArray, FloatArray | None]:
        """What the gauges should read at their times."""
        u1, rel = sample_motion(parameters[_MOTION], self.table.time_s)
        first = parameters[Place.TABLE_OFFSET] + (1.0 + parameters[Place.TABLE_GAIN]) * u1
        if self.relative is None:
            return first, None
        shifted = parameters[_MOTION].copy()
        shifted[Place.RELEASE] += parameters[Place.LAG]
        if not self.same_times or parameters[Place.LAG] != 0.0:
            u1, rel = sample_motion(shifted, self.relative.time_s)
        moved = rel + u1 if self.absolute else rel
        return first, parameters[Place.RELATIVE_OFFSET] + (1.0 + parameters[Place.RELATIVE_GAIN]) * moved

    def residuals(self, parameters: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Reading minus curve of each channel (m); the second is empty without gauge 2."""
        first, second = self.curves(parameters)
        if self.relative is None or second is None:
            return self.table.value_m - first, np.empty(0)
        return self.table.value_m - first, self.relative.value_m - second

    def cost(self, parameters: FloatArray) -> float:
        """Chi-square with the priors' terms."""
        first, second = self.residuals(parameters)
        total = first @ first / self.noise_m[0] ** 2 + second @ second / self.noise_m[1] ** 2
        return float(total) + self._prior_cost(parameters)

    def quadratic(self, parameters: FloatArray, model: Model, free: Places) -> Quadratic:
        """Chi-square, its descent and its Gauss-Newton curvature over the `free` parameters."""
        cost = self._prior_cost(parameters)
        deviation = self.prior_deviation[free]
        informed = (deviation > 0.0) & np.isfinite(deviation)
        weight = np.where(informed, 1.0 / np.where(informed, deviation, 1.0) ** 2, 0.0)
        descent = weight * (self.prior_mean[free] - parameters[free])
        normal = np.diag(weight)
        for residual, columns in self.linearised(parameters, model, free):
            cost += float(residual @ residual)
            descent = descent + columns @ residual
            normal = normal + columns @ columns.T
        return Quadratic(cost, descent, normal)

    def linearised(
        self, parameters: FloatArray, model: Model, free: Places
    ) -> list[tuple[FloatArray, FloatArray]]:
        """Residual (n,) and derivatives (k, n) of each channel's curve, both over its noise."""
        directions = _directions(model, free)
        motion, slopes = sample_with_derivatives(parameters[_MOTION], self.table.time_s, directions)
        parts = [self._table_part(parameters, free, motion[0], slopes[:, 0])]
        if self.relative is not None:
            if not self.same_times:
                motion, slopes = sample_with_derivatives(
                    parameters[_MOTION], self.relative.time_s, directions
                )
            moved, dmoved = motion[1], slopes[:, 1]
            if self.absolute:
                moved, dmoved = moved + motion[0], dmoved + slopes[:, 0]
            parts.append(self._relative_part(parameters, free, moved, dmoved))
        return parts

    def _table_part(
        self, parameters: FloatArray, free: Places, u1: FloatArray, slopes: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        weight = 1.0 / self.noise_m[0]
        gain = 1.0 + parameters[Place.TABLE_GAIN]
        columns = np.zeros((len(free), len(u1)))
        np.multiply(slopes, gain * weight, out=columns[: len(slopes)])
        columns[free == Place.TABLE_OFFSET] = weight
        columns[free == Place.TABLE_GAIN] = weight * u1
        return (self.table.value_m - parameters[Place.TABLE_OFFSET] - gain * u1) * weight, columns

    def _relative_part(
        self, parameters: FloatArray, free: Places, moved: FloatArray, slopes: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        if self.relative is None:
            raise ValueError("no gauge 2 to linearise")
        weight = 1.0 / self.noise_m[1]
        gain = 1.0 + parameters[Place.RELATIVE_GAIN]
        later = slopes[int(np.flatnonzero(free == Place.RELEASE)[0])]  # a lag of gauge 2 is a later release
        moved = moved + parameters[Place.LAG] * later
        columns = np.zeros((len(free), len(moved)))
        np.multiply(slopes, gain * weight, out=columns[: len(slopes)])
        columns[free == Place.RELATIVE_OFFSET] = weight
        columns[free == Place.RELATIVE_GAIN] = weight * moved
        columns[free == Place.LAG] = weight * gain * later
        return (self.relative.value_m - parameters[Place.RELATIVE_OFFSET] - gain * moved) * weight, columns

    def minimise(self, start: FloatArray, model: Model, steps_max: int = 30) -> Minimum:
        """Refine `start` for `model`."""
        free = self.free(model)

        def evaluate(parameters: FloatArray) -> Quadratic:
            return self.quadratic(parameters, model, free)

        def project(parameters: FloatArray) -> FloatArray:
            return allowed(parameters, model)

        return minimise(evaluate, project, start, free, steps_max)

    def _prior_cost(self, parameters: FloatArray) -> float:
        informed = (self.prior_deviation > 0.0) & np.isfinite(self.prior_deviation)
        away = (parameters - self.prior_mean)[informed] / self.prior_deviation[informed]
        return float(away @ away)


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
    if not model.has_tilt:
        point[Place.TILT] = 0.0
    return point


def _directions(model: Model, free: Places) -> FloatArray:
    """Directions (q, 10) of those `free` places, rising, that move the motion; a tied f_s moves with f_d."""
    places = free[free < MOTION_PARAMETERS]
    directions = np.zeros((len(places), MOTION_PARAMETERS))
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
