"""How a gauge does while the stand rests: noise, drift, hum of the mains, range used, clipping, life."""

from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.signal import detrend, welch

from analysis.arrays import Floats
from analysis.formatting import format_length, format_number
from analysis.preparation.noise import MAINS_HZ
from analysis.record import AnalysisError

SECONDS_MIN: Final = 1.0
SAMPLES_MIN: Final = 20
_SEGMENT_S: Final = 1.0
"""Of the spectrum: a hertz apart, and whole cycles of both mains."""
_BLOCKS: Final = 10
_LINE_HZ: Final = 2.0
"""A line is so wide to each side, by Hann's window and by what the mains stray."""
_BESIDE_HZ: Final = (3.5, 7.5)
"""From there to there beside a line is what it must stand out from."""
_STANDS_OUT: Final = 3.0
_MOTION_HZ: Final = 25.0
_COARSE: Final = 20
"""With fewer different values, a converter's steps cannot be told from clipping or repeats."""


class GaugeHealthError(AnalysisError, ValueError):
    """Samples that tell nothing about a gauge."""


@dataclass(frozen=True, eq=False, slots=True)
class GaugeSamples:
    """Consecutive samples of one gauge.

    Attributes
    ----------
    displacement_m : (n,) float64
        By its calibration (m); NaN where a sample is missing or damaged.
    overloaded : (n,) bool
        Flagged by the device.
    rate_hz : float
    range_m : float, optional
        It reads from -range_m to range_m.
    """

    displacement_m: Floats
    overloaded: NDArray[np.bool_]
    rate_hz: float
    range_m: float | None = None


@dataclass(frozen=True, slots=True)
class Hum:
    """The mains in the readings; amplitude (m) 0 where they do not stand out, None where nobody can tell."""

    frequency_hz: float
    amplitude_m: float | None


@dataclass(frozen=True, eq=False, slots=True)
class Spectrum:
    """Amplitude density (k,) in m/sqrt(Hz), one-sided, at frequencies (k,); squared, the variance."""

    frequency_hz: Floats
    density_m_per_sqrt_hz: Floats


@dataclass(frozen=True, eq=False, slots=True)
class GaugeHealth:
    """Figures of a gauge at rest; all displacements in m.

    Attributes
    ----------
    samples : int
        Looked at, absent ones included.
    seconds : float
    mean_m : float
        Where the gauge stands.
    noise_rms_m : float
        Standard deviation of a sample about a straight line, without the hum but with the swing.
    drift_m_per_min, drift_standard_uncertainty : float
        Slope of that line, and how sure it is by the scatter of ten means.
    hum : tuple of Hum
        At 50 and 60 Hz.
    swing_m : float
        Amplitude of the strongest line below 25 Hz where it is most of what is seen, else 0: the table moves.
    step_m : float
        Smallest difference between readings: the converter's step.
    values : int
        Different readings.
    farthest_m : float
        Largest distance of a reading from the calibration's zero.
    range_m : float, optional
        Of the gauge, to either side.
    absent_share, overloaded_share, clipped_share, repeated_share : float
        Of the samples: missing or damaged; flagged; at the very largest or smallest reading; equal to the
        one before, where the converter is fine enough to tell.
    spectrum : Spectrum
    """

    samples: int
    duration_s: float
    mean_m: float
    noise_rms_m: float
    drift_m_per_min: float
    drift_standard_uncertainty_m_per_min: float
    hum: tuple[Hum, ...]
    oscillation_amplitude_m: float
    resolution_m: float
    distinct_values: int
    largest_reading_m: float
    range_m: float | None
    missing_fraction: float
    overload_fraction: float
    clipped_fraction: float
    repeated_fraction: float
    spectrum: Spectrum

    @property
    def range_fraction(self) -> float | None:
        """Farthest reading as a share of the range; None where that is not known, or 0."""
        return self.largest_reading_m / self.range_m if self.range_m else None


