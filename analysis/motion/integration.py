"""Motion of two masses whose friction depends on the sliding velocity, integrated numerically.

Sticks keep their closed form. A slip is integrated by the embedded Runge-Kutta pair 5(4) of Dormand and
Prince (1980) and sampled by the quintic that has the displacements, velocities and accelerations of two
steps. Against DOP853 displacements agree to 1e-11 m and velocities to 1e-8 m/s; peak rates are good to 1e-4
of their values.

The functions that call `friction_coefficient` are templates: `integrated_kernels` compiles them for the
friction of one law.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, fields

import numpy as np

from analysis.arrays import Floats
from analysis.compiled import compile_with, compiled, compiled_part
from analysis.motion import events, sampling
from analysis.motion.events import (
    DAMPING,
    GRAVITY,
    PLATE_MASS,
    PULLBACK,
    RELATIVE,
    RELEASE,
    SIGN,
    START,
    STIFFNESS,
    TABLE,
    TABLE_MASS,
    TILT,
    VELOCITY,
)
from analysis.motion.events import PARAMETER_COUNT as OWN
from analysis.motion.sampling import BLOCK, MotionKernels

Friction = Callable[[float, Floats], float]
"""Compiled: coefficient of friction at a sliding speed (m/s) with the parameters of `MotionKernels`."""


@dataclass(frozen=True)
class IntegratedKernels(MotionKernels):
    """Kernels of a law whose slips are integrated: the friction above which a stick ends is FRICTION_STATIC.

    `state` is phases (m, 6) and nodes (k, 7). The sixth column of a phase is its first row in the nodes. A
    node is a step of a slip: NODE_TAU (s since the phase began), u1, u1', u2' - u1', u2 - u1, u1'' and
    u2'' - u1''.
    The largest rates of a slip are those at five times in each step.
    """

    sample_with_gradient: Callable[[Floats, Floats, Floats], tuple[Floats, Floats]]
    """(parameters, times, directions (q, p)) -> u1 and u2 - u1 (2, n), and their central differences along
    the directions (q, 2, n), good to about 1e-4 of their largest."""


def integrated_kernels(friction: Friction, name: str) -> IntegratedKernels:
    """Kernels for a compiled `friction`; `name` is an identifier that no other law has."""
    kernels = compile_with(_TEMPLATES, name, friction_coefficient=friction)
    return IntegratedKernels(*(kernels[field.name] for field in fields(IntegratedKernels)))


def friction_coefficient(speed: float, parameters: Floats) -> float:
    """Stand for the friction of a law, by which `integrated_kernels` replaces this."""
    raise NotImplementedError


FIRST_NODE = 5
NODE_TAU, NODE_TABLE, NODE_VELOCITY, NODE_SLIP, NODE_RELATIVE, NODE_ACCELERATION, NODE_SLIP_RATE = range(7)

# Where more are needed on average, the parameters are such as no stand can have.
_NODES_A_PHASE, _MOST_NODES = 200.0, 3e5
# Largest estimated error of a step in u1, u1', u2' - u1' and u2 - u1 (m, m/s).
_TOLERANCES = np.array([1e-14, 1e-12, 1e-12, 1e-14])
_STAGES = np.array(
    [
        [1 / 5, 0.0, 0.0, 0.0, 0.0, 0.0],
        [3 / 40, 9 / 40, 0.0, 0.0, 0.0, 0.0],
        [44 / 45, -56 / 15, 32 / 9, 0.0, 0.0, 0.0],
        [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729, 0.0, 0.0],
        [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656, 0.0],
        [35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84],
    ]
)
_ERRORS = np.array([71 / 57600, 0.0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40])


def slope_in_slip(parameters: Floats, sign: float, state: Floats, slope: Floats) -> None:
    """Write the time derivative of (u1, u1', u2' - u1', u2 - u1) in a slip."""
    velocity, slip = state[1], state[2]
    load = parameters[GRAVITY] * (sign * friction_coefficient(abs(slip), parameters) - parameters[TILT])
    springs = parameters[DAMPING] * velocity + parameters[STIFFNESS] * state[0]
    acceleration = (parameters[PLATE_MASS] * load - springs) / parameters[TABLE_MASS]
    slope[0], slope[1], slope[2], slope[3] = velocity, acceleration, -load - acceleration, slip


def _step(
    parameters: Floats, sign: float, state: Floats, slopes: Floats, trial: Floats, step: float
) -> float:
    """Write the state after `step` into `trial`; return its estimated error in tolerances.

    slopes : (7, 4), the first row given; the last row becomes the slope at `trial`.
    """
    for stage in range(6):
        for i in range(4):
            total = 0.0
            for j in range(stage + 1):
                total += _STAGES[stage, j] * slopes[j, i]
            trial[i] = state[i] + step * total
        slope_in_slip(parameters, sign, trial, slopes[stage + 1])
    worst = 0.0
    for i in range(4):
        error = 0.0
        for j in range(7):
            error += _ERRORS[j] * slopes[j, i]
        worst = max(worst, abs(step * error) / _TOLERANCES[i])
    return worst


def _shorten_to_stop(
    parameters: Floats, sign: float, state: Floats, slopes: Floats, trial: Floats, step: float
) -> float:
    """Shorten `step`, over which the slip stops, until it stops at its end; leaves the state in `trial`."""
    low, high = 0.0, step
    for _ in range(60):
        _step(parameters, sign, state, slopes, trial, step)
        speed = sign * trial[2]
        if speed > 0.0:
            low = step
        else:
            high = step
        correction = -speed / (sign * slopes[6, 2])
        if abs(correction) <= 1e-15 * high or high - low <= 1e-15 * high:
            break
        step += correction
        if not low < step < high:
            step = 0.5 * (low + high)
    return step


@compiled_part
def _may_have_stopped(sign: float, state: Floats, slopes: Floats, trial: Floats, step: float) -> bool:
    """Tell whether the slip may have stopped and gone on within the step."""
    if not (sign * slopes[0, 2] < 0.0 < sign * slopes[6, 2]):
        return False
    for k in range(1, 8):
        x = k / 8.0
        rest = 1.0 - x
        before = state[2] * (1.0 + 2.0 * x) + step * x * slopes[0, 2]
        after = trial[2] * (1.0 + 2.0 * rest) - step * rest * slopes[6, 2]
        if sign * (rest * rest * before + x * x * after) <= 0.0:
            return True
    return False


@compiled
def _append_node(nodes: Floats, count: int, tau: float, state: Floats, slope: Floats) -> Floats:
    """Write a node into row `count`; the array is doubled when full."""
    if count == len(nodes):
        nodes = events.doubled(nodes)
    row = nodes[count]
    row[NODE_TAU], row[NODE_TABLE], row[NODE_VELOCITY], row[NODE_SLIP] = tau, state[0], state[1], state[2]
    row[NODE_RELATIVE], row[NODE_ACCELERATION], row[NODE_SLIP_RATE] = state[3], slope[1], slope[2]
    return nodes


@compiled_part
def _pass_grazing_slip(parameters: Floats, state: Floats) -> float:
    """Carry `state` past the turning point of the joint acceleration that set off a slip without length."""
    damping, frequency, _, _ = events.oscillator(parameters, 0.0)
    _, _, cosine, sine = events.oscillation_amplitudes(damping, frequency, state[0], state[1])
    for _ in range(2):
        cosine, sine = events.oscillation_derivative(damping, frequency, cosine, sine)
    turn, _ = events.first_zero(frequency, cosine, sine)
    tau = events.SLIP_PHASE_MIN_RAD / frequency
    if 3.0 * turn < 1e-3 * math.pi / frequency:
        tau = max(tau, 3.0 * turn)
    state[0], state[1], _ = events.advance(parameters, 0.0, state[0], state[1], tau)
    return tau


def _slip(
    parameters: Floats, phase: Floats, longest: float, nodes: Floats, count: int, most: float
) -> tuple[Floats, int, bool]:
    """Append the nodes of a slip; return also whether it stopped within `longest` and `most` nodes."""
    sign, frequency = phase[SIGN], events.oscillator(parameters, 1.0)[1]
    longest_step, shortest_step = 0.1 / frequency, events.SLIP_PHASE_MIN_RAD / frequency
    state, trial, slopes = np.empty(4), np.empty(4), np.empty((7, 4))
    state[0], state[1], state[2], state[3] = phase[TABLE], phase[VELOCITY], 0.0, phase[RELATIVE]
    slope_in_slip(parameters, sign, state, slopes[0])
    nodes = _append_node(nodes, count, 0.0, state, slopes[0])
    tau, step, stopped = 0.0, 0.01 * longest_step, False
    while tau < longest and count < most and not stopped:
        step = min(step, longest_step, longest - tau)
        error = _step(parameters, sign, state, slopes, trial, step)
        if error > 1.0:
            step *= max(0.2, 0.9 * error**-0.2)
            continue
        stopped = sign * trial[2] <= 0.0
        if step > shortest_step and (
            (stopped and tau == 0.0) or _may_have_stopped(sign, state, slopes, trial, step)
        ):
            step, stopped = 0.25 * step, False
            continue
        if stopped and tau == 0.0:
            step = _pass_grazing_slip(parameters, state)
        else:
            if stopped:
                step = _shorten_to_stop(parameters, sign, state, slopes, trial, step)
                trial[2] = 0.0
            for i in range(4):
                state[i], slopes[0, i] = trial[i], slopes[6, i]
        tau += step
        count += 1
        nodes = _append_node(nodes, count, tau, state, slopes[0])
        step *= min(5.0, 0.9 * max(error, 1e-9) ** -0.2)
    return nodes, count + 1, stopped


def integrate(parameters: Floats, duration_s: float) -> tuple[Floats, Floats]:
    """Phases and nodes of the motion until `duration_s` after release; see `IntegratedKernels`."""
    phases, nodes = np.empty((64, 6)), np.empty((4096, 7))
    count, node = 0, 0
    time, sign = 0.0, events.first_sign(parameters)
    table, velocity, relative = parameters[PULLBACK], 0.0, 0.0
    most = events.phase_limit(parameters, duration_s)
    most_nodes = min(_NODES_A_PHASE * most, _MOST_NODES)
    while time < duration_s and not count >= most:
        if count == len(phases):
            phases = events.doubled(phases)
        row = phases[count]
        row[START], row[SIGN], row[FIRST_NODE] = time, sign, node
        row[TABLE], row[VELOCITY], row[RELATIVE] = table, velocity, relative
        if sign == 0.0:
            tau, following = events.stick_end(parameters, table, velocity)
            if time + tau < duration_s:
                table, velocity, _ = events.advance(parameters, sign, table, velocity, tau)
        else:
            nodes, node, stopped = _slip(parameters, row, duration_s - time, nodes, node, most_nodes)
            end = nodes[node - 1]
            tau, table, velocity = end[NODE_TAU], end[NODE_TABLE], end[NODE_VELOCITY]
            relative = end[NODE_RELATIVE]
            following = events.after_slip(parameters, sign, table, velocity) if stopped else sign
        if tau != 0.0:  # a stick without length is no phase
            count += 1
        time = time + tau if sign == 0.0 or stopped else duration_s
        sign = following
    return phases[:count], nodes[:node]


@compiled_part
def hermite_quintic(x: float, h: float, ends: tuple[float, float, float, float, float, float]) -> float:
    """Value at x in [0, 1] from value, slope and curvature at 0 and at 1, which are `h` apart."""
    v0, s0, c0, v1, s1, c1 = ends
    y = 1.0 - x
    start = v0 * (1.0 + 3.0 * x + 6.0 * x * x) + h * x * (s0 * (1.0 + 3.0 * x) + 0.5 * h * x * c0)
    end = v1 * (1.0 + 3.0 * y + 6.0 * y * y) - h * y * (s1 * (1.0 + 3.0 * y) - 0.5 * h * y * c1)
    return y * y * y * start + x * x * x * end


@compiled_part
def hermite_cubic(x: float, h: float, v0: float, s0: float, v1: float, s1: float) -> float:
    """Value at x in [0, 1] from value and slope at 0 and at 1, which are `h` apart."""
    y = 1.0 - x
    return y * y * (v0 * (1.0 + 2.0 * x) + h * x * s0) + x * x * (v1 * (1.0 + 2.0 * y) - h * y * s1)


@compiled_part
def _between(nodes: Floats, k: int, tau: float, state: Floats) -> None:
    """Write (u1, u1', u2' - u1', u2 - u1) at `tau` between the nodes k and k + 1."""
    a, b = nodes[k], nodes[k + 1]
    h = b[NODE_TAU] - a[NODE_TAU]
    x = (tau - a[NODE_TAU]) / h
    velocity, slip, acceleration, rate = NODE_VELOCITY, NODE_SLIP, NODE_ACCELERATION, NODE_SLIP_RATE
    table = a[NODE_TABLE], a[velocity], a[acceleration], b[NODE_TABLE], b[velocity], b[acceleration]
    relative = a[NODE_RELATIVE], a[slip], a[rate], b[NODE_RELATIVE], b[slip], b[rate]
    state[0], state[3] = hermite_quintic(x, h, table), hermite_quintic(x, h, relative)
    state[1] = hermite_cubic(x, h, a[velocity], a[acceleration], b[velocity], b[acceleration])
    state[2] = hermite_cubic(x, h, a[slip], a[rate], b[slip], b[rate])


def _slip_block(
    parameters: Floats, phase: Floats, nodes: Floats, end: int, times: Floats, out: Floats, first: int
) -> None:
    """Write the channels of a block within a slip, nodes up to row `end`, from column `first` on."""
    k, start = int(phase[FIRST_NODE]), phase[START] + parameters[RELEASE]
    state, slope = np.empty(4), np.empty(4)
    for j in range(len(times)):
        tau = times[j] - start
        while k + 2 < end and nodes[k + 1, NODE_TAU] < tau:
            k += 1
        _between(nodes, k, tau, state)
        out[0, first + j], out[1, first + j] = state[0], state[3]
        if len(out) == 6:
            slope_in_slip(parameters, phase[SIGN], state, slope)
            out[2, first + j], out[3, first + j] = state[1], state[1] + state[2]
            out[4, first + j], out[5, first + j] = slope[1], slope[1] + slope[2]


@compiled_part
def _nodes_end(phases: Floats, nodes: Floats, p: int) -> int:
    return int(phases[p + 1, FIRST_NODE]) if p + 1 < len(phases) else len(nodes)


def sample(parameters: Floats, phases: Floats, nodes: Floats, times: Floats, channels: int) -> Floats:
    """Channels at sorted `times`, as `sampling.sample` gives them."""
    out = np.zeros((channels, len(times)))
    tables, basis = sampling.rotation_tables(parameters, times), np.empty((2, BLOCK))
    blocks = sampling.phase_blocks(parameters, phases, times)
    held = blocks[0, 0] if len(blocks) > 0 else len(times)
    for k in range(held):
        out[0, k] = parameters[PULLBACK]
    for b in range(len(blocks)):
        first, last, p = blocks[b, 0], blocks[b, 1], blocks[b, 2]
        phase, at = phases[p], times[first:last]
        if phase[SIGN] != 0.0:
            _slip_block(parameters, phase, nodes, _nodes_end(phases, nodes, p), at, out, first)
            continue
        sampling.block_basis(parameters, phase, at, tables, basis)
        sampling.block_displacements(parameters, phase, at, basis, out[0][first:last], out[1][first:last])
        if channels == 6:
            rates = (out[2][first:last], out[3][first:last], out[4][first:last], out[5][first:last])
            sampling.block_rates(parameters, phase, at, basis, rates)
    return out


def peak_rates(
    parameters: Floats, phases: Floats, nodes: Floats, duration_s: float
) -> tuple[float, float, float, float]:
    """Largest |u1'|, |u2'|, |u1''|, |u2''| until `duration_s`, in slips at five times a step."""
    largest, state, slope = np.zeros(4), np.empty(4), np.empty(4)
    for p in range(len(phases)):
        if phases[p, SIGN] == 0.0:
            span = (phases[p + 1, START] if p + 1 < len(phases) else duration_s) - phases[p, START]
            table, velocity = phases[p, TABLE], phases[p, VELOCITY]
            speed, acceleration = events.table_peak_rates(parameters, 0.0, table, velocity, span)
            events.raise_largest(largest, speed, speed, acceleration, acceleration)
            continue
        for k in range(int(phases[p, FIRST_NODE]), _nodes_end(phases, nodes, p) - 1):
            for quarter in range(5):
                tau = nodes[k, NODE_TAU] + 0.25 * quarter * (nodes[k + 1, NODE_TAU] - nodes[k, NODE_TAU])
                _between(nodes, k, tau, state)
                slope_in_slip(parameters, phases[p, SIGN], state, slope)
                events.raise_largest(largest, state[1], state[1] + state[2], slope[1], slope[1] + slope[2])
    return largest[0], largest[1], largest[2], largest[3]


@compiled_part
def _longest_step(parameters: Floats, direction: Floats) -> float:
    """Step along `direction` with which no parameter moves by more than is good for a difference."""
    step = math.inf
    for place in range(len(parameters)):
        relative = place >= OWN or place in (STIFFNESS, DAMPING, TABLE_MASS, PLATE_MASS, GRAVITY)
        most = 1e-5 * abs(parameters[place]) if relative and parameters[place] != 0.0 else 1e-6
        if direction[place] != 0.0 and most > 0.0:
            step = min(step, most / abs(direction[place]))
    return step if step < math.inf else 1.0


def sample_with_gradient(parameters: Floats, times: Floats, directions: Floats) -> tuple[Floats, Floats]:
    """u1 and u2 - u1 at sorted `times` and their differences along `directions`: (2, n) and (q, 2, n)."""
    duration = max(times[-1] - parameters[RELEASE], 1e-3) + 1e-3
    phases, nodes = integrate(parameters, duration)
    motion = sample(parameters, phases, nodes, times, 2)
    gradient = np.empty((len(directions), 2, len(times)))
    for d in range(len(directions)):
        step = _longest_step(parameters, directions[d])
        for side in range(2):
            moved = parameters + (1.0 - 2.0 * side) * step * directions[d]
            phases, nodes = integrate(moved, duration)
            there = sample(moved, phases, nodes, times, 2)
            for channel in range(2):
                for k in range(len(times)):
                    if side == 0:
                        gradient[d, channel, k] = there[channel, k]
                    else:
                        gradient[d, channel, k] = (gradient[d, channel, k] - there[channel, k]) / (2.0 * step)
    return motion, gradient


_TEMPLATES = (
    (compiled_part, slope_in_slip),
    (compiled_part, _step),
    (compiled_part, _shorten_to_stop),
    (compiled, _slip),
    (compiled, integrate),
    (compiled, _slip_block),
    (compiled, sample),
    (compiled, peak_rates),
    (compiled, sample_with_gradient),
)
"""Functions that depend on friction, each before its callers."""
