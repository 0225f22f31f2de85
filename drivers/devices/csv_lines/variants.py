"""Devices that are chosen by the setting `format`."""

from drivers.devices.csv_lines.presets import OPENSCALE, read_preset, shipped_presets
from drivers.driver import UNVERIFIED, DeviceVariant

_OPENSCALE = DeviceVariant(
    OPENSCALE,
    "SparkFun OpenScale",
    {"format": OPENSCALE},
    f"{UNVERIFIED}; lines of its firmware 1.0 and 1.2 are read",
)


def list_variants() -> list[DeviceVariant]:
    """Rows of `device list`, in no order."""
    return [_OPENSCALE, *map(_variant, shipped_presets())]


def _variant(name: str) -> DeviceVariant:
    preset = read_preset(name)
    verified = "; ".join(filter(None, (UNVERIFIED, preset.peer, f"reads the examples of {preset.source}")))
    return DeviceVariant(name, preset.title, {"format": name}, verified)
