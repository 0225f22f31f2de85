"""What the window is connected to: an engine, and the simulated stand if it is that which is read."""

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import Protocol

from app.acquisition.messages import Arm, Command, Event, Failed, PortSettings, RunSettings, Stop
from app.acquisition.ring import RingRows
from app.simulated_stand.options import SimulatedStandOptions
from app.simulated_stand.truth import Truth


class Engine(Protocol):
    """A running acquisition engine."""

    def send(self, command: Command) -> None:
        """Give a command."""

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
        """How to read it."""

    @property
    def series(self) -> str:
        """What it runs."""

    @property
    def true_friction(self) -> float:
        """Its f_d."""

    def truth(self) -> Truth:
        """What is true of it, as last told."""

    def disturb(self, text: str) -> None:
        """Let something happen to it. Raises SettingsError, SimulatedStandError."""

    def stop(self) -> None:
        """End it."""


class Launcher(Protocol):
    """Starts processes; each call may take seconds and is made outside the window's thread."""

    def engine(self, port: PortSettings) -> Engine:
        """Start an engine that connects to `port`."""

    def simulation(self, options: SimulatedStandOptions) -> Simulation:
        """Start a simulated stand."""


@dataclass(frozen=True, slots=True)
class SimulationStarted:
    """A simulated stand runs and is being connected to."""

    series: str
    true_friction: float


@dataclass(slots=True)
class _Opened:
    engine: Engine
    simulation: Simulation | None = None


class Session:
    """One connection at a time. Nothing but `close` waits; `poll` says what has happened."""

    def __init__(self, launcher: Launcher) -> None:
        self._launcher = launcher
        self._threads = ThreadPoolExecutor(1, thread_name_prefix="slipstand-session")
        self._opening: Future[_Opened] | None = None
        self._opened: _Opened | None = None
        self._listeners: list[Callable[[RingRows], None]] = []

    @property
    def active(self) -> bool:
        """Tell whether something is connected or being connected."""
        return self._opening is not None or self._opened is not None

    def open_port(self, port: PortSettings) -> None:
        """Connect to a port in the background, instead of what is connected now."""
        self._open(lambda: _Opened(self._launcher.engine(port)))

    @property
    def simulation(self) -> Simulation | None:
        """The simulated stand that is connected; None where none is."""
        return None if self._opened is None else self._opened.simulation

    def open_simulated(self, options: SimulatedStandOptions) -> None:
        """Start a simulated stand in the background and connect to it."""
        self._open(lambda: self._simulate(options))

    def poll(self) -> list[Event | SimulationStarted]:
        """What has happened since the last call."""
        started = self._arrived()
        if self._opened is None:
            return started
        events: list[Event | SimulationStarted] = [*started, *self._opened.engine.poll()]
        if any(isinstance(event, Failed) for event in events):
            self._drop()
        return events

    def arm(self, run: RunSettings, count: int = 1) -> None:
        """Record so many runs, one after another."""
        if self._opened is not None:
            self._opened.engine.send(Arm(run, count))

    def stop(self) -> None:
        """End the run and keep it."""
        if self._opened is not None:
            self._opened.engine.send(Stop())

    def new_rows(self) -> RingRows | None:
        """Samples since the last call; None without any. Whoever listens gets them too."""
        rows = None if self._opened is None else self._opened.engine.new_rows()
        if rows is not None:
            for listener in self._listeners:
                listener(rows)
        return rows

    def listen(self, listener: Callable[[RingRows], None]) -> None:
        """Let another one see the samples that `new_rows` gives."""
        self._listeners.append(listener)

    def disconnect(self) -> None:
        """Let go of what is connected, in the background; a run in progress is finished and kept."""
        self._drop()

    def close(self) -> None:
        """Let go of everything and wait until it has ended."""
        self._drop()
        self._threads.shutdown()

    def _open(self, open_it: Callable[[], _Opened]) -> None:
        self._drop()
        self._opening = self._threads.submit(open_it)

    def _simulate(self, options: SimulatedStandOptions) -> _Opened:
        simulation = self._launcher.simulation(options)
        try:
            return _Opened(self._launcher.engine(simulation.port), simulation)
        except BaseException:
            simulation.stop()
            raise

    def _arrived(self) -> list[Event | SimulationStarted]:
        """Take over what was opened in the background."""
        if self._opening is None or not self._opening.done():
            return []
        opening, self._opening = self._opening, None
        error = opening.exception()
        if error is not None:
            return [Failed(" ".join(str(error).split()) or type(error).__name__)]
        self._opened = opening.result()
        simulation = self._opened.simulation
        return [] if simulation is None else [SimulationStarted(simulation.series, simulation.true_friction)]

    def _drop(self) -> None:
        """End what is open, and what is still being opened as soon as it is."""
        if self._opening is not None:
            self._opening.add_done_callback(_close_result)
            self._opening = None
        if self._opened is not None:
            self._threads.submit(_close, self._opened)
            self._opened = None


def _close_result(opening: Future[_Opened]) -> None:
    if not opening.cancelled() and opening.exception() is None:
        _close(opening.result())


def _close(opened: _Opened) -> None:
    try:
        opened.engine.close()
    finally:
        if opened.simulation is not None:
            opened.simulation.stop()
