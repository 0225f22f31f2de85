"""Filters of the reference firmware's converters, from the times in their data sheets."""

import pytest

from drivers.devices.slipstand_binary.converters import converter_filter


def test_an_hx711_settles_in_four_conversions():
    found = converter_filter("1.0.0+hx711", 80.0)
    assert (found.order, found.corner_hz) == (4, pytest.approx(18.2, abs=0.01))


@pytest.mark.parametrize(("rate_hz", "settling_s"), [(40.0, 0.01018), (500.0, 0.00068), (1000.0, 0.00031)])
def test_an_ads1256_averages_over_its_settling_time(rate_hz, settling_s):
    found = converter_filter("1.0.0+ads1256.watchdog", rate_hz)
    assert (found.order, found.corner_hz) == (1, pytest.approx(0.442946 / settling_s))


def test_nothing_is_said_of_other_converters():
    assert converter_filter("1.2", 500.0) is None
    assert converter_filter("1.0.0+pattern", 500.0) is None
