"""Compiled sampling of a walked motion; on an even grid without trigonometry for each sample."""

import math

import numpy as np

from analysis.compiled import compiled
from analysis.motion._phases import (
    PULLBACK,
    RELATIVE,
    RELEASE,
    SIGN,
    START,
    TABLE,
    VELOCITY,
    Floats,
    amplitudes,
    derivative,
    oscillation,
)

# Samples a rotation; a rotation's rounding (1e-16) is repeated n / BLOCK times within a phase.
BLOCK = 64


@compiled
def even_step(times: Floats) -> float:
    """Step of a rising grid that is even to rounding, otherwise 0 (also for fewer than two times)."""
    if len(times) < 2:
        return 0.0
    step = (times[-1] - times[0]) / (len(times) - 1)
    slack = 2e-15 * max(abs(times[0]), abs(times[-1]))
    if not step > 4.0 * slack:
        return 0.0
    worst = 0.0
    for k in range(len(times)):
        worst = max(worst, abs(times[k] - (times[0] + k * step)))
    return step if worst <= slack else 0.0


@compiled
def rotation_table(damping: float, frequency: float, step: float) -> Floats:
    """e^(-n tau) times cos w tau and sin w tau at tau = 0, step, ..., BLOCK step: (2, BLOCK + 1)."""
    table = np.empty((2, BLOCK + 1))
    table[0, 0], table[1, 0] = 1.0, 0.0
    decay = math.exp(-damping * step)
    table[0, 1], table[1, 1] = decay * math.cos(frequency * step), decay * math.sin(frequency * step)
    for j in range(2, BLOCK + 1):
        left, right = j // 2, j - j // 2
        table[0, j] = table[0, left] * table[0, right] - table[1, left] * table[1, right]
        table[1, j] = table[0, left] * table[1, right] + table[1, left] * table[0, right]
    return table


@compiled
def moved(damping: float, frequency: float, cosine: float, sine: float, tau: float) -> tuple[float, float]:
    """Coefficients of the same damped sinusoid with tau counted from `tau` on."""
    decay, cos, sin = math.exp(-damping * tau), math.cos(frequency * tau), math.sin(frequency * tau)
    return decay * (cosine * cos + sine * sin), decay * (sine * cos - cosine * sin)


@compiled
def _fill_even(out: Floats, rotation: Floats, offset: float, cosine: float, sine: float) -> None:
    cos, sin = rotation[0], rotation[1]
    for first in range(0, len(out), BLOCK):
        count = min(BLOCK, len(out) - first)
        block = out[first : first + count]
        for j in range(count):
            block[j] = offset + (cosine * cos[j] + sine * sin[j])
        cosine, sine = cosine * cos[BLOCK] + sine * sin[BLOCK], sine * cos[BLOCK] - cosine * sin[BLOCK]


@compiled
def _fill(
    out: Floats,
    taus: Floats,
    rotation: Floats,
    damping: float,
    frequency: float,
    offset: float,
    cosine: float,
    sine: float,
) -> None:
    """Write offset + e^(-n tau) (cosine cos + sine sin); `rotation` is empty on an uneven grid."""
    if rotation.shape[1] > 0:
        cosine, sine = moved(damping, frequency, cosine, sine, taus[0])
        _fill_even(out, rotation, offset, cosine, sine)
        return
    for k in range(len(taus)):
        out[k] = offset + moved(damping, frequency, cosine, sine, taus[k])[0]


@compiled
def _rotations(parameters: Floats, step: float) -> tuple[Floats, Floats]:
    """Rotation tables of slip and stick."""
    if step == 0.0:
        return np.empty((2, 0)), np.empty((2, 0))
    slip, slip_frequency, _, _ = oscillation(parameters, 1.0)
    stick, stick_frequency, _, _ = oscillation(parameters, 0.0)
    return rotation_table(slip, slip_frequency, step), rotation_table(stick, stick_frequency, step)


@compiled
def _place(times: Floats, start: float) -> int:
    """Where the sorted `times` reach `start`."""
    return int(np.searchsorted(times, start))


@compiled
def sample_displacements(parameters: Floats, phases: Floats, times: Floats) -> Floats:
    """Displacements of table and plate (relative) at sorted `times`, shape (2, n), m."""
    n = len(times)
    out = np.empty((2, n))
    rotations = _rotations(parameters, even_step(times))
    since_release = times - parameters[RELEASE]
    first = _place(since_release, 0.0)
    out[0, :first], out[1, :first] = parameters[PULLBACK], 0.0
    for p in range(len(phases)):
        last = _place(since_release, phases[p + 1, START]) if p + 1 < len(phases) else n
        if last > first:
            _displacements_of_phase(
                parameters, phases[p], rotations, since_release[first:last], out[:, first:last]
            )
        first = last
    return out


@compiled
def _displacements_of_phase(
    parameters: Floats, phase: Floats, rotations: tuple[Floats, Floats], times: Floats, out: Floats
) -> None:
    sign, position, velocity = phase[SIGN], phase[TABLE], phase[VELOCITY]
    damping, frequency, load, drive = oscillation(parameters, sign)
    cosine, sine, _, _ = amplitudes(damping, frequency, position - load, velocity)
    rotation = rotations[1] if sign == 0.0 else rotations[0]
    table, relative = out[0], out[1]
    taus = times - phase[START]
    _fill(table, taus, rotation, damping, frequency, load, cosine, sine)
    if sign == 0.0:
        relative[:] = phase[RELATIVE]
        return
    for k in range(len(taus)):
        slipped = (velocity + 0.5 * drive * taus[k]) * taus[k] - (table[k] - position)
        relative[k] = phase[RELATIVE] + slipped


@compiled
def sample_rates(parameters: Floats, phases: Floats, times: Floats) -> Floats:
    """Velocity and acceleration of the table, then of the plate, at sorted `times`, shape (4, n)."""
    n = len(times)
    out = np.empty((4, n))
    rotations = _rotations(parameters, even_step(times))
    since_release = times - parameters[RELEASE]
    first = _place(since_release, 0.0)
    out[:, :first] = 0.0
    for p in range(len(phases)):
        last = _place(since_release, phases[p + 1, START]) if p + 1 < len(phases) else n
        if last > first:
            _rates_of_phase(parameters, phases[p], rotations, since_release[first:last], out[:, first:last])
        first = last
    return out


@compiled
def _rates_of_phase(
    parameters: Floats, phase: Floats, rotations: tuple[Floats, Floats], times: Floats, out: Floats
) -> None:
    sign, position, velocity = phase[SIGN], phase[TABLE], phase[VELOCITY]
    damping, frequency, load, drive = oscillation(parameters, sign)
    _, _, cosine, sine = amplitudes(damping, frequency, position - load, velocity)
    second_cosine, second_sine = derivative(damping, frequency, cosine, sine)
    rotation = rotations[1] if sign == 0.0 else rotations[0]
    taus = times - phase[START]
    _fill(out[0], taus, rotation, damping, frequency, 0.0, cosine, sine)
    _fill(out[1], taus, rotation, damping, frequency, 0.0, second_cosine, second_sine)
    if sign == 0.0:
        out[2:] = out[:2]
        return
    for k in range(len(taus)):
        out[2, k] = velocity + drive * taus[k]
    out[3] = drive
