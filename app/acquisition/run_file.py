"""The run file that is being written: rows to the writer process, their statistics, and the closing."""

import datetime
import logging
import threading
from collections import deque
from collections.abc import Callable, Iterable
from concurrent.futures import Future
from concurrent.futures import TimeoutError as FutureTimeoutError
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from app.acquisition.disk_space import ROW_BYTES
from app.acquisition.errors import JournalFullError
from app.acquisition.journal.journal import Journal, JournalTap
from app.acquisition.journal.records import Ended, Named, Opened
from app.acquisition.messages import EndReason
from app.acquisition.stream.live_stream import DecodedRead
from app.runs.blocks import CalibratedBlock, RunBlock, StoredRun, count_flags
from app.runs.errors import DiskFullError, RunError, WriteError
from app.runs.lock import remove_lock
from app.runs.metadata import EndMetadata
from app.runs.writer_client import OpenRun, WriterClient
from drivers.host_time import host_ns
from drivers.samples import Losses
from messages.i18n import N_
from messages.message import EMPTY, Message, joined, message, message_of

_log = logging.getLogger(__name__)


class SampleStatistics:
    """Counts the rows of one run by status, each once."""

    def __init__(self) -> None:
        self._rows = Losses()
        self._reads = Losses()

    def add(self, rows: CalibratedBlock) -> None:
        self._rows += count_flags(rows.status)

    def remove(self, rows: CalibratedBlock) -> None:
        self._rows -= count_flags(rows.status)

    def add_losses(self, added: Losses) -> None:
        """Add what a read lost beside its rows, such as how many of the missing samples are estimated."""
        self._reads += added

    def losses(self) -> Losses:
        absent, estimated = self._rows.missing, self._reads.missing_estimated
        if absent:  # the first and the last read may have lost samples that are not of this run
            estimated = min(estimated, absent)
        return replace(
            self._reads,
            samples=self._rows.samples,
            # A device without time and sequence has no rows for what the rate says is missing.
            missing=max(0, absent - estimated),
            missing_estimated=estimated,
            damaged=self._rows.damaged,
            overloaded=self._rows.overloaded,
        )


class UncommittedRows:
    """Rows of a run that its journal may not have yet: if that fails, only the run file has them."""

    def __init__(self, journaled_index: Callable[[], int]) -> None:
        self._journaled_index = journaled_index
        self._rows: deque[CalibratedBlock] = deque()

    def add(self, rows: CalibratedBlock) -> None:
        """Keep the rows that come next, and forget those that the journal has by now."""
        self._rows.append(rows)
        journaled_index = self._journaled_index()
        while self._rows and self._rows[0].end_index <= journaled_index:
            self._rows.popleft()

    def lost_after(self, stored_index: int) -> list[CalibratedBlock]:
        """Rows that are nowhere, where the run file has all before sample `stored_index`."""
        held_index = max(stored_index, self._journaled_index())
        rest = (rows.between(held_index, rows.end_index) for rows in self._rows)
        return [rows for rows in rest if len(rows)]


_BATCH_S = 2.0
_BATCH_ROWS = 1 << 14
"""Rows are passed to the writer in batches of so long, or so many: a small batch costs as much as a large
one. Until then they are in the journal; rows that it could not take are passed on at the end."""
_CLOSING_S = 120.0
_INSPECTION_S = 30.0  # for the run of a writer that gave no answer: its disk may hang
_HANGING_S = 3.0  # for a writer whose disk is known to hang
_SLOW_BYTES_PER_S = 5e6  # and so much longer for what the writer copies and reads again, on a slow disk


@dataclass(frozen=True, slots=True)
class CloseResult:
    """How the closing of a run went."""

    path: str
    fault: EndReason | None = None
    notes: tuple[Message, ...] = ()
    """What went wrong, and what to do."""


