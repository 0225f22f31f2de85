"""Rebuilds a run file from a journal: the same rows, bytes and events as its engine would have stored."""

import datetime
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import msgspec
import numpy as np

from app.acquisition.errors import RecoveryError
from app.acquisition.journal.records import (
    JournalSummary,
    Known,
    Mark,
    MetadataRecord,
    Opened,
    decode_metadata_record,
    end_metadata,
)
from app.acquisition.messages import EndReason
from app.acquisition.run_file import SampleStatistics, run_block
from app.acquisition.stream.connection import create_source
from app.runs.blocks import BlockLayout, CalibratedBlock, StoredRun, calibrate
from app.runs.journal import JournalRecord, JournalSpan, RecordKind, read_journal
from app.runs.metadata import EndMetadata
from app.runs.writer import RunWriter, create_run
from drivers.clock import Skew, TimeBase
from drivers.errors import DriverError, SettingsError
from drivers.samples import Losses, SampleBlock, SampleStatus
from drivers.stream import SampleSource
from messages.i18n import N_

_READS_MAX = 4096


@dataclass(frozen=True, eq=False, slots=True)
class ReplayedReads:
    """A read of the journal, or several consecutive ones from within the run."""

    rows: CalibratedBlock | None
    losses: Losses
    start: int  # byte of the journal at which the first record begins
    is_in_run: bool  # they came after the run file was begun


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
        self._reads = summary.earlier_reads
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
        """Single reads until the run is begun, since it may begin after any; then those of a checkpoint."""
        reads: list[JournalRecord] = []
        for record in records:
            if record.kind is RecordKind.WIRE:
                reads.append(record)
                if not self._is_in_run or len(reads) == _READS_MAX:
                    yield reads
                    reads = []
                continue
            fact = decode_metadata_record(record.data)
            counted = self._counted_reads(fact, len(reads))
            if counted:
                yield reads[:counted]
                reads = reads[counted:]
            self._on_metadata(fact)
        if reads:
            yield reads

    def _counted_reads(self, fact: MetadataRecord, waiting: int) -> int:
        """How many of the `waiting` reads a metadata record counts."""
        if not isinstance(fact, Mark | Opened):
            return 0
        return waiting if fact.reads is None else min(max(fact.reads - self._reads, 0), waiting)

    def _replayed(self, reads: list[JournalRecord]) -> ReplayedReads:
        """Decode consecutive reads and calibrate their samples."""
        is_in_run = self._is_in_run
        try:
            blocks = self._source.decode_reads([(read.data, read.arrival_ns) for read in reads])
        except DriverError as error:
            template = N_("{path}: its bytes make no sense ({error}). It stays as it is")
            raise RecoveryError(template, path=self._summary.path, error=error) from None
        samples = self._counted[-1][1] if self._counted else 0
        if blocks:
            samples = blocks[-1].first_index + len(blocks[-1])
        self._reads += len(reads)
        self._counted.append((self._reads, samples))
        before, self._losses = self._losses, replace(self._source.losses)
        rows = calibrate(_joined(blocks), self._summary.header.metadata.gauges) if blocks else None
        return ReplayedReads(rows, self._losses - before, reads[0].start, is_in_run)

    def skew(self, first_index: int, end_index: int) -> Skew | None:
        offset = self._offset or 0
        return self._source.skew(first_index - offset, end_index - offset)

    def _on_metadata(self, record: MetadataRecord) -> None:
        if isinstance(record, Opened) and record.reads is None:
            self._opened_after = self._reads
        elif isinstance(record, Mark) and (samples := self._samples_after(record.reads)):
            ahead = record.next_index - samples
            self.differs = self.differs or self._offset not in (None, ahead)
            self._offset = ahead if self._offset is None else self._offset

    def _samples_after(self, reads: int | None) -> int:
        """Samples of so many reads, of all until now for None; 0 where that number is not known."""
        wanted = self._reads if reads is None else reads
        while len(self._counted) > 1 and self._counted[0][0] < wanted:
            self._counted.popleft()
        return self._counted[0][1] if self._counted and self._counted[0][0] == wanted else 0


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


INTERRUPTED_NOTE = "Slipstand was ended while it recorded; this run was rebuilt from its journal"
DIFFERS_NOTE = "its samples do not number as they did while they came: the version of Slipstand may differ"
_ROWS_AT_ONCE = 1 << 16
_KEPT_S = 10.0  # longest part that is kept of a run that had not come to its release


@dataclass(frozen=True)
class RebuiltRun:
    """A closed and verified file that is not at its place yet."""

    stored: StoredRun
    ending: EndMetadata


def rebuild(summary: JournalSummary, path: Path, progress: Callable[[float], None]) -> RebuiltRun | None:
    """Write the run of a journal to `path`; None where it holds no sample. Raises RecoveryError, RunError."""
    opened = summary.opened or _opening(summary)
    if opened is None:
        return None
    metadata = summary.header.metadata.replace(start_time=opened.start_time)
    span = JournalSpan(str(summary.path), opened.wire_start)
    writer = create_run(path, metadata, opened.layout, span, summary.header.identifier)
    try:
        return _filled(writer, summary, opened, progress)
    except BaseException:
        if path.exists() and writer.usable:
            writer.discard()
        raise


