"""Lines of values, as Arduinos and loggers send them."""

from drivers.driver import DeviceDriver
from messages.i18n import N_

DRIVER = DeviceDriver(
    name="csv",
    title=N_("CSV lines (Arduino, HX711, ADS1256, OpenScale, loggers)"),
    rank=20,
    default_baud=115200,
    evidence=N_("presets read the examples of manuals, PyVISA 1.16 the simulated multimeter"),
    package=__name__,
    format_bauds={
        "openscale": 9600,
        "loadstar-iload": 9600,
        "mt-sics": 9600,
        "sartorius-sbi": 9600,
        "and-balance": 9600,
        "scpi-read": 9600,
    },
    has_single_gauge_settings=True,
)
