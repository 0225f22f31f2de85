"""The settings of a run are checked before it is armed."""

import math

import pytest

from app.acquisition.errors import RunSettingsError
from app.acquisition.messages import PortSettings, RunSettings
from app.acquisition.run_setup import check_run_settings, complete_port_settings, with_device_filters
from config.files import load_gauges
from config.schema import Device, Filter
from drivers.samples import ChannelFilter


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"trigger": "whistle"}, "whistle"),
        ({"pretrigger_s": -1.0}, "pretrigger -1 s"),
        ({"pretrigger_s": math.nan}, "pretrigger nan s"),
        ({"pretrigger_s": 61.0}, "0 to 60"),
        ({"duration_s": 0.0}, "duration_s"),
        ({"duration_s": math.inf}, "duration_s"),
        ({"trigger_timeout_s": -3.0}, "trigger_timeout_s"),
    ],
)
def test_settings_that_no_run_can_have_are_refused(settings, words):
    with pytest.raises(RunSettingsError, match=words):
        check_run_settings(RunSettings("/runs", **settings))


def test_usual_settings_pass():
    check_run_settings(RunSettings("/runs"))
    check_run_settings(RunSettings("/runs", trigger="none", pretrigger_s=0.0, duration_s=3600.0))


def test_the_calibration_file_says_what_the_port_leaves_open():
    device = Device("csv", baud=9600, rate_hz=80.0, settings={"columns": "table,relative", "time_bits": 16})
    asked = PortSettings("/dev/x", "csv", device={"columns": "relative,table"})
    port = complete_port_settings(asked, device)
    assert (port.baud, port.rate_hz) == (9600, 80.0)
    line = complete_port_settings(asked, Device("csv", parity="E", stop_bits=2))
    assert (line.parity, line.stop_bits) == ("E", 2)
    given = PortSettings("/dev/x", "csv", parity="N", stop_bits=1)
    assert complete_port_settings(given, Device("csv", parity="E", stop_bits=2)) == given
    assert port.device == {"columns": "relative,table", "time_bits": "16"}
    assert complete_port_settings(PortSettings("/dev/x", "csv", baud=1200), device).baud == 1200
    other = PortSettings("/dev/x", "slipstand-binary")
    assert complete_port_settings(other, device) == other


def test_a_device_fills_in_the_filters_that_are_not_stated():
    gauges = load_gauges()
    stated = gauges.replace(table=gauges.table.replace(filter=Filter("none")))
    run = with_device_filters(stated, (ChannelFilter(4, 18.2), ChannelFilter(4, 18.2)))
    assert run.table == stated.table
    assert run.relative == gauges.relative.replace(filter=Filter("sinc", 4, 18.2, 0.0))
    assert with_device_filters(gauges, (None, None)) == gauges


def test_the_calibration_file_may_say_what_is_of_gauge_2s_device_alone():
    device = Device("modbus", settings={"unit": 1, "relative": {"unit": 2}})
    assert complete_port_settings(PortSettings("/dev/x", "modbus"), device).device == {
        "unit": "1",
        "relative.unit": "2",
    }
