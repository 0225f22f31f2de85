"""A run file made anew from a journal: the same rows, bytes and events as its engine would have stored."""

import datetime
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from app.acquisition.journal.records import JournalSummary, Known, Mark, Opened
from app.acquisition.journal.replay import Replay, ReplayedReads
from app.acquisition.messages import EndReason
from app.acquisition.run_file import SampleStatistics, run_block
from app.runs.blocks import BlockLayout, CalibratedBlock, StoredRun
from app.runs.journal import JournalSpan
from app.runs.metadata import EndMetadata, Events
from app.runs.writer import RunWriter, create_run
from drivers.clock import TimeBase
from drivers.samples import SampleStatus

INTERRUPTED_NOTE = "Slipstand was ended while it recorded; this run was rebuilt from its journal"
DIFFERS_NOTE = "its samples do not number as they did while they came: the version of Slipstand may differ"
_ROWS_AT_ONCE = 1 << 16
_KEPT_S = 10.0
"""So much is kept at most of a run that had not come to its release."""


@dataclass(frozen=True)
class RebuiltRun:
    """A closed and verified file that is not at its place yet."""

    stored: StoredRun
    ending: EndMetadata
    differs: bool


def rebuild(story: JournalSummary, path: Path, progress: Callable[[float], None]) -> RebuiltRun | None:
    """Write the run of a journal to `path`; None where the journal holds no sample.

    Parameters
    ----------
    path : Path
        Must not exist yet.
    progress : callable
        Told the share of the journal that is done.

    Raises
    ------
    RecoveryError
        Its bytes cannot be decoded.
    RunError
        The file cannot be written.
    """
    opened = story.opened or _opening(story)
    if opened is None:
        return None
    metadata = story.header.metadata.replace(start_time=opened.start_time)
    span = JournalSpan(str(story.path), opened.wire_start)
    writer = create_run(path, metadata, opened.layout, span, story.header.identifier)
    try:
        return _filled(writer, story, opened, progress)
    except BaseException:
        if path.exists() and writer.usable:
            writer.discard()
        raise


def _filled(
    writer: RunWriter, story: JournalSummary, opened: Opened, progress: Callable[[float], None]
) -> RebuiltRun:
    replay = Replay(story)
    account = SampleStatistics()
    size = story.path.stat().st_size
    waiting: list[CalibratedBlock] = []
    next_index = opened.start_index
    for read, rows in _run_rows(replay, story, opened):
        account.add_losses(read.losses)
        for fresh in rows:
            account.add(fresh)
            waiting.append(fresh)
            next_index = fresh.end_index
        if waiting and next_index - waiting[0].first_index >= _ROWS_AT_ONCE:
            writer.append(run_block(waiting, opened.start_index, story.rate_hz))
            waiting.clear()
            progress(read.start / size)
    if waiting:
        writer.append(run_block(waiting, opened.start_index, story.rate_hz))
    if story.ended is not None:
        ending = story.ended.ending
    else:
        ending = _ending(story, opened, next_index, account, replay)
    return RebuiltRun(writer.close(ending), ending, replay.differs)


def _run_rows(
    replay: Replay, story: JournalSummary, opened: Opened
) -> Iterator[tuple[ReplayedReads, list[CalibratedBlock]]]:
    """Reads that count for the run, with the rows of theirs that belong to it, without holes."""
    next_index = opened.start_index
    end_index = None if story.ended is None else story.ended.end_index
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


@dataclass(frozen=True, slots=True)
class _Place:
    """Where a read stands in the journal, and which samples it brought."""

    start: int
    first_index: int
    end_index: int
    is_whole: bool

    @classmethod
    def of(cls, start: int, rows: CalibratedBlock) -> "_Place":
        return cls(start, rows.first_index, rows.end_index, rows.counts.dtype.kind == "i")


def _opening(story: JournalSummary) -> Opened | None:
    """Where a run begins whose file was not begun yet; None without a sample."""
    reads = [_Place.of(read.start, read.rows) for read in Replay(story) if read.rows]
    if not reads:
        return None
    end_index = reads[-1].end_index
    start_index = max(reads[0].first_index, min(_wanted_start(story, end_index), end_index - 1))
    armed_index = story.checkpoint.armed_index if story.checkpoint else start_index
    since_armed = datetime.timedelta(seconds=(start_index - armed_index) / story.rate_hz)
    return Opened(
        start_index=start_index,
        start_time=story.header.metadata.start_time + since_armed,
        layout=BlockLayout(counts="int32" if reads[0].is_whole else "float64"),
        wire_start=max((read.start for read in reads if read.end_index <= start_index), default=0),
    )


def _wanted_start(story: JournalSummary, end_index: int) -> int:
    """As the engine would have had it: before the release, or the last seconds since arming."""
    mark, settings = story.checkpoint, story.header.run
    if mark is None:
        return 0
    if settings.trigger == "pullback" and mark.known.release_index is not None:
        return mark.known.release_index - round(settings.pretrigger_s * story.rate_hz)
    if settings.trigger == "none":
        return mark.armed_index
    return max(mark.armed_index, end_index - round(_KEPT_S * story.rate_hz))


def _ending(
    story: JournalSummary, opened: Opened, next_index: int, account: SampleStatistics, replay: Replay
) -> EndMetadata:
    """What is known of a run that its engine did not live to end."""
    untimed = TimeBase.from_estimates(None, None)
    mark = story.checkpoint or Mark(next_index, opened.start_index, Known(), untimed)
    time_base = mark.time_base.with_skew(replay.skew(opened.start_index, next_index))
    lasted = datetime.timedelta(seconds=(next_index - opened.start_index) / story.rate_hz)
    dwell = _between(mark.known.held_index, mark.known.release_index)
    return EndMetadata(
        ended=str(EndReason.INTERRUPTED),
        end_time=opened.start_time + lasted,
        events=_events(mark, opened.start_index, story.rate_hz),
        losses=account.losses(),
        time_base=time_base,
        dwell_s=None if dwell is None else dwell / story.rate_hz,
        zero_m=mark.known.zero_m,
        relative_zero_m=mark.known.relative_zero_m,
        held_m=mark.known.held_m,
        message=". ".join(_notes(replay, time_base)),
    )


def _notes(replay: Replay, time_base: TimeBase) -> list[str]:
    differs = DIFFERS_NOTE.capitalize() if replay.differs else ""
    return [note for note in (INTERRUPTED_NOTE, differs, str(time_base.skew_message)) if note]


def _events(mark: Mark, start_index: int, rate_hz: float) -> Events:
    def time_s(index: int | None) -> float | None:
        return None if index is None else (index - start_index) / rate_hz

    return Events(
        pulled_back_s=time_s(mark.known.held_index),
        armed_s=time_s(mark.armed_index),
        release_s=time_s(mark.known.release_index),
        slip_end_s=time_s(mark.known.slip_end_index),
        rest_s=time_s(mark.known.rest_index),
    )


def _between(first: int | None, last: int | None) -> int | None:
    return None if first is None or last is None else last - first
