"""The model of the stand: a friction law with its motion, and suspension, release and gauges beside it."""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from analysis.arrays import Floats, Indices
from analysis.compiled import compiled, compiled_part
from analysis.laws.closed_form import (
    GAUGE_1,
    GAUGE_2_BASE,
    GaugeReadings,
    gauge_normal_equations,
    quadratic_model,
)
from analysis.laws.parameters import (
    FRICTION_MAX,
    MOTION_PARAMETER_COUNT,
    PERIOD_MAX_S,
    PERIOD_MIN_S,
    SHARED_PARAMETER_COUNT,
    TRAVEL_MAX_M,
    OwnParameter,
    Parameter,
)
from analysis.motion.events import DURATION_MIN_S, integrate_events
from analysis.motion.integration import (
    FIRST_NODE,
    NODE_SLIP,
    NODE_TAU,
    Friction,
    IntegratedKernels,
    integrated_kernels,
)
from analysis.motion.sampling import EXACT, MotionKernels, phase_responses
from analysis.motion.two_mass import Motion, TwoMassParameters, simulate_kernels

Gauge = tuple[Floats, Floats, int, float]
"""Times, readings (m), which gauge (see `closed_form`) and standard deviation of the noise (m)."""


class MotionSolver(ABC):
    """Motion of the stand with one friction law; a `vector` holds what `FrictionLaw.vector` returns."""

    is_closed_form: ClassVar[bool]
    """Whether it is fast enough for scans, and for following chi-square to the ends of an interval."""
    kernels: MotionKernels

    def simulate(self, parameters: TwoMassParameters, own: list[float], duration_s: float) -> Motion:
        """Motion from release to `duration_s`; `own` are the values of the law's own parameters."""
        return simulate_kernels(self.kernels, np.append(parameters.vector(), own), duration_s)

    def phases(self, vector: Floats, duration_s: float) -> Floats:
        """Phases (m, 5) from release: start, sign of slip (0 stick), and u1, u1', u2 - u1 there."""
        return self.kernels.integrate(vector, duration_s)[0][:, :5]

    def displacements(self, vector: Floats, time_s: Floats, duration_s: float) -> Floats:
        """u1 and u2 - u1 (2, n) at rising `time_s`, the last of them `duration_s` after release."""
        return self.kernels.sample(vector, *self.kernels.integrate(vector, duration_s), time_s, 2)

    def final_relative(self, vector: Floats, duration_s: float) -> float:
        """u2 - u1 at the end (m)."""
        return self.kernels.final_relative(vector, self.kernels.integrate(vector, duration_s), duration_s)

    def peak_rates(self, vector: Floats, duration_s: float) -> Floats:
        """Largest |u1'|, |u2'|, |u1''|, |u2''|, (4,)."""
        state = self.kernels.integrate(vector, duration_s)
        return np.array(self.kernels.peak_rates(vector, *state, duration_s))

    @abstractmethod
    def normal_equations(
        self, point: Floats, vector: Floats, free: Indices, directions: Floats, gauges: list[Gauge]
    ) -> list[Floats]:
        """Gauss-Newton form of each gauge's chi-square over the `free` places (k,) of a point (p,).

        Those that move the motion come first; `directions` (q, v) are how these move `vector`. A form is
        (k + 1, k + 1): normal matrix, descent (last column) and chi-square (corner), priors aside.
        """

    def quadratic_form(
        self,
        point: Floats,
        vector: Floats,
        free: Indices,
        directions: Floats,
        gauges: list[Gauge],
        readings: GaugeReadings,  # noqa: ARG002 - the same as `gauges`, for compiled functions
        known: tuple[Floats, Floats],
    ) -> tuple[float, Floats, Floats]:
        """Chi-square of all gauges at a point, its descent (k,) and its normal matrix (k, k).

        `known` is what is known of the `free` places beforehand: values (k,), and inverse variances (k,).
        """
        system = np.sum(self.normal_equations(point, vector, free, directions, gauges), axis=0)
        mean, weight = known
        last, away = len(free), mean - point[free]
        pull = weight * away
        cost = float(system[last, last]) + float(pull @ away)
        return cost, system[:last, last] + pull, system[:last, :last] + np.diag(weight)


class ClosedFormSolver(MotionSolver):
    """Coulomb friction in each phase: every phase is a damped oscillation with constant load."""

    is_closed_form = True
    kernels = EXACT

    def quadratic_form(
        self,
        point: Floats,
        vector: Floats,  # noqa: ARG002 - it is the beginning of `point`
        free: Indices,
        directions: Floats,
        gauges: list[Gauge],  # noqa: ARG002 - the same as `readings`
        readings: GaugeReadings,
        known: tuple[Floats, Floats],
    ) -> tuple[float, Floats, Floats]:
        return quadratic_model(point, free, directions, readings, *known)

    def normal_equations(
        self, point: Floats, vector: Floats, free: Indices, directions: Floats, gauges: list[Gauge]
    ) -> list[Floats]:
        end_s = max(float(gauge[0][-1]) for gauge in gauges)
        phases = integrate_events(vector, max(DURATION_MIN_S, end_s - float(point[Parameter.RELEASE])))
        rows = phase_responses(vector, phases, directions)
        return [gauge_normal_equations(point, free, phases, rows, *gauge) for gauge in gauges]


