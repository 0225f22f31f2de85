"""Displacements of the motion at any times, and their exact derivatives for least squares."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.arrays import Floats
from analysis.compiled import compiled, compiled_part
from analysis.motion import events
from analysis.motion.events import (
    DAMPING,
    FRICTION_DYNAMIC,
    FRICTION_STATIC,
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

BLOCK = 256
_ANCHORED = 32  # rotations between two exact evaluations: their rounding errors add up
_SMALL_ANGLE, _SMALL_DECAY = 0.5, 0.02  # up to these a rotation and a decay have series of a few terms
_C4, _C6, _C8, _C10, _C12, _C14 = ((-1.0) ** (k // 2) / math.factorial(k) for k in range(4, 16, 2))
_S3, _S5, _S7, _S9, _S11, _S13, _S15 = ((-1.0) ** (k // 2) / math.factorial(k) for k in range(3, 17, 2))


@compiled_part
def out_of_order(times: Floats) -> int:
    """How many of `times` are not at or after the one before; a time that is not a number never is."""
    count = int(len(times) > 0 and math.isnan(times[0]))
    for k in range(len(times) - 1):
        count += not times[k + 1] >= times[k]
    return count


@compiled_part
def even_step(times: Floats) -> float:
    """Step of a rising grid that is even to rounding, otherwise 0 (also for fewer than two times)."""
    if len(times) < 2:
        return 0.0
    first = times[0]
    step = (times[-1] - first) / (len(times) - 1)
    slack = 2e-15 * max(abs(first), abs(times[-1]))
    off_grid = 0
    for k in range(len(times)):
        off_grid += not abs(times[k] - (first + k * step)) <= slack
    return step if step > 4.0 * slack and off_grid == 0 else 0.0


@compiled_part
def first_at(times: Floats, start: float) -> int:
    """Index of the first of sorted `times` that is not before `start`."""
    low, high = 0, len(times)
    while low < high:
        middle = (low + high) // 2
        if times[middle] < start:
            low = middle + 1
        else:
            high = middle
    return low


@compiled
def phase_blocks(parameters: Floats, phases: Floats, times: Floats) -> NDArray[np.int64]:
    """Blocks of the sorted `times` after release: first sample, end, row in `phases`; shape (b, 3)."""
    blocks = np.empty((len(times) // BLOCK + len(phases) + 1, 3), np.int64)
    count = 0
    first = first_at(times, parameters[RELEASE])
    for p in range(len(phases)):
        end = len(times)
        if p + 1 < len(phases):
            end = first_at(times, phases[p + 1, START] + parameters[RELEASE])
        while first < end:
            last = min(first + BLOCK, end)
            blocks[count, 0], blocks[count, 1], blocks[count, 2] = first, last, p
            count += 1
            first = last
    return blocks[:count]


@compiled_part
def _fill_rotation(table: Floats, damping: float, frequency: float, step: float) -> None:
    """Write e^(-n tau) cos w tau and e^(-n tau) sin w tau at tau = 0, step, ..., (BLOCK - 1) step."""
    decay = math.exp(-damping * step)
    table[0, 0], table[1, 0] = 1.0, 0.0
    table[0, 1], table[1, 1] = decay * math.cos(frequency * step), decay * math.sin(frequency * step)
    for j in range(2, BLOCK):
        left, right = j // 2, j - j // 2
        table[0, j] = table[0, left] * table[0, right] - table[1, left] * table[1, right]
        table[1, j] = table[0, left] * table[1, right] + table[1, left] * table[0, right]


@compiled
def rotation_tables(parameters: Floats, times: Floats) -> Floats:
    """Rotations of stick and slip over the blocks of an even grid, (2, 2, BLOCK); empty on an uneven one."""
    step = even_step(times)
    if step == 0.0:
        return np.empty((0, 2, BLOCK))
    tables = np.empty((2, 2, BLOCK))
    for slips in range(2):
        damping, frequency, _, _ = events.oscillator(parameters, float(slips))
        _fill_rotation(tables[slips], damping, frequency, step)
    return tables


@compiled_part
def _basis_at(damping: float, frequency: float, tau: float) -> tuple[float, float]:
    """Return e^(-n tau) cos w tau and e^(-n tau) sin w tau."""
    decay = math.exp(-damping * tau)
    return decay * math.cos(frequency * tau), decay * math.sin(frequency * tau)


@compiled_part
def _small_basis(decay: float, angle: float) -> tuple[float, float]:
    """Return e^-decay cos angle and e^-decay sin angle, for arguments as small as the series allow."""
    x, y = angle * angle, -decay
    cos = _C8 + x * (_C10 + x * (_C12 + x * _C14))
    cos = 1.0 + x * (-0.5 + x * (_C4 + x * (_C6 + x * cos)))
    sin = _S9 + x * (_S11 + x * (_S13 + x * _S15))
    sin = angle * (1.0 + x * (_S3 + x * (_S5 + x * (_S7 + x * sin))))
    fade = 1.0 + y * (1.0 + y * (0.5 + y * (-_S3 + y * (_C4 + y * _S5))))
    return fade * cos, fade * sin


@compiled_part
def rotating_basis(
    damping: float, frequency: float, start: float, times: Floats, cosines: Floats, sines: Floats
) -> None:
    """Write the basis at any rising times: where they are close, by rotation from one to the next."""
    for k in range(len(times)):
        step = times[k] - times[k - 1] if k % _ANCHORED else math.inf
        if frequency * step < _SMALL_ANGLE and damping * step < _SMALL_DECAY:
            cos, sin = _small_basis(damping * step, frequency * step)
            cosines[k] = cosines[k - 1] * cos - sines[k - 1] * sin
            sines[k] = sines[k - 1] * cos + cosines[k - 1] * sin
        else:
            cosines[k], sines[k] = _basis_at(damping, frequency, times[k] - start)


@compiled_part
def block_basis(parameters: Floats, phase: Floats, times: Floats, tables: Floats, basis: Floats) -> None:
    """Write e^(-n tau) cos w tau and e^(-n tau) sin w tau of a block into `basis`, (2, BLOCK)."""
    damping, frequency, _, _ = events.oscillator(parameters, phase[SIGN])
    start = phase[START] + parameters[RELEASE]
    cosines, sines = basis[0], basis[1]
    if len(tables) == 0:
        rotating_basis(damping, frequency, start, times, cosines, sines)
        return
    cosines[0], sines[0] = _basis_at(damping, frequency, times[0] - start)
    table = tables[0] if phase[SIGN] == 0.0 else tables[1]
    cos, sin, table_cosines, table_sines = cosines[0], sines[0], table[0], table[1]
    for k in range(len(times)):
        cosines[k] = cos * table_cosines[k] - sin * table_sines[k]
        sines[k] = sin * table_cosines[k] + cos * table_sines[k]


@compiled_part
def block_displacements(
    parameters: Floats, phase: Floats, times: Floats, basis: Floats, table: Floats, relative: Floats
) -> None:
    """Write u1 and u2 - u1 of a block."""
    sign, position, velocity = phase[SIGN], phase[TABLE], phase[VELOCITY]
    damping, frequency, load, drive = events.oscillator(parameters, sign)
    cosine, sine, _, _ = events.oscillation_amplitudes(damping, frequency, position - load, velocity)
    cosines, sines = basis[0], basis[1]
    for k in range(len(times)):
        table[k] = load + (cosine * cosines[k] + sine * sines[k])
    if sign == 0.0:
        for k in range(len(times)):
            relative[k] = phase[RELATIVE]
        return
    start, offset = phase[START] + parameters[RELEASE], phase[RELATIVE]
    for k in range(len(times)):
        tau = times[k] - start
        relative[k] = offset + ((velocity + 0.5 * drive * tau) * tau - (table[k] - position))


@compiled_part
def block_rates(
    parameters: Floats, phase: Floats, times: Floats, basis: Floats, rates: tuple[Floats, ...]
) -> None:
    """Write u1', u2', u1'', u2'' of a block."""
    sign, position, velocity = phase[SIGN], phase[TABLE], phase[VELOCITY]
    damping, frequency, load, drive = events.oscillator(parameters, sign)
    _, _, cosine, sine = events.oscillation_amplitudes(damping, frequency, position - load, velocity)
    second_cosine, second_sine = events.oscillation_derivative(damping, frequency, cosine, sine)
    start = phase[START] + parameters[RELEASE]
    table, plate, table_second, plate_second = rates
    cosines, sines = basis[0], basis[1]
    for k in range(len(times)):
        table[k] = cosine * cosines[k] + sine * sines[k]
        table_second[k] = second_cosine * cosines[k] + second_sine * sines[k]
    if sign == 0.0:
        for k in range(len(times)):
            plate[k], plate_second[k] = table[k], table_second[k]
        return
    for k in range(len(times)):
        plate[k], plate_second[k] = velocity + drive * (times[k] - start), drive


@compiled
def sample(parameters: Floats, phases: Floats, times: Floats, channels: int) -> Floats:
    """Channels of the motion at sorted `times`, shape (channels, n), SI.

    Two channels are u1 and u2 - u1; six are these and u1', u2', u1'', u2''. Before release the table is
    held at the pullback.
    """
    out = np.empty((channels, len(times)))
    tables, basis = rotation_tables(parameters, times), np.empty((2, BLOCK))
    blocks = phase_blocks(parameters, phases, times)
    held = blocks[0, 0] if len(blocks) > 0 else len(times)
    for channel in range(channels):
        for k in range(held):
            out[channel, k] = parameters[PULLBACK] if channel == 0 else 0.0
    for b in range(len(blocks)):
        first, last, phase = blocks[b, 0], blocks[b, 1], phases[blocks[b, 2]]
        at = times[first:last]
        block_basis(parameters, phase, at, tables, basis)
        # Row by row: a slice of two dimensions would be strided, and slow.
        block_displacements(parameters, phase, at, basis, out[0][first:last], out[1][first:last])
        if channels == 6:
            rates = (out[2][first:last], out[3][first:last], out[4][first:last], out[5][first:last])
            block_rates(parameters, phase, at, basis, rates)
    return out


# Change of u1, u1', u2' and u2 - u1 at the start of a phase.
Change = tuple[float, float, float, float]
# Change within a phase: that of u1 is load + e^(-n tau) ((pc + qc tau) cos w tau + (ps + qs tau) sin w tau),
# that of u2'' is drive; here (load, drive, pc, ps, qc, qs).
Response = tuple[float, float, float, float, float, float]


@compiled_part
def _oscillation_change(parameters: Floats, direction: Floats, sign: float) -> Change:
    """Change of what `oscillator` returns: n, w, u_e and the plate's acceleration."""
    damping, frequency, load, drive = events.oscillator(parameters, sign)
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
    position, velocity = phase[TABLE] - load, phase[VELOCITY]
    cosine, sine, _, _ = events.oscillation_amplitudes(damping, frequency, position, velocity)
    pc = change[0] - d_load
    ps = (change[1] + d_damping * cosine + damping * pc - sine * d_frequency) / frequency
    qc, qs = d_frequency * sine - d_damping * cosine, -d_frequency * cosine - d_damping * sine
    return d_load, d_drive, pc, ps, qc, qs


