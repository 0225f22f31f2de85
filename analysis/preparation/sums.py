"""Compiled sums over readings: about each time, of waves, of a damped cosine, and over neighbours.

Times (n,) rise and are in s, readings (n,) in m; both are float64.
"""

import math

import numpy as np

from analysis.arrays import Floats
from analysis.compiled import compiled, compiled_sum
from analysis.laws.closed_form import (
    BASIS_SIZE,
    COS,
    ONE,
    OSCILLATION,
    RESIDUAL,
    SIN,
    TAU_COS,
    TAU_SIN,
    combine,
    sum_products,
)
from analysis.motion.sampling import BLOCK, rotating_basis

_FRESH = 4096
"""Readings after which running sums are made anew, so that their rounding errors stay those of few terms."""


@compiled
def window_means(times: Floats, values: Floats, half_s: float) -> Floats:
    """Mean of the readings within `half_s` of each, (n,)."""
    means = np.empty(len(times))
    low, high, total = 0, 0, 0.0
    for k in range(len(times)):
        while times[low] < times[k] - half_s:
            total -= values[low]
            low += 1
        while high < len(times) and times[high] <= times[k] + half_s:
            total += values[high]
            high += 1
        if k % _FRESH == 0:
            total = 0.0
            for j in range(low, high):
                total += values[j]
        means[k] = total / (high - low)
    return means


@compiled
def window_slopes(times: Floats, values: Floats, half_s: float) -> Floats:
    """Slope of the line through the readings within `half_s` of each, and two to each side at least, (n,)."""
    slopes = np.zeros(len(times))
    count = len(times)
    first, past = 0, 0  # of the readings that are in the sums
    low, high = 0, 0  # of those within half_s
    origin, sum_t, sum_x, sum_tt, sum_tx = 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(count):
        since_s = times[k] - times[0]
        while times[low] - times[0] < since_s - half_s:
            low += 1
        while high < count and times[high] - times[0] <= since_s + half_s:
            high += 1
        begin, end = min(low, max(k - 2, 0)), max(high, min(k + 3, count))
        if k % _FRESH == 0:
            first, past, origin = begin, begin, times[k]
            sum_t, sum_x, sum_tt, sum_tx = 0.0, 0.0, 0.0, 0.0
        while past < end:
            t, x = times[past] - origin, values[past]
            sum_t, sum_x, sum_tt, sum_tx = sum_t + t, sum_x + x, sum_tt + t * t, sum_tx + t * x
            past += 1
        while first < begin:
            t, x = times[first] - origin, values[first]
            sum_t, sum_x, sum_tt, sum_tx = sum_t - t, sum_x - x, sum_tt - t * t, sum_tx - t * x
            first += 1
        spread = sum_tt - sum_t * sum_t / (end - begin)
        if spread > 0.0:
            slopes[k] = (sum_tx - sum_t * sum_x / (end - begin)) / spread
    return slopes


@compiled
def swing_equations(parameters: Floats, taus: Floats, values: Floats) -> Floats:
    """Normal matrix of a damped cosine over its parameters (5,), descent and sum of squares, (6, 6).

    Parameters are those of `oscillation.DampedCosine`; descent is the last column, the sum its corner.
    """
    damping, frequency, cosine, sine, offset = parameters
    slopes, moments = np.zeros((BASIS_SIZE, 6)), np.zeros((BASIS_SIZE, BASIS_SIZE))
    slopes[TAU_COS, 0], slopes[TAU_SIN, 0] = -cosine, -sine
    slopes[TAU_COS, 1], slopes[TAU_SIN, 1] = sine, -cosine
    slopes[COS, 2] = slopes[SIN, 3] = slopes[ONE, 4] = slopes[RESIDUAL, 5] = 1.0
    block = np.empty((BASIS_SIZE, BLOCK))
    for first in range(0, len(taus), BLOCK):
        count = min(BLOCK, len(taus) - first)
        at = taus[first : first + count]
        rotating_basis(damping, frequency, 0.0, at, block[COS], block[SIN])
        for k in range(count):
            block[ONE, k], block[TAU_COS, k], block[TAU_SIN, k] = (
                1.0,
                at[k] * block[COS, k],
                at[k] * block[SIN, k],
            )
            swing = cosine * block[COS, k] + sine * block[SIN, k]
            block[RESIDUAL, k] = values[first + k] - offset - swing
        sum_products(block, count, moments, OSCILLATION)
    system = np.zeros((6, 6))
    combine(system, slopes, moments, np.empty(6), OSCILLATION)
    return system


