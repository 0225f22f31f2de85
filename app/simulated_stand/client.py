"""The handle of whoever starts a simulated stand; it loads nothing of the simulation itself."""

import contextlib
import shutil
import subprocess
import sys
import tempfile
import threading
from pathlib import Path
from types import TracebackType
from typing import Self

import msgspec

from app.simulated_stand.errors import SimulatedStandError
from app.simulated_stand.options import SimulatedStandOptions
from app.simulated_stand.truth import Truth, read_truth


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
