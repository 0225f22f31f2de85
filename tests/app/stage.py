"""Fakes for presenters and views: an engine that plays one scripted pullback."""

import datetime
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from ring_kit import ring_rows

from analysis.identification import Events, FittedModel, ModelSelection
from analysis.quantities import Quantity, ResultWarning
from app.acquisition.messages import (
    Arm,
    Command,
    Connected,
    EndReason,
    Event,
    Health,
    PortSettings,
    PullbackState,
    RunEnded,
    RunSettings,
    RunStarted,
    StandPosition,
    StateChanged,
    Stop,
)
from app.acquisition.ring import RingRows
from app.presenters.analysed_run import AnalysedRun, Channel
from app.presenters.base import TaskFailure
from app.presenters.navigator import StandContext
from app.presenters.worker import CANCELLED, WorkerPool
from app.simulated_stand.motion import stand_truth
from app.simulated_stand.options import Gesture, SimulatedStandOptions
from app.simulated_stand.truth import Truth
from config.files import load_gauges, load_stand, published_table
from drivers.simulated.faults import parse_disturbance
from drivers.simulated.stream_sender import TransmissionLog
from messages.message import message

RATE_HZ = 1000.0
PULLED_S, HELD_S, RELEASED_S, SLIP_END_S, END_S = 2.0, 4.0, 5.0, 7.5, 15.0
FOLDER = str(Path("/recordings").absolute())  # on Windows with a drive
RUN = str(Path(FOLDER, "20260112_1FFM0_001.h5"))


def bench() -> StandContext:
    """The paper's stand on a fixed day."""
    return StandContext(
        load_stand(),
        load_gauges(),
        tuple(published_table()),
        Path(FOLDER),
        today=lambda: datetime.date(2026, 2, 1),
    )


def motion_m(time_s: np.ndarray) -> np.ndarray:
    """Both gauges (n, 2) in m: rest at 0.2 mm, pull to 12 mm, hold, decay while the plate slides 10 mm."""
    pulled = 0.012 * np.clip((time_s - PULLED_S) / (HELD_S - PULLED_S), 0.0, 1.0)
    after_s = np.maximum(time_s - RELEASED_S, 0.0)
    table = pulled * np.exp(-0.3 * after_s) * np.cos(2.0 * np.pi * after_s / 0.32)
    slid = np.clip(after_s / (SLIP_END_S - RELEASED_S), 0.0, 1.0)
    noise = np.random.default_rng(7).normal(scale=10e-6, size=(2, len(time_s)))
    return np.stack((table + 0.2e-3, -0.010 * np.sin(0.5 * np.pi * slid))).T + noise.T


def rows_between(start_s: float, end_s: float, *, status: int = 0) -> RingRows:
    """Rows of the made-up pullback in a span of time."""
    first, last = round(start_s * RATE_HZ), round(end_s * RATE_HZ)
    time_s = np.arange(first, last) / RATE_HZ
    table_m, relative_m = motion_m(time_s).T
    return ring_rows(first, time_s, table_m, relative_m, status)


class FakeRecorder:
    """Takes the commands of Record, and hands out the rows that a test puts in."""

    def __init__(self) -> None:
        self.armed: list[RunSettings] = []
        self.counts: list[int] = []
        self.stopped = 0
        self.rows: RingRows | None = None

    def send(self, command: Command) -> None:
        if isinstance(command, Arm):
            self.armed.append(command.run)
            self.counts.append(command.count)
        elif isinstance(command, Stop):
            self.stopped += 1

    def new_rows(self) -> RingRows | None:
        rows, self.rows = self.rows, None
        return rows


