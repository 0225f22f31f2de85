"""One port looked at: what it is, who has it, and what speaks on it."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum

from drivers.diagnosis import describe_unknown
from drivers.errors import DriverError
from drivers.holders import Holder, others_with
from drivers.port import Port, PortInfo, open_port
from drivers.probe.asking import ask
from drivers.probe.chips import name_of
from drivers.probe.listening import TUNINGS, Tuning, listen
from drivers.probe.recognition import Recognition
from drivers.probe.surroundings import Hint, hints_of

_UNASKED = "nothing sends by itself: try --write, which asks the device who it is"
_UNANSWERED = "nothing is sent and nothing answers: check cable and power, and that the device is switched on"


class Outcome(StrEnum):
    """How looking at a port ended."""

    RECOGNISED = "recognised"
    UNREADABLE = "unreadable"
    """Bytes come, and no built protocol knows them."""
    SILENT = "silent"
    HELD = "held"
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
    outcome: Outcome
    message: str = ""
    holders: tuple[Holder, ...] = ()
    recognition: Recognition | None = None
    tuning: Tuning | None = None
    hints: tuple[Hint, ...] = ()


def probe_port(port: PortInfo, write: bool, tell: Callable[[str], None]) -> PortReport:
    """Look at a port: who has it, then what it sends by itself, then, if `write`, what it answers.

    A port that another program has open is left alone: listening would take bytes from it.
    """
    chip = name_of(port.vendor_id, port.product_id)
    hints = tuple(hints_of(port))
    holders = tuple(others_with(port.device))
    if holders:
        message = f"in use by {', '.join(map(str, holders))}: close that program, and look again"
        return PortReport(port, chip, Outcome.HELD, message, holders, hints=hints)
    try:
        with open_port(port.device, TUNINGS[0].baud, TUNINGS[0].parity) as link:
            outcome, message, recognition, tuning = _converse(link, write, tell)
    except DriverError as error:
        return PortReport(port, chip, Outcome.UNAVAILABLE, str(error), hints=hints)
    return PortReport(port, chip, outcome, message, (), recognition, tuning, hints)


def _converse(
    link: Port, write: bool, tell: Callable[[str], None]
) -> tuple[Outcome, str, Recognition | None, Tuning | None]:
    heard = listen(link, tell)
    if heard.recognition is not None:
        return Outcome.RECOGNISED, "", heard.recognition, heard.tuning
    if heard.received:
        return Outcome.UNREADABLE, describe_unknown(heard.received, link.has_baud), None, heard.tuning
    answered = ask(link, tell) if write else None
    if answered is not None:
        return Outcome.RECOGNISED, "", answered.recognition, answered.tuning
    return Outcome.SILENT, _UNANSWERED if write else _UNASKED, None, None
