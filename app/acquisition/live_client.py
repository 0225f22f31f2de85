"""The engine's side of the live identification. A run goes on without it, should it fail."""

import contextlib
import os
import queue
import subprocess
import sys
import threading
from collections.abc import Callable
from typing import IO, Self

from app.acquisition.messages import (
    ClockUpdate,
    EndRun,
    FollowRun,
    LiveCommand,
    LiveResult,
    decode_answer,
    encode_line,
)
from app.acquisition.recording import CLOCK_UNCERTAINTY
from app.runs.metadata import RunMetadata
from drivers.clock import ClockEstimate
from drivers.skew import Skew

_STOP_S = 5.0
_WAITING_LINES = 32
"""A process that takes no more commands than that, beside what its pipe holds, is given up."""
_TIMED_EVERY_S = 1.0
_ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
DIED_NOTE = "the live identification ended by itself. The run goes on, and is identified when it has ended"


class LiveClient:
    """One process that identifies a run while it goes on; make it with `LiveClient.start`."""

    def __init__(self, process: "subprocess.Popen[bytes]") -> None:
        if process.stdin is None or process.stdout is None:
            raise ValueError("the live identification has no pipes. Start it with LiveClient.start")
        self._process = process
        self._to_process = process.stdin
        self._lines: queue.Queue[bytes | None] = queue.Queue(_WAITING_LINES)
        self._first_row: int | None = None
        self._newest: LiveResult | None = None
        self._has_ended = False
        self._threads = [
            threading.Thread(target=self._listen, args=(process.stdout,), daemon=True),
            threading.Thread(target=self._speak, daemon=True),
        ]
        for thread in self._threads:
            thread.start()

    @classmethod
    def start(cls) -> Self:
        """Start the process; some seconds later it is ready. Raises OSError."""
        flags = getattr(subprocess, "CREATE_NO_WINDOW", 0)
        flags |= getattr(subprocess, "BELOW_NORMAL_PRIORITY_CLASS", 0)
        process = subprocess.Popen(
            [sys.executable, "-P", "-m", "app.acquisition.live_process"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,  # its end is told of in a word
            env=os.environ | _ONE_THREAD,
            creationflags=flags,
        )
        return cls(process)

    @property
    def pid(self) -> int:
        """Process number."""
        return self._process.pid

    @property
    def has_ended(self) -> bool:
        """Tell whether the process is gone."""
        return self._has_ended

    def follow(self, follow: FollowRun) -> None:
        """Identify a run from now on."""
        self._newest, self._first_row = None, follow.first_row
        self._send(follow)

    def update_clock(self, clock: ClockUpdate) -> None:
        """Tell how the device's clock is found to go."""
        self._send(clock)

    def end_run(self) -> None:
        """The run has ended."""
        self._first_row = None
        self._send(EndRun())

    def take_result(self) -> LiveResult | None:
        """Newest result since the last call, of the run that is followed; none between two runs."""
        newest, self._newest = self._newest, None
        return None if self._first_row is None else newest

    def stop(self) -> None:
        """End the process."""
        self._put(None)
        try:
            self._process.wait(_STOP_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        for thread in self._threads:
            thread.join()

    def _send(self, command: LiveCommand) -> None:
        self._put(encode_line(command))

    def _put(self, line: bytes | None) -> None:
        """Hand a line over without waiting: the engine must not stand still with this process."""
        try:
            self._lines.put_nowait(line)
        except queue.Full:
            self._process.kill()

    def _speak(self) -> None:
        """Thread: lines to the process, until told to end or nobody reads; that is seen by `has_ended`."""
        with contextlib.suppress(OSError), self._to_process as stream:
            while (line := self._lines.get()) is not None:
                stream.write(line)
                stream.flush()

    def _listen(self, stream: IO[bytes]) -> None:
        with contextlib.suppress(Exception), stream:  # half a line is the last word of a process that died
            for line in stream:
                answer = decode_answer(line)
                if answer.first_row == self._first_row:
                    self._newest = answer.result
        self._has_ended = True


class LiveIdentifier:
    """Has one run after another identified while it goes on.

    Parameters
    ----------
    ring_path : str
        Of the live ring.
    clock : callable
        Tells how the device's clock goes.
    start : callable
        Starts the process.
    skew : callable
        Tells by how much later gauge 2 is read than gauge 1 from a row on, if each has a device of its own.
    """

    def __init__(
        self,
        ring_path: str,
        clock: Callable[[], ClockEstimate | None],
        start: Callable[[], LiveClient] = LiveClient.start,
        skew: Callable[[int], Skew | None] = lambda _: None,
    ) -> None:
        self._ring_path = ring_path
        self._clock = clock
        self._skew = skew
        self._start = start
        self._client: LiveClient | None = None
        self._first_row: int | None = None
        self._timed_s = 0.0

    def prepare(self) -> None:
        """Make ready for a run, while the table is pulled back."""
        if self._client is not None and self._client.has_ended:
            self.stop()
        if self._client is None:
            with contextlib.suppress(OSError):  # no room for another process: the run goes on without
                self._client = self._start()

    def poll(self, first_row: int | None, metadata: RunMetadata, now_s: float) -> LiveResult | None:
        """News of the run that began at `first_row` of the ring, which is None before its release."""
        if self._client is None:
            return None
        if self._client.has_ended:
            self.stop()
            return LiveResult(now_s, message=DIED_NOTE)
        if first_row is not None and self._first_row is None:
            self._first_row = first_row
            self._client.follow(FollowRun(self._ring_path, first_row, metadata, self._timed(first_row)))
            self._timed_s = now_s
        elif self._first_row is not None and now_s - self._timed_s > _TIMED_EVERY_S:
            self._client.update_clock(self._timed(self._first_row))
            self._timed_s = now_s
        return self._client.take_result()

    def end_run(self) -> None:
        """The run has ended."""
        if self._client is not None and self._first_row is not None:
            self._client.end_run()
        self._first_row = None

    def stop(self) -> None:
        """End the process."""
        if self._client is not None:
            self._client.stop()
        self._client, self._first_row = None, None

    def _timed(self, first_row: int) -> ClockUpdate:
        clock, skew = self._clock(), self._skew(first_row)
        timed = (1.0, CLOCK_UNCERTAINTY) if clock is None else (clock.scale, clock.scale_standard_uncertainty)
        if skew is None:
            return ClockUpdate(*timed)
        return ClockUpdate(*timed, skew.mean_s, skew.standard_uncertainty_s)
