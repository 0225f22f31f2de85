"""ME-Systeme GSV-4, GSV-3 and GSV-2, the bridge amplifiers before the GSV-6."""

from drivers.driver import DeviceDriver
from messages.i18n import N_

DRIVER = DeviceDriver(
    name="gsv-234",
    title=N_("ME-Systeme GSV-4, GSV-3 and GSV-2 (the latter two with one channel)"),
    rank=35,
    default_baud=115200,
    evidence=N_("no peer; the manuals' examples and the bytes of the vendor's scripts are read"),
    package=__name__,
    format_bauds={"gsv-3": 38400, "gsv-2": 38400},
    frames_title=N_("frames of a GSV-2, 3 or 4"),
    simulated_rate_hz=500.0,
    simulated_gauges="gauges-16-bit.toml",
    has_single_gauge_settings=True,
)