def measure_health(gauge: GaugeSamples) -> GaugeHealth:
    """Figures of a gauge from samples taken while the stand rests.

    Raises
    ------
    HealthError
        Under a second, or hardly any sample with a reading.
    """
    there = np.isfinite(gauge.displacement_m)
    _check(gauge, int(there.sum()))
    places = np.flatnonzero(there)
    x = gauge.displacement_m[there]
    whole = np.interp(np.arange(len(there)), places, x)
    slope, uncertainty, left = _drift(places / gauge.rate_hz, x)
    spectrum = _spectrum(whole, gauge.rate_hz)
    hum = tuple(Hum(frequency, _hum(spectrum, frequency, gauge.rate_hz)) for frequency in MAINS_HZ)
    hums_m2 = sum(0.5 * (one.amplitude_m or 0.0) ** 2 for one in hum)
    values = np.unique(x)
    is_fine = len(values) > _COARSE
    return GaugeHealth(
        samples=len(there),
        duration_s=len(there) / gauge.rate_hz,
        mean_m=float(x.mean()),
        noise_rms_m=float(np.sqrt(max(float(np.mean(left**2)) - hums_m2, 0.0))),
        drift_m_per_min=60.0 * slope,
        drift_standard_uncertainty_m_per_min=60.0 * uncertainty,
        hum=hum,
        oscillation_amplitude_m=_oscillation(spectrum),
        resolution_m=float(np.diff(values).min()) if len(values) > 1 else 0.0,
        distinct_values=len(values),
        largest_reading_m=float(np.abs(x).max()),
        range_m=gauge.range_m,
        missing_fraction=float(1.0 - there.mean()),
        overload_fraction=float(gauge.overloaded.mean()),
        clipped_fraction=_clipped_fraction(x) if is_fine else 0.0,
        repeated_fraction=float(np.mean(np.diff(x) == 0.0)) if is_fine else 0.0,
        spectrum=spectrum,
    )


def _check(gauge: GaugeSamples, present: int) -> None:
    seconds = len(gauge.displacement_m) / gauge.rate_hz
    if seconds < SECONDS_MIN or present < SAMPLES_MIN:
        raise GaugeHealthError(
            f"{present} readings in {format_number(seconds, 2)} s are too few to judge a gauge by. Take"
            f" {SAMPLES_MIN} in {SECONDS_MIN:g} s at least, and look at cable and power if they stay away"
        )


def _drift(time_s: Floats, x: Floats) -> tuple[float, float, Floats]:
    """Slope (m/s) with its standard uncertainty, and what a straight line leaves of the readings (n,).

    The line goes through means of ten blocks, whose scatter tells of slow noise too.
    """
    blocks = np.array_split(np.arange(len(x)), _BLOCKS)
    times = np.array([time_s[block].mean() for block in blocks])
    means = np.array([x[block].mean() for block in blocks])
    away = times - times.mean()
    slope = float(away @ means / (away @ away))
    scatter = means - means.mean() - slope * away
    uncertainty = float(np.sqrt(scatter @ scatter / (_BLOCKS - 2) / (away @ away)))
    line = x.mean() + slope * (time_s - time_s.mean())
    return slope, uncertainty, x - line


def _spectrum(x: Floats, rate_hz: float) -> Spectrum:
    length = min(len(x), max(round(_SEGMENT_S * rate_hz), 8))
    frequency, power = welch(x, rate_hz, "hann", length, detrend=detrend)
    return Spectrum(np.asarray(frequency), np.sqrt(np.asarray(power)))


def _hum(spectrum: Spectrum, frequency_hz: float, rate_hz: float) -> float | None:
    """Amplitude (m) of a line at a frequency, or at where sampling folds it to."""
    folded = abs(frequency_hz - rate_hz * round(frequency_hz / rate_hz))
    others = [abs(f - rate_hz * round(f / rate_hz)) for f in MAINS_HZ if f != frequency_hz]
    edge_hz = _BESIDE_HZ[1]
    is_apart = all(abs(folded - other) > 2.0 * _LINE_HZ for other in others)
    if not (edge_hz < folded < 0.5 * rate_hz - edge_hz and is_apart):
        return None
    return _line(spectrum, folded)