@compiled
def swing_residual(parameters: Floats, taus: Floats, values: Floats) -> Floats:
    """Readings minus a damped cosine (m), (n,)."""
    damping, frequency, cosine, sine, offset = parameters
    left, cosines, sines = np.empty(len(taus)), np.empty(BLOCK), np.empty(BLOCK)
    for first in range(0, len(taus), BLOCK):
        at = taus[first : first + BLOCK]
        rotating_basis(damping, frequency, 0.0, at, cosines, sines)
        for k in range(len(at)):
            left[first + k] = values[first + k] - offset - (cosine * cosines[k] + sine * sines[k])
    return left


@compiled
def wave_amplitudes(times: Floats, values: Floats, frequencies_hz: Floats) -> Floats:
    """Amplitude (m) of each frequency (f,) in the readings, (f,)."""
    found, cosines, sines = np.empty(len(frequencies_hz)), np.empty(len(times)), np.empty(len(times))
    for f in range(len(frequencies_hz)):
        rotating_basis(0.0, 2.0 * math.pi * frequencies_hz[f], times[0], times, cosines, sines)
        found[f] = 2.0 / len(times) * math.hypot(_product(cosines, values), _product(sines, values))
    return found


@compiled_sum
def _product(left: Floats, right: Floats) -> float:
    total = 0.0
    for k in range(len(left)):
        total += left[k] * right[k]
    return total


@compiled
def median_of_five(values: Floats) -> Floats:
    """Median of each reading and two on each side, the first and last repeated beyond the ends, (n,)."""
    medians = np.empty(len(values))
    last = len(values) - 1
    for k in range(len(values)):
        a, b = values[max(k - 2, 0)], values[max(k - 1, 0)]
        d, e = values[min(k + 1, last)], values[min(k + 2, last)]
        low = max(min(a, b), min(d, e))
        high = min(max(a, b), max(d, e))  # the median is that of `low`, `high` and the reading
        medians[k] = max(min(low, high), min(max(low, high), values[k]))
    return medians


@compiled
def widest_intervals(times: Floats) -> Floats:
    """Widest interval among two neighbours on each side (s), (n,); infinite for two readings at each end."""
    widest_s = np.full(len(times), np.inf)
    for k in range(2, len(times) - 2):
        widest = 0.0
        for j in range(k - 2, k + 2):
            widest = max(widest, times[j + 1] - times[j])
        widest_s[k] = widest
    return widest_s


_EVEN = 35.0 / 18.0  # 1 + sum of squared weights of the cubic at even times


@compiled
def off_cubic(times: Floats, values: Floats) -> Floats:
    """Reading minus the cubic through its four neighbours, in the scale of even times; zero at the ends."""
    off = np.zeros(len(values))
    away = np.empty(4)
    for k in range(2, len(times) - 2):
        away[0], away[1] = times[k - 2] - times[k], times[k - 1] - times[k]
        away[2], away[3] = times[k + 1] - times[k], times[k + 2] - times[k]
        curve, squares = 0.0, 1.0
        for j in range(4):
            weight = 1.0
            for other in range(4):
                if other != j:
                    weight *= away[other] / (away[other] - away[j])
            curve += weight * values[k - 2 + j + (j > 1)]
            squares += weight * weight
        off[k] = (values[k] - curve) * math.sqrt(_EVEN / squares)
    return off
