"""Lines of values, as Arduinos and loggers send them."""

from drivers.driver import UNVERIFIED, DeviceDriver
from messages.i18n import N_

DRIVER = DeviceDriver(
    name="csv",
    title=N_("CSV lines (Arduino, HX711, ADS1256, OpenScale, loggers)"),
    rank=20,
    default_baud=115200,
    verified=UNVERIFIED,
    package=__name__,
    format_bauds={"openscale": 9600},
    has_single_gauge_settings=True,
)
