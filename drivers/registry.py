"""Every protocol by its name."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from importlib import import_module

from drivers.errors import SettingsError
from drivers.source import SampleSource

UNVERIFIED = "not verified on hardware"
RESERVED = "reserved, comes later"


@dataclass(frozen=True, slots=True)
class ProtocolInfo:
    """What can be said of a protocol, and how to speak it.

    Attributes
    ----------
    name : str
        As given to `--protocol`.
    title : str
        For people.
    default_baud : int
        0 where none is usual.
    channels : int
        Gauges on one port.
    verified : str
        What it was tested against.
    module : str
        Where its `make_source(settings, rate_hz)` is, imported on use; "" for a name that is only
        reserved.
    bauds : mapping of str to int
        Usual baud rates of a device that is chosen by its setting `format`.
    """

    name: str
    title: str
    default_baud: int
    channels: int
    verified: str = RESERVED
    module: str = ""
    bauds: Mapping[str, int] = field(default_factory=dict)

    @property
    def available(self) -> bool:
        """Whether the protocol is built."""
        return bool(self.module)

    def default_baud_for(self, settings: Mapping[str, str]) -> int:
        """Baud rate of a device with its own `settings`; 0 where none is usual."""
        return self.bauds.get(settings.get("format", ""), self.default_baud)

    def make_source(self, settings: dict[str, str], rate_hz: float | None) -> SampleSource:
        """Source of a device with its own `settings`.

        Raises
        ------
        SettingsError
            For a setting or rate that cannot be, or a protocol that is only reserved.
        """
        find_protocol(self.name)
        make: Callable[[dict[str, str], float | None], SampleSource]
        make = import_module(self.module).make_source
        return make(settings, rate_hz)


PROTOCOLS: dict[str, ProtocolInfo] = {
    info.name: info
    for info in (
        ProtocolInfo(
            "slipstand-binary",
            "Slipstand binary (microcontroller with the reference firmware)",
            460800,
            2,
            f"{UNVERIFIED}; the reference firmware is read in simavr, an AVR simulator",
            "drivers.slipstand_binary.source",
        ),
        ProtocolInfo(
            "csv",
            "CSV lines (Arduino, HX711, ADS1256, OpenScale, loggers)",
            115200,
            2,
            UNVERIFIED,
            "drivers.csv_lines.source",
            {"openscale": 9600},
        ),
        ProtocolInfo(
            "gsv",
            "ME-Systeme GSV-8 and GSV-6 (the GSV-6 usually at 230400 baud)",
            115200,
            2,
            f"{UNVERIFIED}; the vendor's client gsv86lib 0.1.1 reads the simulated device",
            "drivers.gsv.source",
        ),
        ProtocolInfo("dataq", "DATAQ DI-1100 to DI-4208", 0, 2),
        ProtocolInfo(
            "modbus",
            "Modbus RTU transmitters (Laumas TLB4, Scaime eNod4, others by their registers)",
            115200,
            2,
            f"{UNVERIFIED}; reads pymodbus 3.16 as server, and minimalmodbus 2.1 reads the simulated device",
            "drivers.modbus.source",
        ),
        ProtocolInfo("hbm-aed", "HBM/HBK AED and FIT", 0, 1),
        ProtocolInfo("enod4", "Scaime eNod4 fast SCMBus", 115200, 1),
        ProtocolInfo("mantracourt", "Mantracourt DSC, DCell, DSCUSB", 115200, 1),
        ProtocolInfo("scale-line", "Lines of scales (Dini Argeo, KERN, Laumas)", 0, 1),
        ProtocolInfo(
            "harp",
            "Harp LoadCells",
            1_000_000,
            2,
            f"{UNVERIFIED}; harp-python 0.4.2 reads the simulated device's bytes",
            "drivers.harp.source",
        ),
    )
}


def find_protocol(name: str) -> ProtocolInfo:
    """The protocol of that name.

    Raises
    ------
    SettingsError
        If it is not known, or only reserved.
    """
    info = PROTOCOLS.get(name)
    if info is None:
        raise SettingsError(f"protocol {name!r} is not known: use one of {_usable()}")
    if not info.available:
        raise SettingsError(f"protocol {name!r} ({info.title}) comes later: use one of {_usable()}")
    return info


def _usable() -> str:
    return ", ".join(info.name for info in PROTOCOLS.values() if info.available)
