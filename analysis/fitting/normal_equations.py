"""Compiled Gauss-Newton form of chi-square for laws without Stribeck friction, summed phase by phase.

Within a phase both displacements, and their derivatives by every parameter, are combinations of the same
few functions: 1, e^(-n tau) cos w tau, e^(-n tau) sin w tau, tau times either, tau and tau^2. So it is enough
to sum the products of these, and of the residual, over the readings of a phase (its moments), and to
combine the sums; no derivative of any single reading is ever worked out. Call::

    system = gauge_system(point, free, phases, rows, times, values, which, noise)

point : (16,) float64, by `models.Place`
free : (k,) int64, the free places, rising
phases, rows : (m, 5) and (q, m, 10) float64, from `walk` and `phase_responses` along the q directions of
    those free places that move the motion
times, values : (n,) float64, readings; noise : their standard deviation (m)
which : 0 for gauge 1, 1 for gauge 2 against the table, 2 for gauge 2 against the base
system : (k + 1, k + 1), the normal matrix, the descent as last column and the cost in the corner
"""

import numpy as np

from analysis.arrays import Floats, Indices
from analysis.compiled import compiled, compiled_part, compiled_sum
from analysis.fitting.gauge_motion import (
    BASIS_SIZE,
    CONSTANT,
    COS,
    ONE,
    RESIDUAL,
    SIN,
    TAU,
    TAU_2,
    TAU_COS,
    TAU_SIN,
    basis_size,
    displacement_coefficients,
    gauge_response,
)
from analysis.fitting.models import MOTION_PARAMETER_COUNT, Parameter
from analysis.motion.events import PULLBACK, RELEASE, SIGN, START
from analysis.motion.sampling import BLOCK, block_basis, first_at, rotation_tables

_MOTION = MOTION_PARAMETER_COUNT
_TABLE_OFFSET, _RELATIVE_OFFSET = int(Parameter.TABLE_OFFSET), int(Parameter.RELATIVE_OFFSET)
_TABLE_GAIN, _RELATIVE_GAIN, _LAG = (
    int(Parameter.TABLE_GAIN),
    int(Parameter.RELATIVE_GAIN),
    int(Parameter.LAG),
)


@compiled
def gauge_normal_equations(
    point: Floats,
    free: Indices,
    phases: Floats,
    rows: Floats,
    times: Floats,
    values: Floats,
    which: int,
    noise: float,
) -> Floats:
    """Gauss-Newton form of one gauge's chi-square at `point`; see the head of this module."""
    parameters, (offset, gain, late) = point[:_MOTION].copy(), gauge_response(point, which)
    parameters[RELEASE] += late
    system, mixed = np.zeros((len(free) + 1, len(free) + 1)), np.empty(len(free) + 1)
    motion, slopes = np.zeros(BASIS_SIZE), np.zeros((BASIS_SIZE, len(system)))
    slopes[RESIDUAL, len(free)] = 1.0
    moments, block = np.zeros((BASIS_SIZE, BASIS_SIZE)), np.empty((BASIS_SIZE, BLOCK))
    tables, last = rotation_tables(parameters, times), first_at(times, parameters[RELEASE])
    _held_slopes(motion, slopes, parameters, rows, which)
    _other_slopes(slopes, motion, free, len(rows), which, gain)
    _add_still(moments, block, values[:last], offset + gain * motion[ONE])
    _combine(system, slopes, moments, mixed, CONSTANT)
    for p in range(len(phases)):
        first, last = last, len(times)
        if p + 1 < len(phases):
            last = first_at(times, phases[p + 1, START] + parameters[RELEASE])
        if first == last:
            continue
        phase, needed = phases[p], basis_size(phases[p, SIGN], which)
        _phase_slopes(motion, slopes, parameters, phase, rows, p, which)
        _other_slopes(slopes, motion, free, len(rows), which, gain)
        if needed == CONSTANT:
            _add_still(moments, block, values[first:last], offset + gain * motion[ONE])
        else:
            at, read = times[first:last], values[first:last]
            _add_moving(moments, block, parameters, phase, at, read, tables, motion, offset, gain, needed)
        _combine(system, slopes, moments, mixed, needed)
    return system / noise**2


@compiled_part
def _held_slopes(motion: Floats, slopes: Floats, parameters: Floats, rows: Floats, which: int) -> None:
    """Before release the table stands at the pullback, and the plate on it."""
    swings = 0.0 if which == 1 else 1.0
    motion[ONE] = swings * parameters[PULLBACK]
    for d in range(len(rows)):
        slopes[ONE, d] = swings * rows[d, 0, 0]


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
    swings, plate, slips = displacement_coefficients(parameters, phase, which, motion)
    for d in range(len(rows)):
        row = rows[d, p]
        slopes[ONE, d] = swings * row[4] + plate * row[3] + slips * row[0]
        slopes[COS, d], slopes[SIN, d] = swings * row[6], swings * row[7]
        slopes[TAU_COS, d], slopes[TAU_SIN, d] = swings * row[8], swings * row[9]
        slopes[TAU, d], slopes[TAU_2, d] = slips * row[2], slips * 0.5 * row[5]


@compiled_part
def _other_slopes(
    slopes: Floats, motion: Floats, free: Indices, moving: int, which: int, gain: float
) -> None:
    """Scale the derivatives of the motion to readings, and add those by offset, gain and lag."""
    own_offset, own_gain = _TABLE_OFFSET, _TABLE_GAIN
    if which > 0:
        own_offset, own_gain = _RELATIVE_OFFSET, _RELATIVE_GAIN
    later = 0
    for d in range(moving):
        if free[d] == RELEASE:
            later = d
    for k in range(ONE, BASIS_SIZE):
        row = slopes[k]
        for d in range(moving):
            row[d] *= gain
        for d in range(moving, len(free)):
            row[d] = 0.0
            if free[d] == own_gain:
                row[d] = motion[k]
            elif free[d] == own_offset and k == ONE:
                row[d] = 1.0
            elif free[d] == _LAG and which > 0:
                row[d] = row[later]


@compiled_part
def _add_still(moments: Floats, block: Floats, values: Floats, level: float) -> None:
    """Add the moments of readings of a gauge that stands still."""
    for first in range(0, len(values), BLOCK):
        count = min(BLOCK, len(values) - first)
        for k in range(count):
            block[ONE, k], block[RESIDUAL, k] = 1.0, values[first + k] - level
        _sum_products(block, count, moments, CONSTANT)


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
        block_basis(parameters, phase, at, tables, block[COS : SIN + 1])
        for k in range(count):
            tau, cosine, sine = at[k] - start, block[COS, k], block[SIN, k]
            block[ONE, k], block[TAU_COS, k], block[TAU_SIN, k] = 1.0, tau * cosine, tau * sine
            block[TAU, k], block[TAU_2, k] = tau, tau * tau
            moved = motion[ONE] + (motion[COS] * cosine + motion[SIN] * sine)
            moved += (motion[TAU] + motion[TAU_2] * tau) * tau
            block[RESIDUAL, k] = values[first + k] - offset - gain * moved
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
