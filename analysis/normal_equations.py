"""Compiled Gauss-Newton form of chi-square for laws without Stribeck friction, summed phase by phase.

Within a phase both displacements, and their derivatives by every parameter, are combinations of the same
few functions: 1, e^(-n tau) cos w tau, e^(-n tau) sin w tau, tau times either, tau and tau^2. So it is enough
to sum the products of these, and of the residual, over the readings of a phase (its moments), and to
combine the sums; no derivative of any single reading is ever worked out.
"""

import numpy as np

from analysis.chi_square import Floats, Places
from analysis.compiled import compiled, compiled_part, compiled_sum
from analysis.models import MOTION_PARAMETERS, Place
from analysis.motion.phases import (
    PULLBACK,
    RELATIVE,
    RELEASE,
    SIGN,
    START,
    TABLE,
    VELOCITY,
    amplitudes,
    oscillation,
)
from analysis.motion.sampling import BLOCK, block_basis, first_at, rotation_tables

_MOTION = MOTION_PARAMETERS
_TABLE_OFFSET, _RELATIVE_OFFSET = int(Place.TABLE_OFFSET), int(Place.RELATIVE_OFFSET)
_TABLE_GAIN, _RELATIVE_GAIN, _LAG = int(Place.TABLE_GAIN), int(Place.RELATIVE_GAIN), int(Place.LAG)

# The residual, and the functions whose combinations all displacements are.
_RESIDUAL, _ONE, _COS, _SIN, _TAU_COS, _TAU_SIN, _TAU, _TAU_2 = range(8)
_FUNCTIONS = 8
# How many of them it takes where nothing moves, where the gauge swings, and where the plate slips.
_CONSTANT, _SWING, _SLIP = 2, 6, 8


@compiled
def gauge_system(
    point: Floats,
    free: Places,
    phases: Floats,
    rows: Floats,
    times: Floats,
    values: Floats,
    which: int,
    noise: float,
) -> Floats:
    """Gauss-Newton form of one gauge's chi-square at `point`.

    Parameters
    ----------
    point : (16,) float64
        By `models.Place`.
    free : (k,) int64
        Free places, rising.
    phases, rows : (m, 5) and (q, m, 10) float64
        From `walk` and `phase_responses` along the q directions of those that move the motion.
    times, values : (n,) float64
        Readings.
    which : int
        0 for gauge 1, 1 for gauge 2 against the table, 2 for gauge 2 against the base.
    noise : float
        Standard deviation of the readings (m).

    Returns
    -------
    (k + 1, k + 1) float64
        The first k rows and columns are the normal matrix, the last column the descent, the corner the cost.
    """
    parameters, offset, gain = point[:_MOTION].copy(), point[_TABLE_OFFSET], 1.0 + point[_TABLE_GAIN]
    if which > 0:
        offset, gain = point[_RELATIVE_OFFSET], 1.0 + point[_RELATIVE_GAIN]
        parameters[RELEASE] += point[_LAG]
    system, mixed = np.zeros((len(free) + 1, len(free) + 1)), np.empty(len(free) + 1)
    motion, slopes = np.zeros(_FUNCTIONS), np.zeros((_FUNCTIONS, len(system)))
    slopes[_RESIDUAL, len(free)] = 1.0
    moments, block = np.zeros((_FUNCTIONS, _FUNCTIONS)), np.empty((_FUNCTIONS, BLOCK))
    tables, last = rotation_tables(parameters, times), first_at(times, parameters[RELEASE])
    _held_slopes(motion, slopes, parameters, rows, which)
    _other_slopes(slopes, motion, free, len(rows), which, gain)
    _add_still(moments, block, values[:last], offset + gain * motion[_ONE])
    _combine(system, slopes, moments, mixed, _CONSTANT)
    for p in range(len(phases)):
        first, last = last, len(times)
        if p + 1 < len(phases):
            last = first_at(times, phases[p + 1, START] + parameters[RELEASE])
        if first == last:
            continue
        phase, needed = phases[p], _needed(phases[p, SIGN], which)
        _phase_slopes(motion, slopes, parameters, phase, rows, p, which)
        _other_slopes(slopes, motion, free, len(rows), which, gain)
        if needed == _CONSTANT:
            _add_still(moments, block, values[first:last], offset + gain * motion[_ONE])
        else:
            at, read = times[first:last], values[first:last]
            _add_moving(moments, block, parameters, phase, at, read, tables, motion, offset, gain, needed)
        _combine(system, slopes, moments, mixed, needed)
    return system / noise**2


@compiled_part
def _needed(sign: float, which: int) -> int:
    if sign == 0.0:
        return _CONSTANT if which == 1 else _SWING
    return _SWING if which == 0 else _SLIP


@compiled_part
def _held_slopes(motion: Floats, slopes: Floats, parameters: Floats, rows: Floats, which: int) -> None:
    """Before release the table stands at the pullback, and the plate on it."""
    swings = 0.0 if which == 1 else 1.0
    motion[_ONE] = swings * parameters[PULLBACK]
    for d in range(len(rows)):
        slopes[_ONE, d] = swings * rows[d, 0, 0]


