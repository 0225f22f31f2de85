"""Filters of the reference firmware's converters, from the times in their data sheets."""

import numpy as np
import pytest

from drivers.devices.slipstand_binary.converters import converter_filter


def test_an_hx711_settles_in_four_conversions():
    found = converter_filter("1.0.0+hx711", 80.0)
    assert (found.order, found.corner_hz) == (4, pytest.approx(18.2, abs=0.01))


@pytest.mark.parametrize(("rate_hz", "settling_s"), [(40.0, 0.01018), (500.0, 0.00068), (1000.0, 0.00031)])
def test_an_ads1256_averages_over_its_settling_time(rate_hz, settling_s):
    found = converter_filter("1.0.0+ads1256.watchdog", rate_hz)
    assert (found.order, found.corner_hz) == (1, pytest.approx(0.442946 / settling_s))


@pytest.mark.parametrize("rate_hz", [1000.0, 2000.0, 4000.0])
def test_an_ads131m02_is_a_sinc_of_third_order(rate_hz):
    """Data sheet of its kin ADS131B26: 262 Hz at 1 kHz, 524 Hz at 2 kHz, 1.0 kHz at 4 kHz."""
    found = converter_filter("1.0.0+ads131m02", rate_hz)
    assert (found.order, found.corner_hz) == (3, pytest.approx(0.262 * rate_hz, rel=3e-4))
    assert np.sinc(found.corner_hz / rate_hz) ** 3 == pytest.approx(np.sqrt(0.5), rel=1e-5)


def test_nothing_is_said_of_other_converters():
    assert converter_filter("1.2", 500.0) is None
    assert converter_filter("1.0.0+pattern", 500.0) is None
