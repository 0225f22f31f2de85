"""The live identification: the engine's client, and what runs in its process.

It computes apart from the engine, so that neither compiled code nor a held interpreter lock can delay a read
of the port. What computes is imported when the pipes are open and the priority is lowered, since that takes
seconds. When stdin ends, the process ends at once: it holds nothing worth keeping. If it fails, a run goes on
without it.
"""

import contextlib
import importlib
import os
import subprocess
from collections.abc import Callable

from app.acquisition.messages import (
    ClockUpdate,
    EndRun,
    FollowRun,
    LiveAnswer,
    LiveCommand,
    LiveResult,
    decode_live_answer,
    decode_live_command,
)
from app.child_process import (
    ChildProcess,
    CommandReader,
    EventSender,
    LineDecoder,
    encode_line,
    ignore_session_signals,
    reserve_stdout,
    spawn,
)
from app.log import start_log
from app.runs.metadata import RunMetadata
from drivers.clock import TimeBase
from messages.message import message

_TIMED_EVERY_S = 1.0
DIED_NOTE = message(
    "the live identification ended by itself. The run goes on, and is identified when it has ended"
)


def spawn_live() -> "subprocess.Popen[bytes]":
    """Start the process, which is ready some seconds later. Raises OSError."""
    return spawn("app.acquisition.live_client", is_background=True, discard_stderr=True)


class LiveIdentifier:
    """Has runs identified while they are recorded; `time_base` gives the time base from a row on."""

    _STOP_S = 5.0
    _QUEUE_COMMANDS = 32
    """A process that leaves so many commands waiting, besides those in its pipe, is killed."""

    def __init__(
        self,
        ring_path: str,
        time_base: Callable[[int], TimeBase],
        start: Callable[[], "subprocess.Popen[bytes]"] = spawn_live,
    ) -> None:
        self._ring_path = ring_path
        self._time_base = time_base
        self._start = start
        self._child: ChildProcess[LiveCommand, LiveAnswer] | None = None
        self._first_row: int | None = None
        self._latest: LiveResult | None = None
        self._timed_s = 0.0

    def prepare(self) -> None:
        """Start the process, best before the release, unless it runs."""
        if self._child is not None and self._child.has_ended:
            self.stop()
        if self._child is None:
            with contextlib.suppress(OSError):  # no room for another process: the run goes on without
                self._child = ChildProcess(
                    self._start(),
                    encode_line,
                    decode_live_answer,
                    self._on_answer,
                    queue_size=self._QUEUE_COMMANDS,
                )

    def poll(self, first_row: int | None, metadata: RunMetadata, now_s: float) -> LiveResult | None:
        """New result of the run that began at `first_row` of the ring, which is None before its release."""
        if self._child is None:
            return None
        if self._child.has_ended:
            self.stop()
            return LiveResult(now_s, message=DIED_NOTE)
        if first_row is not None and self._first_row is None:
            self._first_row, self._latest, self._timed_s = first_row, None, now_s
            self._send(FollowRun(self._ring_path, first_row, metadata, self._time_base(first_row)))
        elif self._first_row is not None and now_s - self._timed_s > _TIMED_EVERY_S:
            self._send(ClockUpdate(self._time_base(self._first_row)))
            self._timed_s = now_s
        latest, self._latest = self._latest, None
        return None if self._first_row is None else latest

    def end_run(self) -> None:
        if self._first_row is not None:
            self._send(EndRun())
        self._first_row = None

    def stop(self) -> None:
        if self._child is not None:
            self._child.stop(self._STOP_S)
        self._child, self._first_row = None, None

    def _send(self, command: LiveCommand) -> None:
        if self._child is not None and not self._child.send(command):
            self._child.kill()

    def _on_answer(self, answer: LiveAnswer) -> None:
        if answer.first_row == self._first_row:
            self._latest = answer.result


_NICE = 5
"""The engine, at 0, gets about three times the processor time of this process where both want it (Linux)."""


def main() -> None:
    """Run until stdin ends."""
    start_log("live")
    ignore_session_signals()
    if hasattr(os, "nice"):
        os.nice(_NICE)
    events: EventSender[LiveAnswer] = EventSender(reserve_stdout(), is_transient=lambda _: True)
    commands: CommandReader[LiveCommand] = CommandReader.of_stdin(
        LineDecoder(decode_live_command).feed, on_closed=lambda: os._exit(0)
    )
    follower = importlib.import_module("app.acquisition.live_follower")
    follower.warm_up()
    follower.serve(commands, events)
