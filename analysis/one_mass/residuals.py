"""Whether what a fit leaves over is noise: its size, its colour, and single lines in its spectrum."""

import math
from dataclasses import dataclass

import numpy as np
from scipy.special import kolmogorov

from analysis.arrays import Floats

_RARE = 1e-3
"""Chance at which noise alone is called a pattern, per test."""
_BAND = 3.29
"""Standard deviations within which 99.9 % of a normal distribution lie."""
_COMPUTED = 1e-9
_ROUNDED_SHARE = 0.25
"""Rounding makes residuals of any colour once it makes this share of their variance."""
_ROUNDED_LINE = 1.0 / 3.0
"""Lines up to this share of a rounding step may be harmonics of the rounding itself."""


@dataclass(frozen=True, slots=True)
class SpectralLine:
    """A line that stands out of the spectrum of residuals.

    Attributes
    ----------
    frequency_hz, amplitude : float
        By the median sampling interval; as a steady sine, in the unit of the residuals.
    """

    frequency_hz: float
    amplitude: float


@dataclass(frozen=True, slots=True)
class ResidualAssessment:
    """What was found in residuals.

    Attributes
    ----------
    adequate : bool
        They are noise, or the rounding of the converter.
    rms, noise : float
        Their root mean square, and that of their part which neighbours do not share.
    line : Line or None
        The strongest line, if noise does not explain it.
    """

    adequate: bool
    rms: float
    noise: float
    line: SpectralLine | None


def assess_residuals(residual: Floats, interval_s: float, step: float, swing: float) -> ResidualAssessment:
    """Judge residuals (n,) of readings every `interval_s`, rounded to `step` (0: not rounded).

    Residuals under a billionth of the `swing` are those of computed readings, and good enough.

    White noise must pass four tests, each of which it fails once in a thousand: mean square against the half
    mean squared difference of neighbours (von Neumann), the cumulative periodogram (Bartlett), its largest
    ordinate (Fisher), and the mean square of the first eighth against that of the rest. Where rounding makes
    a good part of the residuals no colour is asked for, and only lines above a third of a step count.
    """
    rms = math.sqrt(float(np.mean(residual**2)))
    noise = math.sqrt(0.5 * float(np.mean(np.diff(residual) ** 2)))
    if rms < _COMPUTED * swing:
        return ResidualAssessment(adequate=True, rms=rms, noise=noise, line=None)
    line = _strongest_line(residual, interval_s)
    if is_rounding(rms, step):
        line = line if line is not None and line.amplitude > _ROUNDED_LINE * step else None
        return ResidualAssessment(line is None, rms, noise, line)
    small = rms**2 <= noise**2 * (1.0 + _BAND / math.sqrt(len(residual)))
    adequate = small and line is None and _is_flat(residual) and _is_even(residual)
    return ResidualAssessment(adequate, rms, noise, line)


def is_rounding(rms: float, step: float) -> bool:
    """Tell whether rounding to `step` makes a good part of residuals of size `rms`."""
    return step**2 / 12.0 >= _ROUNDED_SHARE * rms**2


def rounding_step(value: Floats) -> float:
    """Step to which readings are rounded; 0 where they lie on no lattice."""
    levels = np.unique(value)
    if not 2 <= len(levels) < 0.6 * len(value):
        return 0.0
    steps = np.diff(levels)
    step = float(np.median(steps[steps > 0.5 * np.median(steps)]))
    off = (steps / step) - np.round(steps / step)
    return step if float(np.mean(np.abs(off) < 0.1)) > 0.95 else 0.0


def _ordinates(residual: Floats) -> Floats:
    """Periodogram without its ends, over its mean: for white noise independent and exponential."""
    power = np.abs(np.fft.rfft(residual - residual.mean())[1 : (len(residual) + 1) // 2]) ** 2
    return np.asarray(power / max(float(power.mean()), 1e-300))


def _strongest_line(residual: Floats, interval_s: float) -> SpectralLine | None:
    power = _ordinates(residual)
    peak = int(np.argmax(power))
    if power[peak] < math.log(len(power) / _RARE):
        return None
    total = 2.0 * float(np.var(residual)) * float(power[max(0, peak - 2) : peak + 3].sum() / power.sum())
    return SpectralLine((peak + 1) / (len(residual) * interval_s), math.sqrt(total))


def _is_flat(residual: Floats) -> bool:
    power = _ordinates(residual)
    share = np.cumsum(power) / power.sum()
    even = np.arange(1, len(power) + 1) / len(power)
    distance = float(np.abs(share - even).max())
    return bool(kolmogorov(distance * math.sqrt(len(power))) > _RARE)


def _is_even(residual: Floats) -> bool:
    first, rest = np.split(residual**2, [len(residual) // 8])
    if len(first) < 5:
        return True
    spread = math.sqrt(2.0 / len(first) + 2.0 / len(rest))
    return bool(abs(math.log(float(first.mean() / max(rest.mean(), 1e-300)))) < _BAND * spread)
