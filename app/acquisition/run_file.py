"""The run file that is being written: rows to the writer process, the account of them, and the closing."""

import contextlib
import datetime
import threading
from collections import deque
from collections.abc import Callable, Iterable
from concurrent.futures import Future
from concurrent.futures import TimeoutError as FutureTimeoutError
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Protocol

import numpy as np

from app.acquisition.disk_space import ROW_BYTES
from app.acquisition.errors import JournalError, JournalFullError
from app.acquisition.journal.journal import Journal
from app.acquisition.journal.records import Ended, Named, Opened
from app.acquisition.journal.tap import JournalTap
from app.acquisition.messages import EndReason
from app.acquisition.stream.live_stream import DecodedRead
from app.runs.blocks import CalibratedBlock, RunBlock, StoredRun
from app.runs.errors import DiskFullError, RunError, WriteError
from app.runs.metadata import EndMetadata
from app.runs.writer_client import OpenRun
from drivers.host_time import host_ns
from drivers.samples import INCOMPLETE, Losses, SampleStatus
from messages.message import EMPTY, Message, joined, message, message_of

_OVERLOAD = SampleStatus.OVERLOAD_TABLE | SampleStatus.OVERLOAD_RELATIVE
_COUNTED_BY_ROW = ("samples", "missing", "missing_estimated", "damaged", "overloaded")


class SampleStatistics:
    """Counts the rows of one run; together they are all its samples, each counted once as what it is."""

    def __init__(self) -> None:
        self._losses = Losses()
        self._absent = 0

    def add(self, rows: CalibratedBlock) -> None:
        """Count rows by their flags."""
        self._count(rows, 1)

    def remove(self, rows: CalibratedBlock) -> None:
        """Count rows no more that were added before."""
        self._count(rows, -1)

    def _count(self, rows: CalibratedBlock, sign: int) -> None:
        self._losses.samples += sign * len(rows)
        if not rows.status.any():
            return
        self._losses.damaged += sign * int(np.count_nonzero(rows.status & SampleStatus.DAMAGED))
        self._losses.overloaded += sign * int(np.count_nonzero(rows.status & _OVERLOAD))
        self._absent += sign * int(np.count_nonzero(rows.status & INCOMPLETE))

    def add_losses(self, added: Losses) -> None:
        """Take what a read added beside its rows: how many of the missing ones are only estimated, ..."""
        self._losses.missing_estimated += added.missing_estimated
        for field in fields(Losses):
            if field.name not in _COUNTED_BY_ROW:
                total = getattr(self._losses, field.name) + getattr(added, field.name)
                setattr(self._losses, field.name, total)

    def losses(self) -> Losses:
        """The account until now."""
        counted = {field.name: getattr(self._losses, field.name) for field in fields(Losses)}
        if self._absent:  # the first and the last read may have lost samples that are not of this run
            counted["missing_estimated"] = min(self._losses.missing_estimated, self._absent)
        # A device without time and sequence has no rows for what the rate says is lacking.
        counted["missing"] = max(0, self._absent - counted["missing_estimated"])
        return Losses(**counted)


class UncommittedRows:
    """Rows of a run that its journal may not have yet: where that fails, only the run file can have them.

    Parameters
    ----------
    held_index : callable
        Tells before which sample the journal has all.
    """

    def __init__(self, journaled_index: Callable[[], int]) -> None:
        self._held_index = journaled_index
        self._rows: deque[CalibratedBlock] = deque()

    def add(self, rows: CalibratedBlock) -> None:
        """Keep the rows that come next, and forget those that the journal has by now."""
        self._rows.append(rows)
        held_index = self._held_index()
        while self._rows and self._rows[0].end_index <= held_index:
            self._rows.popleft()

    def lost_after(self, stored_index: int) -> list[CalibratedBlock]:
        """Rows that are nowhere, where the run file has all before sample `stored_index`."""
        held_index = max(stored_index, self._held_index())
        rest = (rows.between(held_index, rows.end_index) for rows in self._rows)
        return [rows for rows in rest if len(rows)]


_BATCH_S = 0.05
_CLOSING_S = 120.0
_SLOW_BYTES_PER_S = 5e6
"""And so much longer for what the writer copies and reads again, on a slow disk."""


class Writer(Protocol):
    """What `app.runs.writer_client.WriterClient` does for a run."""

    def open(self, request: OpenRun) -> "Future[Path]":
        """Begin a run; the future holds the path of its file."""

    def append(self, block: RunBlock) -> None:
        """Hand rows over. Raises RunError."""

    def close(self, ending: EndMetadata) -> "Future[StoredRun]":
        """Complete the run; the future holds what was stored."""