class RunFile:
    """The file of a run from its first stored sample on. The journal is removed once the run is safe."""

    def __init__(
        self,
        writer: WriterClient,
        request: OpenRun,
        journal: Journal,
        start_index: int,
        rate_hz: float,
        tap: JournalTap,
    ) -> None:
        self.start_index = start_index
        self.next_index = start_index
        self.statistics = SampleStatistics()
        """Of the rows that were taken; once the file is closed, of those that are held."""
        self.close_result: Future[CloseResult] = Future()
        self._rate_hz = rate_hz
        self._writer = writer
        self._journal = journal
        self._waiting: list[CalibratedBlock] = []
        self._uncommitted = UncommittedRows(lambda: tap.journaled_index)
        self._is_closing = False
        self._began = (datetime.datetime.now().astimezone(), host_ns())
        wire_start = request.journal.start if request.journal else 0
        started = request.metadata.known_start_time
        journal.append_metadata(Opened(start_index, started, request.layout, wire_start, tap.decoded_reads))
        self.path: Future[Path] = writer.open(request)

    def append_all(self, reads: Iterable[DecodedRead], end_index: int | None = None) -> None:
        """Store the rows of several reads at once; raises the first RunError when all rows are counted."""
        failure: RunError | None = None
        for read in reads:
            try:
                self.append(read, end_index)
            except RunError as error:
                failure = failure or error
        if failure is not None:
            raise failure
        self._pass_on()

    def append(self, read: DecodedRead, end_index: int | None = None) -> None:
        """Store the rows of a read that come next, up to `end_index`. Raises RunError."""
        for rows in read.rows:
            fresh = rows.between(self.next_index, rows.end_index if end_index is None else end_index)
            if len(fresh):
                self.statistics.add(fresh)
                self._uncommitted.add(fresh)
                self.next_index = fresh.end_index
                self._waiting.append(fresh)
        self.statistics.add_losses(read.losses)
        waiting = self.next_index - self._waiting[0].first_index if self._waiting else 0
        if waiting >= min(_BATCH_S * self._rate_hz, _BATCH_ROWS) or self._writer.failure is not None:
            self._pass_on()

    def time_s(self, index: int | None) -> float | None:
        return None if index is None else (index - self.start_index) / self._rate_hz

    def current_time(self) -> datetime.datetime:
        """Time of day by the clock as it stood when the run began; it may have been set meanwhile."""
        began, began_ns = self._began
        return began + datetime.timedelta(seconds=(host_ns() - began_ns) * 1e-9)

    def record_path(self) -> None:
        """Write the path of the file into the journal; a recovery finds the file without it, by a search."""
        if self.path.exception() is None and not self._is_closing:
            self._journal.append_metadata(Named(str(self.path.result())))

    def close(self, ending: EndMetadata) -> None:
        """Begin to complete the file; `close_result` is set when that is done."""
        self._is_closing = True
        self._journal.append_metadata(Ended(self.next_index, ending))
        threading.Thread(target=self._close, args=(ending,), name="closing", daemon=True).start()

    def _pass_on(self) -> None:
        waiting, self._waiting = self._waiting, []
        if waiting:
            self._writer.append(run_block(waiting, self.start_index, self._rate_hz))

    def _close(self, ending: EndMetadata) -> None:
        """Thread: journal first, so that the writer can copy its bytes; it is removed when all is safe."""
        rows_fault, journal_fault = _fault_of(self._pass_on), _fault_of(self._journal.close)
        stored, fault = None, rows_fault
        try:
            stored = self._stored(ending)
        except Exception as error:  # whatever it is, the engine waits for the result
            _log.error("the run file could not be closed: %s", error)
            fault = error
        samples = getattr(fault, "stored_samples", 0) if stored is None else stored.samples
        lost = self._uncommitted.lost_after(self.start_index + samples)
        for rows in lost:
            self.statistics.remove(rows)
        first, missing = fault or journal_fault, self.statistics.losses().samples - samples
        notes = [] if first is None else [message_of(first)]
        if first is None and missing:
            notes.append(message("{samples} samples are only in the journal", samples=missing))
        elif first is None and (stored is None or not stored.raw_bytes_stored):
            notes.append(message("no room for the received bytes in the run"))
        if not notes and self._journal.left is None:
            self._journal.remove()
        elif missing or journal_fault is None:
            notes.append(self._remedy(journal_fault))
        self._journal.release()
        if lost:
            template = N_("the last {samples} samples found no room in run or journal, and are lost")
            notes.append(message(template, samples=sum(map(len, lost))))
        path = stored.path if stored else self._known_path()
        reason = None if first is None else end_reason(first)
        self.close_result.set_result(CloseResult(path, reason, tuple(notes)))

    def _stored(self, ending: EndMetadata) -> StoredRun:
        size = self.statistics.losses().samples * ROW_BYTES + self._journal.size
        timeout_s = _CLOSING_S + size / _SLOW_BYTES_PER_S
        if self._journal.left is not None:
            timeout_s = _HANGING_S
        try:
            return self._writer.close(ending).result(timeout_s)
        except FutureTimeoutError:
            template = N_("the run writer gives no answer for {timeout_s:.0f} s")
            error = WriteError(template, timeout_s=timeout_s)
            self._writer.give_up(error)
            if (stored := self._finished_run()) is not None:
                self._writer.kill()
                remove_lock(Path(stored.path))
                return stored
            raise error from None

    def _finished_run(self) -> StoredRun | None:
        """What a writer that gives no answer has finished; None where it has not, or its disk hangs too."""
        path, samples = self._known_path(), self.statistics.losses().samples
        if not path or self._journal.left is not None:
            return None
        found: Future[StoredRun | None] = Future()

        def find() -> None:
            from app.runs.file_operations import finished_run  # loads HDF5, which an engine does without

            found.set_result(finished_run(Path(path), samples))

        threading.Thread(target=find, name="looking for a finished run", daemon=True).start()
        try:
            return found.result(_INSPECTION_S)
        except FutureTimeoutError:
            return None

    def _remedy(self, journal_fault: Exception | None) -> Message:
        left = self._journal.left
        if left is not None:
            template = N_(
                "When the disk is back, rebuild the run with slipstand recover {folder}, and what came later"
                " with slipstand recover {other}"
            )
            return message(template, folder=left.parent, other=self._journal.path.parent)
        template = N_("All that came is in {journal}: rebuild the run with slipstand recover {folder}")
        if journal_fault is not None:
            template = N_(
                "More than the run has is in {journal}: rebuild the run with slipstand recover {folder}"
            )
        return message(template, journal=self._journal.path, folder=self._journal.path.parent)

    def _known_path(self) -> str:
        has_path = self.path.done() and self.path.exception() is None
        return str(self.path.result()) if has_path else ""


