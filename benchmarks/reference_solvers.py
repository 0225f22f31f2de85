"""Two other ways to the same motion: scipy's DOP853 with events, and the paper's loop in plain Python."""

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from analysis.motion.two_mass import TwoMassParameters

Floats = NDArray[np.float64]


@dataclass
class IntegratedMotion:
    """Phases from an integrator; `pieces` are its dense solutions (u1, u1', u2, u2'), one a phase."""

    starts: list[float] = field(default_factory=list)
    signs: list[int] = field(default_factory=list)
    pieces: list[Any] = field(default_factory=list)

    def sample(self, times: Floats) -> Floats:
        """u1, u1', u2, u2' at `times`, shape (4, n)."""
        which = np.searchsorted(self.starts, times, side="right") - 1
        return np.array([self.pieces[k](t) for k, t in zip(which, times, strict=True)]).T


def integrate_with_events(
    parameters: TwoMassParameters,
    duration_s: float,
    *,
    rtol: float = 1e-12,
    atol: float = 1e-14,
    max_step: float = math.inf,
    stribeck_velocity_m_per_s: float | None = None,
    dense: bool = True,
) -> IntegratedMotion:
    """Equations (1)-(3) of the paper, integrated by DOP853 from event to event.

    With a Stribeck velocity v_s, friction is f_d + (f_s - f_d) exp(-|u2' - u1'| / v_s). Without `dense`
    the motion cannot be sampled. Steps are so long that a short slip may be missed between two of them,
    and dense output is only of seventh order: give a `max_step` of 2 ms for displacements to 1e-12 m.
    """
    motion, time = IntegratedMotion(), 0.0
    state = np.array([parameters.pullback_m, 0.0, parameters.pullback_m, 0.0])
    sign = _demanded(parameters, state)
    while time < duration_s:
        events = [_standstill(sign)] if sign else [_breakaway(parameters, 1), _breakaway(parameters, -1)]
        solution = solve_ivp(
            _equations(parameters, sign, stribeck_velocity_m_per_s), (time, duration_s), state, "DOP853",
            events=events, dense_output=dense, rtol=rtol, atol=atol, max_step=max_step,
        )  # fmt: skip
        motion.starts.append(time)
        motion.signs.append(sign)
        motion.pieces.append(solution.sol)
        time, state = solution.t[-1], solution.y[:, -1]
        if solution.status != 1:
            break
        if sign:
            state[3] = state[1]
            sign = _demanded(parameters, state)
        else:  # the direction comes from the event that fired; deciding again would drown in rounding
            sign = 1 if len(solution.t_events[0]) else -1
    return motion


@dataclass
class MarchedMotion:
    """What the paper's algorithm gives at its steps; a sign a step, displacements at their ends too."""

    signs: list[int] = field(default_factory=list)
    table_m: list[float] = field(default_factory=list)
    relative_m: list[float] = field(default_factory=list)


def march_like_the_paper(p: TwoMassParameters, duration_s: float, step_s: float = 1e-4) -> MarchedMotion:
    """The paper's three-state algorithm in plain Python, formula by formula (sign of f as in Eq. (4))."""
    motion = MarchedMotion()
    u1 = u2 = p.pullback_m
    v1 = v2 = 0.0
    for _ in range(round(duration_s / step_s)):
        motion.table_m.append(u1)
        motion.relative_m.append(u2 - u1)
        tried = {sign: _paper_slip(p, sign, (u1, v1, u2, v2), step_s) for sign in (1, -1)}
        speeds = {sign: state[3] - state[1] for sign, state in tried.items()}
        if speeds[1] * speeds[-1] < 0.0:
            sign = 0
            moved, v1 = _paper_stick(p, u1, v1, step_s)
            u1, u2, v2 = moved, u2 + moved - u1, v1
        else:
            sign = 1 if abs(speeds[1]) < abs(speeds[-1]) else -1
            u1, v1, u2, v2 = tried[sign]
        motion.signs.append(sign)
    motion.table_m.append(u1)
    motion.relative_m.append(u2 - u1)
    return motion