class FakeEngine:
    """An engine whose clock a test sets: `play(until_s)` brings rows and events up to then.

    Rests until armed; then the made-up pullback goes by.
    """

    def __init__(self, directory: Path | str = FOLDER) -> None:
        self.commands: list[Command] = []
        self.closed = False
        self._directory = directory
        self._events: list[Event] = [
            Connected("Slipstand simulator", "1.0", RATE_HZ, "/nowhere"),
            StateChanged(PullbackState.IDLE, 0.0),
            health(),
        ]
        self._played_s = 0.0
        self._rows: list[RingRows] = []
        self._script: list[tuple[float, Event]] = []

    @property
    def run_path(self) -> str:
        return str(Path(self._directory) / Path(RUN).name)

    def send(self, command: Command) -> None:
        self.commands.append(command)
        if isinstance(command, Arm):
            self._script = script(self.run_path)
        elif isinstance(command, Stop):
            self._events.append(ended(self.run_path, EndReason.STOPPED))
            self._script = []

    def poll(self) -> list[Event]:
        events, self._events = self._events, []
        return events

    def new_rows(self) -> RingRows | None:
        return self._rows.pop(0) if self._rows else None

    def close(self) -> None:
        self.closed = True

    def play(self, until_s: float) -> None:
        self._rows.append(rows_between(self._played_s, until_s))
        self._events += [event for at_s, event in self._script if self._played_s <= at_s < until_s]
        self._played_s = until_s

    def say(self, event: Event) -> None:
        self._events.append(event)


STATES = [
    (0.5, PullbackState.ZERO),
    (1.0, PullbackState.PULLING),
    (HELD_S, PullbackState.HELD),
    (HELD_S + 0.3, PullbackState.ARMED),
    (RELEASED_S, PullbackState.RELEASED),
    (RELEASED_S, PullbackState.SLIPPING),
    (SLIP_END_S, PullbackState.TAIL),
    (END_S, PullbackState.CLOSING),
]


def standing(state: PullbackState) -> StandPosition:
    """What the engine knows of table and plate when it comes to a state."""
    if state is PullbackState.ZERO:
        return StandPosition(0.012, 0.24e-3)
    return StandPosition(0.012, 0.24e-3, 0.2e-3, 0.0)


def script(path: str) -> list[tuple[float, Event]]:
    """What the engine says, and when."""
    changes: list[tuple[float, Event]] = [
        (at_s, StateChanged(state, at_s, "", standing(state))) for at_s, state in STATES
    ]
    closing: list[tuple[float, Event]] = [
        (END_S, ended(path)),
        (END_S, StateChanged(PullbackState.IDLE, END_S)),
    ]
    return [(0.5, RunStarted(path)), *changes, *closing]


def ended(path: str = RUN, reason: EndReason = EndReason.ENOUGH, message: str = "") -> RunEnded:
    return RunEnded(path, reason, 14000, 0, 0, 0, 0, RATE_HZ, 5.0, message)


def health(**changes: Any) -> Health:
    facts = {
        "rate_hz": 1000.02,
        "samples": 5000,
        "missing": 0,
        "missing_estimated": 0,
        "damaged": 0,
        "overloaded": 0,
        "free_disk_bytes": 210_000_000_000,
    }
    return Health(**{**facts, **changes})


def analysed(path: str = RUN, **changes: Any) -> AnalysedRun:
    """The made-up pullback as if identified."""
    time_s = np.arange(1.0, END_S, 1.0 / RATE_HZ)
    truth_m = motion_m(time_s)
    noise_m = np.random.default_rng(1).normal(scale=20e-6, size=truth_m.shape)
    facts: dict[str, Any] = {
        "path": Path(path),
        "time_s": time_s,
        "table": Channel(truth_m[:, 0] + noise_m[:, 0], truth_m[:, 0]),
        "relative": Channel(truth_m[:, 1] + noise_m[:, 1], truth_m[:, 1]),
        "results": {
            "period_s": Quantity.normal(0.319942, 4.8e-5, "s"),
            "damping_n1_per_s": Quantity.normal(0.1203, 0.0042, "1/s"),
            "friction_dynamic": Quantity.normal(0.1003, 0.00064, "1"),
            "friction_static_upper": Quantity.normal(0.31, 0.002, "1"),
            "tilt_rad": Quantity.normal(1.2e-4, 3e-5, "rad"),
            "pullback_m": Quantity.normal(0.012, 1.2e-5, "m"),
            "residual_displacement_m": Quantity.normal(-0.01, 1.1e-5, "m"),
        },
        "labels": {"msk64_degree": "IX"},
        "model": ModelSelection(
            "coulomb+tilt",
            True,
            2.1e-5,
            2.0e-5,
            (
                FittedModel("coulomb", 120.0, 4.1e-5, 0.1021),
                FittedModel("coulomb+tilt", 10.0, 2.1e-5, 0.1003),
            ),
        ),
        "events": Events(RELEASED_S, SLIP_END_S, None),
        "warnings": (
            ResultWarning("tail-not-exponential", message("The tail does not decay exponentially.")),
        ),
        "ended": "enough",
    }
    return AnalysedRun(**{**facts, **changes})


