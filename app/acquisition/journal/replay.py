"""Decodes the reads of a journal again, with their samples numbered as in the live stream."""

from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from app.acquisition.errors import RecoveryError
from app.acquisition.journal.records import JournalSummary, Mark, Opened, decode_metadata_record
from app.acquisition.stream.connection import create_source
from app.runs.blocks import CalibratedBlock, calibrate
from app.runs.journal import JournalRecord, RecordKind, read_journal
from drivers.clock import Skew
from drivers.errors import DriverError, SettingsError
from drivers.samples import Losses, SampleBlock
from drivers.stream import SampleSource
from messages.i18n import N_

_READS_MAX = 4096


@dataclass(frozen=True, eq=False, slots=True)
class ReplayedReads:
    """A read of the journal, or several consecutive ones from within the run."""

    rows: CalibratedBlock | None
    losses: Losses
    start: int
    """Byte of the journal at which the first record begins."""
    is_in_run: bool
    """They came after the run file was begun."""


class Replay:
    """Decodes a journal by the code that decoded its bytes live. Iterate over it once.

    A journal may begin within a stream: its samples count from 0, and the first checkpoint gives the offset.
    `differs` is set when a later one does not agree. A checkpoint stands behind the reads that it counts, and
    maybe behind some that came while those were decoded.
    """

    def __init__(self, summary: JournalSummary) -> None:
        self.differs = False
        self._summary = summary
        self._source = _source(summary)
        self._losses = Losses()
        self._offset: int | None = None
        self._reads = 0
        self._counted: deque[tuple[int, int]] = deque()
        """Reads, and samples up to these, that no checkpoint has passed yet."""
        self._opened_after: int | None = summary.opened.reads if summary.opened else None

    @property
    def _is_in_run(self) -> bool:
        return self._opened_after is not None and self._reads >= self._opened_after

    def __iter__(self) -> Iterator[ReplayedReads]:
        waiting: list[ReplayedReads] = []
        for reads in self._groups(read_journal(self._summary.path)):
            waiting.append(self._replayed(reads))
            if self._offset is not None:
                yield from (_numbered(read, self._offset) for read in waiting)
                waiting.clear()
        yield from (_numbered(read, self._offset or 0) for read in waiting)

    def _groups(self, records: Iterable[JournalRecord]) -> Iterator[list[JournalRecord]]:
        """Single reads until the run is begun, since it may begin after any; then those between two notes.

        Metadata are processed when all reads before them are decoded.
        """
        reads: list[JournalRecord] = []
        for record in records:
            is_read = record.kind is RecordKind.WIRE
            if is_read:
                reads.append(record)
            if reads and (not is_read or not self._is_in_run or len(reads) == _READS_MAX):
                yield reads
                reads = []
            if not is_read:
                self._on_metadata(record.data)
        if reads:
            yield reads

    def _replayed(self, reads: list[JournalRecord]) -> ReplayedReads:
        """Decode each read with its own time, then calibrate the samples of all together, for speed."""
        is_in_run = self._is_in_run
        try:
            blocks = [block for read in reads for block in self._decoded(read)]
        except DriverError as error:
            template = N_("{path}: its bytes make no sense ({error}). It stays as it is")
            raise RecoveryError(template, path=self._summary.path, error=error) from None
        before, self._losses = self._losses, replace(self._source.losses)
        rows = calibrate(_joined(blocks), self._summary.header.metadata.gauges) if blocks else None
        return ReplayedReads(rows, self._losses - before, reads[0].start, is_in_run)

    def _decoded(self, read: JournalRecord) -> list[SampleBlock]:
        blocks = list(self._source.decode(read.data, read.arrival_ns))
        samples = self._counted[-1][1] if self._counted else 0
        if blocks:
            samples = blocks[-1].first_index + len(blocks[-1])
        self._reads += 1
        self._counted.append((self._reads, samples))
        return blocks

    def skew(self, first_index: int, end_index: int) -> Skew | None:
        offset = self._offset or 0
        return self._source.skew(first_index - offset, end_index - offset)

    def _on_metadata(self, data: bytes) -> None:
        record = decode_metadata_record(data)
        if isinstance(record, Opened) and record.reads is None:
            self._opened_after = self._reads
        elif isinstance(record, Mark) and (samples := self._samples_after(record.reads)):
            ahead = record.next_index - samples
            self.differs = self.differs or self._offset not in (None, ahead)
            self._offset = ahead if self._offset is None else self._offset

    def _samples_after(self, reads: int | None) -> int:
        """Samples of so many reads, of all until now for None; 0 where there are none to compare."""
        while len(self._counted) > 1 and self._counted[0][0] < (self._reads if reads is None else reads):
            self._counted.popleft()
        return self._counted[0][1] if self._counted else 0


def _joined(blocks: list[SampleBlock]) -> SampleBlock:
    if len(blocks) == 1:
        return blocks[0]
    return SampleBlock(
        first_index=blocks[0].first_index,
        counts=np.concatenate([block.counts for block in blocks]),
        status=np.concatenate([block.status for block in blocks]),
        arrival_ns=blocks[-1].arrival_ns,
    )


def _numbered(read: ReplayedReads, offset: int) -> ReplayedReads:
    if read.rows is None:
        return read
    return replace(read, rows=replace(read.rows, first_index=read.rows.first_index + offset))


def _source(summary: JournalSummary) -> SampleSource:
    """Create a source at the rate of the run, or one that measures it where no device can be set to it."""
    port, facts = summary.header.port, summary.header.metadata.device.settings
    try:
        try:
            source = create_source(port, summary.rate_hz, facts)
        except SettingsError:
            source = create_source(port, port.rate_hz, facts)
        source.prepare()
    except DriverError as error:
        raise RecoveryError(
            "{path} cannot be decoded ({error}). It stays as it is", path=summary.path, error=error
        ) from None
    return source