def _line(spectrum: Spectrum, frequency_hz: float) -> float:
    """Amplitude of a line over what is beside it; 0 where it does not stand out."""
    away = np.abs(spectrum.frequency_hz - frequency_hz)
    power = spectrum.density_m_per_sqrt_hz**2
    beside = float(np.median(power[(away > _BESIDE_HZ[0]) & (away < _BESIDE_HZ[1])]))
    line = power[away <= _LINE_HZ]
    if line.mean() <= _STANDS_OUT * beside:
        return 0.0
    step_hz = float(spectrum.frequency_hz[1] - spectrum.frequency_hz[0])
    return float(np.sqrt(2.0 * (line.sum() - len(line) * beside) * step_hz))


def _oscillation(spectrum: Spectrum) -> float:
    """Amplitude of a slow line that is more than all the rest of the spectrum."""
    power = spectrum.density_m_per_sqrt_hz**2
    slow = np.where(spectrum.frequency_hz < _MOTION_HZ, power, 0.0)
    strongest = int(np.argmax(slow))
    near = np.abs(spectrum.frequency_hz - spectrum.frequency_hz[strongest]) <= _LINE_HZ
    if power[near].sum() <= 0.5 * power.sum():
        return 0.0
    step_hz = float(spectrum.frequency_hz[1] - spectrum.frequency_hz[0])
    return float(np.sqrt(2.0 * power[near].sum() * step_hz))


def _clipped_fraction(x: Floats) -> float:
    """Share of readings at the largest or the smallest value, where either is met more than twice."""
    at_ends = [int(np.count_nonzero(x == end)) for end in (x.max(), x.min())]
    return sum(count for count in at_ends if count > 2) / len(x)


NOISE_M: Final = (30e-6, 100e-6)
"""Doubtful and bad above; releases are found within 20 ms with noise up to 20 um (docs/benchmarks.md)."""
DRIFT_M_PER_MIN: Final = (0.1e-3, 1e-3)
"""A test lasts half a minute: 0.1 mm/min are half a percent of a pullback of 9 mm."""
HUM_M: Final = (10e-6, 100e-6)
_RANGE: Final = (0.4, 0.95)
_ABSENT: Final = (1e-3, 0.05)
_OVERLOADED: Final = (0.0, 0.01)
_CLIPPED: Final = (0.02, 0.2)
_REPEATED: Final = 0.25
_SWING_M: Final = 10e-6
_DRIFT_SIGMAS: Final = 4.0
_QUIET: Final = 1e-7
"""Noise below this share of the range is less than the last of 24 bits."""


class HealthGrade(StrEnum):
    """How a gauge does; in this order, the worst symptom decides."""

    GOOD = "good"
    DOUBTFUL = "doubtful"
    BAD = "bad"


@dataclass(frozen=True, slots=True)
class Symptom:
    """Something that is not as it should be. `code` is stable; message and remedy are for people."""

    code: str
    grade: HealthGrade
    message: str
    remedy: str


_ORDER: Final = list(HealthGrade)


def worst_grade(symptoms: tuple[Symptom, ...]) -> HealthGrade:
    """Return the worst of them, good without any."""
    return max((symptom.grade for symptom in symptoms), key=_ORDER.index, default=HealthGrade.GOOD)


def diagnose(health: GaugeHealth) -> tuple[Symptom, ...]:
    """What is not as it should be, the worst first.

    Noise, drift and hum of a gauge that is dead, overloaded or in motion say nothing, and are not judged.
    """
    found = [*_signal(health), *_liveness(health)]
    moves = health.distinct_values > 1 and health.oscillation_amplitude_m > _SWING_M
    if moves:
        found.append(
            Symptom(
                "moves",
                HealthGrade.DOUBTFUL,
                f"the table swings by {format_length(health.oscillation_amplitude_m)}, so noise and drift"
                f" cannot be told",
                "Let the stand come to rest, and look again",
            )
        )
    if not moves and not any(symptom.grade is HealthGrade.BAD for symptom in found):
        found += _disturbances(health)
    return tuple(sorted(found, key=lambda symptom: -_ORDER.index(symptom.grade)))


