"""The process of the simulated stand: what runs in it, and the handle of whoever starts it."""

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Self

import msgspec

from analysis.record import AnalysisError
from app.simulated_stand.errors import SimulatedStandError
from app.simulated_stand.options import SimulatedStandOptions
from app.simulated_stand.stand import StandOnWire
from app.simulated_stand.truth import Truth, read_truth
from config.schema import ConfigError
from drivers.errors import DriverError
from drivers.simulated.transport import open_pseudo_terminal


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


def serve(
    options: SimulatedStandOptions, announce: Callable[[Ready], None], ended: Callable[[], bool]
) -> None:
    """Be a simulated stand in this process until `ended()`.

    Raises
    ------
    ConfigError, DriverError, AnalysisError
        If it cannot be set up as asked; nothing was announced then.
    """
    transport = open_pseudo_terminal()
    try:
        stand = StandOnWire(options, transport)
        announce(Ready(transport.url, options.protocol, options.rate_hz, options.series, options.truth_file))
        while not ended():
            transport.wait(stand.step(time.monotonic_ns()))
        stand.tell()
    finally:
        transport.close()


def interrupted_or_orphaned() -> Callable[[], bool]:
    """Become true with SIGINT or SIGTERM, or when the parent process has gone. For a command line."""
    ended = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: ended.set())
    parent = os.getppid()
    return lambda: ended.is_set() or os.getppid() != parent


def stdin_closed() -> Callable[[], bool]:
    """Become true with the end of stdin, which is the end of whoever holds the other end, or with SIGTERM.

    SIGINT is ignored: a Ctrl-C reaches all processes of a terminal, and the owner decides what it means.
    """
    ended = threading.Event()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, lambda *_: ended.set())

    def drain() -> None:
        # Not sys.stdin: its lock would be held for ever, and the interpreter could not finish.
        while os.read(0, 4096):
            pass
        ended.set()

    threading.Thread(target=drain, name="stdin", daemon=True).start()
    return ended.is_set


def main() -> int:
    """Run as `python -m app.simulated_stand OPTIONS`, for `SimulatedStand`."""
    ended = stdin_closed()
    options = msgspec.json.decode(sys.argv[1], type=SimulatedStandOptions)
    try:
        serve(options, _write_line, ended)
    except (ConfigError, DriverError, AnalysisError) as error:
        _write_line(Refused(str(error)))
        return 1
    return 0


class SimulatedStand:
    """A simulated stand in a process of its own, which lives no longer than the process that started it.

    Make it with `SimulatedStand.start`; use it in a `with` statement, or call `stop`.
    """

    _READY_S = 120.0
    """A first start compiles the solver."""

    def __init__(self, process: "subprocess.Popen[bytes]", ready: Ready, folder: Path | None) -> None:
        self._process = process
        self._ready = ready
        self._folder = folder
        self._last_truth: Truth | None = None

    @classmethod
    def start(cls, options: SimulatedStandOptions) -> Self:
        """Start the process and wait until its port can be opened.

        Raises
        ------
        SimulatedStandError
            If it cannot be set up as asked, or does not get ready.
        """
        folder = None
        if options.truth_file is None:
            folder = Path(tempfile.mkdtemp(prefix="slipstand-truth-"))
            options = msgspec.structs.replace(options, truth_file=str(folder / "truth.json"))
        process = subprocess.Popen(
            [sys.executable, "-P", "-m", "app.simulated_stand", msgspec.json.encode(options).decode()],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )
        try:
            return cls(process, _await_ready(process, cls._READY_S), folder)
        except BaseException:
            _end(process)
            _remove(folder)
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
        """The truth as last told: at each start and end of a stream and each release, and when stopped."""
        return self._last_truth or read_truth(Path(self._ready.truth_file or ""))

    def stop(self) -> None:
        """End the process; `truth` tells all of it from then on. Harmless when it has ended before."""
        _end(self._process)
        if self._last_truth is None:
            with contextlib.suppress(SimulatedStandError):
                self._last_truth = self.truth()
        _remove(self._folder)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()


def _write_line(said: Ready | Refused) -> None:
    sys.stdout.buffer.write(msgspec.json.encode(said) + b"\n")
    sys.stdout.buffer.flush()


def _await_ready(process: "subprocess.Popen[bytes]", patience_s: float) -> Ready:
    # A process that does not get ready is ended, and that ends the wait for its line.
    watchdog = threading.Timer(patience_s, process.kill)
    watchdog.start()
    try:
        line = process.stdout.readline() if process.stdout else b""
    finally:
        watchdog.cancel()
        watchdog.join()
    try:
        said = msgspec.json.decode(line, type=dict[str, str | float | None])
        if "error" in said:
            raise SimulatedStandError(f"{said['error']}")
        return msgspec.convert(said, Ready)
    except (msgspec.DecodeError, msgspec.ValidationError):
        raise SimulatedStandError(
            f"the simulated stand did not start (exit code {process.wait()}). Its own message stands above"
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
    if process.stdout:
        process.stdout.close()


def _remove(folder: Path | None) -> None:
    if folder is not None:
        shutil.rmtree(folder, ignore_errors=True)
