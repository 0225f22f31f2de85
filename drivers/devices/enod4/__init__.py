"""Scaime eNod4 that sends by itself, in the fast SCMBus protocol."""

from drivers.driver import DeviceDriver
from messages.i18n import N_

DRIVER = DeviceDriver(
    name="enod4",
    title=N_("Scaime eNod4, fast SCMBus (one channel)"),
    rank=70,
    default_baud=115200,
    channels=1,
    evidence=N_("no peer; frames are written as the manual describes them"),
    package=__name__,
    frames_title=N_("fast SCMBus frames"),
    simulated_rate_hz=500.0,
)
