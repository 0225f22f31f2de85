"""Exact derivatives of the sampled motion, through its events, for least squares.

Call, also from other compiled code and without the interpreter lock::

    phases = walk(parameters, duration_s)                       # (m, 5)
    motion, gradient = sample_with_gradient(parameters, phases, times, directions)

parameters : (10,) float64 in the order of `analysis.motion.events` (FRICTION_DYNAMIC to GRAVITY)
times : (n,) float64, sorted; an even grid is several times faster than an uneven one
directions : (q, 10) float64, each row a direction in the space of parameters: unit vectors for plain
    derivatives, a row with 1 at FRICTION_DYNAMIC and FRICTION_STATIC for the coulomb model, and so on
motion : (2, n), u1 and u2 - u1; gradient : (q, 2, n), their derivatives along each direction

All arrays writable and C-contiguous. `gradient.reshape(q, -1).T` is the Jacobian of both channels.

What is carried along is the change of the state at fixed time. It obeys the linear equations of the
phase between events. At an event whose time moves by dt it jumps by (rate before - rate after) dt. Where
a slip turns into a stick this is conservation of momentum, so that no division by the small relative
acceleration of a short slip is ever needed; a breakaway with f_s = f_d has no jump at all. With
f_s > f_d and a joint acceleration that only just reaches its limit, the derivatives are truly unbounded.
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
    RELEASE,
    SIGN,
    START,
    STIFFNESS,
    TABLE,
    TABLE_MASS,
    TILT,
    VELOCITY,
    oscillation_amplitudes,
    oscillation_derivative,
    oscillator,
    static_limit,
)
from analysis.motion.sampling import (
    BLOCK,
    block_basis,
    block_displacements,
    phase_blocks,
    rotation_tables,
)

# Change of u1, u1', u2' and u2 - u1 at the start of a phase.
Change = tuple[float, float, float, float]
# Change within a phase: that of u1 is load + e^(-n tau) ((pc + qc tau) cos w tau + (ps + qs tau) sin w tau),
# that of u2'' is drive; here (load, drive, pc, ps, qc, qs).
Response = tuple[float, float, float, float, float, float]


@compiled_part
def _oscillation_change(parameters: Floats, direction: Floats, sign: float) -> Change:
    """Change of what `oscillation` returns: n, w, u_e and the plate's acceleration."""
    damping, frequency, load, drive = oscillator(parameters, sign)
    mass, d_mass = parameters[TABLE_MASS], direction[TABLE_MASS]
    d_load, d_drive = 0.0, 0.0
    if sign == 0.0:
        mass, d_mass = mass + parameters[PLATE_MASS], d_mass + direction[PLATE_MASS]
    else:
        d_drive = drive * direction[GRAVITY] / parameters[GRAVITY]
        d_drive -= parameters[GRAVITY] * (sign * direction[FRICTION_DYNAMIC] - direction[TILT])
        d_force = direction[PLATE_MASS] * drive + parameters[PLATE_MASS] * d_drive
        d_load = -(d_force + load * direction[STIFFNESS]) / parameters[STIFFNESS]
    d_damping = (0.5 * direction[DAMPING] - damping * d_mass) / mass
    d_square = (direction[STIFFNESS] - parameters[STIFFNESS] / mass * d_mass) / mass
    return d_damping, (0.5 * d_square - damping * d_damping) / frequency, d_load, d_drive


@compiled_part
def _response(mode: Floats, d_mode: Floats, phase: Floats, change: Change) -> Response:
    damping, frequency, load = mode[0], mode[1], mode[2]
    d_damping, d_frequency, d_load, d_drive = d_mode[0], d_mode[1], d_mode[2], d_mode[3]
    cosine, sine, _, _ = oscillation_amplitudes(damping, frequency, phase[TABLE] - load, phase[VELOCITY])
    pc = change[0] - d_load
    ps = (change[1] + d_damping * cosine + damping * pc - sine * d_frequency) / frequency
    qc, qs = d_frequency * sine - d_damping * cosine, -d_frequency * cosine - d_damping * sine
    return d_load, d_drive, pc, ps, qc, qs


