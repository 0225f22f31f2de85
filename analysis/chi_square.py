"""Compiled chi-square of a motion against the readings of both gauges, with its Gauss-Newton form.

Everything that a search evaluates thousands of times: no array outlives a call, no Python in between.
`Readings` stands for the tuple (table_time, table_m, relative_time, relative_m, noise, options) with

noise : (2,) float64, standard deviation of either channel
options : (2,) int64, is gauge 2 against the base (1) or the table (0); are both gauges' times the same

Without gauge 2 its arrays are empty. Points are parameter vectors by `models.Place`.
"""

import numpy as np
from numpy.typing import NDArray

from analysis.compiled import compiled
from analysis.models import MOTION_PARAMETERS, Place
from analysis.motion.phases import walk
from analysis.motion.sampling import sample_displacements

Floats = NDArray[np.float64]
Places = NDArray[np.int64]
Readings = tuple[Floats, Floats, Floats, Floats, Floats, Places]

_MOTION = MOTION_PARAMETERS
_RELEASE = int(Place.RELEASE)
_TABLE_OFFSET, _RELATIVE_OFFSET = int(Place.TABLE_OFFSET), int(Place.RELATIVE_OFFSET)
_TABLE_GAIN, _RELATIVE_GAIN, _LAG = int(Place.TABLE_GAIN), int(Place.RELATIVE_GAIN), int(Place.LAG)
_SHORTEST_S = 1e-3


@compiled
def residuals(point: Floats, readings: Readings) -> tuple[Floats, Floats]:
    """Reading minus curve of each gauge, over its noise, for laws without Stribeck friction."""
    table_time, table, relative_time, relative, noise, options = readings
    parameters = point[:_MOTION].copy()
    end = max(table_time[-1], relative_time[-1]) if len(relative) > 0 else table_time[-1]
    phases = walk(parameters, max(_SHORTEST_S, end - point[_RELEASE]))
    motion = sample_displacements(parameters, phases, table_time)
    first = (table - point[_TABLE_OFFSET] - (1.0 + point[_TABLE_GAIN]) * motion[0]) / noise[0]
    if len(relative) == 0:
        return first, np.empty(0)
    if options[1] == 0 or point[_LAG] != 0.0:
        parameters[_RELEASE] += point[_LAG]
        motion = sample_displacements(parameters, phases, relative_time)
    moved = motion[1] + motion[0] if options[0] == 1 else motion[1]
    return first, (relative - point[_RELATIVE_OFFSET] - (1.0 + point[_RELATIVE_GAIN]) * moved) / noise[1]


@compiled
def costs(points: Floats, readings: Readings) -> Floats:
    """Chi-square of each of the points (m, 16), shape (m,), for laws without Stribeck friction."""
    result = np.empty(len(points))
    for k in range(len(points)):
        first, second = residuals(points[k], readings)
        result[k] = np.sum(first * first) + np.sum(second * second)
    return result


@compiled
def open_costs(points: Floats, readings: Readings) -> Floats:
    """Chi-square of each of the points (m, 16) with gauge 2's zero at its best, shape (m,)."""
    result = np.empty(len(points))
    for k in range(len(points)):
        first, second = residuals(points[k], readings)
        result[k] = np.sum(first * first)
        if len(second) > 0:
            result[k] += np.sum(second * second) - np.sum(second) ** 2 / len(second)
    return result


@compiled
def table_system(
    motion: Floats, slopes: Floats, point: Floats, extra: Places, readings: Floats, noise: float
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
def relative_system(
    motion: Floats,
    slopes: Floats,
    later: int,
    point: Floats,
    extra: Places,
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