def sentences(*parts: Message) -> Message:
    """Join those parts that are not empty."""
    texts = [part for part in parts if part]
    return joined(texts, ". ") if texts else EMPTY


def run_block(rows: list[CalibratedBlock], start_index: int, rate_hz: float) -> RunBlock:
    """Consecutive rows in the base of a run that begins with sample `start_index`."""
    numbers = np.arange(rows[0].first_index, rows[-1].end_index) - start_index
    return RunBlock(
        time_s=numbers / rate_hz,
        readings=np.concatenate([part.readings for part in rows]),
        status=np.concatenate([part.status for part in rows]),
        counts=np.concatenate([part.counts for part in rows]),
    )


def start_time(read: DecodedRead, start_index: int, rate_hz: float) -> datetime.datetime:
    """Time of sample `start_index`, from the arrival of a read that came about then or later."""
    ago_s = (host_ns() - read.arrival_ns) * 1e-9
    if read.rows:
        ago_s += (read.rows[-1].end_index - start_index) / rate_hz
    return datetime.datetime.now().astimezone() - datetime.timedelta(seconds=ago_s)


def _fault_of(step: Callable[[], None]) -> Exception | None:
    try:
        step()
    except Exception as error:
        return error
    return None


def end_reason(error: Exception) -> EndReason:
    """Reason for the end of a run that met this error."""
    is_full = isinstance(error, DiskFullError | JournalFullError)
    return EndReason.DISK_FULL if is_full else EndReason.WRITE_ERROR