@compiled_part
def _released(parameters: Floats, direction: Floats, sign: float) -> Change:
    """Change just after a release that comes later by direction[RELEASE]."""
    damping, frequency, load, drive = events.oscillator(parameters, sign)
    _, _, cosine, sine = events.oscillation_amplitudes(damping, frequency, parameters[PULLBACK] - load, 0.0)
    acceleration, _ = events.oscillation_derivative(damping, frequency, cosine, sine)
    plate = drive if sign != 0.0 else acceleration
    late = direction[RELEASE]
    return direction[PULLBACK], -acceleration * late, -plate * late, 0.0


@compiled_part
def _at_end(
    mode: Floats, end: tuple[float, float, float], joint: bool, change: Change, response: Response
) -> Change:
    """Change at the end of a phase, before that has moved; `end` is tau and the basis there."""
    d_load, d_drive, pc, ps, qc, qs = response
    tau, cos, sin = end
    cosine, sine = pc + qc * tau, ps + qs * tau
    rate_cosine, rate_sine = events.oscillation_derivative(mode[0], mode[1], cosine, sine)
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
    _, _, _, drive = events.oscillator(parameters, sign)
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
        drop = after[SIGN] * (events.static_limit(parameters) - dynamic)
        if drop == 0.0:
            return change
        delay = _breakaway_delay(parameters, direction, after, change)
    else:
        drop = before[SIGN] * 2.0 * dynamic
        delay = _reversal_delay(parameters, after, before[SIGN], change)
    # The plate is held back by `drop` less after the event, and the table driven on less.
    table = change[1] + plate_mass / table_mass * drop * delay
    return change[0], table, change[2] - drop * delay, change[3]