def _paper_slip(
    p: TwoMassParameters, sign: int, state: tuple[float, ...], t: float
) -> tuple[float, float, float, float]:
    """Eq. (6)."""
    u1, v1, u2, v2 = state
    f = sign * p.friction_dynamic * p.gravity_m_per_s2
    n2 = p.damping_coefficient_kg_per_s / (2.0 * p.table_mass_kg)
    k2 = math.sqrt(p.stiffness_n_per_m / p.table_mass_kg)
    shift = p.plate_mass_kg * f / p.stiffness_n_per_m
    a, b = u1 - shift, (v1 + (u1 - shift) * n2) / k2
    decay, cos, sin = math.exp(-n2 * t), math.cos(k2 * t), math.sin(k2 * t)
    velocity = decay * (-n2 * b * sin - a * k2 * sin + v1 * cos)
    return decay * (a * cos + b * sin) + shift, velocity, u2 + v2 * t - 0.5 * f * t * t, v2 - f * t


def _paper_stick(p: TwoMassParameters, u1: float, v1: float, t: float) -> tuple[float, float]:
    """The known solution of the joint motion."""
    mass = p.table_mass_kg + p.plate_mass_kg
    n1 = p.damping_coefficient_kg_per_s / (2.0 * mass)
    w = math.sqrt(p.stiffness_n_per_m / mass - n1 * n1)
    b = (v1 + n1 * u1) / w
    decay, cos, sin = math.exp(-n1 * t), math.cos(w * t), math.sin(w * t)
    return decay * (u1 * cos + b * sin), decay * (v1 * cos - (n1 * b + w * u1) * sin)


def _joint_acceleration(p: TwoMassParameters, state: Floats) -> float:
    joint = p.table_mass_kg + p.plate_mass_kg
    return -(p.damping_coefficient_kg_per_s * state[1] + p.stiffness_n_per_m * state[0]) / joint


def _demanded(p: TwoMassParameters, state: Floats) -> int:
    excess = _joint_acceleration(p, state) - p.gravity_m_per_s2 * p.tilt_rad
    return 0 if abs(excess) <= p.gravity_m_per_s2 * p.static_or_dynamic else -int(np.sign(excess))


def _standstill(sign: int) -> Any:
    def event(_: float, state: Floats) -> float:
        return sign * (state[3] - state[1])

    event.terminal, event.direction = True, -1  # type: ignore[attr-defined]
    return event


def _breakaway(p: TwoMassParameters, sign: int) -> Any:
    def event(_: float, state: Floats) -> float:
        excess = _joint_acceleration(p, state) - p.gravity_m_per_s2 * p.tilt_rad
        return -sign * excess - p.gravity_m_per_s2 * p.static_or_dynamic

    event.terminal, event.direction = True, 1  # type: ignore[attr-defined]
    return event


def _equations(p: TwoMassParameters, sign: int, stribeck_velocity: float | None) -> Any:
    def friction(slip_velocity: float) -> float:
        if stribeck_velocity is None:
            return p.friction_dynamic
        fading = math.exp(-abs(slip_velocity) / stribeck_velocity)
        return p.friction_dynamic + (p.static_or_dynamic - p.friction_dynamic) * fading

    def stick(_: float, state: Floats) -> list[float]:
        acceleration = _joint_acceleration(p, state)
        return [state[1], acceleration, state[1], acceleration]

    def slip(_: float, state: Floats) -> list[float]:
        load = p.gravity_m_per_s2 * (sign * friction(state[3] - state[1]) - p.tilt_rad)
        springs = p.damping_coefficient_kg_per_s * state[1] + p.stiffness_n_per_m * state[0]
        return [state[1], (p.plate_mass_kg * load - springs) / p.table_mass_kg, state[3], -load]

    return slip if sign else stick
