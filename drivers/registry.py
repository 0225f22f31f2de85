"""All devices by name: the folders of `drivers.devices`, and names that are reserved for later ones."""

from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules

from drivers.driver import DeviceDriver
from drivers.errors import SettingsError
from messages.i18n import N_
from messages.message import option

_RESERVED = (
    DeviceDriver("mantracourt", "Mantracourt DSC, DCell, DSCUSB", 80, 115200, 1),
    DeviceDriver("scale-line", "Lines of scales (Dini Argeo, KERN, Laumas)", 90, channels=1),
)
_READ_BY = {"mantracourt": "csv --set format=mantracourt-dscusb", "scale-line": "csv --set columns=..."}
"""What reads the lines of a device whose own protocol is only reserved, as options."""

_FOLDERS = iter_modules([str(Path(__file__).with_name("devices"))])
_BUILT = [import_module(f"drivers.devices.{folder.name}").DRIVER for folder in _FOLDERS]
_BY_NAME = {driver.name: driver for driver in (*_RESERVED, *_BUILT)}
DRIVERS: dict[str, DeviceDriver] = dict(sorted(_BY_NAME.items(), key=lambda item: item[1].rank))
"""By name, in the order of lists; reserved names included."""

AVAILABLE = tuple(driver for driver in DRIVERS.values() if driver.available)
"""Those that are built, in the same order."""


def find_driver(name: str) -> DeviceDriver:
    """Driver of that name. Raises SettingsError for one that is unknown or only reserved."""
    driver = DRIVERS.get(name)
    if driver is not None and driver.available:
        return driver
    if driver is not None:
        template = N_("protocol {name!r} ({title}) comes later: its lines are read by {option} {read_by}")
        raise SettingsError(
            template, name=name, title=driver.title, option=option("--protocol"), read_by=_READ_BY[name]
        )
    template = N_("protocol {name!r} is not known: use one of {usable}")
    raise SettingsError(template, name=name, usable=[one.name for one in AVAILABLE])
