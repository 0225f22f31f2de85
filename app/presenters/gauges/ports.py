"""Presenter of the tab Ports and devices: lists the serial ports, and probes them on request."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from app.presenters.base import EMPTY_CHIP, Chip, Presenter, Progress, TaskFailure, Tone
from app.presenters.gauges.state import PortCard, PortsState
from app.presenters.navigator import ConnectForm, Navigator
from app.presenters.results import sentence
from app.presenters.worker import LazyModule, Worker
from messages.i18n import gettext

if TYPE_CHECKING:
    from app.presenters.gauges import port_tasks
else:
    port_tasks = LazyModule("app.presenters.gauges.port_tasks")


class PortsPresenter(Presenter[PortsState]):
    """Runs one probe at a time, in a worker of its own: cancelling a probe ends its process."""

    def __init__(self, worker: Worker, navigator: Navigator) -> None:
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
            self._worker.submit(port_tasks.list_port_cards, done=self._on_listed)

    def probe(self) -> None:
        if not self._is_probing:
            self._is_probing = True
            known = self.state.ports or None  # that there are none is to be found out anew
            self._update(progress=gettext("Looking at the ports"), message=EMPTY_CHIP, ports=known)
            self._worker.submit(
                port_tasks.probe_ports,
                self.state.query_silent,
                self.connected_url,
                done=self._on_probed,
                failed=self._on_failed,
                progress=self._on_progress,
            )

    def cancel(self) -> None:
        if self._is_probing:
            self._worker.cancel()

    def connect(self, url: str) -> None:
        """Connect to the device that was found on a port."""
        form = self._suggested_form(url)
        if form is not None:
            self.cancel()
            self._navigator.connect_device(form)

    def fill_port(self, url: str) -> None:
        form = self._suggested_form(url)
        if form is not None:
            self._navigator.fill_connection(form)

    def fill_second_port(self, url: str) -> None:
        self._navigator.fill_second_port(url)

    def tick(self) -> None:
        self._worker.poll()

    def close(self) -> None:
        self._worker.close()

    def _suggested_form(self, url: str) -> ConnectForm | None:
        return next((card.suggested_form for card in self.state.ports or () if card.url == url), None)

    def _on_progress(self, progress: Progress) -> None:
        self._update(progress=progress.text)

    def _on_failed(self, failure: TaskFailure) -> None:
        cancelled = Chip(gettext("Given up"))
        self._end(cancelled if failure.is_cancelled else Chip(sentence(failure.message), Tone.BAD))

    def _on_listed(self, ports: tuple[PortCard, ...]) -> None:
        self._update(ports=_with_known_devices(ports, self.state.ports or ()))

    def _on_probed(self, ports: tuple[PortCard, ...]) -> None:
        self._update(ports=ports)
        self._end(EMPTY_CHIP)

    def _end(self, message: Chip) -> None:
        self._is_probing = False
        self._update(progress="", message=message)


def _with_known_devices(listed: Sequence[PortCard], before: Sequence[PortCard]) -> tuple[PortCard, ...]:
    known = {(card.url, card.identity): card for card in before}
    return tuple(known.get((card.url, card.identity), card) for card in listed)