@compiled_part
def _phase_slopes(
    motion: Floats,
    slopes: Floats,
    parameters: Floats,
    phase: Floats,
    rows: Floats,
    p: int,
    which: int,
) -> None:
    """Write the coefficients of the gauge's displacement in a phase, and of its derivatives."""
    sign, position, velocity = phase[SIGN], phase[TABLE], phase[VELOCITY]
    damping, frequency, load, drive = oscillation(parameters, sign)
    cosine, sine, _, _ = amplitudes(damping, frequency, position - load, velocity)
    plate = 0.0 if which == 0 else 1.0
    slips = plate if sign != 0.0 else 0.0
    swings = (1.0 if which != 1 else 0.0) - slips  # where the plate slips it does not swing
    motion[_ONE] = swings * load + plate * phase[RELATIVE] + slips * position
    motion[_COS], motion[_SIN] = swings * cosine, swings * sine
    motion[_TAU], motion[_TAU_2] = slips * velocity, slips * 0.5 * drive
    for d in range(len(rows)):
        row = rows[d, p]
        slopes[_ONE, d] = swings * row[4] + plate * row[3] + slips * row[0]
        slopes[_COS, d], slopes[_SIN, d] = swings * row[6], swings * row[7]
        slopes[_TAU_COS, d], slopes[_TAU_SIN, d] = swings * row[8], swings * row[9]
        slopes[_TAU, d], slopes[_TAU_2, d] = slips * row[2], slips * 0.5 * row[5]


@compiled_part
def _other_slopes(slopes: Floats, motion: Floats, free: Places, moving: int, which: int, gain: float) -> None:
    """Scale the derivatives of the motion to readings, and add those by offset, gain and lag."""
    own_offset, own_gain = _TABLE_OFFSET, _TABLE_GAIN
    if which > 0:
        own_offset, own_gain = _RELATIVE_OFFSET, _RELATIVE_GAIN
    later = 0
    for d in range(moving):
        if free[d] == RELEASE:
            later = d
    for k in range(_ONE, _FUNCTIONS):
        row = slopes[k]
        for d in range(moving):
            row[d] *= gain
        for d in range(moving, len(free)):
            row[d] = 0.0
            if free[d] == own_gain:
                row[d] = motion[k]
            elif free[d] == own_offset and k == _ONE:
                row[d] = 1.0
            elif free[d] == _LAG and which > 0:
                row[d] = row[later]


@compiled_part
def _add_still(moments: Floats, block: Floats, values: Floats, level: float) -> None:
    """Add the moments of readings of a gauge that stands still."""
    for first in range(0, len(values), BLOCK):
        count = min(BLOCK, len(values) - first)
        for k in range(count):
            block[_ONE, k], block[_RESIDUAL, k] = 1.0, values[first + k] - level
        _sum_products(block, count, moments, _CONSTANT)


@compiled_part
def _add_moving(
    moments: Floats,
    block: Floats,
    parameters: Floats,
    phase: Floats,
    times: Floats,
    values: Floats,
    tables: Floats,
    motion: Floats,
    offset: float,
    gain: float,
    needed: int,
) -> None:
    """Add the moments of readings within a phase."""
    start = phase[START] + parameters[RELEASE]
    for first in range(0, len(times), BLOCK):
        count = min(BLOCK, len(times) - first)
        at = times[first : first + count]
        block_basis(parameters, phase, at, tables, block[_COS : _SIN + 1])
        for k in range(count):
            tau, cosine, sine = at[k] - start, block[_COS, k], block[_SIN, k]
            block[_ONE, k], block[_TAU_COS, k], block[_TAU_SIN, k] = 1.0, tau * cosine, tau * sine
            block[_TAU, k], block[_TAU_2, k] = tau, tau * tau
            moved = motion[_ONE] + (motion[_COS] * cosine + motion[_SIN] * sine)
            moved += (motion[_TAU] + motion[_TAU_2] * tau) * tau
            block[_RESIDUAL, k] = values[first + k] - offset - gain * moved
        _sum_products(block, count, moments, needed)


@compiled_sum
def _sum_products(block: Floats, count: int, moments: Floats, needed: int) -> None:
    """Add the sums of products of the first `needed` functions over `count` readings."""
    for i in range(needed):
        for j in range(i + 1):
            left, right, total = block[i], block[j], 0.0
            for k in range(count):
                total += left[k] * right[k]
            moments[i, j] += total
            if i != j:
                moments[j, i] += total


@compiled_part
def _combine(system: Floats, slopes: Floats, moments: Floats, mixed: Floats, needed: int) -> None:
    """Add slopes^T moments slopes, the part of a phase, and clear the moments."""
    for i in range(needed):
        for e in range(len(mixed)):
            mixed[e] = 0.0
        for j in range(needed):
            moment, slope = moments[i, j], slopes[j]
            moments[i, j] = 0.0
            for e in range(len(mixed)):
                mixed[e] += moment * slope[e]
        for d in range(len(mixed)):
            factor, row = slopes[i, d], system[d]
            for e in range(len(mixed)):
                row[e] += factor * mixed[e]
