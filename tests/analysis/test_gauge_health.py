"""Health of a gauge at rest, from readings of known noise, drift and hum."""

from typing import Any

import numpy as np
import pytest

from analysis.gauge_health import (
    GaugeHealth,
    GaugeHealthError,
    GaugeSamples,
    diagnose,
    measure_health,
    worst_grade,
)
from analysis.health_grade import HealthGrade

RATE_HZ = 1000.0
RANGE_M = 0.0165


def rest(seconds: float = 5.0, noise_m: float = 10e-6, rate_hz: float = RATE_HZ, seed: int = 1) -> np.ndarray:
    """White noise about 1 mm."""
    count = round(seconds * rate_hz)
    return 1e-3 + noise_m * np.random.default_rng(seed).standard_normal(count)


def line(amplitude_m: float, frequency_hz: float, x: np.ndarray, rate_hz: float = RATE_HZ) -> np.ndarray:
    return amplitude_m * np.sin(2.0 * np.pi * frequency_hz * np.arange(len(x)) / rate_hz + 0.7)


def health_of(x: np.ndarray, rate_hz: float = RATE_HZ, **changes: Any) -> GaugeHealth:
    facts: dict[str, Any] = {"overloaded": np.zeros(len(x), bool), "range_m": RANGE_M} | changes
    return measure_health(GaugeSamples(x, rate_hz=rate_hz, **facts))


def said_of(x: np.ndarray, rate_hz: float = RATE_HZ, **changes: Any) -> list[tuple[str, HealthGrade]]:
    return [(one.code, one.grade) for one in diagnose(health_of(x, rate_hz, **changes))]


def test_a_sound_gauge_is_good() -> None:
    found = health_of(rest())
    assert found.noise_rms_m == pytest.approx(10e-6, rel=0.05)
    assert [one.amplitude_m for one in found.hum] == [0.0, 0.0]
    assert found.mean_m == pytest.approx(1e-3, abs=1e-6)
    assert found.range_fraction == pytest.approx(1.04e-3 / RANGE_M, rel=0.01)
    assert diagnose(found) == ()
    assert worst_grade(()) is HealthGrade.GOOD


def test_the_spectrum_sums_to_the_variance() -> None:
    x = rest(seconds=60.0) + line(30e-6, 50.0, rest(seconds=60.0))
    spectrum = health_of(x).spectrum
    variance = np.sum(spectrum.density_m_per_sqrt_hz**2) * spectrum.frequency_hz[1]
    assert variance == pytest.approx(np.var(x), rel=0.02)


def test_drift_is_found_with_an_uncertainty_that_holds() -> None:
    """Ratios of error to stated uncertainty follow Student's t with 8 degrees of freedom."""
    errors = []
    for seed in range(400):
        x = rest(seconds=2.0, seed=seed) + np.arange(2000) / RATE_HZ * 60e-6 / 60.0
        found = health_of(x)
        errors.append((found.drift_m_per_min - 60e-6) / found.drift_standard_uncertainty_m_per_min)
    within = np.mean(np.abs(errors) < 2.306)  # 95 % of Student's t
    assert 0.92 <= within <= 0.98
    assert abs(np.mean(errors)) < 0.2


def test_slow_noise_makes_drift_less_sure_rather_than_significant() -> None:
    """A random walk has no drift; its scatter must not be taken for one."""
    called = 0
    for seed in range(200):
        walk = np.cumsum(np.random.default_rng(seed).normal(0.0, 0.2e-6, 5000))
        found = health_of(rest(noise_m=1e-6, seed=seed) + walk)
        called += abs(found.drift_m_per_min) > 4.0 * found.drift_standard_uncertainty_m_per_min
    assert called < 100  # by white noise alone it would be nearly all


@pytest.mark.parametrize("mains_hz", [50.0, 50.1, 59.95])
@pytest.mark.parametrize("amplitude_m", [8e-6, 200e-6])
def test_hum_is_measured_at_its_frequency(mains_hz: float, amplitude_m: float) -> None:
    x = rest(seconds=10.0)
    found = health_of(x + line(amplitude_m, mains_hz, x))
    amplitudes = {one.frequency_hz: one.amplitude_m for one in found.hum}
    assert amplitudes.pop(float(round(mains_hz, -1))) == pytest.approx(amplitude_m, rel=0.1)
    assert list(amplitudes.values()) == [0.0]
    assert found.noise_rms_m == pytest.approx(10e-6, rel=0.25)


def test_hum_folded_by_a_low_rate_is_still_told() -> None:
    x = rest(seconds=20.0, rate_hz=80.0)
    found = health_of(x + line(40e-6, 50.0, x, 80.0), 80.0)
    assert found.hum[0].amplitude_m == pytest.approx(40e-6, rel=0.1)
    assert found.hum[1].amplitude_m == 0.0


