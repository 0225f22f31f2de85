"""What is shown of the gauges' health."""

import numpy as np

from analysis.gauge_health import GaugeSamples, measure_health
from analysis.health_grade import HealthGrade
from app.presenters.gauge_health import gauge_health_state
from app.presenters.gauge_health_state import GaugeHealthState


def shown(x: np.ndarray, rate_hz: float = 1000.0) -> GaugeHealthState:
    samples = GaugeSamples(x, np.zeros(len(x), bool), rate_hz, 0.0165)
    return gauge_health_state("gauge 1 (table)", measure_health(samples))


NOISE = 12e-6 * np.random.default_rng(8).standard_normal(5000)


def test_a_sound_gauge_in_figures() -> None:
    state = shown(1e-3 + NOISE)
    figures = {one.label: one.value for one in state.figures}
    assert state.verdict is HealthGrade.GOOD
    assert figures["reading"] == "1.000\u202fmm"
    assert figures["noise, rms"] == "12.1\u202fµm"
    assert figures["hum, 50 Hz"] == "none seen"
    assert figures["range used"] == "6\u202f%"
    assert len(state.frequency_hz) == len(state.density_um) == 501


def test_large_figures_are_written_out() -> None:
    figures = {one.label: one.value for one in shown(200.0 * NOISE).figures}
    assert figures["noise, rms"] == "2419\u202fµm"


def test_hum_that_the_rate_hides_is_not_called_none() -> None:
    figures = {one.label: one.value for one in shown(NOISE, 50.0).figures}
    assert figures["hum, 50 Hz"] == "hidden by this rate"


def test_a_dead_gauge_says_what_to_do() -> None:
    state = shown(np.zeros(5000))
    assert state.verdict is HealthGrade.BAD
    assert [one.code for one in state.symptoms] == ["dead"]
    assert "check plug" in state.symptoms[0].remedy


def test_both_gauges_have_the_same_lines() -> None:
    labels = [[one.label for one in shown(x).figures] for x in (NOISE, np.zeros(5000))]
    assert labels[0] == labels[1]


def test_of_a_moving_table_no_noise_and_no_drift_are_told() -> None:
    swing = 1e-3 * np.sin(2.0 * np.pi * 3.0 * np.arange(5000) / 1000.0)
    state = shown(swing + NOISE)
    figures = {one.label: one.value for one in state.figures}
    assert [one.code for one in state.symptoms] == ["moves"]
    assert figures["noise, rms"] == figures["drift"] == "−"


def test_a_drift_has_two_digits_of_its_uncertainty() -> None:
    rise = 40e-6 / 60.0 * np.arange(5000) / 1000.0
    figures = {one.label: one.value for one in shown(rise + NOISE).figures}
    value, _, rest = figures["drift"].replace("\u00a0", " ").partition(" ± ")
    uncertainty, unit = rest.split(" ")
    assert unit == "µm/min"
    assert len(uncertainty.replace(".", "").lstrip("0")) == 2
    assert len(value.partition(".")[2]) == len(uncertainty.partition(".")[2])
    assert abs(float(value) - 40.0) < 4.0 * float(uncertainty)
