"""Reads on their way from the port to whoever decodes them, and beside that into a journal."""

import threading
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TypeAlias

from drivers.port import QueueFullError

_WAITING_READS = 4096


@dataclass(frozen=True, slots=True)
class RawRead:
    """What was read at once, and the host's time after it (ns); no bytes where the link was broken."""

    arrival_ns: int
    data: bytes


Tap: TypeAlias = Callable[[RawRead], None]
"""Takes each read in the thread that reads the port: must neither wait nor raise."""


class ReadQueue:
    """Holds each read until it is decoded. A tap gets it at once, whatever becomes of the decoding.

    One thread puts, another takes; both go on over all the connections of a stream.
    """

    def __init__(self) -> None:
        self._waiting: deque[RawRead] = deque()
        self._changed = threading.Condition(threading.Lock())
        self._tap: Tap | None = None

    @property
    def is_empty(self) -> bool:
        """Tell whether all that came was taken."""
        return not self._waiting

    def put(self, arrival_ns: int, data: bytes) -> None:
        """Add a read. Raises QueueFullError when thousands wait; the tap has this one too."""
        read = RawRead(arrival_ns, data)
        with self._changed:
            if self._tap is not None:
                self._tap(read)
            if len(self._waiting) >= _WAITING_READS:
                raise QueueFullError(
                    f"this computer is too slow: {_WAITING_READS} reads wait to be decoded."
                    " Close other programs"
                )
            self._waiting.append(read)
            self._changed.notify()

    def take(self, timeout_s: float) -> RawRead | None:
        """The oldest read that waits; None when nothing comes in time."""
        with self._changed:
            if not self._waiting:
                self._changed.wait(timeout_s)
            return self._waiting.popleft() if self._waiting else None

    def open_tap(self, tap: Tap, earlier: Iterable[RawRead] = ()) -> None:
        """Give all reads to `tap` from now on, those first that were taken already, then those that wait."""
        with self._changed:
            for read in (*earlier, *self._waiting):
                tap(read)
            self._tap = tap

    def close_tap(self) -> None:
        """Give nothing to a tap any more; it is not under way when this returns."""
        with self._changed:
            self._tap = None
