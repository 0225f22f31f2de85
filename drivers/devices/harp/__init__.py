"""Harp LoadCells, an interface for eight load cells that sends at 1 kHz with the time of each sample."""

from drivers.driver import DeviceDriver
from messages.i18n import N_

DRIVER = DeviceDriver(
    name="harp",
    title=N_("Harp LoadCells"),
    rank=100,
    default_baud=1_000_000,
    evidence=N_("harp-device 0.5.0 talks to the simulated device, harp-python 0.4.2 reads it"),
    package=__name__,
    simulated_rate_hz=1000.0,
    simulated_gauges="gauges-16-bit.toml",
    frames_title=N_("Harp events"),
)