class IntegratedSolver(MotionSolver):
    """Friction that depends on the sliding velocity: slips are integrated, derivatives are differences.

    `friction` is compiled, see `analysis.motion.integration.Friction`; `name` is an identifier that no other
    law has.
    """

    is_closed_form = False
    kernels: IntegratedKernels

    def __init__(self, friction: Friction, name: str) -> None:
        self.friction, self.kernels = friction, integrated_kernels(friction, name)

    def mean_friction(self, vector: Floats, duration_s: float) -> float:
        """Mean of the coefficient of friction over the slid path."""
        phases, nodes = self.kernels.integrate(vector, duration_s)
        speeds = np.abs(nodes[:, NODE_SLIP])
        friction = np.array([self.friction(speed, vector) for speed in speeds.tolist()])
        steps_s = np.diff(nodes[:, NODE_TAU])
        begins = phases[:, FIRST_NODE].astype(np.intp)
        steps_s[begins[(begins > 0) & (begins < len(nodes))] - 1] = 0.0  # from one slip to the next
        path = float(steps_s @ (speeds[1:] + speeds[:-1]))
        work = friction * speeds
        return float(steps_s @ (work[1:] + work[:-1])) / path if path > 0.0 else float("nan")

    def normal_equations(
        self, point: Floats, vector: Floats, free: Indices, directions: Floats, gauges: list[Gauge]
    ) -> list[Floats]:
        extra, systems = free[len(directions) :], []
        release = int(np.flatnonzero(free == Parameter.RELEASE)[0])
        sampled_s, motion, slopes = None, np.empty(0), np.empty(0)
        for times, readings, which, noise in gauges:
            if sampled_s is None or not np.array_equal(times, sampled_s):
                sampled_s = times
                motion, slopes = self.kernels.sample_with_gradient(vector, times, directions)
            moved = motion[0], slopes[:, 0].copy()
            if which != GAUGE_1:
                moved = motion[1], slopes[:, 1].copy()
            if which == GAUGE_2_BASE:
                moved = motion[1] + motion[0], slopes[:, 1] + slopes[:, 0]
            response = _RESPONSES[0 if which == GAUGE_1 else 1]
            systems.append(
                _sampled_normal_equations(*moved, response, release, point, extra, readings, noise)
            )
        return systems


@compiled
def _sampled_normal_equations(
    moved: Floats,
    slopes: Floats,
    response: Indices,
    release: int,
    point: Floats,
    extra: Indices,
    readings: Floats,
    noise: float,
) -> Floats:
    """X X^T of a gauge: the rows of X are the derivatives and, last, the residual, over the noise.

    `moved` (n,) is the displacement that the gauge reads, `slopes` (q, n) its derivatives by the free
    parameters of the motion, and `release` the row of the release in them: a delay of the gauge is a later
    release. `response` (3,) are the places of offset, gain and delay (-1: none), `extra` the other free ones.
    """
    weight, gain, late = 1.0 / noise, 1.0 + point[response[1]], response[2] >= 0
    rows = np.zeros((len(slopes) + len(extra) + 1, len(readings)))
    for k in range(len(slopes)):
        for j in range(len(readings)):
            rows[k, j] = weight * gain * slopes[k, j]
    last = rows[len(rows) - 1]
    for j in range(len(readings)):
        value = moved[j]
        if late:
            value += point[response[2]] * rows[release, j] / (weight * gain)
        last[j] = weight * (readings[j] - point[response[0]] - gain * value)
        for k in range(len(extra)):
            if extra[k] == response[0]:
                rows[len(slopes) + k, j] = weight
            elif extra[k] == response[1]:
                rows[len(slopes) + k, j] = weight * value
            elif extra[k] == response[2]:
                rows[len(slopes) + k, j] = rows[release, j]
    system: Floats = np.dot(rows, rows.T)
    return system


_RESPONSES = (
    np.array([Parameter.TABLE_OFFSET, Parameter.TABLE_GAIN, -1]),
    np.array([Parameter.RELATIVE_OFFSET, Parameter.RELATIVE_GAIN, Parameter.LAG]),
)
"""Places of offset, gain and delay of either gauge."""
CLOSED_FORM = ClosedFormSolver()


_FRICTION_MIN, _FRICTION_MAX = 1e-4, 10.0 * FRICTION_MAX
"""Of f_d and f_s: a fit may pass what is refused as a result, within reason."""
_TILT_MAX = 1.0  # no plane of a stand is steeper (rad); a plane of some milliradians is usual
_DYNAMIC, _STATIC = int(Parameter.FRICTION_DYNAMIC), int(Parameter.FRICTION_STATIC)
_TILT = int(Parameter.TILT)
StartPoints = Callable[[Floats, Indices], list[Floats]]
"""Points (p,) to search from, given the best one of a simpler law and the places of the own parameters."""


