"""A friction law: its parameters, their bounds, its motion and where its search begins."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from analysis.arrays import Floats, Indices
from analysis.compiled import compiled_part
from analysis.laws.parameters import (
    FRICTION_MAX,
    MOTION_PARAMETER_COUNT,
    SHARED_PARAMETER_COUNT,
    OwnParameter,
    Parameter,
)
from analysis.laws.solvers import MotionSolver

_FRICTION_MIN, _FRICTION_MAX = 1e-4, 10.0 * FRICTION_MAX
"""Of f_d and f_s: a fit may pass what is refused as a result, within reason."""
_TILT_MAX = 1.0
"""No plane of a stand is steeper (rad); a plane of some milliradians is usual."""
_DYNAMIC, _STATIC, _TILT = (
    int(Parameter.FRICTION_DYNAMIC),
    int(Parameter.FRICTION_STATIC),
    int(Parameter.TILT),
)
StartPoints = Callable[[Floats, Indices], list[Floats]]
"""Points (p,) to search from, given the best one of a simpler law and the places of the own parameters."""


def _no_start_points(_point: Floats, _own: Indices) -> list[Floats]:
    return []


@dataclass(frozen=True, eq=False)
class FrictionLaw:
    """One friction law between plate and table.

    Every law has f_d. A law without FRICTION_STATIC among its parameters has f_s = f_d, one without TILT a
    level plane.

    Attributes
    ----------
    name : str
        As in `analyze --model` and in saved analyses.
    description : str
        For help and reports.
    solver : MotionSolver
    extra : tuple of Parameter
        Which of FRICTION_STATIC and TILT it leaves free.
    own : tuple of OwnParameter
        Parameters that no other law has; `analysis.laws.catalogue` gives them their places.
    start_points : callable
        Additional points from which its search begins, see `StartPoints`.
    own_start : int
        Place of the first of its own parameters.
    """

    name: str
    description: str
    solver: MotionSolver
    extra: tuple[Parameter, ...] = ()
    own: tuple[OwnParameter, ...] = ()
    start_points: StartPoints = _no_start_points
    own_start: int = SHARED_PARAMETER_COUNT

    @property
    def own_places(self) -> Indices:
        """Places of its own parameters in the parameter vector."""
        return np.arange(self.own_start, self.own_start + len(self.own))

    @property
    def free_parameters(self) -> tuple[int, ...]:
        """Places that the law leaves free, beside those of the stand."""
        return (Parameter.FRICTION_DYNAMIC, *self.extra, *self.own_places.tolist())

    @property
    def has_static_friction(self) -> bool:
        """Whether f_s is a parameter."""
        return Parameter.FRICTION_STATIC in self.extra

    @property
    def has_tilt(self) -> bool:
        """Whether the tilt of the plane is a parameter."""
        return Parameter.TILT in self.extra

    def vector(self, point: Floats) -> Floats:
        """Parameters for the solver from a parameter vector: those of the motion, then its own."""
        motion = point[:MOTION_PARAMETER_COUNT]
        if not self.own:
            return motion
        return np.concatenate((motion, point[self.own_start : self.own_start + len(self.own)]))

    def directions(self, moving: Indices) -> Floats:
        """Directions (q, v) in the space of `vector` along which the places `moving` (q,) shift it."""
        directions = np.zeros((len(moving), MOTION_PARAMETER_COUNT + len(self.own)))
        columns = np.where(
            moving < MOTION_PARAMETER_COUNT, moving, moving - self.own_start + MOTION_PARAMETER_COUNT
        )
        directions[np.arange(len(moving)), columns] = 1.0
        if not self.has_static_friction:
            directions[moving == _DYNAMIC, _STATIC] = 1.0
        return directions

    def apply_bounds(self, point: Floats) -> None:
        """Move a point of the fit (p,) in place to the nearest that the law allows."""
        _bound_friction(point, self.has_static_friction, self.has_tilt)
        for place, parameter in enumerate(self.own, start=self.own_start):
            point[place] = min(max(point[place], parameter.lower), parameter.upper)


@compiled_part
def _bound_friction(point: Floats, has_static_friction: bool, has_tilt: bool) -> None:
    point[_DYNAMIC] = min(max(point[_DYNAMIC], _FRICTION_MIN), _FRICTION_MAX)
    static = min(max(point[_STATIC], point[_DYNAMIC]), _FRICTION_MAX)
    point[_STATIC] = static if has_static_friction else point[_DYNAMIC]
    point[_TILT] = min(max(point[_TILT], -_TILT_MAX), _TILT_MAX) if has_tilt else 0.0
