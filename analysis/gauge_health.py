"""Health of a gauge at rest: noise, drift, mains hum, range in use, clipping; symptoms and remedies."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.signal import detrend, welch

from analysis.arrays import Floats
from analysis.formatting import format_length, format_number
from analysis.health_grade import HealthGrade
from analysis.preparation.channels import MAINS_HZ
from analysis.record import AnalysisError
from messages.message import Message, message

SECONDS_MIN: Final = 1.0
SAMPLES_MIN: Final = 20
_SEGMENT_S: Final = 1.0  # of the spectrum: a hertz apart, and whole cycles of both mains
_BLOCKS: Final = 10
_LINE_HZ: Final = 2.0  # half width of a line: main lobe of Hann's window at 1 s, drift of the mains
_BESIDE_HZ: Final = (3.5, 7.5)  # distances from a line between which the background is measured
_STANDS_OUT: Final = 3.0  # power over the background's: chance exceeds it rarely in a mean over segments
_MOTION_HZ: Final = 25.0  # stands swing below 10 Hz; mains hum begins at 50 Hz
_COARSE: Final = 20  # with fewer distinct values, the steps of the converter look like clipping or repeats


class GaugeHealthError(AnalysisError, ValueError):
    """Too few samples to judge a gauge by."""


@dataclass(frozen=True, eq=False, slots=True)
class GaugeSamples:
    """Consecutive samples of one gauge."""

    displacement_m: Floats  # (n,) float64: by its calibration (m); NaN where a sample is missing or damaged
    overloaded: NDArray[np.bool_]
    rate_hz: float
    range_m: float | None = None  # it reads from -range_m to range_m


@dataclass(frozen=True, slots=True)
class Hum:
    """Mains hum; amplitude (m) 0 where it does not stand out, None where aliasing hides it."""

    frequency_hz: float
    amplitude_m: float | None


@dataclass(frozen=True, eq=False, slots=True)
class Spectrum:
    """Amplitude density (k,) in m/sqrt(Hz), one-sided, at frequencies (k,); squared, the variance."""

    frequency_hz: Floats
    density_m_per_sqrt_hz: Floats


@dataclass(frozen=True, eq=False, slots=True)
class GaugeHealth:
    """Figures of a gauge at rest; all displacements in m."""

    samples: int  # looked at, absent ones included
    duration_s: float
    mean_m: float
    noise_rms_m: float  # of a sample about a straight line, without the hum but with the swing
    drift_m_per_min: float
    drift_standard_uncertainty_m_per_min: float  # from the scatter of ten means
    hum: tuple[Hum, ...]
    oscillation_amplitude_m: float  # of a line below 25 Hz that is most of the signal, else 0
    resolution_m: float  # smallest difference between readings: the converter's step
    distinct_values: int
    largest_reading_m: float  # largest distance of a reading from the calibration's zero
    range_m: float | None  # of the gauge, to either side
    missing_fraction: float
    overload_fraction: float
    clipped_fraction: float  # fraction at the very largest or smallest reading
    repeated_fraction: float  # equal to the sample before, where the converter is fine enough to tell
    spectrum: Spectrum

    @property
    def range_fraction(self) -> float | None:
        """Farthest reading as a share of the range; None where that is not known, or 0."""
        return self.largest_reading_m / self.range_m if self.range_m else None


def measure_health(gauge: GaugeSamples) -> GaugeHealth:
    """Figures of a gauge from samples taken while the stand rests.

    Raises GaugeHealthError for under a second, or hardly any sample with a reading.
    """
    there = np.isfinite(gauge.displacement_m)
    places = np.flatnonzero(there)
    seconds = len(there) / gauge.rate_hz
    if seconds < SECONDS_MIN or len(places) < SAMPLES_MIN:
        raise GaugeHealthError(
            "{present} readings in {seconds} s are too few to judge a gauge by. Take"
            " {samples_min} in {seconds_min:g} s at least, and look at cable and power if they"
            " stay away",
            present=len(places),
            seconds=format_number(seconds, 2),
            samples_min=SAMPLES_MIN,
            seconds_min=SECONDS_MIN,
        )
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
        duration_s=seconds,
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


def _drift(time_s: Floats, x: Floats) -> tuple[float, float, Floats]:
    """Slope (m/s) with its standard uncertainty, and the residuals (n,) of a straight line.

    The line goes through means of ten blocks, whose scatter includes slow noise.
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
    """Amplitude of a slow line that exceeds the rest of the spectrum."""
    power = spectrum.density_m_per_sqrt_hz**2
    slow = np.where(spectrum.frequency_hz < _MOTION_HZ, power, 0.0)
    strongest = int(np.argmax(slow))
    near = np.abs(spectrum.frequency_hz - spectrum.frequency_hz[strongest]) <= _LINE_HZ
    if power[near].sum() <= 0.5 * power.sum():
        return 0.0
    step_hz = float(spectrum.frequency_hz[1] - spectrum.frequency_hz[0])
    return float(np.sqrt(2.0 * power[near].sum() * step_hz))


