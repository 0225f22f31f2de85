"""The engine's side of the live identification. If that fails, a run goes on without it."""

import contextlib
import subprocess
from collections.abc import Callable
from typing import Self

from app.acquisition.messages import (
    ClockUpdate,
    EndRun,
    FollowRun,
    LiveAnswer,
    LiveCommand,
    LiveResult,
    decode_live_answer,
)
from app.child_process import ChildProcess, encode_line, spawn
from app.runs.metadata import RunMetadata
from drivers.clock import TimeBase
from messages.message import message

_TIMED_EVERY_S = 1.0
DIED_NOTE = message(
    "the live identification ended by itself. The run goes on, and is identified when it has ended"
)


class LiveClient:
    """A process that identifies runs while they are recorded; make it with `LiveClient.start`."""

    _STOP_S = 5.0
    _QUEUE_COMMANDS = 32
    """A process that leaves so many commands waiting, besides those in its pipe, is killed."""

    def __init__(self, process: "subprocess.Popen[bytes]") -> None:
        self.pid = process.pid
        self._first_row: int | None = None
        self._latest: LiveResult | None = None
        self._child: ChildProcess[LiveCommand, LiveAnswer] = ChildProcess(
            process, encode_line, decode_live_answer, self._on_answer, queue_size=self._QUEUE_COMMANDS
        )

    @classmethod
    def start(cls) -> Self:
        """Start the process, which is ready some seconds later. Raises OSError."""
        return cls(spawn("app.acquisition.live_process", is_background=True, discard_stderr=True))

    @property
    def has_ended(self) -> bool:
        return self._child.has_ended

    def follow(self, command: FollowRun) -> None:
        self._latest, self._first_row = None, command.first_row
        self._send(command)

    def update_clock(self, time_base: TimeBase) -> None:
        self._send(ClockUpdate(time_base))

    def end_run(self) -> None:
        self._first_row = None
        self._send(EndRun())

    def take_result(self) -> LiveResult | None:
        """Latest result since the last call, of the run that is followed; None between two runs."""
        latest, self._latest = self._latest, None
        return None if self._first_row is None else latest

    def stop(self) -> None:
        self._child.stop(self._STOP_S)

    def _send(self, command: LiveCommand) -> None:
        if not self._child.send(command):
            self._child.kill()

    def _on_answer(self, answer: LiveAnswer) -> None:
        if answer.first_row == self._first_row:
            self._latest = answer.result


class LiveIdentifier:
    """Has one run after another identified while it goes on.

    `time_base` gives the time base of the rows from a given one on; `start` starts the process.
    """

    def __init__(
        self,
        ring_path: str,
        time_base: Callable[[int], TimeBase],
        start: Callable[[], LiveClient] = LiveClient.start,
    ) -> None:
        self._ring_path = ring_path
        self._time_base = time_base
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
        """New result of the run that began at `first_row` of the ring, which is None before its release."""
        if self._client is None:
            return None
        if self._client.has_ended:
            self.stop()
            return LiveResult(now_s, message=DIED_NOTE)
        if first_row is not None and self._first_row is None:
            self._first_row = first_row
            self._client.follow(FollowRun(self._ring_path, first_row, metadata, self._time_base(first_row)))
            self._timed_s = now_s
        elif self._first_row is not None and now_s - self._timed_s > _TIMED_EVERY_S:
            self._client.update_clock(self._time_base(self._first_row))
            self._timed_s = now_s
        return self._client.take_result()

    def end_run(self) -> None:
        if self._client is not None and self._first_row is not None:
            self._client.end_run()
        self._first_row = None

    def stop(self) -> None:
        if self._client is not None:
            self._client.stop()
        self._client, self._first_row = None, None
