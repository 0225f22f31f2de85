"""Tests of residuals of a fitted decay: whether they are noise, and whether a second mode is in them."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.arrays import Floats

RARE = 1e-3  # chance at which noise alone is called a pattern, per test
KOLMOGOROV_RARE = 1.9494746035043753  # exceeded by that chance: scipy.special.kolmogi(RARE)
_BAND = 3.29  # standard deviations within which 99.9 % of a normal distribution lie
COMPUTED = 1e-9  # residuals under this share of the swing are those of computed readings
_ROUNDED_SHARE = 0.25  # rounding makes residuals of any colour once it makes this share of their variance
_ROUNDED_LINE = 1.0 / 3.0  # lines up to this share of a rounding step may be harmonics of the rounding itself
_PERIODS_MIN = 6.0  # in fewer the spectrum does not part a line from harmonics
_SLOW_BINS = 4  # of the spectrum from zero on: drift
_LINE_BINS = 1.5  # so far from a harmonic of the decay its highest bin lies at most, where its swing varies
_CARRIER_BINS = 4.0  # the same of the decay itself: what is left of it varies in amplitude and phase
_CHIRP = 0.01  # share by which the period may change over a record, and its harmonics with it
_HARMONIC_MAX = 0.4  # of the distance of harmonics: so much about each is left out at most
_TOP_BINS = 3  # a line is the highest of so many bins on either side; skirts of the decay rise to one
_SKIRT_BINS, _NEIGHBOUR_BINS, _NEIGHBOURS_MIN = (
    8,
    40,
    5,
)  # of a line that decays, and of what it is compared with
_HARMONICS, _SLOW_TERMS = 3, 4  # of what is left of the decay, and terms of their polynomials in time
_PEAKS = 5  # largest ordinates that are tried
_FADINGS = (
    0.0,
    1.0,
    2.0,
    4.0,
    8.0,
    16.0,
    32.0,
    64.0,
)  # damping of a second mode over the length of the record


@dataclass(frozen=True, slots=True)
class SpectralLine:
    """A line that stands out of the spectrum of residuals."""

    frequency_hz: float
    amplitude: float  # in the unit of the residuals


@dataclass(frozen=True, slots=True)
class ResidualAssessment:
    """Assessment of residuals."""

    adequate: bool  # they are noise, or the rounding of the converter
    rms: float
    noise: float  # root mean square of their part which neighbours do not share
    line: SpectralLine | None
    count: int

    @property
    def unseen(self) -> float:
        """Amplitude of the largest line that noise of this size hides."""
        return 2.0 * self.rms * math.sqrt(math.log(max(1, self.count // 2) / RARE) / max(1, self.count))


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
    if rms < COMPUTED * swing:
        return ResidualAssessment(adequate=True, rms=rms, noise=noise, line=None, count=len(residual))
    power = _ordinates(residual)
    line = _strongest_line(residual, power, interval_s)
    if is_rounding(rms, step):
        line = line if line is not None and line.amplitude > _ROUNDED_LINE * step else None
        return ResidualAssessment(line is None, rms, noise, line, len(residual))
    small = rms**2 <= noise**2 * (1.0 + _BAND / math.sqrt(len(residual)))
    adequate = small and line is None and _is_flat(power) and _is_even(residual)
    return ResidualAssessment(adequate, rms, noise, line, len(residual))


def find_second_mode(time_s: Floats, residual: Floats, period_s: float, step: float) -> SpectralLine | None:
    """Find the strongest narrow line in residuals (n,) of a decay of `period_s` that is no harmonic of it.

    A line is narrow where it stands above the spectrum on both of its sides further than noise does once in
    a thousand. The decay itself and its harmonics are left out: there a spring or damping of another law
    shows, and rounding to `step`. The amplitude is that at the first reading.
    """
    periods = float(time_s[-1] - time_s[0]) / period_s
    if periods < _PERIODS_MIN:
        return None
    even_s = np.linspace(time_s[0], time_s[-1], len(time_s))
    even = np.interp(even_s, time_s, residual)
    power = np.abs(np.fft.rfft((even - even.mean()) * np.hanning(len(even))))[: len(even) // 2] ** 2
    lone = np.flatnonzero(~_is_harmonic(len(power), periods))
    limit = 2.0 * math.log(max(len(power), 2) / RARE)
    for peak in lone[np.argsort(power[lone])[::-1]][:_PEAKS].tolist():
        around = power[max(0, peak - _TOP_BINS) : peak + _TOP_BINS + 1]
        if power[peak] == around.max() and power[peak] > limit * _level_beside(power, lone, peak):
            since_s = even_s - even_s[0]
            line = _fading_line(since_s, _without_decay(since_s, even, period_s), peak)
            return None if line.amplitude < _ROUNDED_LINE * step else line
    return None


def _is_harmonic(count: int, periods: float) -> NDArray[np.bool_]:
    """Whether each of `count` bins of the spectrum belongs to drift, to the decay or to its harmonics."""
    bins = np.arange(count)
    order = np.round(bins / periods)
    half_width = np.where(order <= 1.0, _CARRIER_BINS, _LINE_BINS) + _CHIRP * order * periods
    half_width = np.minimum(half_width, _HARMONIC_MAX * periods)
    near = (order > 0.0) & (np.abs(bins - order * periods) <= half_width)
    return np.asarray(near | (bins < _SLOW_BINS))


def _level_beside(power: Floats, lone: NDArray[np.int64], peak: int) -> float:
    """Mean power on the louder side of a peak, from the median; infinite where too little lies beside it."""
    off = lone - peak
    near = (np.abs(off) > _SKIRT_BINS) & (np.abs(off) <= _NEIGHBOUR_BINS)
    sides = [power[lone[near & (np.sign(off) == side)]] for side in (-1, 1)]
    levels = [float(np.median(side)) for side in sides if len(side) >= _NEIGHBOURS_MIN]
    return max(levels, default=math.inf) / math.log(2.0)


def _without_decay(since_s: Floats, residual: Floats, period_s: float) -> Floats:
    """Residuals without what a wrong law leaves of the decay and its harmonics: slowly varying sines."""
    angle = 2.0 * math.pi / period_s * since_s
    slow = np.vander(since_s / since_s[-1], _SLOW_TERMS)
    waves = [wave(order * angle) for order in range(1, _HARMONICS + 1) for wave in (np.cos, np.sin)]
    columns = np.concatenate([slow * wave[:, None] for wave in waves], axis=1)
    return np.asarray(residual - columns @ np.linalg.lstsq(columns, residual, rcond=None)[0])


def _fading_line(since_s: Floats, residual: Floats, peak: int) -> SpectralLine:
    """Best damped sine of about the frequency of a peak of the spectrum."""
    length_s = float(since_s[-1])
    best, amplitude, frequency_hz = -1.0, 0.0, peak / length_s
    for fading in _FADINGS:
        for shift in (-0.5, -0.25, 0.0, 0.25, 0.5):
            angle = 2.0 * math.pi * (peak + shift) / length_s * since_s
            columns = np.exp(-fading / length_s * since_s) * np.stack((np.cos(angle), np.sin(angle)))
            parts = np.linalg.lstsq(columns @ columns.T, columns @ residual, rcond=None)[0]
            explained = float(parts @ (columns @ residual))
            if explained > best:
                best, amplitude, frequency_hz = explained, float(np.hypot(*parts)), (peak + shift) / length_s
    return SpectralLine(frequency_hz, amplitude)


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


def _strongest_line(residual: Floats, power: Floats, interval_s: float) -> SpectralLine | None:
    peak = int(np.argmax(power))
    if power[peak] < math.log(len(power) / RARE):
        return None
    total = 2.0 * float(np.var(residual)) * float(power[max(0, peak - 2) : peak + 3].sum() / power.sum())
    return SpectralLine((peak + 1) / (len(residual) * interval_s), math.sqrt(total))


def _is_flat(power: Floats) -> bool:
    share, even = np.cumsum(power) / power.sum(), np.arange(1, len(power) + 1) / len(power)
    distance = float(np.abs(share - even).max())
    return distance * math.sqrt(len(power)) < KOLMOGOROV_RARE


def _is_even(residual: Floats) -> bool:
    first, rest = np.split(residual**2, [len(residual) // 8])
    if len(first) < 5:
        return True
    spread = math.sqrt(2.0 / len(first) + 2.0 / len(rest))
    return bool(abs(math.log(float(first.mean() / max(rest.mean(), 1e-300)))) < _BAND * spread)