def _clipped_fraction(x: Floats) -> float:
    at_ends = [int(np.count_nonzero(x == end)) for end in (x.max(), x.min())]
    return sum(count for count in at_ends if count > 2) / len(x)


NOISE_M: Final = (30e-6, 100e-6)
"""Doubtful and bad above. Releases are found within 20 ms with noise up to 20 µm (docs/benchmarks.md)."""
DRIFT_M_PER_MIN: Final = (0.1e-3, 1e-3)
"""A test lasts half a minute: 0.1 mm/min moves the zero by half a percent of a pullback of 9 mm."""
HUM_M: Final = (10e-6, 100e-6)  # a third of the noise that is still good, and a percent of a pullback of 9 mm
_RANGE: Final = (0.4, 0.95)
"""A zero beyond 40 % of the range leaves less room on one side than a pullback needs; 95 % clips at once."""
_MISSING: Final = (1e-3, 0.05)  # by judgement: a sound serial link loses less than one sample in a thousand
_OVERLOADED: Final = (0.0, 0.01)  # a gauge at rest is never overloaded
_CLIPPED: Final = (0.02, 0.2)  # noise alone puts under 2 % onto the extreme values with over 20 steps
_REPEATED: Final = 0.25  # white noise over 20 steps or more repeats a reading in less than one of ten samples
_OSCILLATION_M: Final = 10e-6  # the table moves; below, the line is counted as noise
_DRIFT_SIGMAS: Final = 4.0  # chance lets one gauge in some thousands drift by so many standard uncertainties
_QUIET: Final = 1e-7  # noise below this fraction of the range is less than the last of 24 bits


@dataclass(frozen=True, slots=True)
class Symptom:
    """A fault of a gauge at rest."""

    code: str
    grade: HealthGrade
    message: Message
    remedy: Message


_ORDER: Final = list(HealthGrade)


def worst_grade(symptoms: tuple[Symptom, ...]) -> HealthGrade:
    """Return the grade of the worst symptom; good without any."""
    return max((symptom.grade for symptom in symptoms), key=_ORDER.index, default=HealthGrade.GOOD)


def diagnose(health: GaugeHealth) -> tuple[Symptom, ...]:
    """Return the symptoms, the worst first.

    Noise, drift and hum of a gauge that is dead, overloaded or in motion mean nothing and are not judged.
    """
    symptoms = list(_signal_faults(health))
    if health.distinct_values > 1 and health.oscillation_amplitude_m > _OSCILLATION_M:
        text = message(
            "the table swings by {amplitude}, so noise and drift cannot be told",
            amplitude=format_length(health.oscillation_amplitude_m),
        )
        remedy = message("Let the stand come to rest, and look again")
        symptoms.append(Symptom("moves", HealthGrade.DOUBTFUL, text, remedy))
    elif not any(symptom.grade is HealthGrade.BAD for symptom in symptoms):
        symptoms += _disturbances(health)
    return tuple(sorted(symptoms, key=lambda symptom: -_ORDER.index(symptom.grade)))