@compiled
def _modes(parameters: Floats, directions: Floats) -> tuple[Floats, Floats]:
    """Return `oscillator` for the signs -1, 0, 1, (3, 4), and its changes, (q, 3, 4)."""
    modes, d_modes = np.empty((3, 4)), np.empty((len(directions), 3, 4))
    for k in range(3):
        modes[k, 0], modes[k, 1], modes[k, 2], modes[k, 3] = events.oscillator(parameters, k - 1.0)
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
        end = tau, decay * math.cos(angle), decay * math.sin(angle)
        for d in range(len(directions)):
            row = out[d, p]
            if p == 0:
                row[0], row[1], row[2], row[3] = _released(parameters, directions[d], phase[SIGN])
            change = row[0], row[1], row[2], row[3]
            response = _response(modes[k], d_modes[d, k], phase, change)
            row[4], row[5], row[6], row[7], row[8], row[9] = response
            if not last:
                change = _at_end(modes[k], end, k == 1, change, response)
                change = _after_event(parameters, directions[d], phase, phases[p + 1], change)
                row = out[d, p + 1]
                row[0], row[1], row[2], row[3] = change
    return out


@dataclass(frozen=True)
class MotionKernels:
    """Compiled functions of the motion with one friction law; all run without the interpreter lock.

    `parameters` are the ten of `analysis.motion.events`, then those of the law's own.
    """

    integrate: Callable[[Floats, float], tuple[Floats, ...]]
    """(parameters, duration_s) -> state: phases (m, 5 at least) as `integrate_events` gives them, and what
    else tells the motion within them."""
    sample: Callable[..., Floats]
    """(parameters, *state, times, channels) -> (channels, n) as `sampling.sample` gives them; times rise."""
    peak_rates: Callable[..., tuple[float, float, float, float]]
    """(parameters, *state, duration_s) -> largest |u1'|, |u2'|, |u1''|, |u2''|."""

    def final_relative(self, parameters: Floats, state: tuple[Floats, ...], duration_s: float) -> float:
        """u2 - u1 at `duration_s` after release (m)."""
        end_s = np.array([parameters[events.RELEASE] + duration_s])
        return float(self.sample(parameters, *state, end_s, 2)[1, 0])


def _integrate_exactly(parameters: Floats, duration_s: float) -> tuple[Floats]:
    return (events.integrate_events(parameters, duration_s),)


EXACT = MotionKernels(_integrate_exactly, sample, events.peak_rates)
"""Coulomb friction in closed form: sampled at any time without interpolation."""
