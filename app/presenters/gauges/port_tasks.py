"""Looking at the serial ports of this computer, in a worker's process: it takes long and may be given up."""

from dataclasses import dataclass

from app.presenters.base import Chip, Progress, Tone
from app.presenters.gauges.port_card import PortCard
from app.presenters.worker import ReportProgress
from messages.i18n import gettext


@dataclass(frozen=True, slots=True)
class ListPorts:
    """Look which ports there are."""


@dataclass(frozen=True, slots=True)
class ProbePorts:
    """Look at all ports but one that is connected: what speaks there; with `asks`, who answers."""

    asks: bool
    connected: str


def list_all(_task: ListPorts, _report: ReportProgress) -> tuple[PortCard, ...]:
    """Ports of this computer, not looked at."""
    from app.presenters.gauges.ports import card_of
    from drivers.port import list_ports

    return tuple(card_of(port) for port in list_ports())


def probe(task: ProbePorts, report: ReportProgress) -> tuple[PortCard, ...]:
    """Look at one port after the other."""
    from app.presenters.gauges.ports import card_of, describe_port
    from drivers.port import list_ports
    from drivers.probe.report import probe_port

    cards = []
    present = list_ports()
    for number, port in enumerate(present):
        if port.device == task.connected:
            cards.append(card_of(port, Chip(gettext("connected here"), Tone.OK)))
            continue

        def tell(doing: str, device: str = port.device, share: float = number / len(present)) -> None:
            report(Progress(f"{device}: {doing}", share))

        tell("looking")
        cards.append(describe_port(probe_port(port, task.asks, tell)))
    return tuple(cards)
