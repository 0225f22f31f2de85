"""Deviations from the ideal stand that a fit can add to a friction law, one part at a time."""

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, fields, replace
from functools import cache, lru_cache
from typing import Any, TypeAlias

import numpy as np

from analysis.arrays import Floats, Indices
from analysis.compiled import compiled_part
from analysis.laws.catalogue import PARAMETER_COUNT, law_by_name
from analysis.laws.closed_form import GAUGE_1, GAUGE_2_BASE
from analysis.laws.coulomb import COULOMB
from analysis.laws.law import FrictionLaw, Gauge, IntegratedSolver, MotionSolver
from analysis.laws.parameters import MOTION_PARAMETER_COUNT, SHARED_PARAMETER_COUNT, OwnParameter, Parameter
from analysis.motion.events import (
    DURATION_MIN_S,
    FRICTION_DYNAMIC,
    FRICTION_STATIC,
    GRAVITY,
    PULLBACK,
    RELEASE,
    TILT,
)
from analysis.motion.stand_motion import (
    ACCELERATION,
    BASE_ACCELERATION,
    SLIP,
    SLIP_RATE,
    STAND_PARAMETER_COUNT,
    TABLE,
    TIME,
    VELOCITY,
    StandParameter,
    gauge_readings,
    stand_kernels,
)
from analysis.motion.two_mass import Motion, TwoMassParameters

STAND_PARAMETERS = {
    StandParameter.RELEASE_RAMP: OwnParameter("release_ramp_s", "s", 0.0, 0.0, 0.06),
    StandParameter.RELEASE_STEP: OwnParameter("release_step", "1", 0.0, 0.0, 0.95),
    StandParameter.RELEASE_SHAPE: OwnParameter("release_shape", "1", 0.0, -1.5, 3.0),
    StandParameter.RELEASE_VELOCITY: OwnParameter("release_velocity_m_per_s", "m/s", 0.0, -0.3, 0.3),
    StandParameter.SPRING_HARDENING: OwnParameter("spring_hardening", "1", 0.0, -0.3, 0.5),
    StandParameter.SPRING_ASYMMETRY: OwnParameter("spring_asymmetry", "1", 0.0, -0.3, 0.3),
    StandParameter.STAND_FRICTION: OwnParameter("stand_friction_m", "m", 0.0, 0.0, 2e-3),
    StandParameter.DRAG: OwnParameter("drag_per_m", "1/m", 0.0, 0.0, 10.0),
    StandParameter.LOSS_FACTOR: OwnParameter("loss_factor", "1", 0.0, 0.0, 0.2),
    StandParameter.ARC: OwnParameter("arc_per_m", "1/m", 0.0, -10.0, 10.0),
    StandParameter.MODE_MASS: OwnParameter("second_mode_mass_share", "1", 0.0, 0.0, 0.3),
    StandParameter.MODE_FREQUENCY: OwnParameter("second_mode_frequency_hz", "Hz", 0.0, 0.5, 100.0),
    StandParameter.MODE_DAMPING: OwnParameter("second_mode_damping", "1", 0.0, 0.0, 0.3),
    StandParameter.FILM: OwnParameter("film_s_per_m", "s/m", 0.0, -5.0, 20.0),
    StandParameter.LOGARITHMIC: OwnParameter("friction_per_log_velocity", "1", 0.0, -0.2, 0.3),
    StandParameter.GRADIENT: OwnParameter("friction_gradient_per_m", "1/m", 0.0, -40.0, 40.0),
    StandParameter.WEAR: OwnParameter("friction_wear_per_m", "1/m", 0.0, -5.0, 5.0),
    StandParameter.ASYMMETRY: OwnParameter("friction_asymmetry", "1", 0.0, -0.5, 0.5),
    StandParameter.DWELL: OwnParameter("friction_per_log_dwell", "1", 0.0, 0.0, 0.5),
    StandParameter.FILTER: OwnParameter("filter_s2", "s2", 0.0, 0.0, 2.5e-3),
    StandParameter.FILTER_2: OwnParameter("gauge_2_filter_s2", "s2", 0.0, 0.0, 2.5e-3),
    StandParameter.BEND_1: OwnParameter("gauge_1_bend", "1", 0.0, -0.2, 0.2),
    StandParameter.BEND_2: OwnParameter("gauge_2_bend", "1", 0.0, -0.2, 0.2),
    StandParameter.CROSS_TALK: OwnParameter("cross_talk", "1", 0.0, -0.2, 0.2),
    StandParameter.SQUARE_1: OwnParameter("gauge_1_square", "1", 0.0, -0.2, 0.2),
    StandParameter.SQUARE_2: OwnParameter("gauge_2_square", "1", 0.0, -0.2, 0.2),
    StandParameter.CROSS_TALK_1: OwnParameter("cross_talk_1", "1", 0.0, -0.2, 0.2),
    StandParameter.BASE_COMPLIANCE: OwnParameter("base_compliance", "1", 0.0, 0.0, 0.3),
    StandParameter.BASE_FREQUENCY: OwnParameter("base_frequency_hz", "Hz", 0.0, 2.0, 100.0),
    StandParameter.BASE_DAMPING: OwnParameter("base_damping", "1", 0.0, 0.0, 0.3),
    StandParameter.HOLD_CREEP: OwnParameter("hold_creep_m_per_s", "m/s", 0.0, -0.01, 0.01),
    StandParameter.FILTER_DAMPING: OwnParameter("filter_damping", "1", 0.0, -0.4, 1.0),
    StandParameter.PRESLIDING: OwnParameter("presliding_m", "m", 0.0, 1e-7, 5e-5),
    StandParameter.CREEP_1: OwnParameter("gauge_1_creep_m", "m", 0.0, -2e-3, 2e-3),
    StandParameter.CREEP_1_TIME: OwnParameter("gauge_1_creep_time_s", "s", 0.0, 0.5, 60.0),
    StandParameter.CREEP_2: OwnParameter("gauge_2_creep_m", "m", 0.0, -2e-3, 2e-3),
    StandParameter.CREEP_2_TIME: OwnParameter("gauge_2_creep_time_s", "s", 0.0, 0.5, 60.0),
}
"""Names, units and bounds; at zero the stand is ideal. The bounds are beyond what a stand that still serves
its purpose shows."""


