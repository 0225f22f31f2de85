"""Delays of stated filters, against the designs of scipy and against moving averages."""

import numpy as np
import pytest
from scipy import signal
from synthetic import Truth, simulate_record

from analysis.identify import identify
from analysis.record import GaugeFilter, GaugeUncertainty

CORNER_HZ = 40.0
DESIGNS = {"butterworth": signal.buttap, "bessel": lambda order: signal.besselap(order, norm="mag")}


@pytest.mark.parametrize("order", range(1, 9))
@pytest.mark.parametrize("kind", ["butterworth", "bessel"])
def test_delay_of_an_analogue_design(kind, order):
    _, poles, _ = DESIGNS[kind](order)
    delay_s = -np.sum(1.0 / poles).real / (2.0 * np.pi * CORNER_HZ)
    assert GaugeFilter(kind, order, CORNER_HZ).delay_s == pytest.approx(delay_s, rel=1e-5)


@pytest.mark.parametrize("order", [1, 2, 5])
def test_delay_of_equal_stages(order):
    delay_s = GaugeFilter("rc", order, CORNER_HZ).delay_s
    stage = 1j * 2.0 * np.pi * CORNER_HZ * delay_s / order
    assert abs((1.0 + stage) ** -order) == pytest.approx(0.5**0.5)


@pytest.mark.parametrize("order", [1, 3, 4, 8])
def test_delay_of_moving_averages(order):
    window_s = 2.0 * GaugeFilter("sinc", order, CORNER_HZ).delay_s / order
    assert np.sinc(CORNER_HZ * window_s) ** order == pytest.approx(0.5**0.5)


def test_a_stated_filter_takes_its_delay_out_of_the_friction():
    stage = GaugeFilter("rc", 1, 1.0 / (2.0 * np.pi * 5e-3))
    truth = Truth(lag_s=stage.delay_s, duration_s=6.0)
    known = identify(simulate_record(truth, relative_gauge=GaugeUncertainty(filter=stage)))
    assert known.model.adequate
    assert known.results["friction_dynamic"].value == pytest.approx(truth.friction_dynamic, rel=1e-3)
