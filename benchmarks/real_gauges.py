"""Gauges and amplifiers that are not ideal: bend, cross-talk, analogue filters, lag, gain, thermal creep."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import signal
from scipy.interpolate import CubicSpline

Floats = NDArray[np.float64]

GRID_HZ = 10_000.0
"""Rate at which the analogue filters are computed. A reading between two points of a bend in velocity is off
by less than 0.02 um there."""


@dataclass(frozen=True)
class RealGauge:
    """One gauge with its amplifier; a value of zero is the ideal. SI."""

    filter: str = ""  # "rc", "butterworth", "bessel", "sinc" or none
    order: int = 1
    corner_hz: float = 0.0  # -3 dB; of "sinc" the rate of the averages (its first zero)
    lag_s: float = 0.0
    bend: float = 0.0  # share of the displacement at `range_m`, in its square
    bend_cubic: float = 0.0  # the same, with its cube
    range_m: float = 0.012  # of the motion, for the shares of the bend
    cross_talk: float = 0.0  # share of the other gauge's displacement in the reading
    gain_error: float = 0.0
    creep_m: float = 0.0  # thermal: creep_m (1 - exp(-t / creep_time_s))
    creep_time_s: float = 5.0
    zero_m: float = 0.0

    def read(self, moved_m: Floats, other_m: Floats, since_s: Floats, times_s: Floats) -> Floats:
        """Readings at `times_s` (n,) of a displacement on the even grid `since_s` (m,) of rate GRID_HZ."""
        bent = moved_m * (
            1.0 + (self.bend + self.bend_cubic * moved_m / self.range_m) * moved_m / self.range_m
        )
        shown = self._filtered(bent + self.cross_talk * other_m)
        crept = self.creep_m * -np.expm1(-(times_s - times_s[0]) / self.creep_time_s)
        late = CubicSpline(since_s, shown)(times_s - self.lag_s)
        return np.asarray((1.0 + self.gain_error) * late + crept + self.zero_m)

    def _filtered(self, values: Floats) -> Floats:
        """As the filter shows it that has long settled on the first value."""
        if not self.filter:
            return values
        shown = values - values[0]
        if self.filter == "sinc":
            count = round(GRID_HZ / self.corner_hz)
            for _ in range(self.order):
                shown = signal.lfilter(np.r_[0.5, np.ones(count - 1), 0.5] / count, 1.0, shown)
        else:
            for section in self._sections():
                analogue = [np.trim_zeros(part, "f") for part in (section[:3], section[3:])]
                numerator, denominator, _ = signal.cont2discrete(analogue, 1.0 / GRID_HZ, "foh")
                shown = signal.lfilter(numerator.ravel(), denominator, shown)
        return np.asarray(shown + values[0])

    def _sections(self) -> Floats:
        """Analogue sections of second order at most, (k, 6)."""
        corner = 2.0 * np.pi * self.corner_hz
        if self.filter == "rc":  # equal stages without reaction
            single = corner / np.sqrt(2.0 ** (1.0 / self.order) - 1.0)
            return np.tile([0.0, 0.0, single, 0.0, 1.0, single], (self.order, 1))
        if self.filter == "butterworth":
            zpk = signal.butter(self.order, corner, analog=True, output="zpk")
        else:
            zpk = signal.bessel(self.order, corner, analog=True, output="zpk", norm="mag")
        return np.asarray(signal.zpk2sos(*zpk, pairing="minimal", analog=True))
