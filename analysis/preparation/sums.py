"""Compiled sums over readings: windows about each time, waves, a damped cosine, and the cubic of neighbours.

Times (n,) rise and are in s, readings (n,) in m; both are float64.
"""

import math

import numpy as np

from analysis.arrays import Floats, Indices
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


@compiled
def windows(times: Floats, half_s: float) -> tuple[Indices, Indices]:
    """First, and past the last, of the readings within `half_s` of each, (n,) and (n,)."""
    first, past = np.empty(len(times), np.int64), np.empty(len(times), np.int64)
    low, high = 0, 0
    for k in range(len(times)):
        while times[low] < times[k] - half_s:
            low += 1
        while high < len(times) and times[high] <= times[k] + half_s:
            high += 1
        first[k], past[k] = low, high
    return first, past


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
def cubic_weights(times: Floats) -> tuple[Floats, Floats]:
    """Weights (4, n) of four neighbours in the cubic through them, and the widest interval among them (s).

    Both are zero and infinite for the two readings at each end.
    """
    weights, widest_s = np.zeros((4, len(times))), np.full(len(times), np.inf)
    away = np.empty(4)
    for k in range(2, len(times) - 2):
        away[0], away[1] = times[k - 2] - times[k], times[k - 1] - times[k]
        away[2], away[3] = times[k + 1] - times[k], times[k + 2] - times[k]
        widest = 0.0
        for j in range(k - 2, k + 2):
            widest = max(widest, times[j + 1] - times[j])
        widest_s[k] = widest
        for j in range(4):
            weight = 1.0
            for other in range(4):
                if other != j:
                    weight *= away[other] / (away[other] - away[j])
            weights[j, k] = weight
    return weights, widest_s
