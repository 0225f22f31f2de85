"""The latest reads with their samples, from which a run takes what came before its release."""

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields

from app.acquisition.stream.calibration import CalibratedBlock, concatenate
from drivers.samples import Losses


@dataclass(frozen=True, eq=False, slots=True)
class DecodedRead:
    """One read of the port, and the samples that it completed.

    Attributes
    ----------
    data : bytes
        As they came.
    arrival_ns : int
        Host's monotonic time after the read.
    rows : tuple of Rows
        In order, without holes.
    losses : Losses
        What this read added to the account of the stream.
    """

    data: bytes
    arrival_ns: int
    rows: tuple[CalibratedBlock, ...]
    losses: Losses


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
