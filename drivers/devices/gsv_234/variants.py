"""Models with one channel, which are chosen by the setting `format`."""

from drivers.driver import UNVERIFIED, DeviceVariant

_SOURCES = {
    "gsv-3": "me-systeme, GSV-3-test-scripts; GSV-3USB manual, page 47",
    "gsv-2": "GSV-2AS user manual, pages 16, 18, 29",
}


def list_variants() -> list[DeviceVariant]:
    """Rows of `device list`, in no order."""
    return [
        DeviceVariant(
            name,
            f"ME-Systeme {name.upper()}",
            {"format": name},
            f"{UNVERIFIED}, no peer; bytes of {source}",
        )
        for name, source in _SOURCES.items()
    ]