@dataclass(frozen=True, slots=True)
class StandEffect:
    """One deviation from the ideal stand.

    `probes` are values of its own parameters from which its fit begins where a small value may not lead to
    the right ones.
    """

    name: str
    own: tuple[StandParameter, ...] = ()
    shared: tuple[Parameter, ...] = ()
    probes: tuple[tuple[float, ...], ...] = ()
    needs: str = ""  # name of the effect that this one refines
    bends_tail: bool = False  # whether the stick tail is no damped cosine with it
    misleads_plate: bool = (
        False  # whether gauges do not show the table's own motion, which the plate alone needs
    )
    varies_friction: bool = False  # whether f_d is a mean over the slid path with it
    rarity: float = 0.0
    """Added to the BIC: what stands rarely show must explain more than what they often show."""


_RARE = 6.0  # odds of 20 to 1 (Kass and Raftery: the border of strong evidence)
STATIC_FRICTION = StandEffect("static-friction", shared=(Parameter.FRICTION_STATIC,))
EFFECTS = (
    STATIC_FRICTION,
    StandEffect("release-ramp", (StandParameter.RELEASE_RAMP,), probes=((0.002,), (0.01,))),
    StandEffect("release-shape", (StandParameter.RELEASE_SHAPE,), needs="release-ramp", rarity=_RARE),
    StandEffect("release-step", (StandParameter.RELEASE_STEP,), needs="release-ramp", rarity=_RARE),
    StandEffect("release-velocity", (StandParameter.RELEASE_VELOCITY,), rarity=_RARE),
    StandEffect("hold-creep", (StandParameter.HOLD_CREEP,), rarity=_RARE),
    StandEffect("gauge-lag", shared=(Parameter.LAG,)),
    StandEffect("gauge-ratio", shared=(Parameter.RELATIVE_GAIN,), rarity=_RARE),
    StandEffect("stand-friction", (StandParameter.STAND_FRICTION,), probes=((3e-5,),), bends_tail=True),
    StandEffect("film", (StandParameter.FILM,), varies_friction=True),
    StandEffect("spring-hardening", (StandParameter.SPRING_HARDENING,), bends_tail=True),
    StandEffect("spring-asymmetry", (StandParameter.SPRING_ASYMMETRY,), rarity=_RARE, bends_tail=True),
    StandEffect("drag", (StandParameter.DRAG,), bends_tail=True),
    StandEffect("loss-factor", (StandParameter.LOSS_FACTOR,), rarity=_RARE, bends_tail=True),
    StandEffect("arc", (StandParameter.ARC,), bends_tail=True),
    StandEffect(
        "second-mode",
        (StandParameter.MODE_MASS, StandParameter.MODE_FREQUENCY, StandParameter.MODE_DAMPING),
        bends_tail=True,
    ),
    StandEffect(
        "base",
        (StandParameter.BASE_COMPLIANCE, StandParameter.BASE_FREQUENCY, StandParameter.BASE_DAMPING),
        bends_tail=True,
        misleads_plate=True,
    ),
    StandEffect(
        "dwell", (StandParameter.DWELL,), probes=((0.02,), (0.05,)), needs="static-friction", rarity=_RARE
    ),
    StandEffect("presliding", (StandParameter.PRESLIDING,), probes=((2e-6,),), bends_tail=True),
    StandEffect("gauge-1-creep", (StandParameter.CREEP_1, StandParameter.CREEP_1_TIME), bends_tail=True),
    StandEffect("gauge-2-creep", (StandParameter.CREEP_2, StandParameter.CREEP_2_TIME)),
    StandEffect("log-velocity", (StandParameter.LOGARITHMIC,), rarity=_RARE, varies_friction=True),
    StandEffect("gradient", (StandParameter.GRADIENT,), varies_friction=True),
    StandEffect("wear", (StandParameter.WEAR,), varies_friction=True),
    StandEffect("filter", (StandParameter.FILTER,), misleads_plate=True),
    StandEffect(
        "filter-damping", (StandParameter.FILTER_DAMPING,), needs="filter", rarity=_RARE, misleads_plate=True
    ),
    StandEffect("gauge-2-filter", (StandParameter.FILTER_2,), rarity=_RARE, misleads_plate=True),
    StandEffect(
        "gauge-1-bend", (StandParameter.SQUARE_1, StandParameter.BEND_1), rarity=_RARE, misleads_plate=True
    ),
    StandEffect(
        "gauge-2-bend", (StandParameter.SQUARE_2, StandParameter.BEND_2), rarity=_RARE, misleads_plate=True
    ),
    StandEffect(
        "cross-talk",
        (StandParameter.CROSS_TALK, StandParameter.CROSS_TALK_1),
        rarity=_RARE,
        misleads_plate=True,
    ),
)


