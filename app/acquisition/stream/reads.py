"""The latest reads with their samples, from which a run takes what came before its release."""

import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, fields
from typing import TypeAlias

import numpy as np

from app.acquisition.stream.calibration import CalibratedBlock
from drivers.errors import QueueFullError
from drivers.packets import MAX_BLOCK_ROWS
from drivers.samples import Losses
from messages.message import message

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
                    message(
                        "this computer is too slow: {reads} reads wait to be decoded. Close other programs",
                        reads=_WAITING_READS,
                    )
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


@dataclass(frozen=True, eq=False, slots=True)
class DecodedRead:
    """One read of the port, and the samples that it completed."""

    data: bytes
    """As they came."""
    arrival_ns: int
    """Host's monotonic time after the read."""
    rows: tuple[CalibratedBlock, ...]
    """In order, without holes."""
    losses: Losses
    """What this read added to the account of the stream."""


_BYTES_PER_SAMPLE = 25.0
"""A line of text with its time and two readings."""


class ReadHistory:
    """Reads of the last `span` samples."""

    def __init__(self, span: int) -> None:
        self._span = span
        self._chunks: deque[DecodedRead] = deque()
        self.next_index = 0
        """Index of the sample that comes next."""

    def set_span(self, span: int) -> None:
        """Reach back `span` samples from now on."""
        self._span = span

    def add(self, chunk: DecodedRead) -> None:
        """Add the latest read and forget what has become too old."""
        self._chunks.append(chunk)
        if chunk.rows:
            self.next_index = chunk.rows[-1].end_index
        while len(self._chunks) > 1 and _end_index(self._chunks[0]) < self.next_index - self._span:
            self._chunks.popleft()

    @property
    def bytes_per_sample(self) -> float:
        """What the device sends for each sample, as far as is known."""
        samples = self.next_index - self.first_index
        return sum(len(chunk.data) for chunk in self._chunks) / samples if samples else _BYTES_PER_SAMPLE

    @property
    def first_index(self) -> int:
        """Index of the oldest sample that is kept."""
        return next((chunk.rows[0].first_index for chunk in self._chunks if chunk.rows), self.next_index)

    def reads(self, first_index: int = -1) -> Iterator[DecodedRead]:
        """Reads that are kept, oldest first; only those with samples from `first_index` on, where given."""
        return (chunk for chunk in self._chunks if _end_index(chunk) > first_index or first_index < 0)


def concatenate(parts: tuple[CalibratedBlock, ...]) -> tuple[CalibratedBlock, ...]:
    """Consecutive rows in one piece; as they are where there is nothing to join, or a long gap is in them."""
    if len(parts) < 2 or parts[-1].end_index - parts[0].first_index > MAX_BLOCK_ROWS:
        return parts
    columns = (
        np.concatenate([getattr(rows, name) for rows in parts])
        for name in ("counts", "readings", "relative_m", "status")
    )
    return (CalibratedBlock(parts[0].first_index, *columns),)


def merge_reads(chunks: Sequence[DecodedRead]) -> DecodedRead:
    """One or more consecutive reads as if they had come as one."""
    if len(chunks) == 1:
        return chunks[0]
    rows = tuple(rows for chunk in chunks for rows in chunk.rows)
    losses = Losses(**{f.name: sum(getattr(c.losses, f.name) for c in chunks) for f in fields(Losses)})
    return DecodedRead(
        b"".join(chunk.data for chunk in chunks), chunks[-1].arrival_ns, concatenate(rows), losses
    )


def losses_between(after: Losses, before: Losses) -> Losses:
    """What was added to an account between two looks at it."""
    return Losses(**{f.name: getattr(after, f.name) - getattr(before, f.name) for f in fields(Losses)})


def _end_index(chunk: DecodedRead) -> int:
    """Index after the last sample of a read; reads that completed none go with the next one that did."""
    return chunk.rows[-1].end_index if chunk.rows else -1
