"""HBM/HBK AED and FIT, transducer electronics and digital load cells with one channel."""

from drivers.driver import DeviceDriver
from messages.i18n import N_

DRIVER = DeviceDriver(
    name="hbm-aed",
    title=N_("HBM/HBK AED and FIT, one gauge each (usually even parity)"),
    rank=60,
    default_baud=9600,
    channels=1,
    evidence=N_("no peer; commands, answers and formats are those of the maker's AD104 manual"),
    package=__name__,
    frames_title=N_("binary values of an AED or FIT"),
    simulated_rate_hz=600.0,
)