def _no_start_points(_point: Floats, _own: Indices) -> list[Floats]:
    return []


@dataclass(frozen=True, eq=False)
class FrictionLaw:
    """One friction law between plate and table.

    Every law has f_d. A law without FRICTION_STATIC among its parameters has f_s = f_d, one without TILT a
    level plane.
    """

    name: str  # as in `analyze --model` and in saved analyses
    description: str  # for help and reports
    solver: MotionSolver
    extra: tuple[Parameter, ...] = ()  # which of FRICTION_STATIC and TILT it leaves free
    own: tuple[OwnParameter, ...] = ()
    """Parameters that no other law has; `analysis.laws.catalogue` gives them their places."""
    start_points: StartPoints = _no_start_points
    """Additional points from which its search begins, see `StartPoints`."""
    own_start: int = SHARED_PARAMETER_COUNT  # place of the first of its own parameters

    @property
    def own_places(self) -> Indices:
        return np.arange(self.own_start, self.own_start + len(self.own))

    @property
    def free_parameters(self) -> tuple[int, ...]:
        """Places that the law leaves free, beside those of the stand."""
        return (Parameter.FRICTION_DYNAMIC, *self.extra, *self.own_places.tolist())

    @property
    def has_static_friction(self) -> bool:
        return Parameter.FRICTION_STATIC in self.extra

    @property
    def has_tilt(self) -> bool:
        return Parameter.TILT in self.extra

    def simulate(self, parameters: TwoMassParameters, own: list[float], duration_s: float) -> Motion:
        """Motion from release to `duration_s`; `own` are the values of its own parameters."""
        return self.solver.simulate(parameters, own, duration_s)

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
        for place, parameter in zip(self.own_places.tolist(), self.own, strict=True):
            point[place] = min(max(point[place], parameter.lower), parameter.upper)


@compiled_part
def _bound_friction(point: Floats, has_static_friction: bool, has_tilt: bool) -> None:
    point[_DYNAMIC] = min(max(point[_DYNAMIC], _FRICTION_MIN), _FRICTION_MAX)
    static = min(max(point[_STATIC], point[_DYNAMIC]), _FRICTION_MAX)
    point[_STATIC] = static if has_static_friction else point[_DYNAMIC]
    point[_TILT] = min(max(point[_TILT], -_TILT_MAX), _TILT_MAX) if has_tilt else 0.0


_ANGULAR_MIN, _ANGULAR_MAX = 2.0 * math.pi / (3.0 * PERIOD_MAX_S), 2.0 * math.pi * 3.0 / PERIOD_MIN_S
"""Of the joint motion (rad/s): a fit may pass the limits of plausible stands by three times."""
_DAMPING_RATIO_MAX = 0.5  # a table damped more than half critically hardly oscillates: it is no stand
_STIFFNESS, _DAMPING, _PULLBACK = int(Parameter.STIFFNESS), int(Parameter.DAMPING), int(Parameter.PULLBACK)
_TABLE_MASS, _PLATE_MASS = int(Parameter.TABLE_MASS), int(Parameter.PLATE_MASS)


def _unbounded(_point: Floats) -> None:
    """Leave the point as it is."""


@dataclass(frozen=True, slots=True)
class StandPart:
    """One part of the model."""

    free: tuple[Parameter, ...]
    """Parameters that are always fitted. Those of masses and gauges that are fitted only where their
    uncertainty is known are not among them."""
    apply_bounds: Callable[[Floats], None] = _unbounded
    """Moves a point of the fit (p,) in place into what the part allows. Points beyond any stand only cost
    time: a fit that explains nothing goes there, and its motions have no end."""


@compiled_part
def _bound_oscillator(point: Floats) -> None:
    mass = point[_TABLE_MASS] + point[_PLATE_MASS]
    point[_STIFFNESS] = min(max(point[_STIFFNESS], mass * _ANGULAR_MIN**2), mass * _ANGULAR_MAX**2)
    critical = 2.0 * math.sqrt(point[_STIFFNESS] * point[_TABLE_MASS])
    point[_DAMPING] = min(max(point[_DAMPING], 0.0), _DAMPING_RATIO_MAX * critical)


@compiled_part
def _bound_pullback(point: Floats) -> None:
    point[_PULLBACK] = min(max(point[_PULLBACK], -TRAVEL_MAX_M), TRAVEL_MAX_M)


LINEAR_SUSPENSION = StandPart((Parameter.STIFFNESS, Parameter.DAMPING), _bound_oscillator)
SUDDEN_RELEASE = StandPart((Parameter.PULLBACK, Parameter.RELEASE), _bound_pullback)
LINEAR_GAUGES = StandPart((Parameter.TABLE_OFFSET, Parameter.RELATIVE_OFFSET))
IDEAL_STAND = (LINEAR_SUSPENSION, SUDDEN_RELEASE, LINEAR_GAUGES)
