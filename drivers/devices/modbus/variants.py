"""Devices that are chosen by the setting `map`."""

from drivers.devices.modbus.maps import read_origin, shipped_maps
from drivers.driver import UNVERIFIED, DeviceVariant


def list_variants() -> list[DeviceVariant]:
    """Rows of `device list`, in no order."""
    return [_variant(name) for name in shipped_maps()]


def _variant(name: str) -> DeviceVariant:
    origin = read_origin(name)
    registers = f"registers of {origin.source}" if origin.source else ""
    verified = "; ".join(filter(None, (UNVERIFIED, origin.peer, registers)))
    return DeviceVariant(name, origin.title, {"map": name}, verified)
