"""Friction that falls with the sliding speed w: f = f_d + (f_s - f_d) exp(-|w| / v_s) (Stribeck)."""

import math
from itertools import product

from analysis.arrays import Floats, Indices
from analysis.compiled import compiled_part
from analysis.laws.law import FrictionLaw, IntegratedSolver
from analysis.laws.parameters import MOTION_PARAMETER_COUNT, OwnParameter, Parameter
from analysis.motion.events import FRICTION_DYNAMIC, FRICTION_STATIC

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


STRIBECK_TILT = FrictionLaw(
    "stribeck+tilt",
    "friction falls from f_s to f_d with the sliding velocity, on a tilted plane",
    IntegratedSolver(friction, "stribeck"),
    (Parameter.FRICTION_STATIC, Parameter.TILT),
    (VELOCITY,),
    start_points,
)