def _filled(
    writer: RunWriter, summary: JournalSummary, opened: Opened, progress: Callable[[float], None]
) -> RebuiltRun:
    replay = Replay(summary)
    statistics = SampleStatistics()
    size = summary.path.stat().st_size
    waiting: list[CalibratedBlock] = []
    next_index = opened.start_index

    def write_waiting() -> None:
        writer.append(run_block(waiting, opened.start_index, summary.rate_hz))
        waiting.clear()

    for read, rows in _run_rows(replay, summary, opened):
        statistics.add_losses(read.losses)
        for fresh in rows:
            statistics.add(fresh)
            waiting.append(fresh)
            next_index = fresh.end_index
        if waiting and next_index - waiting[0].first_index >= _ROWS_AT_ONCE:
            write_waiting()
            progress(read.start / size)
    if waiting:
        write_waiting()
    if summary.ended is not None and summary.opened is not None:
        ending = summary.ended.ending
    else:
        ending = _ending(summary, opened, next_index, statistics, replay)
    return RebuiltRun(writer.close(ending), ending)


def _run_rows(
    replay: Replay, summary: JournalSummary, opened: Opened
) -> Iterator[tuple[ReplayedReads, list[CalibratedBlock]]]:
    """Reads that count for the run, with the rows of theirs that belong to it, without holes."""
    next_index = opened.start_index
    end_index = None if summary.ended is None else summary.ended.end_index
    for read in replay:
        rows = read.rows
        if not read.is_in_run and (rows is None or rows.end_index <= opened.start_index):
            continue  # what came before the run; as when it was recorded, reads without samples too
        kept: list[CalibratedBlock] = []
        if rows is not None:
            last = rows.end_index if end_index is None else end_index
            if rows.first_index > next_index and next_index == opened.start_index:
                kept.append(_absent(next_index, min(rows.first_index, last), rows))
            fresh = rows.between(next_index, last)
            if len(fresh):
                kept.append(fresh)
                next_index = fresh.end_index
        yield read, kept


def _absent(first_index: int, end_index: int, like: CalibratedBlock) -> CalibratedBlock:
    """Rows that stand for samples whose first byte came before the first byte of the journal."""
    n = end_index - first_index
    return CalibratedBlock(
        first_index,
        np.zeros((n, 2), like.counts.dtype),
        np.full((n, 2), np.nan),
        np.full(n, np.nan),
        np.full(n, SampleStatus.MISSING, np.uint8),
    )


def _opening(summary: JournalSummary) -> Opened | None:
    places = list[tuple[int, int]]()
    """Byte of the journal at which a read begins, and the index after its last sample."""
    first_index, layout = 0, BlockLayout()
    for read in Replay(summary):
        if not read.rows:
            continue
        if not places:
            first_index = read.rows.first_index
            layout = BlockLayout(counts="int32" if read.rows.counts.dtype.kind == "i" else "float64")
        places.append((read.start, read.rows.end_index))
    if not places:
        return None
    end_index = places[-1][1]
    start_index = max(first_index, min(_wanted_start(summary, end_index), end_index - 1))
    armed_index = summary.checkpoint.armed_index if summary.checkpoint else start_index
    since_armed = datetime.timedelta(seconds=(start_index - armed_index) / summary.rate_hz)
    return Opened(
        start_index=start_index,
        start_time=summary.header.metadata.known_start_time + since_armed,
        layout=layout,
        wire_start=max((start for start, end in places if end <= start_index), default=0),
    )


def _wanted_start(summary: JournalSummary, end_index: int) -> int:
    """First sample as the engine would have chosen it: before the release, or in the last seconds."""
    mark, settings = summary.checkpoint, summary.header.run
    if mark is None:
        return 0
    if settings.trigger == "pullback" and mark.known.release_index is not None:
        return mark.known.release_index - round(settings.pretrigger_s * summary.rate_hz)
    if settings.trigger == "none":
        return mark.armed_index
    return max(mark.armed_index, end_index - round(_KEPT_S * summary.rate_hz))


def _ending(
    summary: JournalSummary, opened: Opened, next_index: int, statistics: SampleStatistics, replay: Replay
) -> EndMetadata:
    untimed = TimeBase.from_estimates(None, None)
    mark = summary.checkpoint or Mark(next_index, opened.start_index, Known(), untimed)
    time_base = mark.time_base.with_skew(replay.skew(opened.start_index, next_index))
    ended = summary.ended.ending if summary.ended else None  # of the whole run, of which this is a part
    notes = (
        ended.message if ended else INTERRUPTED_NOTE,
        DIFFERS_NOTE.capitalize() if replay.differs else "",
        str(time_base.skew_message),
    )
    length_s = (next_index - opened.start_index) / summary.rate_hz
    return end_metadata(
        msgspec.structs.replace(mark, time_base=time_base),
        opened.start_index,
        summary.rate_hz,
        ended.ended if ended else str(EndReason.INTERRUPTED),
        opened.start_time + datetime.timedelta(seconds=length_s),
        statistics.losses(),
        ". ".join(filter(None, notes)),
    )
