"""Rebuilds a run file from a journal: the same rows, bytes and events as its engine would have stored."""

import datetime
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np

from app.acquisition.journal.records import JournalSummary, Known, Mark, Opened, end_metadata
from app.acquisition.journal.replay import Replay, ReplayedReads
from app.acquisition.messages import EndReason
from app.acquisition.run_file import SampleStatistics, run_block
from app.runs.blocks import BlockLayout, CalibratedBlock, StoredRun
from app.runs.journal import JournalSpan
from app.runs.metadata import EndMetadata
from app.runs.writer import RunWriter, create_run
from drivers.clock import TimeBase
from drivers.samples import SampleStatus

INTERRUPTED_NOTE = "Slipstand was ended while it recorded; this run was rebuilt from its journal"
DIFFERS_NOTE = "its samples do not number as they did while they came: the version of Slipstand may differ"
_ROWS_AT_ONCE = 1 << 16
_KEPT_S = 10.0
"""Longest part that is kept of a run that had not come to its release."""


@dataclass(frozen=True)
class RebuiltRun:
    """A closed and verified file that is not at its place yet."""

    stored: StoredRun
    ending: EndMetadata
    differs: bool


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
    if summary.ended is not None:
        ending = summary.ended.ending
    else:
        ending = _ending(summary, opened, next_index, statistics, replay)
    return RebuiltRun(writer.close(ending), ending, replay.differs)


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
        start_time=summary.header.metadata.start_time + since_armed,
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
    summary: JournalSummary,
    opened: Opened,
    next_index: int,
    statistics: SampleStatistics,
    replay: Replay,
) -> EndMetadata:
    untimed = TimeBase.from_estimates(None, None)
    mark = summary.checkpoint or Mark(next_index, opened.start_index, Known(), untimed)
    time_base = mark.time_base.with_skew(replay.skew(opened.start_index, next_index))
    notes = (
        INTERRUPTED_NOTE,
        DIFFERS_NOTE.capitalize() if replay.differs else "",
        str(time_base.skew_message),
    )
    length_s = (next_index - opened.start_index) / summary.rate_hz
    return end_metadata(
        msgspec.structs.replace(mark, time_base=time_base),
        opened.start_index,
        summary.rate_hz,
        str(EndReason.INTERRUPTED),
        opened.start_time + datetime.timedelta(seconds=length_s),
        statistics.losses(),
        ". ".join(filter(None, notes)),
    )
