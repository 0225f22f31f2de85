"""Connection of the window: an engine, and the simulated stand if that is the device."""

import logging
import threading
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from typing import TypeVar

from app.acquisition.engine_client import EngineClient
from app.acquisition.messages import (
    Command,
    Event,
    Failed,
    PortSettings,
    PullbackState,
    RunEnded,
    StateChanged,
)
from app.acquisition.ring import RingRows
from app.presenters.base import SimulationStarted
from app.presenters.device_status import DeviceMonitor, DeviceStatus
from app.presenters.error_reports import ErrorReport, error_report
from app.simulated_stand.client import SimulatedStand
from app.simulated_stand.options import Gesture, SimulatedStandOptions
from config.files import published_row
from messages.message import message, message_of

_log = logging.getLogger(__name__)
Answer = TypeVar("Answer")
_WAITING = (PullbackState.RECENTRE, PullbackState.ZERO, PullbackState.PULLING)
"""States in which a run begins."""


@dataclass(slots=True)
class _Opened:
    engine: EngineClient
    stand: SimulatedStand | None = None
    started: SimulationStarted | None = None
    has_pulled: bool = False  # for the run that is being recorded

    def pull_for_each_run(self, event: Event | SimulationStarted) -> None:
        """Ask the simulated stand for a test when a run begins to wait for one."""
        if isinstance(event, RunEnded):
            self.has_pulled = False
        elif isinstance(event, StateChanged) and event.state in _WAITING and not self.has_pulled:
            self.has_pulled = True
            if self.stand is not None:
                self.stand.ask(Gesture.PULL)


class Connection:
    """One connection at a time. No method but `close` waits; `poll` returns what has happened.

    `start_engine` and `start_stand` may take seconds: they are called in another thread, as is `report_error`
    with errors of ending engine and stand.
    """

    CLOSE_S = 240.0  # longer than an engine takes to give up storing a run: three minutes

    def __init__(
        self,
        start_engine: Callable[[PortSettings], EngineClient],
        start_stand: Callable[[SimulatedStandOptions], SimulatedStand],
        report_error: Callable[[ErrorReport], None],
        monitor: DeviceMonitor | None = None,
    ) -> None:
        self._start_engine = start_engine
        self._start_stand = start_stand
        self._report_error = report_error
        self._monitor = monitor or DeviceMonitor()
        self._thread: threading.Thread | None = None
        self._opening: Future[_Opened] | None = None
        self._opened: _Opened | None = None
        self._listeners: list[Callable[[RingRows], None]] = []

    @property
    def is_active(self) -> bool:
        return self._opening is not None or self._opened is not None

    def open_port(self, port: PortSettings) -> None:
        self._open(lambda: _Opened(self._start_engine(port)))

    @property
    def status(self) -> DeviceStatus:
        """Whether the device sends; to be asked when `new_rows` was."""
        return self._monitor.status()

    @property
    def stand(self) -> SimulatedStand | None:
        """The simulated stand, while it runs."""
        stand = None if self._opened is None else self._opened.stand
        return stand if stand is not None and stand.is_running else None

    def open_simulated(self, options: SimulatedStandOptions) -> None:
        self._open(lambda: self._simulate(options))

    def poll(self) -> list[Event | SimulationStarted]:
        started = self._take_opened()
        if self._opened is None:
            return started
        events: list[Event | SimulationStarted] = [*started, *self._opened.engine.poll()]
        for event in events:
            self._opened.pull_for_each_run(event)
            self._monitor.on_event(event)
        if any(isinstance(event, Failed) for event in events):
            self.disconnect()
        return events

    def send(self, command: Command) -> None:
        if self._opened is not None:
            self._opened.engine.send(command)

    def new_rows(self) -> RingRows | None:
        """Samples since the last call, also given to all listeners; None without any."""
        rows = None if self._opened is None else self._opened.engine.new_rows()
        if rows is not None:
            self._monitor.on_rows(rows)
            for listener in self._listeners:
                listener(rows)
        return rows

    def add_row_listener(self, listener: Callable[[RingRows], None]) -> None:
        self._listeners.append(listener)

    def disconnect(self) -> None:
        """End the connection in the background; a run in progress is finished and kept.

        A connection that is being opened is ended as soon as it is open.
        """
        self._monitor.reset()
        opening, opened = self._opening, self._opened
        self._opening = self._opened = None
        if opening is not None:
            self._submit(lambda: self._end_opening(opening))
        if opened is not None:
            self._submit(lambda: self._end(opened))

    def close(self) -> None:
        """End the connection and wait until it has ended, at most `CLOSE_S`."""
        self.disconnect()
        if self._thread is None:
            return
        self._thread.join(self.CLOSE_S)
        if self._thread.is_alive():
            late = message(
                "Engine or simulated stand did not end within {seconds} s. Runs that are left unfinished"
                " are offered for recovery at the next start",
                seconds=f"{self.CLOSE_S:g}",
            )
            self._report_error(ErrorReport(late, str(late)))

    def _open(self, open_it: Callable[[], _Opened]) -> None:
        self.disconnect()
        self._opening = self._submit(open_it)

    def _submit(self, call: Callable[[], Answer]) -> Future[Answer]:
        """Make a call in another thread, after the calls submitted before.

        Unlike those of an executor, a daemon thread does not keep the program from ending.
        """
        future: Future[Answer] = Future()
        before = self._thread

        def run() -> None:
            if before is not None:
                before.join()
            try:
                future.set_result(call())
            except Exception as error:
                future.set_exception(error)

        self._thread = threading.Thread(target=run, name="slipstand-connection", daemon=True)
        self._thread.start()
        return future

    def _simulate(self, options: SimulatedStandOptions) -> _Opened:
        stand = self._start_stand(options)
        try:
            friction = options.friction
            if friction is None:
                friction = published_row(options.series).friction_dynamic
            port = PortSettings(
                url=stand.port, protocol=options.protocol, device=options.device, simulated=True
            )
            return _Opened(self._start_engine(port), stand, SimulationStarted(options.series, friction))
        except BaseException:
            stand.stop()
            raise

    def _take_opened(self) -> list[Event | SimulationStarted]:
        if self._opening is None or not self._opening.done():
            return []
        opening, self._opening = self._opening, None
        error = opening.exception()
        if error is not None:
            _log.error("no connection: %s", error)
            return [Failed(message_of(error))]
        self._opened = opening.result()
        return [] if self._opened.started is None else [self._opened.started]

    def _end_opening(self, opening: Future[_Opened]) -> None:
        if opening.exception() is None:
            self._end(opening.result())

    def _end(self, opened: _Opened) -> None:
        for end in (opened.engine.close, opened.stand.stop if opened.stand else None):
            try:
                if end is not None:
                    end()
            except Exception as error:
                self._report_error(error_report(error))