@compiled_part
def _released(parameters: Floats, direction: Floats, sign: float) -> Change:
    """Change just after a release that comes later by direction[RELEASE]."""
    damping, frequency, load, drive = oscillator(parameters, sign)
    _, _, cosine, sine = oscillation_amplitudes(damping, frequency, parameters[PULLBACK] - load, 0.0)
    acceleration, _ = oscillation_derivative(damping, frequency, cosine, sine)
    plate = drive if sign != 0.0 else acceleration
    late = direction[RELEASE]
    return direction[PULLBACK], -acceleration * late, -plate * late, 0.0


@compiled_part
def _at_end(
    mode: Floats, swing: tuple[float, float, float], joint: bool, change: Change, response: Response
) -> Change:
    """Change at the end of a phase, before that has moved; swing is tau and the basis there."""
    d_load, d_drive, pc, ps, qc, qs = response
    tau, cos, sin = swing
    cosine, sine = pc + qc * tau, ps + qs * tau
    rate_cosine, rate_sine = oscillation_derivative(mode[0], mode[1], cosine, sine)
    table = d_load + (cosine * cos + sine * sin)
    velocity = (rate_cosine + qc) * cos + (rate_sine + qs) * sin
    if joint:
        return table, velocity, velocity, change[3]
    plate = change[2] + d_drive * tau
    relative = change[3] + (change[2] + 0.5 * d_drive * tau) * tau - (table - change[0])
    return table, velocity, plate, relative


@compiled_part
def _reversal_delay(parameters: Floats, state: Floats, sign: float, change: Change) -> float:
    """How much later a slip with `sign` ends in `state`."""
    _, _, _, drive = oscillator(parameters, sign)
    force = parameters[PLATE_MASS] * drive + parameters[DAMPING] * state[VELOCITY]
    acceleration = -(force + parameters[STIFFNESS] * state[TABLE]) / parameters[TABLE_MASS]
    gap = drive - acceleration
    return -(change[2] - change[1]) / gap if gap != 0.0 else 0.0


@compiled_part
def _breakaway_delay(parameters: Floats, direction: Floats, state: Floats, change: Change) -> float:
    """How much later a stick ends in `state`, from which it slips with the sign of `state`."""
    mass = parameters[TABLE_MASS] + parameters[PLATE_MASS]
    damping, stiffness = parameters[DAMPING], parameters[STIFFNESS]
    position, velocity, sign = state[TABLE], state[VELOCITY], state[SIGN]
    acceleration = -(damping * velocity + stiffness * position) / mass
    jerk = -(damping * acceleration + stiffness * velocity) / mass
    force = direction[DAMPING] * velocity + damping * change[1]
    force += direction[STIFFNESS] * position + stiffness * change[0]
    excess = -(force + acceleration * (direction[TABLE_MASS] + direction[PLATE_MASS])) / mass
    excess -= direction[GRAVITY] * parameters[TILT] + parameters[GRAVITY] * direction[TILT]
    static = (
        direction[GRAVITY] * parameters[FRICTION_STATIC] + parameters[GRAVITY] * direction[FRICTION_STATIC]
    )
    return -(excess + sign * static) / jerk if jerk != 0.0 else 0.0


@compiled_part
def _after_event(
    parameters: Floats, direction: Floats, before: Floats, after: Floats, change: Change
) -> Change:
    """Change on the other side of the event between two phases; `after` holds the state there."""
    table_mass, plate_mass = parameters[TABLE_MASS], parameters[PLATE_MASS]
    if after[SIGN] == 0.0:
        velocity = (table_mass * change[1] + plate_mass * change[2]) / (table_mass + plate_mass)
        return change[0], velocity, velocity, change[3]
    dynamic = parameters[GRAVITY] * parameters[FRICTION_DYNAMIC]
    if before[SIGN] == 0.0:
        drop = after[SIGN] * (static_limit(parameters) - dynamic)
        if drop == 0.0:
            return change
        delay = _breakaway_delay(parameters, direction, after, change)
    else:
        drop = before[SIGN] * 2.0 * dynamic
        delay = _reversal_delay(parameters, after, before[SIGN], change)
    # The plate is held back by `drop` less after the event, and the table pushed on less.
    table = change[1] + plate_mass / table_mass * drop * delay
    return change[0], table, change[2] - drop * delay, change[3]


