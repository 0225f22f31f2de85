"""The handle of whoever starts a simulated stand; it loads nothing of the simulation itself."""

import contextlib
import subprocess
import sys
import threading
from types import TracebackType
from typing import Self

import msgspec

from app.simulated_stand.options import SimulatedStandError, SimulatedStandOptions
from app.simulated_stand.truth import Truth
from drivers.simulated.disturbances import parse_disturbance


class Ready(msgspec.Struct, frozen=True):
    """What a simulated stand says once it can be read; `slipstand device simulate --json` prints it."""

    port: str
    protocol: str
    rate_hz: float
    series: str
    truth_file: str | None


class Refused(msgspec.Struct, frozen=True):
    """What the process says instead when it cannot be set up."""

    error: str


class SimulatedStand:
    """A simulated stand in a process of its own, which lives no longer than the process that started it.

    Make it with `SimulatedStand.start`; use it in a `with` statement, or call `stop`.
    """

    _READY_S = 120.0
    """A first start compiles the solver."""

    def __init__(self, process: "subprocess.Popen[bytes]", ready: Ready, truth: Truth) -> None:
        self._process = process
        self._ready = ready
        self._truth = truth
        self._listener = threading.Thread(target=self._listen, name="simulated stand", daemon=True)
        self._listener.start()

    @classmethod
    def start(cls, options: SimulatedStandOptions) -> Self:
        """Start the process and wait until its port can be opened.

        Raises
        ------
        SimulatedStandError
            If it cannot be set up as asked, or does not get ready.
        """
        process = subprocess.Popen(
            [sys.executable, "-P", "-m", "app.simulated_stand", msgspec.json.encode(options).decode()],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )
        try:
            return cls(process, *_await_ready(process, cls._READY_S))
        except BaseException:
            _end(process)
            if process.stdout:
                process.stdout.close()
            raise

    @property
    def port(self) -> str:
        """What a reader opens."""
        return self._ready.port

    @property
    def process_id(self) -> int:
        """Of the stand's process."""
        return self._process.pid

    @property
    def is_running(self) -> bool:
        """Tell whether the process lives."""
        return self._process.poll() is None

    def truth(self) -> Truth:
        """The truth as last told: at each turn of events, and when stopped.

        Turns are the start and end of a stream, a release, a disturbance and a port that goes or comes.
        """
        return self._truth

    def disturb(self, text: str) -> None:
        """Let something happen to the device now, or at a time: `unplug 1.5`, `stall`, `jump -5 at 3`.

        It happens within some milliseconds; `truth` tells when it did.

        Raises
        ------
        SettingsError
            If `text` is not as `drivers.simulated.disturbances.parse_disturbance` wants it.
        SimulatedStandError
            If the stand has ended.
        """
        parse_disturbance(text)
        try:
            if self._process.stdin:
                self._process.stdin.write(text.encode() + b"\n")
                self._process.stdin.flush()
        except (OSError, ValueError):
            raise SimulatedStandError(
                f"{text!r} cannot be done: the simulated stand has ended. Start another one"
            ) from None

    def stop(self) -> None:
        """End the process; `truth` tells all of it from then on. Harmless when it has ended before."""
        _end(self._process)
        self._listener.join()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()

    def _listen(self) -> None:
        """Thread: truths until the process ends."""
        if self._process.stdout is None:
            return
        # The last line of a killed process may be a part of one.
        with self._process.stdout as stream, contextlib.suppress(msgspec.DecodeError):
            for line in stream:
                self._truth = msgspec.json.decode(line, type=Truth)


def _await_ready(process: "subprocess.Popen[bytes]", patience_s: float) -> tuple[Ready, Truth]:
    # A process that does not get ready is ended, and that ends the wait for its lines.
    watchdog = threading.Timer(patience_s, process.kill)
    watchdog.start()
    try:
        lines = [process.stdout.readline() for _ in range(2)] if process.stdout else []
    finally:
        watchdog.cancel()
        watchdog.join()
    with contextlib.suppress(msgspec.ValidationError, msgspec.DecodeError):
        raise SimulatedStandError(msgspec.json.decode(lines[0], type=Refused).error)
    try:
        return msgspec.json.decode(lines[0], type=Ready), msgspec.json.decode(lines[1], type=Truth)
    except msgspec.DecodeError:
        raise SimulatedStandError(
            f"the simulated stand did not start (exit code {process.poll()}). Its own message stands above"
        ) from None


def _end(process: "subprocess.Popen[bytes]", patience_s: float = 5.0) -> None:
    if process.stdin:
        with contextlib.suppress(OSError):
            process.stdin.close()
    try:
        process.wait(patience_s)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
