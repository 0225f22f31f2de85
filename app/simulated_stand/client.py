"""Client of a simulated stand in its own process; it imports nothing of the simulation."""

import contextlib
import queue
import subprocess
from collections.abc import Callable
from types import TracebackType
from typing import Self

import msgspec

from app.child_process import ChildProcess, json_decoder, spawn
from app.simulated_stand.options import Gesture, SimulatedStandError, SimulatedStandOptions
from app.simulated_stand.truth import Truth
from drivers.simulated.faults import parse_disturbance


class Ready(msgspec.Struct, frozen=True):
    """What a reader needs to know of a simulated stand; `slipstand device simulate --json` prints it."""

    port: str
    protocol: str
    rate_hz: float
    series: str
    truth_file: str | None
    calibration: str | None
    """Calibration file that its readings need; None for the one in use."""


class Started(msgspec.Struct, frozen=True, tag=True):
    """The stand can be read. Its truth follows."""

    ready: Ready


class TruthChanged(msgspec.Struct, frozen=True, tag=True):
    """Something happened to the stand; or it ends, and this is all of its truth."""

    truth: Truth


class Refused(msgspec.Struct, frozen=True, tag=True):
    """The stand cannot be set up; the process ends."""

    error: str


StandEvent = Started | TruthChanged | Refused
decode_stand_event: Callable[[bytes], StandEvent] = json_decoder(StandEvent)


class SimulatedStand:
    """A simulated stand in its own process; a context manager, made by `start`.

    It ends with this process, or when an engine has finished the run that it records then.
    """

    _READY_S = 600.0  # a first start compiles the solver, each file of it watched by a virus scanner

    _STOP_S = 5.0

    def __init__(self, process: "subprocess.Popen[bytes]") -> None:
        self._first: queue.SimpleQueue[StandEvent | int] = queue.SimpleQueue()
        self._truth: Truth | None = None
        self._child: ChildProcess[str, StandEvent] = ChildProcess(
            process, _encode_disturbance, decode_stand_event, self._on_event, self._first.put
        )
        try:
            self._ready = self._await_start()
        except BaseException:
            self.stop()
            raise

    @classmethod
    def start(cls, options: SimulatedStandOptions) -> Self:
        return cls(spawn("app.simulated_stand.process", msgspec.json.encode(options).decode()))

    @property
    def port(self) -> str:
        return self._ready.port

    @property
    def calibration(self) -> str | None:
        """Calibration file that its readings need; None for the one in use."""
        return self._ready.calibration

    @property
    def process_id(self) -> int:
        return self._child.pid

    @property
    def is_running(self) -> bool:
        return self._child.is_running

    def truth(self) -> Truth:
        """The truth at the last change (stream, release, disturbance, port), and after `stop` all of it."""
        if self._truth is None:
            raise SimulatedStandError("the simulated stand has not started")
        return self._truth

    def ask(self, gesture: Gesture) -> None:
        """Ask the operator of the stand for something; nothing happens where the stand has ended."""
        if self._child.is_running:
            self._child.send(gesture)

    def disturb(self, text: str) -> None:
        """Disturb the device now or later: `unplug 1.5`, `jump -5 at 3`. Raises DriverError."""
        parse_disturbance(text)
        if not self._child.is_running:
            raise SimulatedStandError(
                "{text!r} cannot be done: the simulated stand has ended. Start another one", text=text
            )
        self._child.send(text, self._STOP_S)

    def stop(self) -> None:
        """End the process; may be called twice. `truth` is complete from then on."""
        self.ask(Gesture.END)
        self._child.stop(self._STOP_S)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()

    def _on_event(self, event: StandEvent) -> None:
        has_started = self._truth is not None
        if isinstance(event, TruthChanged):
            self._truth = event.truth
        if not has_started:
            self._first.put(event)

    def _await_start(self) -> Ready:
        ready, code = None, ""
        with contextlib.suppress(queue.Empty):
            while isinstance(event := self._first.get(timeout=self._READY_S), Started | TruthChanged):
                if isinstance(event, Started):
                    ready = event.ready
                elif ready is not None:
                    return ready
            if isinstance(event, Refused):
                raise SimulatedStandError(event.error)
            code = f" (exit code {event})"
        raise SimulatedStandError(
            "the simulated stand did not start{code}. Its own message stands above", code=code
        )


def _encode_disturbance(text: str) -> bytes:
    return text.encode() + b"\n"