STAND_PLACES = {own.name: place for place, own in STAND_PARAMETERS.items()}


CORNER_NAMES = {"filter_s2": "gauge_filter_hz", "gauge_2_filter_s2": "gauge_2_filter_hz"}
"""Results that are given in place of squared time constants."""
PULLBACK_POWERS = {
    "spring_hardening": 2,
    "spring_asymmetry": 1,
    "gauge_1_bend": 2,
    "gauge_2_bend": 2,
    "gauge_1_square": 1,
    "gauge_2_square": 1,
}
"""Sizes that are stated at the pullback, and the power of it with which they rise (`stand_motion`)."""
SHARED_NAMES = {
    Parameter.LAG: ("gauge_2_lag_s", "s"),
    Parameter.RELATIVE_GAIN: ("relative_gain", "1"),
}
"""Names and units of results for shared parameters that effects free."""


class StandSolver(MotionSolver):
    """Motion on a stand that is not ideal: integrated as a whole, derivatives are differences.

    A vector holds the ten parameters of the motion, those of the friction law, and all of the stand.
    """

    is_closed_form = False

    def __init__(self, law: FrictionLaw) -> None:
        if isinstance(law.solver, IntegratedSolver):
            kernels = stand_kernels(law.solver.friction, law.name.replace("+", "_"))
        else:
            kernels = stand_kernels(_constant_friction, "coulomb")
        self.kernels = replace(kernels, integrate=_remembered(kernels.integrate))

    def displacements(self, vector: Floats, time_s: Floats, duration_s: float) -> Floats:
        return gauge_readings(self.kernels, vector, self.kernels.integrate(vector, duration_s), time_s)

    def normal_equations(
        self, point: Floats, vector: Floats, free: Indices, directions: Floats, gauges: list[Gauge]
    ) -> list[Floats]:
        lag_s, moving = float(point[Parameter.LAG]), len(directions)
        end_s = max(float(times[-1]) for times, *_ in gauges) + abs(lag_s)
        duration_s = max(DURATION_MIN_S, end_s - float(vector[RELEASE]))
        state = self.kernels.integrate(vector, duration_s)
        ideal = self._readings(vector, state, lag_s, gauges)
        rows = [np.zeros((len(free) + 1, len(gauge[0]))) for gauge in gauges]
        for k, direction in enumerate(directions):
            step = _step(vector, direction)
            moved = vector + step * direction
            moved_state = state if _is_read_only(direction) else self.kernels.integrate(moved, duration_s)
            others = self._readings(moved, moved_state, lag_s, gauges)
            for row, above, below in zip(rows, others, ideal, strict=True):
                row[k] = (above - below) / step
        later = ideal
        if Parameter.LAG in free:
            later = self._readings(vector, state, lag_s + _LAG_STEP_S, gauges)
        for number, (_, readings, which, noise) in enumerate(gauges):
            row, slopes, read = rows[number], rows[number][:-1], ideal[number]
            second = which != GAUGE_1
            gain_place = Parameter.RELATIVE_GAIN if second else Parameter.TABLE_GAIN
            offset_place = Parameter.RELATIVE_OFFSET if second else Parameter.TABLE_OFFSET
            gain = 1.0 + point[gain_place]
            slopes[:moving] *= gain
            slopes[free == offset_place], slopes[free == gain_place] = 1.0, read
            if second:
                slopes[free == Parameter.LAG] = gain * (later[number] - read) / _LAG_STEP_S
            row[-1] = readings - point[offset_place] - gain * read
            row /= noise
        return [row @ row.T for row in rows]

    def mean_friction(self, vector: Floats, duration_s: float) -> float:
        """Mean of the coefficient of friction over the slid path."""
        _, nodes = self.kernels.integrate(vector, duration_s)
        arc = vector[len(vector) - STAND_PARAMETER_COUNT + StandParameter.ARC]
        vertical = arc * (nodes[:, VELOCITY] ** 2 + nodes[:, TABLE] * nodes[:, ACCELERATION])
        table = nodes[:, ACCELERATION] + nodes[:, BASE_ACCELERATION]
        load = vector[GRAVITY] * vector[TILT] - table - nodes[:, SLIP_RATE]
        force = np.abs(load / (vector[GRAVITY] + vertical)) * np.abs(nodes[:, SLIP])
        steps_s = np.diff(nodes[:, TIME])
        path = float(steps_s @ (np.abs(nodes[1:, SLIP]) + np.abs(nodes[:-1, SLIP])))
        return float(steps_s @ (force[1:] + force[:-1])) / path if path > 0.0 else float("nan")

    def _readings(
        self, vector: Floats, state: tuple[Floats, ...], lag_s: float, gauges: list[Gauge]
    ) -> list[Floats]:
        """What ideal gauges of these kinds read of a motion at their times, gauge 2 later by `lag_s`."""
        found = []
        for times, _, which, _ in gauges:
            late_s = 0.0 if which == GAUGE_1 else lag_s
            table, relative = gauge_readings(self.kernels, vector, state, times - late_s)
            found.append(table if which == GAUGE_1 else relative + table * (which == GAUGE_2_BASE))
        return found


