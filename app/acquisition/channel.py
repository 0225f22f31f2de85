"""The engine's two pipes: commands in, events out, neither of which can hold the engine up."""

import contextlib
import os
import queue
import threading

import msgspec

from app.acquisition.messages import Command, Event, Failed, Health, LiveResult, decode_command, encode

_COMMAND_BYTES = 1 << 20


class CommandReader:
    """Reads command lines from a pipe in a thread of its own.

    Parameters
    ----------
    descriptor : int
        Read end of the pipe. Its end means that whoever gave commands is gone.
    """

    _QUEUE_COMMANDS = 1024

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        # A full one leaves the rest in the pipe: who gives commands faster than they are taken waits.
        self._commands: queue.Queue[Command | None] = queue.Queue(self._QUEUE_COMMANDS)
        self._is_closed = False
        # Not a buffered file: its lock would be held for ever, and the interpreter could not finish.
        threading.Thread(target=self._read, name="commands", daemon=True).start()

    @property
    def is_closed(self) -> bool:
        """Tell whether no more commands will come: `take` has come to the end of the pipe."""
        return self._is_closed

    def take(self, timeout_s: float = 0.0) -> Command | None:
        """Next command; None if none comes in time, and from the end of the pipe on."""
        if self._is_closed:
            return None
        try:
            command = self._commands.get(block=timeout_s > 0.0, timeout=timeout_s or None)
        except queue.Empty:
            return None
        self._is_closed = command is None
        return command

    def _read(self) -> None:
        rest = b""
        with contextlib.suppress(OSError, msgspec.DecodeError):
            while (data := os.read(self._descriptor, 65536)) and len(rest) < _COMMAND_BYTES:
                *lines, rest = (rest + data).split(b"\n")
                for line in lines:
                    self._commands.put(decode_command(line))
        self._commands.put(None)


class EventSender:
    """Writes events to a pipe in a thread of its own; a reader that hangs only misses some.

    Parameters
    ----------
    descriptor : int
        Write end of the pipe.
    """

    _QUEUE_EVENTS = 4096
    _CLOSE_S = 2.0

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        # Bounded by `send`: a queue that bounds itself takes several times as long for each event.
        self._events: queue.SimpleQueue[Event | None] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._write, name="events", daemon=True)
        self._thread.start()

    def send(self, event: Event) -> None:
        """Say something; what will soon be said anew may be left out when nobody listens."""
        is_soon_said_anew = isinstance(event, Health | LiveResult)
        if self._events.qsize() < self._QUEUE_EVENTS // (2 if is_soon_said_anew else 1):
            self._events.put(event)

    def fail(self, message: str) -> None:
        """Say why the engine ends, in one line."""
        self.send(Failed(" ".join(message.split())))

    def close(self) -> None:
        """Bring the last words out, if anybody takes them."""
        self._events.put(None)
        self._thread.join(self._CLOSE_S)

    def _write(self) -> None:
        with contextlib.suppress(OSError):
            while (event := self._events.get()) is not None:
                line = encode(event)
                while line:
                    line = line[os.write(self._descriptor, line) :]