@dataclass(frozen=True, slots=True)
class CloseResult:
    """How the closing of a run went."""

    path: str
    fault: EndReason | None = None
    message: Message = EMPTY


class RunFile:
    """A run from its first stored sample on.

    Parameters
    ----------
    request : OpenRun
        What the file is to be.
    journal : Journal
        Open; closed here, and removed once the run is safe.
    start_index : int
        Sample that is stored first.
    rate_hz : float
        Nominal samples a second.
    feed : JournalFeed
        Knows how much of what was decoded the journal has.
    """

    def __init__(
        self,
        writer: Writer,
        request: OpenRun,
        journal: Journal,
        start_index: int,
        rate_hz: float,
        feed: JournalTap,
    ) -> None:
        self.next_index = start_index
        """Sample that is stored next."""
        self.statistics = SampleStatistics()
        """Of the rows that were taken; once the outcome is there, of those that are held."""
        self.start_index = start_index
        self._rate_hz = rate_hz
        self._writer = writer
        self._journal = journal
        self._waiting: list[CalibratedBlock] = []
        self._unsure = UncommittedRows(lambda: feed.journaled_index)
        self._is_closing = False
        self._began = (datetime.datetime.now().astimezone(), host_ns())
        span = request.journal
        wire_start = span.start if span else 0
        started = request.metadata.start_time
        with contextlib.suppress(JournalError):  # which is told of at the next read; the file can be had yet
            journal.append_metadata(
                Opened(start_index, started, request.layout, wire_start, feed.decoded_reads)
            )
        self._path = writer.open(request)
        self._outcome: Future[CloseResult] = Future()

    @property
    def path(self) -> "Future[Path]":
        """Where it is, once it is there."""
        return self._path

    @property
    def close_result(self) -> "Future[CloseResult]":
        """How the closing went, once it is done."""
        return self._outcome

    def append_earlier(self, chunks: Iterable[DecodedRead], end_index: int | None = None) -> None:
        """Store the rows of reads that came before; all of them are in the journal. Raises RunError."""
        failure: RunError | None = None
        for chunk in chunks:
            try:
                self.append(chunk, end_index)
            except RunError as error:
                failure = failure or error
        if failure is not None:
            raise failure

    def append(self, chunk: DecodedRead, end_index: int | None = None) -> None:
        """Store the rows of a read that come next, up to `end_index`. Raises RunError."""
        for rows in chunk.rows:
            fresh = rows.between(self.next_index, rows.end_index if end_index is None else end_index)
            if len(fresh):
                self.statistics.add(fresh)
                self._unsure.add(fresh)
                self.next_index = fresh.end_index
                self._waiting.append(fresh)
        self.statistics.add_losses(chunk.losses)
        if self._waiting and self.next_index - self._waiting[0].first_index >= _BATCH_S * self._rate_hz:
            self._hand_over()

    def time_s(self, index: int | None) -> float | None:
        """Time of a sample in the base of this run; negative before it began."""
        return None if index is None else (index - self.start_index) / self._rate_hz

    def current_time(self) -> datetime.datetime:
        """Time of day by the clock as it stood when the run began: it may have been set meanwhile."""
        began, began_ns = self._began
        return began + datetime.timedelta(seconds=(host_ns() - began_ns) * 1e-9)

    def record_path(self) -> None:
        """Tell the journal where the file is; a recovery finds it without that too, but must look."""
        if self._path.exception() is None and not self._is_closing:
            with contextlib.suppress(JournalError):
                self._journal.append_metadata(Named(str(self._path.result())))

    def close(self, ending: EndMetadata) -> None:
        """Begin to complete the file; `outcome` tells when it is done."""
        self._is_closing = True
        with contextlib.suppress(JournalError):
            self._journal.append_metadata(Ended(self.next_index, ending))
        threading.Thread(target=self._close, args=(ending,), name="closing", daemon=True).start()

    def _hand_over(self) -> None:
        """Give the writer what has come together; block by block would cost it several times as much."""
        waiting, self._waiting = self._waiting, []
        self._writer.append(run_block(waiting, self.start_index, self._rate_hz))

    def _close(self, ending: EndMetadata) -> None:
        """Thread: journal first, so that the writer can copy its bytes; it goes last, when all is safe."""
        hand_over_fault, journal_fault = _fault_of(self._hand_over_rest), _fault_of(self._journal.close)
        try:
            stored, fault = self._stored(ending), hand_over_fault
        except Exception as error:  # whatever it is, someone waits for the outcome
            stored, fault = None, error
        samples = getattr(fault, "stored_samples", 0) if stored is None else stored.samples
        lost = self._take_back_lost(samples)
        outcome = self._told(stored, samples, fault, journal_fault)
        self._journal.release()
        self._outcome.set_result(replace(outcome, message=_sentences(outcome.message, lost)))

    def _hand_over_rest(self) -> None:
        if self._waiting:
            self._hand_over()

    def _stored(self, ending: EndMetadata) -> StoredRun:
        try:
            return self._writer.close(ending).result(self._patience_s)
        except FutureTimeoutError:
            raise WriteError(
                message("the run writer gives no answer for {timeout_s:.0f} s", timeout_s=self._patience_s)
            ) from None

    def _take_back_lost(self, stored_samples: int) -> Message:
        """Count what neither file nor journal has no more, and say so."""
        lost = self._unsure.lost_after(self.start_index + stored_samples)
        for rows in lost:
            self.statistics.remove(rows)
        samples = sum(len(rows) for rows in lost)
        if not samples:
            return EMPTY
        return message(
            "the last {samples} samples found no room in run or journal, and are lost", samples=samples
        )

    def _told(
        self, stored: StoredRun | None, samples: int, fault: Exception | None, journal_fault: Exception | None
    ) -> CloseResult:
        """Say how it went, and remove the journal where nothing of it is missed."""
        path = self._known_path() if stored is None else stored.path
        lacking = self.statistics.losses().samples - samples
        first = fault or journal_fault
        if first is not None:
            remedy = self._remedy(journal_fault) if lacking or journal_fault is None else EMPTY
            return CloseResult(path, end_reason(first), _sentences(message_of(first), remedy))
        if lacking:
            return CloseResult(
                path,
                message=_sentences(
                    message("{samples} samples are only in the journal", samples=lacking), self._remedy()
                ),
            )
        if stored is None or not stored.raw_bytes_stored:
            return CloseResult(
                path, message=_sentences(message("no room for the received bytes in the run"), self._remedy())
            )
        self._journal.remove()
        return CloseResult(path)

    @property
    def _patience_s(self) -> float:
        """How long the writer may take to close the file."""
        size = self.statistics.losses().samples * ROW_BYTES + self._journal.size
        return _CLOSING_S + size / _SLOW_BYTES_PER_S

    def _remedy(self, journal_fault: Exception | None = None) -> Message:
        journal = self._journal.path
        if journal_fault is None:
            return message(
                "All that came is in {journal}: rebuild the run with slipstand recover {folder}",
                journal=journal,
                folder=journal.parent,
            )
        return message(
            "More than the run has is in {journal}: rebuild the run with slipstand recover {folder}",
            journal=journal,
            folder=journal.parent,
        )

    def _known_path(self) -> str:
        has_path = self._path.done() and self._path.exception() is None
        return str(self._path.result()) if has_path else ""