_Integrate: TypeAlias = Callable[[Floats, float], tuple[Floats, ...]]
_MOTIONS_KEPT = 64  # those of two points for each parameter, as derivatives by differences need


def _remembered(integrate: _Integrate) -> _Integrate:
    """`integrate` that keeps its last motions: peaks, ends and means of one motion are asked one by one."""

    @lru_cache(maxsize=_MOTIONS_KEPT)
    def integrate_bytes(parameters: bytes, duration_s: float) -> tuple[Floats, ...]:
        return integrate(np.frombuffer(parameters).copy(), duration_s)

    return lambda parameters, duration_s: integrate_bytes(parameters.tobytes(), duration_s)


@compiled_part
def _constant_friction(_speed: float, parameters: Floats) -> float:
    coefficient: float = parameters[FRICTION_DYNAMIC]
    return coefficient


_SQUARED_CONSTANT_MIN_S2 = 1e-12  # a corner of 100 kHz: no stand shows a higher one
_READ_ONLY = (
    StandParameter.FILTER,
    StandParameter.FILTER_2,
    StandParameter.FILTER_DAMPING,
    StandParameter.BEND_1,
    StandParameter.BEND_2,
    StandParameter.SQUARE_1,
    StandParameter.SQUARE_2,
    StandParameter.CROSS_TALK,
    StandParameter.CROSS_TALK_1,
    StandParameter.CREEP_1,
    StandParameter.CREEP_1_TIME,
    StandParameter.CREEP_2,
    StandParameter.CREEP_2_TIME,
)
"""Parameters of gauges, which leave the motion as it is."""
_LAG_STEP_S = 1e-6
_STEP_SHARE = 1e-5
"""Step of differences over the range of a parameter of the stand, or over the value of one of the motion."""
_OWN_STEPS = {
    StandParameter.FILTER: 2.5e-5,  # a time constant of 5 ms: less is lost in interpolating filtered readings
    StandParameter.FILTER_2: 2.5e-5,
    StandParameter.MODE_MASS: 1e-3,  # less is lost in the errors of shorter steps of integration
    StandParameter.BASE_COMPLIANCE: 1e-3,
    StandParameter.PRESLIDING: 1e-8,  # less is lost in the errors of integration
}
_FIRST_PRESLIDING_M = 5e-7
"""Step from a contact that does not give way: records show as much, and less takes long to integrate."""
_ADDITIVE = frozenset((PULLBACK, TILT, RELEASE, FRICTION_DYNAMIC, FRICTION_STATIC))
_ADDITIVE_STEP = 1e-7  # m, rad, s or a coefficient of friction