@pytest.mark.parametrize("rate_hz", [10.0, 50.0, 100.0, 110.0])
def test_hum_that_sampling_hides_is_called_unknown(rate_hz: float) -> None:
    found = health_of(rest(seconds=20.0, rate_hz=rate_hz), rate_hz)
    assert found.hum[0].amplitude_m is None


def test_hum_is_not_seen_where_there_is_none() -> None:
    """In 300 gauges of white and of low-pass noise, not once in two hundred."""
    seen = 0
    for seed in range(300):
        x = rest(seconds=5.0, seed=seed)
        low = np.convolve(x, np.ones(8) / 8.0, "same")[50:-50]
        seen += sum(bool(one.amplitude_m) for y in (x, low) for one in health_of(y).hum)
    assert seen <= 6


def gaps(x: np.ndarray, share: float) -> np.ndarray:
    x = x.copy()
    x[np.random.default_rng(2).random(len(x)) < share] = np.nan
    return x


STUCK = np.full(5000, 2e-3)
COARSE = np.round(rest(noise_m=8e-6) / 10e-6) * 10e-6


@pytest.mark.parametrize(
    ("x", "changes", "said"),
    [
        (rest(noise_m=60e-6), {}, [("noisy", HealthGrade.DOUBTFUL)]),
        (rest(noise_m=200e-6), {}, [("noisy", HealthGrade.BAD)]),
        (rest() + line(40e-6, 50.0, rest()), {}, [("hums", HealthGrade.DOUBTFUL)]),
        (rest() + np.linspace(0.0, 40e-6, 5000), {}, [("drifts", HealthGrade.DOUBTFUL)]),
        (rest() + np.linspace(0.0, 400e-6, 5000), {}, [("drifts", HealthGrade.BAD)]),
        (rest() + line(1e-3, 3.1, rest()), {}, [("moves", HealthGrade.DOUBTFUL)]),
        (STUCK, {}, [("dead", HealthGrade.BAD)]),
        (rest(noise_m=1e-10), {}, [("too-quiet", HealthGrade.DOUBTFUL)]),
        (np.minimum(rest(), 1e-3 + 5e-6), {}, [("clipped", HealthGrade.BAD)]),
        (np.minimum(rest(), 1e-3 + 15e-6), {}, [("clipped", HealthGrade.DOUBTFUL)]),
        (rest() + 8e-3, {}, [("off-centre", HealthGrade.DOUBTFUL)]),
        (rest() + 15e-3, {}, [("off-centre", HealthGrade.BAD)]),
        (rest(), {"overloaded": np.arange(5000) < 20}, [("overloaded", HealthGrade.DOUBTFUL)]),
        (rest(), {"overloaded": np.arange(5000) < 500}, [("overloaded", HealthGrade.BAD)]),
        (gaps(rest(), 0.01), {}, [("absent", HealthGrade.DOUBTFUL)]),
        (gaps(rest(), 0.2), {}, [("absent", HealthGrade.BAD)]),
        (np.repeat(rest(seconds=2.5), 2), {}, [("repeats", HealthGrade.DOUBTFUL)]),
        (COARSE, {}, []),
        (rest(), {"range_m": None}, []),
    ],
)  # fmt: skip
def test_each_trouble_has_its_name(
    x: np.ndarray, changes: dict[str, Any], said: list[tuple[str, HealthGrade]]
) -> None:
    assert said_of(x, **changes) == said


def test_every_symptom_has_a_remedy_and_the_worst_comes_first() -> None:
    x = gaps(np.minimum(rest() + 8e-3, 9e-3 + 5e-6), 0.01)
    symptoms = diagnose(health_of(x))
    assert [one.code for one in symptoms] == ["clipped", "absent", "off-centre"]
    assert worst_grade(symptoms) is HealthGrade.BAD
    assert all(one.message and one.remedy for one in symptoms)


def test_too_few_readings_are_refused() -> None:
    with pytest.raises(GaugeHealthError, match=r"500 readings in 0\.5 s are too few"):
        health_of(rest(seconds=0.5))
    with pytest.raises(GaugeHealthError, match="0 readings in 5 s"):
        health_of(np.full(5000, np.nan))


def test_a_large_drift_is_said_in_millimetres() -> None:
    x = rest(seconds=10.0) + np.arange(10_000) / RATE_HZ * 5.46e-3 / 60.0
    drifts = next(one for one in diagnose(health_of(x)) if one.code == "drifts")
    assert str(drifts.message) in {f"it drifts by 5.{digits} mm a minute" for digits in range(44, 49)}
