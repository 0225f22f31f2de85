"""ME-Systeme GSV-8 and GSV-6, multi-channel bridge amplifiers."""

from drivers.driver import DeviceDriver
from messages.i18n import N_

DRIVER = DeviceDriver(
    name="gsv",
    title=N_("ME-Systeme GSV-8 and GSV-6 (the GSV-6 usually at 230400 baud)"),
    rank=30,
    default_baud=115200,
    evidence=N_("the vendor's client gsv86lib 0.1.1 reads the simulated device"),
    package=__name__,
    frames_title=N_("frames of a GSV"),
)