def _sentences(*parts: Message) -> Message:
    """Join those parts that say anything."""
    spoken = [part for part in parts if part]
    return joined(spoken, ". ") if spoken else EMPTY


def run_block(rows: list[CalibratedBlock], start_index: int, rate_hz: float) -> RunBlock:
    """Consecutive rows in the base of a run that begins with sample `start_index`."""
    numbers = np.arange(rows[0].first_index, rows[-1].end_index) - start_index
    return RunBlock(
        time_s=numbers / rate_hz,
        readings=np.concatenate([part.readings for part in rows]),
        status=np.concatenate([part.status for part in rows]),
        counts=np.concatenate([part.counts for part in rows]),
    )


def start_time(chunk: DecodedRead, start_index: int, rate_hz: float) -> datetime.datetime:
    """When sample `start_index` was taken, going by the arrival of a read that came about then or later."""
    ago_s = (host_ns() - chunk.arrival_ns) * 1e-9
    if chunk.rows:
        ago_s += (chunk.rows[-1].end_index - start_index) / rate_hz
    return datetime.datetime.now().astimezone() - datetime.timedelta(seconds=ago_s)


def _fault_of(step: Callable[[], None]) -> Exception | None:
    """What a step fails of, whatever it is: those after it are done all the same."""
    try:
        step()
    except Exception as error:
        return error
    return None


def end_reason(error: Exception) -> EndReason:
    """What a run that met this error has ended of."""
    is_full = isinstance(error, DiskFullError | JournalFullError)
    return EndReason.DISK_FULL if is_full else EndReason.WRITE_ERROR
