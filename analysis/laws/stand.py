"""The parts of the stand's model beside friction: suspension, release and gauges.

A part declares which parameters it leaves free and keeps a point of the fit within bounds. `analysis.fitting`
composes them with a friction law. The solvers of `analysis.laws.solvers` know one kind of each so far: linear
springs with viscous damping, a sudden release, and gauges with zero, gain and delay.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

from analysis.arrays import Floats
from analysis.compiled import compiled_part
from analysis.laws.parameters import PERIOD_MAX_S, PERIOD_MIN_S, TRAVEL_MAX_M, Parameter

_ANGULAR_MIN, _ANGULAR_MAX = 2.0 * math.pi / (3.0 * PERIOD_MAX_S), 2.0 * math.pi * 3.0 / PERIOD_MIN_S
"""Of the joint motion (rad/s): a fit may pass the limits of plausible stands by three times."""
_DAMPING_RATIO_MAX = 0.5
"""A table damped more than half critically hardly swings: it is no stand, and no motion of the kernels."""
_STIFFNESS, _DAMPING, _PULLBACK = int(Parameter.STIFFNESS), int(Parameter.DAMPING), int(Parameter.PULLBACK)
_TABLE_MASS, _PLATE_MASS = int(Parameter.TABLE_MASS), int(Parameter.PLATE_MASS)


def _unbounded(_point: Floats) -> None:
    """Leave the point as it is."""


@dataclass(frozen=True, slots=True)
class StandPart:
    """One part of the model.

    Attributes
    ----------
    name : str
    free : tuple of Parameter
        Parameters that are always fitted. Those of masses and gauges that are fitted only where their
        uncertainty is known are not among them.
    apply_bounds : callable
        Moves a point of the fit (p,) in place into what the part allows. Points beyond any stand only cost
        time: a fit that explains nothing goes there, and its motions have no end.
    """

    name: str
    free: tuple[Parameter, ...]
    apply_bounds: Callable[[Floats], None] = _unbounded


@compiled_part
def _bound_oscillator(point: Floats) -> None:
    mass = point[_TABLE_MASS] + point[_PLATE_MASS]
    point[_STIFFNESS] = min(max(point[_STIFFNESS], mass * _ANGULAR_MIN**2), mass * _ANGULAR_MAX**2)
    critical = 2.0 * math.sqrt(point[_STIFFNESS] * point[_TABLE_MASS])
    point[_DAMPING] = min(max(point[_DAMPING], 0.0), _DAMPING_RATIO_MAX * critical)


@compiled_part
def _bound_pullback(point: Floats) -> None:
    point[_PULLBACK] = min(max(point[_PULLBACK], -TRAVEL_MAX_M), TRAVEL_MAX_M)


LINEAR_SUSPENSION = StandPart(
    "linear springs, viscous damping", (Parameter.STIFFNESS, Parameter.DAMPING), _bound_oscillator
)
SUDDEN_RELEASE = StandPart("sudden release", (Parameter.PULLBACK, Parameter.RELEASE), _bound_pullback)
LINEAR_GAUGES = StandPart("zero, gain and delay", (Parameter.TABLE_OFFSET, Parameter.RELATIVE_OFFSET))
IDEAL_STAND = (LINEAR_SUSPENSION, SUDDEN_RELEASE, LINEAR_GAUGES)
