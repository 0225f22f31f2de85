"""What the figures of a gauge at rest mean: good, doubtful or bad, and what to do."""

from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from typing import Final

from analysis.formatting import format_length, format_number
from analysis.gauge_health import GaugeHealth

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
                f"the table swings by {format_length(health.oscillation_amplitude_m)}, so noise and drift cannot be told",
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
            f"it rests at {health.mean_m * 1e3:.2f} mm, {health.range_fraction:.0%} of the range from its middle",
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
