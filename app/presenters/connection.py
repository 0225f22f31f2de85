"""Connection of the window: an engine, and the simulated stand if that is the device."""

import contextlib
import queue
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Protocol, TypeVar

from app.acquisition.messages import Command, Event, Failed, PortSettings
from app.acquisition.ring import RingRows
from app.presenters.error_reports import ErrorReport, error_report
from app.simulated_stand.options import SimulatedStandOptions
from app.simulated_stand.truth import Truth
from messages.i18n import gettext
from messages.message import message_of


class Engine(Protocol):
    """A running acquisition engine."""

    def send(self, command: Command) -> None:
        """Send a command."""

    def poll(self) -> list[Event]:
        """Events since the last call."""

    def new_rows(self) -> RingRows | None:
        """Samples since the last call; None without any."""

    def close(self) -> None:
        """Finish a run that is being recorded, and end the engine."""


class Simulation(Protocol):
    """A running simulated stand."""

    @property
    def port(self) -> PortSettings:
        """Settings to connect to it."""

    @property
    def series(self) -> str:
        """Code of its series."""

    @property
    def true_friction(self) -> float:
        """Its f_d."""

    def truth(self) -> Truth:
        """True values and events of the stand, as last reported."""

    def disturb(self, text: str) -> None:
        """Disturb it. Raises SettingsError, SimulatedStandError."""

    def stop(self) -> None:
        """End it."""


class Launcher(Protocol):
    """Starts processes; a call may take seconds and is made outside the thread of the window."""

    def engine(self, port: PortSettings) -> Engine:
        """Start an engine that connects to `port`."""

    def simulation(self, options: SimulatedStandOptions) -> Simulation:
        """Start a simulated stand."""


@dataclass(frozen=True, slots=True)
class SimulationStarted:
    """A simulated stand has started and is being connected."""

    series: str
    true_friction: float


@dataclass(slots=True)
class _Opened:
    engine: Engine
    simulation: Simulation | None = None


class Connection:
    """One connection at a time. No method but `close` waits; `poll` returns what has happened.

    Parameters
    ----------
    launcher : Launcher
    report_error : callable
        Takes errors of ending engine and stand; called from another thread.
    """

    CLOSE_S = 240.0
    """Longer than an engine takes to give up storing a run: three minutes."""

    def __init__(self, launcher: Launcher, report_error: Callable[[ErrorReport], None]) -> None:
        self._launcher = launcher
        self._report_error = report_error
        self._background = DaemonExecutor("slipstand-session")
        self._opening: Future[_Opened] | None = None
        self._opened: _Opened | None = None
        self._listeners: list[Callable[[RingRows], None]] = []

    @property
    def is_active(self) -> bool:
        """Tell whether a device is connected or being connected."""
        return self._opening is not None or self._opened is not None

    def open_port(self, port: PortSettings) -> None:
        """Replace the connection by one to a port, in the background."""
        self._open(lambda: _Opened(self._launcher.engine(port)))

    @property
    def simulation(self) -> Simulation | None:
        """Simulated stand that is connected; None without one."""
        return None if self._opened is None else self._opened.simulation

    def open_simulated(self, options: SimulatedStandOptions) -> None:
        """Start a simulated stand in the background and connect to it."""
        self._open(lambda: self._simulate(options))

    def poll(self) -> list[Event | SimulationStarted]:
        """Events since the last call."""
        started = self._take_opened()
        if self._opened is None:
            return started
        events: list[Event | SimulationStarted] = [*started, *self._opened.engine.poll()]
        if any(isinstance(event, Failed) for event in events):
            self._disconnect()
        return events

    def send(self, command: Command) -> None:
        """Send a command to the engine, if one is connected."""
        if self._opened is not None:
            self._opened.engine.send(command)

    def new_rows(self) -> RingRows | None:
        """Samples since the last call, also given to all listeners; None without any."""
        rows = None if self._opened is None else self._opened.engine.new_rows()
        if rows is not None:
            for listener in self._listeners:
                listener(rows)
        return rows

    def add_row_listener(self, listener: Callable[[RingRows], None]) -> None:
        """Call `listener` with the samples of each `new_rows`."""
        self._listeners.append(listener)

    def disconnect(self) -> None:
        """End the connection in the background; a run in progress is finished and kept."""
        self._disconnect()

    def close(self) -> None:
        """End the connection and wait until it has ended, at most `CLOSE_S`."""
        self._disconnect()
        if not self._background.close(self.CLOSE_S):
            words = gettext(
                "Engine or simulated stand did not end within {seconds} s. Runs that are left unfinished"
                " are offered for recovery at the next start",
                seconds=f"{self.CLOSE_S:g}",
            )
            self._report_error(ErrorReport(words, words))

    def _open(self, open_it: Callable[[], _Opened]) -> None:
        self._disconnect()
        self._opening = self._background.submit(open_it)

    def _simulate(self, options: SimulatedStandOptions) -> _Opened:
        simulation = self._launcher.simulation(options)
        try:
            return _Opened(self._launcher.engine(simulation.port), simulation)
        except BaseException:
            simulation.stop()
            raise

    def _take_opened(self) -> list[Event | SimulationStarted]:
        """Take a connection that was opened in the background."""
        if self._opening is None or not self._opening.done():
            return []
        opening, self._opening = self._opening, None
        error = opening.exception()
        if error is not None:
            return [Failed(message_of(error))]
        self._opened = opening.result()
        simulation = self._opened.simulation
        return [] if simulation is None else [SimulationStarted(simulation.series, simulation.true_friction)]

    def _disconnect(self) -> None:
        """End the open connection, and one that is being opened as soon as it is open."""
        opening, opened = self._opening, self._opened
        self._opening = self._opened = None
        if opening is not None:
            self._background.submit(lambda: self._end_opening(opening))
        if opened is not None:
            self._background.submit(lambda: self._end(opened))

    def _end_opening(self, opening: Future[_Opened]) -> None:
        """In the background: end a connection that was opened too late; a failed one is ignored."""
        if opening.exception() is None:
            self._end(opening.result())

    def _end(self, opened: _Opened) -> None:
        """In the background: end engine and stand, each whether or not the other fails."""
        with self._errors_reported():
            opened.engine.close()
        if opened.simulation is not None:
            with self._errors_reported():
                opened.simulation.stop()

    @contextlib.contextmanager
    def _errors_reported(self) -> Iterator[None]:
        try:
            yield
        except Exception as error:
            self._report_error(error_report(error))


Answer = TypeVar("Answer")


class DaemonExecutor:
    """Does calls in the order in which they were submitted.

    Unlike an executor's, the thread does not keep the program from ending: a call that never returns
    is given up.

    Parameters
    ----------
    name : str
        Of the thread.
    """

    def __init__(self, name: str) -> None:
        self._calls: queue.SimpleQueue[Callable[[], None] | None] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._work, name=name, daemon=True)
        self._thread.start()

    def submit(self, call: Callable[[], Answer]) -> Future[Answer]:
        """Do `call` after those before it; what it returns or raises is in the future."""
        future: Future[Answer] = Future()
        self._calls.put(lambda: _into(future, call))
        return future

    def close(self, patience_s: float) -> bool:
        """Do what was submitted, and end; False if that takes longer than `patience_s`."""
        self._calls.put(None)
        self._thread.join(patience_s)
        return not self._thread.is_alive()

    def _work(self) -> None:
        while (call := self._calls.get()) is not None:
            call()


def _into(future: Future[Answer], call: Callable[[], Answer]) -> None:
    try:
        future.set_result(call())
    except Exception as error:
        future.set_exception(error)
