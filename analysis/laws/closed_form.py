"""Compiled chi-square and its Gauss-Newton form for motions in closed form.

Within a phase both displacements are combinations of 1, C = e^(-n tau) cos w tau, S = e^(-n tau) sin w tau,
tau and tau^2; their derivatives by every parameter are combinations of these, tau C and tau S. So the normal
matrix of a phase follows from the sums of the products of these functions and of the residual over its
readings (the moments): the derivative at a single reading is never computed.

A gauge is a tuple (times (n,), values (n,) in m, which, noise in m); `which` is GAUGE_1, GAUGE_2 (against the
table) or GAUGE_2_BASE (against the base). Points are parameter vectors by `Parameter`.
"""

import numpy as np

from analysis.arrays import Floats, Indices
from analysis.compiled import compiled, compiled_part, compiled_sum
from analysis.laws.parameters import MOTION_PARAMETER_COUNT, Parameter
from analysis.motion import events, sampling
from analysis.motion.events import DURATION_MIN_S, PULLBACK, RELATIVE, RELEASE, SIGN, START, TABLE, VELOCITY
from analysis.motion.sampling import BLOCK

GAUGE_1, GAUGE_2, GAUGE_2_BASE = 0, 1, 2
_MOTION = MOTION_PARAMETER_COUNT
# Rows of moments: the residual, and the functions whose combinations all displacements are.
RESIDUAL, ONE, COS, SIN, TAU_COS, TAU_SIN, TAU, TAU_2 = range(8)
BASIS_SIZE = 8
# How many of them it takes where nothing moves, where the displacement oscillates, and where the plate slips.
CONSTANT, OSCILLATION, SLIP = 2, 6, 8

_TABLE_OFFSET, _TABLE_GAIN = int(Parameter.TABLE_OFFSET), int(Parameter.TABLE_GAIN)
_RELATIVE_OFFSET, _RELATIVE_GAIN = int(Parameter.RELATIVE_OFFSET), int(Parameter.RELATIVE_GAIN)
_LAG = int(Parameter.LAG)


@compiled_part
def gauge_response(point: Floats, which: int) -> tuple[float, float, float]:
    """Zero (m), gain and lateness (s) of a gauge at a point of the fit."""
    if which == 0:
        return point[_TABLE_OFFSET], 1.0 + point[_TABLE_GAIN], 0.0
    return point[_RELATIVE_OFFSET], 1.0 + point[_RELATIVE_GAIN], point[_LAG]


@compiled_part
def basis_size(sign: float, which: int) -> int:
    """How many of the functions a gauge takes in a phase with this sign."""
    if sign == 0.0:
        return CONSTANT if which == 1 else OSCILLATION
    return OSCILLATION if which == 0 else SLIP


@compiled_part
def displacement_coefficients(
    parameters: Floats, phase: Floats, which: int, motion: Floats
) -> tuple[float, float, float]:
    """Write the coefficients of the displacement in a phase into `motion` (8,).

    Returns the share of u1 in it but for that of u2 where the plate slips, then 1 where u2 - u1 is in it, and
    1 where that slips.
    """
    sign, position, velocity = phase[SIGN], phase[TABLE], phase[VELOCITY]
    damping, frequency, load, drive = events.oscillator(parameters, sign)
    cosine, sine, _, _ = events.oscillation_amplitudes(damping, frequency, position - load, velocity)
    plate = 0.0 if which == 0 else 1.0
    slips = plate if sign != 0.0 else 0.0
    oscillates = (1.0 if which != 1 else 0.0) - slips  # the displacement of a slipping plate does not
    motion[ONE] = oscillates * load + plate * phase[RELATIVE] + slips * position
    motion[COS], motion[SIN] = oscillates * cosine, oscillates * sine
    motion[TAU], motion[TAU_2] = slips * velocity, slips * 0.5 * drive
    return oscillates, plate, slips


GaugeReadings = tuple[Floats, Floats, Floats, Floats, Floats, int]


@compiled
def chi_squares(points: Floats, readings: GaugeReadings) -> Floats:
    """Chi-square of each of the points (m, p), shape (m,), for laws in closed form."""
    result = np.empty(len(points))
    for k in range(len(points)):
        sums = _sums(points[k], readings)
        result[k] = sums[0, 1] + sums[1, 1]
    return result


