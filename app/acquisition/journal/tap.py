"""Writes reads and checkpoints of a run into its journal."""

import contextlib
from collections import deque
from collections.abc import Callable

import msgspec

from app.acquisition.errors import JournalError
from app.acquisition.journal.journal import Journal
from app.acquisition.journal.records import Known, Mark
from app.acquisition.pullback.plan import PullbackMeasurement
from app.acquisition.stream.connection import RawRead
from app.acquisition.stream.live_stream import DecodedRead
from drivers.clock import TimeBase

_EVERY_S = 1.0


class JournalTap:
    """Puts each read into a journal as it comes, and knows its place there once it is decoded."""

    def __init__(self, journal: Journal) -> None:
        self.decoded_reads = 0
        """Reads that were decoded."""
        self._journal = journal
        self._starts: deque[int] = deque()
        self._failure: JournalError | None = None
        self._places: deque[tuple[int, int]] = deque()
        """Index after the last sample of a read, and the byte of the journal at which that begins."""

    def on_read(self, read: RawRead) -> None:
        """Put a read into the journal, as tap of the queue; none after a failure, so that none is skipped."""
        try:
            if self._failure is None:
                self._starts.append(self._journal.append(read.data, read.arrival_ns))
        except JournalError as error:
            self._failure = error

    def note_decoded(self, read: DecodedRead, oldest_index: int) -> None:
        """Note the samples of the next read, in order; no run begins before `oldest_index` any more.

        Raises JournalError if the read did not get into the journal.
        """
        if not self._starts and self._failure is not None:
            raise self._failure
        self.decoded_reads += 1
        end_before = self._places[-1][0] if self._places else 0
        end_index = read.rows[-1].end_index if read.rows else end_before
        self._places.append((end_index, self._starts.popleft()))
        while len(self._places) > 1 and self._places[1][0] < oldest_index and self._is_held(1):
            self._places.popleft()

    @property
    def journaled_index(self) -> int:
        """Sample before which the file of the journal has all that was decoded; 0 where it has none."""
        held = (place for place in range(len(self._places) - 1, -1, -1) if self._is_held(place))
        return next((self._places[place][0] for place in held), 0)

    def _is_held(self, place: int) -> bool:
        """Tell whether a read is in the file: records are written whole, one after another."""
        return self._places[place][1] < self._journal.written

    def offset_of(self, index: int) -> int:
        return max((start for end_index, start in self._places if end_index <= index), default=0)


class CheckpointWriter:
    """Writes a checkpoint whenever the measurement has changed, and once a second."""

    def __init__(
        self, journal: Journal, armed_index: int, rate_hz: float, time_base: Callable[[int, int], TimeBase]
    ) -> None:
        self._journal = journal
        self._armed_index = armed_index
        self._every = round(_EVERY_S * rate_hz)
        self._time_base = time_base
        self._known: Known | None = None
        self._due = 0

    def update(self, reads: int, next_index: int, measurement: PullbackMeasurement) -> None:
        """Take what is known after so many reads of the journal; `next_index` is of the sample after theirs.

        A failure of the journal is reported at the next read.
        """
        known = msgspec.convert(measurement, Known, from_attributes=True)
        if known == self._known and next_index < self._due:
            return
        self._known, self._due = known, next_index + self._every
        time_base = self._time_base(self._armed_index, next_index)
        mark = Mark(next_index, self._armed_index, known, time_base, reads)
        with contextlib.suppress(JournalError):
            self._journal.append_metadata(mark)
