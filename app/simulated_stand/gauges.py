"""The simulated gauges: displacement to counts, with all that a real one adds."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from config.schema import Gauge

ADC_MAX_COUNT = 2**23 - 1
"""Largest count of a 24-bit converter."""


@dataclass(frozen=True, slots=True)
class GaugeFaults:
    """What one gauge adds to the true displacement.

    Attributes
    ----------
    noise_m : float
        Standard deviation of white noise (m).
    drift_m_per_s : float
        Creep of the zero since the beginning of the test (m/s).
    nonlinearity_m : float
        Largest deviation from the calibration line, at half range (m).
    clip_m : float, optional
        Readings beyond are clipped, where that comes before the end of its range (m).
    """

    noise_m: float = 0.0
    drift_m_per_s: float = 0.0
    nonlinearity_m: float = 0.0
    clip_m: float | None = None


class SimulatedGauge:
    """One gauge with its 24-bit converter.

    Parameters
    ----------
    gauge : Gauge
        Calibration that the counts follow.
    faults : GaugeFaults
    random : Generator
        Source of the noise.
    """

    def __init__(self, gauge: Gauge, faults: GaugeFaults, random: np.random.Generator) -> None:
        self._gauge = gauge
        self._faults = faults
        self._random = random
        ends = (np.array([-ADC_MAX_COUNT, ADC_MAX_COUNT]) - gauge.zero_count) * gauge.gain_m_per_count
        self._range_m = min(gauge.range_m or math.inf, float(np.abs(ends).min()))
        self._limit_m = min(self._range_m, faults.clip_m or math.inf)

    def read(
        self, displacement_m: NDArray[np.float64], drifting_s: NDArray[np.float64]
    ) -> tuple[NDArray[np.int32], NDArray[np.bool_]]:
        """Counts (n,) for true displacements (n,), and where the gauge is overloaded.

        `drifting_s` is for how long the zero has crept (s).
        """
        faults = self._faults
        shown = displacement_m + faults.drift_m_per_s * drifting_s
        if faults.nonlinearity_m:
            shown += faults.nonlinearity_m * np.sin(np.pi / self._range_m * displacement_m)
        if faults.noise_m:
            shown += faults.noise_m * self._random.standard_normal(len(shown), dtype=np.float32)
        overloaded = np.abs(shown) > self._limit_m
        np.clip(shown, -self._limit_m, self._limit_m, out=shown)
        return np.rint(self._gauge.counts(shown)).astype(np.int32), overloaded