class FakeSimulation:
    """A simulated stand that is none."""

    is_running = True

    def __init__(self, options: SimulatedStandOptions) -> None:
        self.port = "fake://"
        self.options = options
        self.disturbed: list[str] = []
        self.asked: list[Gesture] = []
        self.stopped = False

    def truth(self) -> Truth:
        at_s = iter(range(3, 100))
        happened = [replace(parse_disturbance(text), at_s=float(next(at_s))) for text in self.disturbed]
        return Truth(
            port=self.port,
            stand=stand_truth(self.options, load_stand()),
            options=self.options,
            timetable=self.options.timetable(),
            release_s=[4.5],
            plate_offset_m=[0.0],
            residual_displacement_m=0.0101,
            streams=1,
            wire=TransmissionLog(2000.0, 2000.0, frames=640, frames_damaged=7),
            disturbances=happened,
        )

    def ask(self, gesture: Gesture) -> None:
        self.asked.append(gesture)

    def disturb(self, text: str) -> None:
        parse_disturbance(text)
        self.disturbed.append(text)

    def stop(self) -> None:
        self.stopped = True


class FakeLauncher:
    """Starts fakes, at once."""

    def __init__(self, directory: Path | str = FOLDER, error: Exception | None = None) -> None:
        self.engines: list[FakeEngine] = []
        self.simulations: list[FakeSimulation] = []
        self.ports: list[PortSettings] = []
        self._directory = directory
        self._error = error

    @property
    def starters(self) -> tuple[Any, Any]:
        """What `Connection` starts engine and stand with."""
        return self.engine, self.simulation

    def engine(self, port: PortSettings) -> FakeEngine:
        if self._error is not None:
            raise self._error
        self.ports.append(port)
        self.engines.append(FakeEngine(self._directory))
        return self.engines[-1]

    def simulation(self, options: SimulatedStandOptions) -> FakeSimulation:
        self.simulations.append(FakeSimulation(options))
        return self.simulations[-1]


class RecordingView:
    """Keeps every state it is shown."""

    def __init__(self) -> None:
        self.states: list[Any] = []

    def show_state(self, state: Any) -> None:
        self.states.append(state)


@dataclass(frozen=True)
class Call:
    """A call that a presenter has submitted; a test answers it with one of the callbacks."""

    function: Any
    arguments: tuple[Any, ...]
    done: Callable[[Any], object] = lambda _: None
    failed: Callable[[TaskFailure], object] = lambda _: None
    progress: Callable[[Any], object] = lambda _: None

    @property
    def name(self) -> str:
        return getattr(self.function, "name", "") or self.function.__name__

    def fail(self, text: str) -> None:
        self.failed(TaskFailure(message("{text}", text=text)))

    def cancel(self) -> None:
        self.failed(TaskFailure(CANCELLED, is_cancelled=True))


class FakeWorker:
    """Keeps calls for a test to answer."""

    is_busy = False

    def __init__(self) -> None:
        self.calls: list[Call] = []
        self.cancelled = 0
        self.closed = False

    def submit(self, function: Callable[..., Any], *arguments: Any, **callbacks: Any) -> None:
        self.calls.append(Call(function, arguments, **callbacks))

    def poll(self) -> None:
        """Do nothing: tests call the callbacks."""

    def cancel(self) -> None:
        self.cancelled += 1

    def close(self) -> None:
        self.closed = True


class FakePool(WorkerPool):
    """Makes fake workers."""

    def make_worker(self) -> Any:
        return FakeWorker()