def _signal_faults(health: GaugeHealth) -> Iterator[Symptom]:
    """Yield faults that suppress or falsify readings, and signs that no gauge is connected."""
    yield from _graded(
        "absent", health.missing_fraction, _MISSING,
        message("{share:.1%} of the samples are missing or damaged", share=health.missing_fraction),
        message("Check cable and plugs, take a shorter cable, or a lower rate"),
    )  # fmt: skip
    yield from _graded(
        "overloaded", health.overload_fraction, _OVERLOADED,
        message("the amplifier is overloaded in {share:.1%} of the samples", share=health.overload_fraction),
        message("Move the gauge back into its range, or choose a wider input range; check for a broken wire"),
    )  # fmt: skip
    yield from _graded(
        "clipped", health.clipped_fraction, _CLIPPED,
        message("{share:.0%} of the readings stand at the very same end", share=health.clipped_fraction),
        message("Move the gauge back into its range, or choose a wider input range"),
    )  # fmt: skip
    mean_mm, share = health.mean_m * 1e3, health.range_fraction or 0.0
    text = message(
        "it rests at {mean_mm:.2f} mm, {share:.0%} of the range from its middle", mean_mm=mean_mm, share=share
    )
    remedy = message("Re-centre the gauge, so that a test has room to both sides")
    yield from _graded("off-centre", share, _RANGE, text, remedy)
    if health.distinct_values == 1:
        text = message("all readings are {mean_mm:.4f} mm: the channel is dead or stuck", mean_mm=mean_mm)
        remedy = message(
            "Touch the table: if nothing changes, check plug, bridge supply and the choice of channels"
        )
        yield Symptom("dead", HealthGrade.BAD, text, remedy)
    elif health.range_m is not None and health.noise_rms_m < _QUIET * health.range_m:
        noise_nm = format_number(health.noise_rms_m * 1e9, 2)
        text = message("noise of {noise_nm} nm is less than any strain gauge has", noise_nm=noise_nm)
        remedy = message("Touch the table: if nothing changes, the input is open, shorted or another one")
        yield Symptom("too-quiet", HealthGrade.DOUBTFUL, text, remedy)
    if health.repeated_fraction > _REPEATED:
        text = message("{share:.0%} of the readings repeat the one before", share=health.repeated_fraction)
        remedy = message("The converter is slower than the device sends: ask for a lower rate")
        yield Symptom("repeats", HealthGrade.DOUBTFUL, text, remedy)


def _disturbances(health: GaugeHealth) -> Iterator[Symptom]:
    """Yield what adds to the readings."""
    yield from _graded(
        "noisy", health.noise_rms_m, NOISE_M,
        message("noise of {noise} rms", noise=format_length(health.noise_rms_m)),
        message("Check shield and plugs, keep motors and phones away, or set the amplifier's filter lower"),
    )  # fmt: skip
    drift = abs(health.drift_m_per_min)
    if drift > _DRIFT_SIGMAS * health.drift_standard_uncertainty_m_per_min:
        text = message("it drifts by {drift} a minute", drift=format_length(health.drift_m_per_min))
        remedy = message(
            "Let the amplifier warm up for half an hour, and keep draughts and sun off the stand"
        )
        yield from _graded("drifts", drift, DRIFT_M_PER_MIN, text, remedy)
    for hum in health.hum:
        text = message(
            "{frequency_hz:g} Hz of the mains with an amplitude of {amplitude}",
            frequency_hz=hum.frequency_hz,
            amplitude=format_length(hum.amplitude_m or 0.0),
        )
        remedy = message(
            "Connect the cable's shield at one end, ground the amplifier, lay mains cables elsewhere"
        )
        yield from _graded("hums", hum.amplitude_m or 0.0, HUM_M, text, remedy)


def _graded(
    code: str, value: float, bounds: tuple[float, float], text: Message, remedy: Message
) -> Iterator[Symptom]:
    """Yield the symptom of a value above the first bound, bad above the second."""
    if value > bounds[0]:
        yield Symptom(code, HealthGrade.BAD if value > bounds[1] else HealthGrade.DOUBTFUL, text, remedy)