@compiled
def _modes(parameters: Floats, directions: Floats) -> tuple[Floats, Floats]:
    """Return `oscillation` for the signs -1, 0, 1, (3, 4), and its changes, (q, 3, 4)."""
    modes, d_modes = np.empty((3, 4)), np.empty((len(directions), 3, 4))
    for k in range(3):
        modes[k, 0], modes[k, 1], modes[k, 2], modes[k, 3] = oscillator(parameters, k - 1.0)
        for d in range(len(directions)):
            change = _oscillation_change(parameters, directions[d], k - 1.0)
            for column in range(4):
                d_modes[d, k, column] = change[column]
    return modes, d_modes


@compiled
def phase_responses(parameters: Floats, phases: Floats, directions: Floats) -> Floats:
    """Change at the start of each phase and response within it: (q, m, 10)."""
    out = np.empty((len(directions), len(phases), 10))
    modes, d_modes = _modes(parameters, directions)
    for p in range(len(phases)):
        phase, k = phases[p], int(phases[p, SIGN]) + 1
        last = p + 1 == len(phases)
        tau = 0.0 if last else phases[p + 1, START] - phase[START]
        decay, angle = math.exp(-modes[k, 0] * tau), modes[k, 1] * tau
        swing = tau, decay * math.cos(angle), decay * math.sin(angle)
        for d in range(len(directions)):
            row = out[d, p]
            if p == 0:
                row[0], row[1], row[2], row[3] = _released(parameters, directions[d], phase[SIGN])
            change = row[0], row[1], row[2], row[3]
            response = _response(modes[k], d_modes[d, k], phase, change)
            row[4], row[5], row[6], row[7], row[8], row[9] = response
            if not last:
                change = _at_end(modes[k], swing, k == 1, change, response)
                change = _after_event(parameters, directions[d], phase, phases[p + 1], change)
                row = out[d, p + 1]
                row[0], row[1], row[2], row[3] = change
    return out


@compiled_part
def _block_gradient(
    row: Floats, joint: bool, start: float, times: Floats, basis: Floats, table: Floats, relative: Floats
) -> None:
    """Write the change of u1 and u2 - u1 in a block, from the row of its phase."""
    d_load, d_drive, pc, ps, qc, qs = row[4], row[5], row[6], row[7], row[8], row[9]
    cosines, sines = basis[0], basis[1]
    for k in range(len(times)):
        tau = times[k] - start
        table[k] = d_load + ((pc + qc * tau) * cosines[k] + (ps + qs * tau) * sines[k])
    if joint:
        for k in range(len(times)):
            relative[k] = row[3]
        return
    offset, speed = row[3] + row[0], row[2]
    for k in range(len(times)):
        tau = times[k] - start
        relative[k] = (offset - table[k]) + (speed + 0.5 * d_drive * tau) * tau


@compiled
def sample_with_gradient(
    parameters: Floats, phases: Floats, times: Floats, directions: Floats
) -> tuple[Floats, Floats]:
    """u1 and u2 - u1, and their derivatives along `directions`; see the head of this module."""
    motion, gradient = np.empty((2, len(times))), np.empty((len(directions), 2, len(times)))
    rows = phase_responses(parameters, phases, directions)
    tables, basis = rotation_tables(parameters, times), np.empty((2, BLOCK))
    blocks = phase_blocks(parameters, phases, times)
    held = blocks[0, 0] if len(blocks) > 0 else len(times)
    for k in range(held):
        motion[0, k], motion[1, k] = parameters[PULLBACK], 0.0
        for d in range(len(directions)):
            gradient[d, 0, k], gradient[d, 1, k] = directions[d, PULLBACK], 0.0
    for b in range(len(blocks)):
        first, last, phase = blocks[b, 0], blocks[b, 1], phases[blocks[b, 2]]
        at, start = times[first:last], phase[START] + parameters[RELEASE]
        block_basis(parameters, phase, at, tables, basis)
        block_displacements(parameters, phase, at, basis, motion[0][first:last], motion[1][first:last])
        for d in range(len(directions)):
            row, both = rows[d, blocks[b, 2]], gradient[d]
            _block_gradient(
                row, phase[SIGN] == 0.0, start, at, basis, both[0][first:last], both[1][first:last]
            )
    return motion, gradient