@compiled
def chi_squares_with_fitted_zero(points: Floats, readings: GaugeReadings) -> Floats:
    """Chi-square of each of the points (m, p) with gauge 2's zero at its best, shape (m,)."""
    result = np.empty(len(points))
    for k in range(len(points)):
        sums = _sums(points[k], readings)
        result[k] = sums[0, 1] + sums[1, 1] - sums[1, 0] ** 2 / max(1, len(readings[3]))
    return result


@compiled
def _sums(point: Floats, readings: GaugeReadings) -> Floats:
    """Sum and sum of squares of each gauge's residuals over its noise, (2, 2)."""
    table_time, table, relative_time, relative, noise, which = readings
    parameters, result = point[:_MOTION].copy(), np.zeros((2, 2))
    end = max(table_time[-1], relative_time[-1]) if len(relative) > 0 else table_time[-1]
    phases = events.integrate_events(parameters, max(DURATION_MIN_S, end - point[RELEASE]))
    _add_residuals(point, phases, table_time, table / noise[0], 0, noise[0], result[0])
    if len(relative) > 0:
        _add_residuals(point, phases, relative_time, relative / noise[1], which, noise[1], result[1])
    return result


@compiled
def _add_residuals(
    point: Floats, phases: Floats, times: Floats, values: Floats, which: int, noise: float, sums: Floats
) -> None:
    """Add the residuals of one gauge, whose `values` are in units of its noise, and their squares."""
    parameters, (offset, gain, late) = point[:_MOTION].copy(), gauge_response(point, which)
    parameters[RELEASE] += late
    offset, gain = offset / noise, gain / noise
    motion, basis = np.zeros(BASIS_SIZE), np.empty((2, BLOCK))
    tables, last = sampling.rotation_tables(parameters, times), sampling.first_at(times, parameters[RELEASE])
    held = 0.0 if which == 1 else gain * parameters[PULLBACK]
    _sum_still(values[:last], offset + held, sums)
    for p in range(len(phases)):
        first, last, start = last, len(times), phases[p, START] + parameters[RELEASE]
        if p + 1 < len(phases):
            last = sampling.first_at(times, phases[p + 1, START] + parameters[RELEASE])
        if first == last:
            continue
        displacement_coefficients(parameters, phases[p], which, motion)
        if basis_size(phases[p, SIGN], which) == CONSTANT:
            _sum_still(values[first:last], offset + gain * motion[ONE], sums)
            continue
        for begin in range(first, last, BLOCK):
            at, read = times[begin : min(begin + BLOCK, last)], values[begin : min(begin + BLOCK, last)]
            sampling.block_basis(parameters, phases[p], at, tables, basis)
            _sum_moving(read, at, start, motion, basis, offset, gain, sums)


@compiled_sum
def _sum_still(values: Floats, level: float, sums: Floats) -> None:
    total, squares = 0.0, 0.0
    for k in range(len(values)):
        residual = values[k] - level
        total += residual
        squares += residual * residual
    sums[0] += total
    sums[1] += squares


@compiled_sum
def _sum_moving(
    values: Floats,
    times: Floats,
    start: float,
    motion: Floats,
    basis: Floats,
    offset: float,
    gain: float,
    sums: Floats,
) -> None:
    total, squares = 0.0, 0.0
    for k in range(len(values)):
        tau = times[k] - start
        moved = motion[ONE] + (motion[COS] * basis[0, k] + motion[SIN] * basis[1, k])
        moved += (motion[TAU] + motion[TAU_2] * tau) * tau
        residual = values[k] - offset - gain * moved
        total += residual
        squares += residual * residual
    sums[0] += total
    sums[1] += squares