def _signal(health: GaugeHealth) -> Iterator[Symptom]:
    """What keeps readings from coming, or from being true."""
    if health.missing_fraction > _ABSENT[0]:
        yield Symptom(
            "absent", _grade(health.missing_fraction, _ABSENT),
            f"{health.missing_fraction:.1%} of the samples are missing or damaged",
            "Check cable and plugs, take a shorter cable, or a lower rate",
        )  # fmt: skip
    if health.overload_fraction > _OVERLOADED[0]:
        yield Symptom(
            "overloaded", _grade(health.overload_fraction, _OVERLOADED),
            f"the amplifier is overloaded in {health.overload_fraction:.1%} of the samples",
            "Move the gauge back into its range, or choose a wider input range; check for a broken wire",
        )  # fmt: skip
    if health.clipped_fraction > _CLIPPED[0]:
        yield Symptom(
            "clipped", _grade(health.clipped_fraction, _CLIPPED),
            f"{health.clipped_fraction:.0%} of the readings stand at the very same end",
            "Move the gauge back into its range, or choose a wider input range",
        )  # fmt: skip
    if health.range_fraction is not None and health.range_fraction > _RANGE[0]:
        yield Symptom(
            "off-centre", _grade(health.range_fraction, _RANGE),
            f"it rests at {health.mean_m * 1e3:.2f} mm, {health.range_fraction:.0%} of the range from its"
            f" middle",
            "Re-centre the gauge, so that a test has room to both sides",
        )  # fmt: skip


def _liveness(health: GaugeHealth) -> Iterator[Symptom]:
    """Whether a gauge is behind the readings at all."""
    if health.distinct_values == 1:
        yield Symptom(
            "dead", HealthGrade.BAD,
            f"all readings are {health.mean_m * 1e3:.4f} mm: the channel is dead or stuck",
            "Touch the table: if nothing changes, check plug, bridge supply and the choice of channels",
        )  # fmt: skip
    elif health.range_m is not None and health.noise_rms_m < _QUIET * health.range_m:
        yield Symptom(
            "too-quiet", HealthGrade.DOUBTFUL,
            f"noise of {format_number(health.noise_rms_m * 1e9, 2)} nm is less than any strain gauge has",
            "Touch the table: if nothing changes, the input is open, shorted or another one",
        )  # fmt: skip
    if health.repeated_fraction > _REPEATED:
        yield Symptom(
            "repeats", HealthGrade.DOUBTFUL,
            f"{health.repeated_fraction:.0%} of the readings repeat the one before",
            "The converter is slower than the device sends: ask for a lower rate",
        )  # fmt: skip


def _disturbances(health: GaugeHealth) -> Iterator[Symptom]:
    """What adds to the readings."""
    if health.noise_rms_m > NOISE_M[0]:
        yield Symptom(
            "noisy", _grade(health.noise_rms_m, NOISE_M), f"noise of {format_length(health.noise_rms_m)} rms",
            "Check shield and plugs, keep motors and phones away, or set the amplifier's filter lower",
        )  # fmt: skip
    drift = abs(health.drift_m_per_min)
    if drift > max(DRIFT_M_PER_MIN[0], _DRIFT_SIGMAS * health.drift_standard_uncertainty_m_per_min):
        yield Symptom(
            "drifts", _grade(drift, DRIFT_M_PER_MIN),
            f"it drifts by {format_length(health.drift_m_per_min)} a minute",
            "Let the amplifier warm up for half an hour, and keep draughts and sun off the stand",
        )  # fmt: skip
    for hum in health.hum:
        if hum.amplitude_m is not None and hum.amplitude_m > HUM_M[0]:
            yield Symptom(
                "hums", _grade(hum.amplitude_m, HUM_M),
                f"{hum.frequency_hz:g} Hz of the mains with an amplitude of {format_length(hum.amplitude_m)}",
                "Connect the cable's shield at one end, ground the amplifier, lay mains cables elsewhere",
            )  # fmt: skip


def _grade(value: float, bounds: tuple[float, float]) -> HealthGrade:
    return HealthGrade.BAD if value > bounds[1] else HealthGrade.DOUBTFUL
