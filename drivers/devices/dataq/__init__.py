"""DATAQ DI-1100, 1110, 1120, 2108, 4108 and 4208, converters for amplifiers with a voltage output."""

from drivers.driver import DeviceDriver
from messages.i18n import N_

DRIVER = DeviceDriver(
    name="dataq",
    title=N_("DATAQ DI-1100, 1110, 1120, 2108, 4108, 4208"),
    rank=40,
    default_baud=115200,
    evidence=N_("the maker's Python examples read the simulated device"),
    package=__name__,
    simulated_gauges="gauges-16-bit.toml",
    frames_title=N_("scans of a DATAQ instrument"),
)
