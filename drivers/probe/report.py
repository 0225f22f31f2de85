"""One port looked at: what it is, who has it, and what speaks on it."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum

from drivers.diagnosis import describe_unrecognised
from drivers.errors import DriverError
from drivers.port import Port, PortInfo, open_port
from drivers.port_users import PortUser, other_port_users
from drivers.probe.host_checks import PortHint, port_hints, usb_chip_name
from drivers.probe.identity_queries import query_identity
from drivers.probe.listening import COMMON_LINE_SETTINGS, LineSettings, listen
from drivers.probe.recognition import Recognition

_UNASKED = "nothing sends by itself: try --write, which asks the device who it is"
_UNANSWERED = "nothing is sent and nothing answers: check cable and power, and that the device is switched on"


class ProbeOutcome(StrEnum):
    """How looking at a port ended."""

    RECOGNISED = "recognised"
    UNREADABLE = "unreadable"
    """Bytes come, and no built protocol knows them."""
    SILENT = "silent"
    IN_USE = "held"
    UNAVAILABLE = "unavailable"


@dataclass(frozen=True, slots=True)
class PortReport:
    """What was found on a port.

    Attributes
    ----------
    port : PortInfo
    chip : str
        Known name of the chip or board; "" for others.
    outcome : Outcome
    message : str
        What is wrong and what to do, where nothing was recognised.
    holders : tuple of Holder
        Programs that have it open, beside this one.
    recognition : Recognition or None
    tuning : Tuning or None
        Baud rate and parity at which it was recognised; None where they mean nothing.
    hints : tuple of Hint
        What stands in the way of this port.
    """

    port: PortInfo
    chip: str
    outcome: ProbeOutcome
    message: str = ""
    users: tuple[PortUser, ...] = ()
    recognition: Recognition | None = None
    line_settings: LineSettings | None = None
    hints: tuple[PortHint, ...] = ()


def probe_port(port: PortInfo, write: bool, on_progress: Callable[[str], None]) -> PortReport:
    """Look at a port: who has it, then what it sends by itself, then, if `write`, what it answers.

    A port that another program has open is left alone: listening would take bytes from it.
    """
    chip = usb_chip_name(port.vendor_id, port.product_id)
    hints = tuple(port_hints(port))
    holders = tuple(other_port_users(port.device))
    if holders:
        message = f"in use by {', '.join(map(str, holders))}: close that program, and look again"
        return PortReport(port, chip, ProbeOutcome.IN_USE, message, holders, hints=hints)
    try:
        with open_port(port.device, COMMON_LINE_SETTINGS[0].baud, COMMON_LINE_SETTINGS[0].parity) as link:
            outcome, message, recognition, tuning = _converse(link, write, on_progress)
    except DriverError as error:
        return PortReport(port, chip, ProbeOutcome.UNAVAILABLE, str(error), hints=hints)
    return PortReport(port, chip, outcome, message, (), recognition, tuning, hints)


def _converse(
    link: Port, write: bool, tell: Callable[[str], None]
) -> tuple[ProbeOutcome, str, Recognition | None, LineSettings | None]:
    heard = listen(link, tell)
    if heard.recognition is not None:
        return ProbeOutcome.RECOGNISED, "", heard.recognition, heard.line_settings
    if heard.received:
        return (
            ProbeOutcome.UNREADABLE,
            describe_unrecognised(heard.received, link.has_baud),
            None,
            heard.line_settings,
        )
    answered = query_identity(link, tell) if write else None
    if answered is not None:
        return ProbeOutcome.RECOGNISED, "", answered.recognition, answered.line_settings
    return ProbeOutcome.SILENT, _UNANSWERED if write else _UNASKED, None, None