def motion_count(free: Indices) -> int:
    """Number of parameters at the places `free` of a `StandModel` that change the motion from its release."""
    read_only = {Parameter.RELEASE, *(PARAMETER_COUNT + place for place in _READ_ONLY)}
    places: list[int] = free.tolist()
    moving = [place for place in places if place < MOTION_PARAMETER_COUNT or place >= SHARED_PARAMETER_COUNT]
    return len(moving) - len(read_only.intersection(places))


def _is_read_only(direction: Floats) -> bool:
    """Whether a move along `direction` changes what is read of a motion since its release only."""
    first = len(direction) - STAND_PARAMETER_COUNT
    places = np.flatnonzero(direction).tolist()
    return all(place == RELEASE or place - first in _READ_ONLY for place in places)


def _step(vector: Floats, direction: Floats) -> float:
    """Step of a difference along `direction`."""
    first = len(vector) - STAND_PARAMETER_COUNT
    steps = []
    for place in np.flatnonzero(direction).tolist():
        if place >= first:
            part = StandParameter(place - first)
            own = STAND_PARAMETERS[part]
            step = _OWN_STEPS.get(part, _STEP_SHARE * (own.upper - own.lower))
            is_first = part is StandParameter.PRESLIDING and vector[place] == 0.0
            steps.append(_FIRST_PRESLIDING_M if is_first else step)
        elif place in _ADDITIVE:
            steps.append(_ADDITIVE_STEP)
        else:
            steps.append(_STEP_SHARE * abs(float(vector[place])) or _ADDITIVE_STEP)
    return min(steps)


@cache
def _solver_of(law: FrictionLaw) -> StandSolver:
    return StandSolver(law)


def _solver(law: FrictionLaw) -> StandSolver:
    """The solver of a law; those in closed form share one."""
    return _solver_of(law if law.own else COULOMB)


@dataclass(frozen=True, eq=False)
class StandModel(FrictionLaw):
    """A friction law with deviations from the ideal stand.

    Its points are those of an ideal stand, followed by the `StandParameter` values.
    """

    law: FrictionLaw = COULOMB
    effects: tuple[StandEffect, ...] = ()
    stand_places: tuple[int, ...] = ()  # places of their own parameters in a point

    @property
    def own_places(self) -> Indices:
        count = len(self.own) - len(self.stand_places)
        return np.array([*range(self.own_start, self.own_start + count), *self.stand_places], dtype=np.int64)

    def mean_friction(self, point: Floats, duration_s: float) -> float:
        """Mean of the coefficient of friction over the slid path."""
        return _solver(self.law).mean_friction(self.vector(point), duration_s)

    def simulate(self, parameters: TwoMassParameters, own: list[float], duration_s: float) -> Motion:
        count = len(self.own) - len(self.stand_places)
        stand = np.zeros(STAND_PARAMETER_COUNT)
        stand[[place - PARAMETER_COUNT for place in self.stand_places]] = own[count:]
        return self.solver.simulate(parameters, [*own[:count], *stand.tolist()], duration_s)

    def vector(self, point: Floats) -> Floats:
        own = self.own_places[: len(self.own) - len(self.stand_places)]
        return np.concatenate((point[:MOTION_PARAMETER_COUNT], point[own], point[PARAMETER_COUNT:]))

    def directions(self, moving: Indices) -> Floats:
        count = MOTION_PARAMETER_COUNT + len(self.own) - len(self.stand_places)
        directions = np.zeros((len(moving), count + STAND_PARAMETER_COUNT))
        for row, place in zip(directions, moving.tolist(), strict=True):
            if place < MOTION_PARAMETER_COUNT:
                row[place] = 1.0
            elif place >= PARAMETER_COUNT:
                row[count + place - PARAMETER_COUNT] = 1.0
            else:
                row[MOTION_PARAMETER_COUNT + place - self.own_start] = 1.0
            if place == Parameter.FRICTION_DYNAMIC and not self.has_static_friction:
                row[FRICTION_STATIC] = 1.0
        return directions

    def apply_bounds(self, point: Floats) -> None:
        super().apply_bounds(point)
        for place, bound in _SHARED_BOUNDS.items():
            if place in self.extra:
                point[place] = min(max(point[place], -bound), bound)


