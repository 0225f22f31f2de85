"""The Slipstand binary protocol of any microcontroller with the reference firmware (`firmware/`)."""

from drivers.driver import DeviceDriver
from messages.i18n import N_

DRIVER = DeviceDriver(
    name="slipstand-binary",
    title=N_("Slipstand binary (microcontroller with the reference firmware)"),
    rank=10,
    default_baud=460800,
    evidence=N_("the reference firmware is read in simavr, an AVR simulator"),
    package=__name__,
    frames_title=N_("Slipstand frames"),
)
