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


class Verdict(StrEnum):
    """How a gauge does; in this order, the worst symptom decides."""

    GOOD = "good"
    DOUBTFUL = "doubtful"
    BAD = "bad"


@dataclass(frozen=True, slots=True)
class Symptom:
    """Something that is not as it should be. `code` is stable; message and remedy are for people."""

    code: str
    verdict: Verdict
    message: str
    remedy: str


_ORDER: Final = list(Verdict)


def verdict_of(symptoms: tuple[Symptom, ...]) -> Verdict:
    """Return the worst of them, good without any."""
    return max((symptom.verdict for symptom in symptoms), key=_ORDER.index, default=Verdict.GOOD)


def find_symptoms(health: GaugeHealth) -> tuple[Symptom, ...]:
    """What is not as it should be, the worst first.

    Noise, drift and hum of a gauge that is dead, overloaded or in motion say nothing, and are not judged.
    """
    found = [*_signal(health), *_life(health)]
    moves = health.values > 1 and health.swing_m > _SWING_M
    if moves:
        found.append(
            Symptom(
                "moves",
                Verdict.DOUBTFUL,
                f"the table swings by {format_length(health.swing_m)}, so noise and drift cannot be told",
                "Let the stand come to rest, and look again",
            )
        )
    if not moves and not any(symptom.verdict is Verdict.BAD for symptom in found):
        found += _disturbances(health)
    return tuple(sorted(found, key=lambda symptom: -_ORDER.index(symptom.verdict)))


def _signal(health: GaugeHealth) -> Iterator[Symptom]:
    """What keeps readings from coming, or from being true."""
    if health.absent_share > _ABSENT[0]:
        yield Symptom(
            "absent", _graded(health.absent_share, _ABSENT),
            f"{health.absent_share:.1%} of the samples are missing or damaged",
            "Check cable and plugs, take a shorter cable, or a lower rate",
        )  # fmt: skip
    if health.overloaded_share > _OVERLOADED[0]:
        yield Symptom(
            "overloaded", _graded(health.overloaded_share, _OVERLOADED),
            f"the amplifier is overloaded in {health.overloaded_share:.1%} of the samples",
            "Move the gauge back into its range, or choose a wider input range; check for a broken wire",
        )  # fmt: skip
    if health.clipped_share > _CLIPPED[0]:
        yield Symptom(
            "clipped", _graded(health.clipped_share, _CLIPPED),
            f"{health.clipped_share:.0%} of the readings stand at the very same end",
            "Move the gauge back into its range, or choose a wider input range",
        )  # fmt: skip
    if health.range_used is not None and health.range_used > _RANGE[0]:
        yield Symptom(
            "off-centre", _graded(health.range_used, _RANGE),
            f"it rests at {health.mean_m * 1e3:.2f} mm, {health.range_used:.0%} of the range from its middle",
            "Re-centre the gauge, so that a test has room to both sides",
        )  # fmt: skip


def _life(health: GaugeHealth) -> Iterator[Symptom]:
    """Whether a gauge is behind the readings at all."""
    if health.values == 1:
        yield Symptom(
            "dead", Verdict.BAD,
            f"all readings are {health.mean_m * 1e3:.4f} mm: the channel is dead or stuck",
            "Touch the table: if nothing changes, check plug, bridge supply and the choice of channels",
        )  # fmt: skip
    elif health.range_m is not None and health.noise_rms_m < _QUIET * health.range_m:
        yield Symptom(
            "too-quiet", Verdict.DOUBTFUL,
            f"noise of {format_number(health.noise_rms_m * 1e9, 2)} nm is less than any strain gauge has",
            "Touch the table: if nothing changes, the input is open, shorted or another one",
        )  # fmt: skip
    if health.repeated_share > _REPEATED:
        yield Symptom(
            "repeats", Verdict.DOUBTFUL,
            f"{health.repeated_share:.0%} of the readings repeat the one before",
            "The converter is slower than the device sends: ask for a lower rate",
        )  # fmt: skip


def _disturbances(health: GaugeHealth) -> Iterator[Symptom]:
    """What adds to the readings."""
    if health.noise_rms_m > NOISE_M[0]:
        yield Symptom(
            "noisy", _graded(health.noise_rms_m, NOISE_M), f"noise of {format_length(health.noise_rms_m)} rms",
            "Check shield and plugs, keep motors and phones away, or set the amplifier's filter lower",
        )  # fmt: skip
    drift = abs(health.drift_m_per_min)
    if drift > max(DRIFT_M_PER_MIN[0], _DRIFT_SIGMAS * health.drift_standard_uncertainty):
        yield Symptom(
            "drifts", _graded(drift, DRIFT_M_PER_MIN),
            f"it drifts by {format_length(health.drift_m_per_min)} a minute",
            "Let the amplifier warm up for half an hour, and keep draughts and sun off the stand",
        )  # fmt: skip
    for hum in health.hum:
        if hum.amplitude_m is not None and hum.amplitude_m > HUM_M[0]:
            yield Symptom(
                "hums", _graded(hum.amplitude_m, HUM_M),
                f"{hum.frequency_hz:g} Hz of the mains with an amplitude of {format_length(hum.amplitude_m)}",
                "Connect the cable's shield at one end, ground the amplifier, lay mains cables elsewhere",
            )  # fmt: skip


def _graded(value: float, bounds: tuple[float, float]) -> Verdict:
    return Verdict.BAD if value > bounds[1] else Verdict.DOUBTFUL
