"""Chi-square of a law over its free parameters, with its derivatives, at as many points as wanted."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from analysis.arrays import Floats, Places
from analysis.fitting.chi_square import relative_system, table_system
from analysis.fitting.least_squares import Quadratic
from analysis.fitting.models import MOTION_PARAMETERS, STRIBECK_PARAMETERS, Model, Place
from analysis.fitting.normal_equations import gauge_system
from analysis.motion.gradients import phase_responses
from analysis.motion.phases import SHORTEST_S, walk
from analysis.motion.stribeck_sampling import sample_stribeck_with_gradient
from analysis.readings.channels import Channel

_TABLE, _RELATIVE, _ABSOLUTE = 0, 1, 2


@dataclass(frozen=True, eq=False, slots=True)
class GaussNewton:
    """Readings, law and prior knowledge, made ready.

    Attributes
    ----------
    gauges : list of (times, readings, which, noise)
        `which` as in `normal_equations.gauge_system`.
    model : Model
    free : (k,) int64
        Rising.
    directions : (q, 10 or 11) float64
        In the space of the motion's parameters, of the free ones that move it.
    mean, weight, known : (k,), (k,) and (k, k) float64
        What is known beforehand, one over its variance (0: nothing), and the diagonal matrix of that.
    """

    gauges: list[tuple[Floats, Floats, int, float]]
    model: Model
    free: Places
    directions: Floats
    mean: Floats
    weight: Floats
    known: Floats

    @classmethod
    def over(
        cls,
        channels: tuple[Channel, Channel | None],
        noise_m: tuple[float, float],
        prior: tuple[Floats, Floats],
        law: tuple[Model, Places, bool],
    ) -> Self:
        """For both gauges' readings; `law` holds its free places and whether gauge 2 is against the base."""
        (table, relative), (model, free, absolute) = channels, law
        gauges = [(table.time_s, table.value_m, _TABLE, noise_m[0])]
        if relative is not None:
            which = _ABSOLUTE if absolute else _RELATIVE
            gauges.append((relative.time_s, relative.value_m, which, noise_m[1]))
        mean, deviation = prior[0][free], prior[1][free]
        informed = (deviation > 0.0) & np.isfinite(deviation)
        weight = np.where(informed, 1.0 / np.where(informed, deviation, 1.0) ** 2, 0.0)
        return cls(gauges, model, free, _directions(model, free), mean, weight, np.diag(weight))

    def at(self, point: Floats) -> Quadratic:
        """Chi-square at `point` (16,), priors included, its descent and its curvature."""
        systems = self.systems(point)
        system = systems[0] if len(systems) == 1 else systems[0] + systems[1]
        last, away = len(self.free), self.mean - point[self.free]
        pull = self.weight * away
        cost = float(system[last, last]) + float(pull @ away)
        return Quadratic(cost, system[:last, last] + pull, system[:last, :last] + self.known)

    def systems(self, point: Floats) -> list[Floats]:
        """Normal matrix, descent (last column) and cost (corner) of each gauge, priors aside."""
        if self.model is Model.STRIBECK_TILT:
            return self._stribeck_systems(point)
        end = max(float(gauge[0][-1]) for gauge in self.gauges)
        motion = point[:MOTION_PARAMETERS]
        phases = walk(motion, max(SHORTEST_S, end - float(point[Place.RELEASE])))
        rows = phase_responses(motion, phases, self.directions)
        return [gauge_system(point, self.free, phases, rows, *gauge) for gauge in self.gauges]

    def _stribeck_systems(self, point: Floats) -> list[Floats]:
        vector, extra = point[:STRIBECK_PARAMETERS], self.free[self.free >= STRIBECK_PARAMETERS]
        times, readings, _, noise = self.gauges[0]
        motion, slopes = sample_stribeck_with_gradient(vector, times, self.directions)
        table = table_system(motion, slopes, point, extra, readings, noise)
        if len(self.gauges) == 1:
            return [table]
        later_times, readings, which, noise = self.gauges[1]
        if not np.array_equal(later_times, times):
            motion, slopes = sample_stribeck_with_gradient(vector, later_times, self.directions)
        release = int(np.flatnonzero(self.free == Place.RELEASE)[0])
        absolute = float(which == _ABSOLUTE)
        return [table, relative_system(motion, slopes, release, point, extra, readings, noise, absolute)]


def _directions(model: Model, free: Places) -> Floats:
    """Directions (q, 10 or 11) of the `free` places that move the motion; a tied f_s moves with f_d."""
    count = STRIBECK_PARAMETERS if model is Model.STRIBECK_TILT else MOTION_PARAMETERS
    places = free[free < count]
    directions = np.zeros((len(places), count))
    directions[np.arange(len(places)), places] = 1.0
    if not model.has_static:
        directions[places == Place.FRICTION_DYNAMIC, Place.FRICTION_STATIC] = 1.0
    return directions
