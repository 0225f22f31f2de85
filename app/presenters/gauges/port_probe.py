"""The ports of this computer: listed, looked at one after another, and what was found on each."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from app.presenters.base import EMPTY_CHIP, Chip, Progress, Tone
from app.presenters.gauges.state import PortCard
from app.presenters.results import sentence
from app.presenters.worker import CANCELLED, ReportProgress, TaskFailed, TaskProgress, Worker, WorkerEvent
from messages.i18n import gettext


class PortProbe:
    """Asks the prober, one look at a time.

    Parameters
    ----------
    prober : Worker
        Its own one, which may be given up alone. Closed by `close`.
    show : callable
        Takes what has changed, by the names of `GaugesState`: ports, probing, ports_message.
    """

    def __init__(self, prober: Worker, show: Callable[..., None]) -> None:
        self.ports: tuple[PortCard, ...] = ()
        self._prober = prober
        self._show = show
        self._is_probing = False

    def list_ports(self) -> None:
        """Look which ports there are, unless they are being looked at."""
        if not self._is_probing:
            self._prober.submit(list_ports, ListPorts())

    def probe(self, connected: str, *, query_silent: bool) -> None:
        """Probe all ports but `connected`; `query_silent` also sends to silent devices."""
        if not self._is_probing:
            self._is_probing = True
            self._show(probing=gettext("Looking at the ports"), ports_message=EMPTY_CHIP)
            self._prober.submit(probe_ports, ProbePorts(query_silent, connected))

    def cancel(self) -> None:
        """Stop looking."""
        if self._is_probing:
            self._prober.cancel()

    def poll(self) -> None:
        """Take in what the prober has said."""
        for news in self._prober.poll():
            self._hear(news)

    def close(self) -> None:
        """End the prober."""
        self._prober.close()

    def _hear(self, news: WorkerEvent) -> None:
        if isinstance(news, TaskProgress):
            self._show(probing=news.progress.text)
        elif isinstance(news, TaskFailed):
            words = gettext("Given up") if news.message == CANCELLED else sentence(news.message)
            self._end(Chip(words, Tone.PLAIN if news.message == CANCELLED else Tone.BAD))
        elif isinstance(news.argument, ListPorts):
            self._take(_known(news.answer, self.ports))
        else:
            self._take(news.answer)
            none = Chip(gettext("No serial port found. Plug the amplifier in"), Tone.WARN)
            self._end(EMPTY_CHIP if news.answer else none)

    def _take(self, ports: tuple[PortCard, ...]) -> None:
        self.ports = ports
        self._show(ports=ports)

    def _end(self, message: Chip) -> None:
        self._is_probing = False
        self._show(probing="", ports_message=message)


def _known(listed: Sequence[PortCard], before: Sequence[PortCard]) -> tuple[PortCard, ...]:
    """Keep what was found on ports that are still there."""
    known: dict[tuple[str, str], PortCard] = {(card.url, card.identity): card for card in before}
    return tuple(known.get((card.url, card.identity), card) for card in listed)


@dataclass(frozen=True, slots=True)
class ListPorts:
    """Look which ports there are."""


@dataclass(frozen=True, slots=True)
class ProbePorts:
    """Look at all ports but one that is connected: what speaks there; with `query_silent`, who answers."""

    query_silent: bool
    connected: str


def list_ports(_task: ListPorts, _report: ReportProgress) -> tuple[PortCard, ...]:
    """Ports of this computer, not looked at."""
    from app.presenters.gauges.port_cards import listed_port
    from drivers.port import list_ports

    return tuple(listed_port(port) for port in list_ports())


def probe_ports(task: ProbePorts, report: ReportProgress) -> tuple[PortCard, ...]:
    """Look at one port after the other."""
    from app.presenters.gauges.port_cards import listed_port, probed_port
    from drivers.port import list_ports
    from drivers.probe.report import probe_port

    cards = []
    present = list_ports()
    for number, port in enumerate(present):
        if port.device == task.connected:
            cards.append(listed_port(port, Chip(gettext("connected here"), Tone.OK)))
            continue

        def tell(doing: str, device: str = port.device, share: float = number / len(present)) -> None:
            report(Progress(f"{device}: {doing}", share))

        tell("looking")
        cards.append(probed_port(probe_port(port, task.query_silent, tell)))
    return tuple(cards)
