"""Presenter of the tab Ports and devices: lists the serial ports, and probes them on request."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from app.presenters.base import EMPTY_CHIP, Chip, Presenter, Tone
from app.presenters.events import TaskFailed, TaskProgress, WorkerEvent
from app.presenters.gauges.state import PortCard, PortsState
from app.presenters.navigator import Navigator
from app.presenters.results import sentence
from app.presenters.worker import EventWorker, LazyFunction
from messages.i18n import gettext

LIST_PORTS: Final = LazyFunction("app.presenters.gauges.port_tasks", "list_port_cards")
PROBE_PORTS: Final = LazyFunction("app.presenters.gauges.port_tasks", "probe_ports")


@dataclass(frozen=True, slots=True)
class ListPorts:
    """List the ports without opening them."""


@dataclass(frozen=True, slots=True)
class ProbePorts:
    """Probe all ports but `connected`; with `query_silent`, send requests to silent devices."""

    query_silent: bool
    connected: str


class PortsPresenter(Presenter[PortsState]):
    """Runs one probe at a time, in a worker of its own: cancelling a probe ends its process."""

    def __init__(self, worker: EventWorker, navigator: Navigator) -> None:
        super().__init__(PortsState())
        self._worker = worker
        self._navigator = navigator
        self._is_probing = False
        self.connected_url = ""

    def set_query_silent(self, query_silent: bool) -> None:
        """Choose whether the probe sends requests to silent devices; else it only listens."""
        self._update(query_silent=query_silent)

    def list_ports(self) -> None:
        if not self._is_probing:
            self._worker.submit(LIST_PORTS, ListPorts())

    def probe(self) -> None:
        if not self._is_probing:
            self._is_probing = True
            self._update(progress=gettext("Looking at the ports"), message=EMPTY_CHIP)
            self._worker.submit(PROBE_PORTS, ProbePorts(self.state.query_silent, self.connected_url))

    def cancel(self) -> None:
        if self._is_probing:
            self._worker.cancel()

    def fill_port(self, url: str) -> None:
        for card in self.state.ports:
            if card.url == url and card.suggested_form is not None:
                self._navigator.fill_connection(card.suggested_form)

    def fill_second_port(self, url: str) -> None:
        self._navigator.fill_second_port(url)

    def poll(self) -> None:
        """Process the worker's events."""
        for event in self._worker.poll():
            self._on_event(event)

    def close(self) -> None:
        self._worker.close()

    def _on_event(self, event: WorkerEvent) -> None:
        if isinstance(event, TaskProgress):
            self._update(progress=event.progress.text)
        elif isinstance(event, TaskFailed):
            cancelled = Chip(gettext("Given up"))
            self._end(cancelled if event.is_cancelled else Chip(sentence(event.message), Tone.BAD))
        elif isinstance(event.argument, ListPorts):
            self._update(ports=_with_known_devices(event.answer, self.state.ports))
        else:
            self._update(ports=event.answer)
            none = Chip(gettext("No serial port found. Plug the amplifier in"), Tone.WARN)
            self._end(EMPTY_CHIP if event.answer else none)

    def _end(self, message: Chip) -> None:
        self._is_probing = False
        self._update(progress="", message=message)


def _with_known_devices(listed: Sequence[PortCard], before: Sequence[PortCard]) -> tuple[PortCard, ...]:
    """Listed ports, each with the result of its last probe."""
    known = {(card.url, card.identity): card for card in before}
    return tuple(known.get((card.url, card.identity), card) for card in listed)
