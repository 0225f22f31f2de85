"""The live identification: the engine's client, and its process `python -m app.acquisition.live_client`.

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
from typing import Self

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
        return cls(spawn("app.acquisition.live_client", is_background=True, discard_stderr=True))

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
    """Has runs identified while they are recorded; `time_base` gives the time base from a row on."""

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


_NICE = 5
"""The engine, at 0, gets about three times the processor time of this process where both want it (Linux)."""


def main() -> None:
    """Run until stdin ends."""
    start_log("live")
    ignore_session_signals()
    if hasattr(os, "nice"):
        os.nice(_NICE)
    events: EventSender[LiveAnswer] = EventSender(reserve_stdout(), is_transient=lambda _: True)
    commands: CommandReader[LiveCommand] = CommandReader(
        0, LineDecoder(decode_live_command), on_closed=lambda: os._exit(0)
    )
    follower = importlib.import_module("app.acquisition.live_follower")
    follower.warm_up()
    follower.serve(commands, events)


if __name__ == "__main__":
    main()
