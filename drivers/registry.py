"""Every protocol by its name."""

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module

from drivers.errors import SettingsError
from drivers.source import SampleSource

UNVERIFIED = "not verified on hardware"

_RESERVED = {
    "gsv": "ME-Systeme GSV-8 and GSV-6",
    "dataq": "DATAQ DI-1100 to DI-4208",
    "modbus": "Modbus RTU transmitters",
    "hbm-aed": "HBM/HBK AED and FIT",
    "enod4": "Scaime eNod4 fast SCMBus",
    "mantracourt": "Mantracourt DSC, DCell, DSCUSB",
    "scale-line": "lines of scales (Dini Argeo, KERN, Laumas)",
    "harp": "Harp LoadCells",
}


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
    channels : int
        Gauges on one port.
    verified : str
        What it was tested against.
    module : str
        Where its `make_source(settings, rate_hz)` and its `compile_decoder` are; imported on use.
    """

    name: str
    title: str
    default_baud: int
    channels: int
    verified: str
    module: str

    def make_source(self, settings: dict[str, str], rate_hz: float | None) -> SampleSource:
        """Source of a device with its own `settings`. Raises SettingsError."""
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
            UNVERIFIED,
            "drivers.slipstand_binary.source",
        ),
        ProtocolInfo(
            "csv",
            "CSV lines (Arduino, HX711, ADS1256, loggers)",
            115200,
            2,
            UNVERIFIED,
            "drivers.csv_lines.source",
        ),
    )
}


def reserved_protocols() -> dict[str, str]:
    """Names that are kept for devices to come, and their titles."""
    return dict(_RESERVED)


def find_protocol(name: str) -> ProtocolInfo:
    """The protocol of that name.

    Raises
    ------
    SettingsError
        If it is not known, or not built yet.
    """
    if name in PROTOCOLS:
        return PROTOCOLS[name]
    usable = ", ".join(PROTOCOLS)
    if name in _RESERVED:
        raise SettingsError(f"protocol {name!r} ({_RESERVED[name]}) comes later: use one of {usable}")
    raise SettingsError(f"protocol {name!r} is not known: use one of {usable}")
