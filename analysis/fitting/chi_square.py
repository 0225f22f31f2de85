"""Compiled chi-square of a motion against the readings of both gauges.

For Stribeck friction also its Gauss-Newton form from sampled derivatives (`table_system`, `relative_system`);
for the other laws that is in `analysis.fitting.normal_equations`.

Everything that a search evaluates thousands of times: no array outlives a call, no Python in between.
`Readings` stands for the tuple (table_time, table_m, relative_time, relative_m, noise, which) with

noise : (2,) float64, standard deviation of either channel
which : int, gauge 2 is against the table (1) or against the base (2), see `analysis.fitting.gauge_motion`

Without gauge 2 its arrays are empty. Points are parameter vectors by `models.Place`.
"""

import numpy as np

from analysis.arrays import Floats, Indices
from analysis.compiled import compiled, compiled_sum
from analysis.fitting.gauge_motion import (
    BASIS_SIZE,
    CONSTANT,
    COS,
    ONE,
    SIN,
    TAU,
    TAU_2,
    basis_size,
    displacement_coefficients,
    gauge_response,
)
from analysis.fitting.models import MOTION_PARAMETER_COUNT, Parameter
from analysis.motion.events import DURATION_MIN_S, PULLBACK, SIGN, START, integrate_events
from analysis.motion.sampling import BLOCK, block_basis, first_at, rotation_tables

GaugeReadings = tuple[Floats, Floats, Floats, Floats, Floats, int]

_MOTION = MOTION_PARAMETER_COUNT
_RELEASE = int(Parameter.RELEASE)
_TABLE_OFFSET, _RELATIVE_OFFSET = int(Parameter.TABLE_OFFSET), int(Parameter.RELATIVE_OFFSET)
_TABLE_GAIN, _RELATIVE_GAIN, _LAG = (
    int(Parameter.TABLE_GAIN),
    int(Parameter.RELATIVE_GAIN),
    int(Parameter.LAG),
)


@compiled
def chi_squares(points: Floats, readings: GaugeReadings) -> Floats:
    """Chi-square of each of the points (m, 16), shape (m,), for laws without Stribeck friction."""
    result = np.empty(len(points))
    for k in range(len(points)):
        sums = _sums(points[k], readings)
        result[k] = sums[0, 1] + sums[1, 1]
    return result


@compiled
def chi_squares_with_fitted_zero(points: Floats, readings: GaugeReadings) -> Floats:
    """Chi-square of each of the points (m, 16) with gauge 2's zero at its best, shape (m,)."""
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
    phases = integrate_events(parameters, max(DURATION_MIN_S, end - point[_RELEASE]))
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
    parameters[_RELEASE] += late
    offset, gain = offset / noise, gain / noise
    motion, basis, tables = np.zeros(BASIS_SIZE), np.empty((2, BLOCK)), rotation_tables(parameters, times)
    last = first_at(times, parameters[_RELEASE])
    held = 0.0 if which == 1 else gain * parameters[PULLBACK]
    _add_still(values[:last], offset + held, sums)
    for p in range(len(phases)):
        first, last, start = last, len(times), phases[p, START] + parameters[_RELEASE]
        if p + 1 < len(phases):
            last = first_at(times, phases[p + 1, START] + parameters[_RELEASE])
        if first == last:
            continue
        displacement_coefficients(parameters, phases[p], which, motion)
        if basis_size(phases[p, SIGN], which) == CONSTANT:
            _add_still(values[first:last], offset + gain * motion[ONE], sums)
            continue
        for begin in range(first, last, BLOCK):
            at, read = times[begin : min(begin + BLOCK, last)], values[begin : min(begin + BLOCK, last)]
            block_basis(parameters, phases[p], at, tables, basis)
            _add_moving(read, at, start, motion, basis, offset, gain, sums)


@compiled_sum
def _add_still(values: Floats, level: float, sums: Floats) -> None:
    total, squares = 0.0, 0.0
    for k in range(len(values)):
        residual = values[k] - level
        total += residual
        squares += residual * residual
    sums[0] += total
    sums[1] += squares


@compiled_sum
def _add_moving(
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
def table_normal_equations(
    motion: Floats, slopes: Floats, point: Floats, extra: Indices, readings: Floats, noise: float
) -> Floats:
    """X X^T of gauge 1: the rows of X are the derivatives and, last, the residual, over the noise.

    Parameters
    ----------
    motion, slopes : (2, n) and (q, 2, n) float64
        u1 and u2 - u1, and their derivatives by the q free parameters of the motion.
    extra : (e,) int64
        Free places from TABLE_OFFSET on, rising.

    Returns
    -------
    (q + e + 1, q + e + 1) float64
        The first q + e rows and columns are the normal matrix, the last column the descent, the corner
        the cost.
    """
    weight, gain = 1.0 / noise, 1.0 + point[_TABLE_GAIN]
    rows = np.zeros((len(slopes) + len(extra) + 1, len(readings)))
    for k in range(len(slopes)):
        for j in range(len(readings)):
            rows[k, j] = weight * gain * slopes[k, 0, j]
    for k in range(len(extra)):
        row = rows[len(slopes) + k]
        for j in range(len(readings)):
            if extra[k] == _TABLE_OFFSET:
                row[j] = weight
            elif extra[k] == _TABLE_GAIN:
                row[j] = weight * motion[0, j]
    last = rows[len(rows) - 1]
    for j in range(len(readings)):
        last[j] = weight * (readings[j] - point[_TABLE_OFFSET] - gain * motion[0, j])
    system: Floats = np.dot(rows, rows.T)
    return system


@compiled
def relative_normal_equations(
    motion: Floats,
    slopes: Floats,
    later: int,
    point: Floats,
    extra: Indices,
    readings: Floats,
    noise: float,
    absolute: float,
) -> Floats:
    """The same of gauge 2; `later` is the row of the release in `slopes`, for a lag is a later release.

    `absolute` is 1 where gauge 2 reads against the base, else 0.
    """
    weight, gain = 1.0 / noise, 1.0 + point[_RELATIVE_GAIN]
    rows = np.zeros((len(slopes) + len(extra) + 1, len(readings)))
    for k in range(len(slopes)):
        for j in range(len(readings)):
            rows[k, j] = weight * gain * (slopes[k, 1, j] + absolute * slopes[k, 0, j])
    last = rows[len(rows) - 1]
    for j in range(len(readings)):
        moved = motion[1, j] + absolute * motion[0, j] + point[_LAG] * rows[later, j] / (weight * gain)
        last[j] = weight * (readings[j] - point[_RELATIVE_OFFSET] - gain * moved)
        for k in range(len(extra)):
            if extra[k] == _RELATIVE_OFFSET:
                rows[len(slopes) + k, j] = weight
            elif extra[k] == _RELATIVE_GAIN:
                rows[len(slopes) + k, j] = weight * moved
            elif extra[k] == _LAG:
                rows[len(slopes) + k, j] = rows[later, j]
    system: Floats = np.dot(rows, rows.T)
    return system