_SHARED_BOUNDS = {Parameter.LAG: 0.06, Parameter.RELATIVE_GAIN: 0.3}
"""Lags are those of filters above 5 Hz; gauges that differ by more measure something else."""


def compose(law: FrictionLaw, effects: Iterable[StandEffect]) -> StandModel:
    """The law with these effects."""
    base = {field.name: getattr(law, field.name) for field in fields(FrictionLaw)}
    effects = tuple(effects)
    places = [place for effect in effects for place in effect.own]
    shared = [place for effect in effects for place in effect.shared]
    changed: dict[str, Any] = {
        "extra": (*law.extra, *shared),
        "own": (*law.own, *(STAND_PARAMETERS[place] for place in places)),
        "solver": _solver(law),
    }
    return StandModel(
        **{**base, **changed},
        law=law,
        effects=effects,
        stand_places=tuple(PARAMETER_COUNT + place for place in places),
    )


def effects_by_name(names: Iterable[str]) -> list[StandEffect]:
    """Effects in the order of `EFFECTS`; names of other versions are passed over."""
    wanted = set(names)
    return [effect for effect in EFFECTS if effect.name in wanted]


def model_law(name: str, parts: Iterable[str] = ()) -> FrictionLaw:
    """The law of this name, on a stand with these effects. Raises AnalysisError if there is no such law."""
    effects = effects_by_name(parts)
    return compose(law_by_name(name), effects) if effects else law_by_name(name)


def simulate_fit(law: FrictionLaw, fitted: Mapping[str, float], duration_s: float) -> Motion:
    """Motion from release to `duration_s` of a law with the parameters of an `Identification`."""
    own = [fitted[parameter.name] for parameter in law.own]
    if isinstance(law, StandModel):
        return law.simulate(TwoMassParameters.from_fit(fitted), own, duration_s)
    return law.solver.simulate(TwoMassParameters.from_fit(fitted), own, duration_s)


def corner_frequency_hz(squared_constant_s2: float) -> float:
    """Corner frequency of an RC filter that rounds readings as much as a fitted filter.

    What is left of a filter without its delay is its second moment: half the squared time constant of an RC
    filter, the whole of a critically damped one.
    """
    return 1.0 / (2.0 * math.pi * math.sqrt(2.0 * max(squared_constant_s2, _SQUARED_CONSTANT_MIN_S2)))


def squared_constant_s2(corner_hz: float) -> float:
    """The inverse of `corner_frequency_hz`."""
    return 0.5 / (2.0 * math.pi * corner_hz) ** 2


def extended_point(point: Floats) -> Floats:
    """A point of an ideal stand (p,) as one of a `StandModel`."""
    return np.concatenate((point, np.zeros(STAND_PARAMETER_COUNT)))


def stand_displacements(
    parameters: TwoMassParameters, values: Mapping[str, float], duration_s: float
) -> Callable[[Floats], tuple[Floats, Floats]]:
    """u1 and u2 - u1 (n,) as the gauges show them, at rising times (n,) from release, negative before it.

    `values` are those of `STAND_PARAMETERS` by name; what is not named is as on an ideal stand. Friction is
    that of Coulomb, with f_s.
    """
    vector = np.concatenate((parameters.vector(), np.zeros(STAND_PARAMETER_COUNT)))
    for name, value in values.items():
        vector[MOTION_PARAMETER_COUNT + STAND_PLACES[name]] = value
    kernels = _solver(COULOMB).kernels
    state = kernels.integrate(vector, duration_s)

    def displacements(time_s: Floats) -> tuple[Floats, Floats]:
        table, relative = gauge_readings(kernels, vector, state, time_s)
        return table, relative

    return displacements
