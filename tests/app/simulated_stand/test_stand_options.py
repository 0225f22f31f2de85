import pytest

from app.simulated_stand.options import SimulatedStandOptions


@pytest.mark.parametrize(
    ("protocol", "given", "settings"),
    [
        ("csv", {}, {"columns": "time_us,value"}),
        ("csv", {"columns": "time_ms,value"}, {"columns": "time_ms,value"}),
        ("csv", {"format": "openscale"}, {"format": "openscale"}),
        ("modbus", {}, {"channel": "relative"}),
    ],
)
def test_an_only_gauge_is_among_the_devices_settings(protocol, given, settings):
    options = SimulatedStandOptions(protocol=protocol, gauge="relative", device=given)
    assert options.device_settings() == (settings, protocol == "csv")