@compiled
def quadratic_model(
    point: Floats, free: Indices, directions: Floats, readings: GaugeReadings, mean: Floats, weight: Floats
) -> tuple[float, Floats, Floats]:
    """Chi-square at `point` with its descent (k,) and normal matrix (k, k) over the `free` places (k,).

    `directions` (q, 10) are how the first q of them, which move the motion, move its parameters. `mean` and
    `weight` (k,) are what is known of the places beforehand: values, and inverse variances.
    """
    table_time, table, relative_time, relative, noise, which = readings
    parameters, last = point[:_MOTION].copy(), len(free)
    end = max(table_time[-1], relative_time[-1]) if len(relative) > 0 else table_time[-1]
    phases = events.integrate_events(parameters, max(DURATION_MIN_S, end - point[RELEASE]))
    rows = sampling.phase_responses(parameters, phases, directions)
    system = gauge_normal_equations(point, free, phases, rows, table_time, table, 0, noise[0])
    if len(relative) > 0:
        system += gauge_normal_equations(point, free, phases, rows, relative_time, relative, which, noise[1])
    cost, descent, normal = system[last, last], system[:last, last].copy(), system[:last, :last].copy()
    for k in range(last):
        away = mean[k] - point[free[k]]
        cost += weight[k] * away * away
        descent[k] += weight[k] * away
        normal[k, k] += weight[k]
    return cost, descent, normal


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
    tables, last = sampling.rotation_tables(parameters, times), sampling.first_at(times, parameters[RELEASE])
    _held_slopes(motion, slopes, parameters, rows, which)
    _other_slopes(slopes, motion, free, len(rows), which, gain)
    _add_still(moments, block, values[:last], offset + gain * motion[ONE])
    combine(system, slopes, moments, mixed, CONSTANT)
    for p in range(len(phases)):
        first, last = last, len(times)
        if p + 1 < len(phases):
            last = sampling.first_at(times, phases[p + 1, START] + parameters[RELEASE])
        if first == last:
            continue
        phase, needed = phases[p], basis_size(phases[p, SIGN], which)
        _phase_slopes(motion, slopes, parameters, phase, rows, p, which)
        _other_slopes(slopes, motion, free, len(rows), which, gain)
        if needed == CONSTANT:
            _add_still(moments, block, values[first:last], offset + gain * motion[ONE])
        else:
            within = times[first:last], values[first:last], tables
            _add_moving(moments, block, parameters, phase, within, motion, (offset, gain), needed)
        combine(system, slopes, moments, mixed, needed)
    return system / noise**2


@compiled_part
def _held_slopes(motion: Floats, slopes: Floats, parameters: Floats, rows: Floats, which: int) -> None:
    """Before release the table stands at the pullback, and the plate on it."""
    oscillates = 0.0 if which == 1 else 1.0
    motion[ONE] = oscillates * parameters[PULLBACK]
    for d in range(len(rows)):
        slopes[ONE, d] = oscillates * rows[d, 0, 0]


@compiled_part
def _phase_slopes(
    motion: Floats, slopes: Floats, parameters: Floats, phase: Floats, rows: Floats, p: int, which: int
) -> None:
    """Write the coefficients of the gauge's displacement in a phase, and of its derivatives."""
    oscillates, plate, slips = displacement_coefficients(parameters, phase, which, motion)
    for d in range(len(rows)):
        row = rows[d, p]
        slopes[ONE, d] = oscillates * row[4] + plate * row[3] + slips * row[0]
        slopes[COS, d], slopes[SIN, d] = oscillates * row[6], oscillates * row[7]
        slopes[TAU_COS, d], slopes[TAU_SIN, d] = oscillates * row[8], oscillates * row[9]
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
        sum_products(block, count, moments, CONSTANT)


@compiled_part
def _add_moving(
    moments: Floats,
    block: Floats,
    parameters: Floats,
    phase: Floats,
    readings: tuple[Floats, Floats, Floats],
    motion: Floats,
    response: tuple[float, float],
    needed: int,
) -> None:
    """Add the moments of readings within a phase: times, values, and the rotation tables of the times."""
    (times, values, tables), (offset, gain) = readings, response
    start = phase[START] + parameters[RELEASE]
    for first in range(0, len(times), BLOCK):
        count = min(BLOCK, len(times) - first)
        at = times[first : first + count]
        sampling.block_basis(parameters, phase, at, tables, block[COS : SIN + 1])
        for k in range(count):
            tau, cosine, sine = at[k] - start, block[COS, k], block[SIN, k]
            block[ONE, k], block[TAU_COS, k], block[TAU_SIN, k] = 1.0, tau * cosine, tau * sine
            block[TAU, k], block[TAU_2, k] = tau, tau * tau
            moved = motion[ONE] + (motion[COS] * cosine + motion[SIN] * sine)
            moved += (motion[TAU] + motion[TAU_2] * tau) * tau
            block[RESIDUAL, k] = values[first + k] - offset - gain * moved
        sum_products(block, count, moments, needed)


@compiled_sum
def sum_products(block: Floats, count: int, moments: Floats, needed: int) -> None:
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
def combine(system: Floats, slopes: Floats, moments: Floats, mixed: Floats, needed: int) -> None:
    """Add the lower triangle of slopes^T moments slopes, the part of a phase, and clear the moments."""
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
            if factor != 0.0:
                for e in range(len(mixed)):
                    row[e] += factor * mixed[e]
