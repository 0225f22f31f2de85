"""Friction that falls with the sliding speed w: f = f_d + (f_s - f_d) exp(-|w| / v_s) (Stribeck)."""

import math
from itertools import product

import numpy as np

from analysis.arrays import Floats, Indices
from analysis.compiled import compiled_part
from analysis.laws.law import FrictionLaw, IntegratedSolver
from analysis.laws.parameters import MOTION_PARAMETER_COUNT, OwnParameter, Parameter
from analysis.motion.events import FRICTION_DYNAMIC, FRICTION_STATIC
from analysis.motion.integration import IntegratedMotion, simulate_integrated
from analysis.motion.two_mass import MotionError, TwoMassParameters
from messages.i18n import N_

VELOCITY = OwnParameter("stribeck_velocity_m_per_s", "m/s", default=0.01, lower=1e-4, upper=1.0)
_VELOCITY = MOTION_PARAMETER_COUNT
_VELOCITIES_M_PER_S = (0.002, 0.005, 0.012, 0.03, 0.08)
"""From a tenth of the bound up to the fastest slips of the stands of Table 1, in equal ratios."""
_EXCESSES = (0.03, 0.1, 0.25, 0.6)  # f_s above f_d, in units of f_d: from hardly seen to that of oiled steel
_TYPICAL_SLIP_M_PER_S = 0.06  # mean sliding speed after the pullbacks of Table 1


@compiled_part
def friction(speed: float, parameters: Floats) -> float:
    """Coefficient of friction at a sliding `speed` (m/s)."""
    surplus = parameters[FRICTION_STATIC] - parameters[FRICTION_DYNAMIC]
    coefficient: float = parameters[FRICTION_DYNAMIC] + surplus * math.exp(-speed / parameters[_VELOCITY])
    return coefficient


def start_points(point: Floats, own: Indices) -> list[Floats]:
    """Points whose friction at the speed of most slips is about that of `point`."""
    found = []
    for velocity, excess in product(_VELOCITIES_M_PER_S, _EXCESSES):
        moved = point.copy()
        moved[own[0]] = velocity
        moved[Parameter.FRICTION_DYNAMIC] *= 1.0 - excess * velocity / (velocity + _TYPICAL_SLIP_M_PER_S)
        moved[Parameter.FRICTION_STATIC] = (1.0 + excess) * moved[Parameter.FRICTION_DYNAMIC]
        found.append(moved)
    return found


_SOLVER = IntegratedSolver(friction, "stribeck")
STRIBECK_TILT = FrictionLaw(
    "stribeck+tilt",
    "friction falls from f_s to f_d with the sliding velocity, on a tilted plane",
    _SOLVER,
    (Parameter.FRICTION_STATIC, Parameter.TILT),
    (VELOCITY,),
    start_points,
)


def simulate(
    parameters: TwoMassParameters, *, stribeck_velocity_m_per_s: float, duration_s: float = 10.0
) -> IntegratedMotion:
    """Motion from release to `duration_s` (s); f_s is the friction at standstill, f_d that at high speed.

    Raises MotionError if a velocity or the duration is not positive and finite.
    """
    if not 0.0 < stribeck_velocity_m_per_s < math.inf:
        template = N_("stribeck_velocity_m_per_s is {velocity:g}: give a positive velocity")
        raise MotionError(template, velocity=stribeck_velocity_m_per_s)
    vector = np.append(parameters.vector(), stribeck_velocity_m_per_s)
    return simulate_integrated(_SOLVER.kernels, vector, duration_s)
