"""Which devices come in pairs, and how each half of one is told what it is."""

from dataclasses import dataclass

from drivers.errors import SettingsError
from drivers.registry import ProtocolInfo
from drivers.source import SampleSource

GAUGES = ("table", "relative")
_OWN = "relative."
"""Before a setting of gauge 2's device alone; its rate can be one of them."""
_RATE = "rate"


@dataclass(frozen=True, slots=True)
class PairedChannel:
    """One device of a pair.

    Attributes
    ----------
    source : SampleSource
    column : int
        Where its readings stand in a block.
    """

    source: SampleSource
    column: int


def make_paired_channel(
    protocol: ProtocolInfo, gauge: int, settings: dict[str, str], rate_hz: float | None
) -> PairedChannel:
    """Device of gauge 0 or 1.

    Parameters
    ----------
    protocol : ProtocolInfo
        Both devices speak it.
    gauge : int
    settings : dict
        Of both devices; those whose name begins with `relative.` are of gauge 2's alone. `relative.rate` is
        its rate, where that is another.
    rate_hz : float or None

    Raises
    ------
    SettingsError
        For a protocol whose devices have both gauges on one port, or a setting or rate that cannot be.
    """
    given = {key: value for key, value in settings.items() if not key.startswith(_OWN)}
    if gauge:
        own = {key.removeprefix(_OWN): value for key, value in settings.items() if key.startswith(_OWN)}
        rate_hz = _parse_rate(own.pop(_RATE)) if _RATE in own else rate_hz
        given |= own
    match protocol.name:
        case "csv":
            return PairedChannel(protocol.make_source(_csv_settings(given), rate_hz), 0)
        case "modbus":
            return PairedChannel(protocol.make_source(given | {"channel": GAUGES[gauge]}, rate_hz), gauge)
    if protocol.channels > 1:
        raise SettingsError(
            f"protocol {protocol.name} has both gauges on one port: leave the port of gauge 2 out"
        )
    return PairedChannel(protocol.make_source(given, rate_hz), 0)


def _csv_settings(given: dict[str, str]) -> dict[str, str]:
    if given.get("format", "columns") != "columns":
        return given  # it tells its columns itself
    columns = given.get("columns", "time_us,value")
    if "value" not in (name.strip() for name in columns.split(",")):
        raise SettingsError(
            f"columns {columns} have no value: a device with one gauge sends one, as time_us,value"
        )
    return given | {"columns": columns}


def _parse_rate(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise SettingsError(f"{_OWN}{_RATE} {text!r} is no number: give samples a second") from None
