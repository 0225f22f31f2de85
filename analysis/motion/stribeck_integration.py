"""Compiled integration of the motion with Stribeck friction; sticks keep their closed form.

Callable from other compiled code and without the interpreter lock::

    phases, nodes = walk_stribeck(parameters, duration_s)

parameters : (11,) float64, those of `analysis.motion.events` and the Stribeck velocity (STRIBECK)
phases : (m, 6), as `walk` gives, and the row in `nodes` with which the phase begins
nodes : (k, 7), the steps of the slips: NODE_TAU (s since the phase began), u1, u1', u2' - u1', u2 - u1,
    u1'', u2'' - u1''

A slip is integrated by the embedded Runge-Kutta pair of Dormand and Prince (1980), 5(4).
"""

import math

import numpy as np

from analysis.arrays import Floats
from analysis.compiled import compiled, compiled_part
from analysis.motion.events import (
    DAMPING,
    FRICTION_DYNAMIC,
    FRICTION_STATIC,
    GRAVITY,
    PLATE_MASS,
    PULLBACK,
    RELATIVE,
    SIGN,
    SLIP_PHASE_MIN_RAD,
    START,
    STIFFNESS,
    TABLE,
    TABLE_MASS,
    TILT,
    VELOCITY,
    advance,
    after_slip,
    first_sign,
    first_zero,
    oscillation_amplitudes,
    oscillation_derivative,
    oscillator,
    phase_limit,
    stick_end,
)

STRIBECK = 10
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


@compiled_part
def slope_in_slip(parameters: Floats, sign: float, state: Floats, slope: Floats) -> None:
    """Write the time derivative of (u1, u1', u2' - u1', u2 - u1) in a slip."""
    velocity, slip = state[1], state[2]
    surplus = parameters[FRICTION_STATIC] - parameters[FRICTION_DYNAMIC]
    friction = parameters[FRICTION_DYNAMIC] + surplus * math.exp(-abs(slip) / parameters[STRIBECK])
    load = parameters[GRAVITY] * (sign * friction - parameters[TILT])
    springs = parameters[DAMPING] * velocity + parameters[STIFFNESS] * state[0]
    acceleration = (parameters[PLATE_MASS] * load - springs) / parameters[TABLE_MASS]
    slope[0], slope[1], slope[2], slope[3] = velocity, acceleration, -load - acceleration, slip


@compiled_part
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


@compiled_part
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
        larger = np.empty((2 * len(nodes), 7))
        for k in range(len(nodes)):
            for column in range(7):
                larger[k, column] = nodes[k, column]
        nodes = larger
    row = nodes[count]
    row[NODE_TAU], row[NODE_TABLE], row[NODE_VELOCITY], row[NODE_SLIP] = tau, state[0], state[1], state[2]
    row[NODE_RELATIVE], row[NODE_ACCELERATION], row[NODE_SLIP_RATE] = state[3], slope[1], slope[2]
    return nodes


@compiled_part
def _pass_grazing_slip(parameters: Floats, state: Floats) -> float:
    """Carry `state` past the turning point of the joint acceleration that set off a slip without length."""
    damping, frequency, _, _ = oscillator(parameters, 0.0)
    _, _, cosine, sine = oscillation_amplitudes(damping, frequency, state[0], state[1])
    for _ in range(2):
        cosine, sine = oscillation_derivative(damping, frequency, cosine, sine)
    turn, _ = first_zero(frequency, cosine, sine)
    tau = SLIP_PHASE_MIN_RAD / frequency
    if 3.0 * turn < 1e-3 * math.pi / frequency:
        tau = max(tau, 3.0 * turn)
    state[0], state[1], _ = advance(parameters, 0.0, state[0], state[1], tau)
    return tau


@compiled
def _slip(
    parameters: Floats, phase: Floats, longest: float, nodes: Floats, count: int, most: float
) -> tuple[Floats, int, bool]:
    """Append the nodes of a slip; return also whether it stopped within `longest` and `most` nodes."""
    sign, frequency = phase[SIGN], oscillator(parameters, 1.0)[1]
    longest_step, shortest_step = 0.1 / frequency, SLIP_PHASE_MIN_RAD / frequency
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


@compiled
def integrate_stribeck(parameters: Floats, duration_s: float) -> tuple[Floats, Floats]:
    """Phases and nodes of the motion until `duration_s` after release; see the head of this module."""
    phases, nodes = np.empty((64, 6)), np.empty((4096, 7))
    count, node = 0, 0
    time, sign = 0.0, first_sign(parameters)
    table, velocity, relative = parameters[PULLBACK], 0.0, 0.0
    most = phase_limit(parameters, duration_s)
    most_nodes = min(_NODES_A_PHASE * most, _MOST_NODES)
    while time < duration_s and not count >= most:
        if count == len(phases):
            phases = _more_phases(phases)
        row = phases[count]
        row[START], row[SIGN], row[FIRST_NODE] = time, sign, node
        row[TABLE], row[VELOCITY], row[RELATIVE] = table, velocity, relative
        if sign == 0.0:
            tau, following = stick_end(parameters, table, velocity)
            if time + tau < duration_s:
                table, velocity, _ = advance(parameters, sign, table, velocity, tau)
        else:
            nodes, node, stopped = _slip(parameters, row, duration_s - time, nodes, node, most_nodes)
            end = nodes[node - 1]
            tau, table, velocity = end[NODE_TAU], end[NODE_TABLE], end[NODE_VELOCITY]
            relative = end[NODE_RELATIVE]
            following = after_slip(parameters, sign, table, velocity) if stopped else sign
        if tau != 0.0:  # a stick without length is no phase
            count += 1
        time = time + tau if sign == 0.0 or stopped else duration_s
        sign = following
    return phases[:count], nodes[:node]


@compiled
def _more_phases(phases: Floats) -> Floats:
    larger = np.empty((2 * len(phases), 6))
    for k in range(len(phases)):
        for column in range(6):
            larger[k, column] = phases[k, column]
    return larger
