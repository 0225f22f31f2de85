"""Chi-square of a law over its free parameters, with its derivatives, at as many points as wanted."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from analysis.arrays import Floats, Indices
from analysis.fitting.chi_square import relative_normal_equations, table_normal_equations
from analysis.fitting.least_squares import QuadraticModel
from analysis.fitting.models import MOTION_PARAMETER_COUNT, STRIBECK_PARAMETER_COUNT, FrictionLaw, Parameter
from analysis.fitting.normal_equations import gauge_normal_equations
from analysis.motion.events import DURATION_MIN_S, integrate_events
from analysis.motion.gradients import phase_responses
from analysis.motion.stribeck_sampling import sample_stribeck_with_gradient
from analysis.preparation.channels import Channel

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
    law: FrictionLaw
    free: Indices
    directions: Floats
    mean: Floats
    weight: Floats
    known: Floats

    @classmethod
    def build(
        cls,
        channels: tuple[Channel, Channel | None],
        noise_m: tuple[float, float],
        prior: tuple[Floats, Floats],
        law: tuple[FrictionLaw, Indices, bool],
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
        return cls(gauges, model, free, _free_directions(model, free), mean, weight, np.diag(weight))

    def evaluate(self, point: Floats) -> QuadraticModel:
        """Chi-square at `point` (16,), priors included, its descent and its curvature."""
        systems = self.normal_equations(point)
        system = systems[0] if len(systems) == 1 else systems[0] + systems[1]
        last, away = len(self.free), self.mean - point[self.free]
        pull = self.weight * away
        cost = float(system[last, last]) + float(pull @ away)
        return QuadraticModel(cost, system[:last, last] + pull, system[:last, :last] + self.known)

    def normal_equations(self, point: Floats) -> list[Floats]:
        """Normal matrix, descent (last column) and cost (corner) of each gauge, priors aside."""
        if self.law is FrictionLaw.STRIBECK_TILT:
            return self._stribeck_normal_equations(point)
        end = max(float(gauge[0][-1]) for gauge in self.gauges)
        motion = point[:MOTION_PARAMETER_COUNT]
        phases = integrate_events(motion, max(DURATION_MIN_S, end - float(point[Parameter.RELEASE])))
        rows = phase_responses(motion, phases, self.directions)
        return [gauge_normal_equations(point, self.free, phases, rows, *gauge) for gauge in self.gauges]

    def _stribeck_normal_equations(self, point: Floats) -> list[Floats]:
        vector, extra = point[:STRIBECK_PARAMETER_COUNT], self.free[self.free >= STRIBECK_PARAMETER_COUNT]
        times, readings, _, noise = self.gauges[0]
        motion, slopes = sample_stribeck_with_gradient(vector, times, self.directions)
        table = table_normal_equations(motion, slopes, point, extra, readings, noise)
        if len(self.gauges) == 1:
            return [table]
        later_times, readings, which, noise = self.gauges[1]
        if not np.array_equal(later_times, times):
            motion, slopes = sample_stribeck_with_gradient(vector, later_times, self.directions)
        release = int(np.flatnonzero(self.free == Parameter.RELEASE)[0])
        absolute = float(which == _ABSOLUTE)
        return [
            table,
            relative_normal_equations(motion, slopes, release, point, extra, readings, noise, absolute),
        ]


def _free_directions(model: FrictionLaw, free: Indices) -> Floats:
    """Directions (q, 10 or 11) of the `free` places that move the motion; a tied f_s moves with f_d."""
    count = STRIBECK_PARAMETER_COUNT if model is FrictionLaw.STRIBECK_TILT else MOTION_PARAMETER_COUNT
    places = free[free < count]
    directions = np.zeros((len(places), count))
    directions[np.arange(len(places)), places] = 1.0
    if not model.has_static_friction:
        directions[places == Parameter.FRICTION_DYNAMIC, Parameter.FRICTION_STATIC] = 1.0
    return directions
