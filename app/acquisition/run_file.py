"""The run file that is being written: rows to the writer process, the account of them, and the closing."""

import contextlib
import datetime
import threading
from concurrent.futures import Future
from concurrent.futures import TimeoutError as FutureTimeoutError
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Protocol

import numpy as np

from app.acquisition.disk_room import ROW_BYTES
from app.acquisition.errors import JournalError, JournalFullError
from app.acquisition.journal.journal import Journal
from app.acquisition.journal.notes import Ended, Named, Opened
from app.acquisition.messages import EndReason
from app.acquisition.stream.calibration import Rows
from app.acquisition.stream.history import Chunk
from app.runs.errors import DiskFullError
from app.runs.layout import RunBlock, StoredRun
from app.runs.metadata import Ending
from app.runs.writer_messages import OpenRun
from drivers.host_time import host_ns
from drivers.samples import INCOMPLETE, Losses, SampleStatus

_BATCH_S = 0.05
_CLOSING_S = 120.0
_SLOW_BYTES_PER_S = 5e6
"""And so much longer for what the writer copies and reads again, on a slow disk."""
_OVERLOAD = SampleStatus.OVERLOAD_TABLE | SampleStatus.OVERLOAD_RELATIVE
_COUNTED_BY_ROW = ("samples", "missing", "missing_estimated", "damaged", "overloaded")


class Writer(Protocol):
    """What `app.runs.writer_client.WriterClient` does for a run."""

    def open(self, request: OpenRun) -> "Future[Path]":
        """Begin a run; the future holds the path of its file."""

    def append(self, block: RunBlock) -> None:
        """Hand rows over. Raises RunError."""

    def close(self, ending: Ending) -> "Future[StoredRun]":
        """Complete the run; the future holds what was stored."""


class RunAccount:
    """Counts the rows of one run; together they are all its samples, each counted once as what it is."""

    def __init__(self) -> None:
        self._losses = Losses()
        self._absent = 0

    def add(self, rows: Rows) -> None:
        """Count rows by their flags."""
        self._losses.samples += len(rows)
        if not rows.status.any():
            return
        self._losses.damaged += int(np.count_nonzero(rows.status & SampleStatus.DAMAGED))
        self._losses.overloaded += int(np.count_nonzero(rows.status & _OVERLOAD))
        self._absent += int(np.count_nonzero(rows.status & INCOMPLETE))

    def add_read(self, added: Losses) -> None:
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


@dataclass(frozen=True, slots=True)
class Outcome:
    """How the closing of a run went."""

    path: str
    fault: EndReason | None = None
    message: str = ""


class RunFile:
    """A run from its first stored sample on.

    Parameters
    ----------
    writer : Writer
    request : OpenRun
        What the file is to be.
    journal : Journal
        Open; closed here, and removed once the run is safe.
    start_index : int
        Sample that is stored first.
    rate_hz : float
        Nominal samples a second.
    reads : int
        Reads of the journal that were decoded before this.
    """

    def __init__(
        self,
        writer: Writer,
        request: OpenRun,
        journal: Journal,
        start_index: int,
        rate_hz: float,
        reads: int = 0,
    ) -> None:
        self.next_index = start_index
        """Sample that is stored next."""
        self.account = RunAccount()
        self.start_index = start_index
        self._rate_hz = rate_hz
        self._writer = writer
        self._journal = journal
        self._waiting: list[Rows] = []
        self._is_closing = False
        self._began = (datetime.datetime.now().astimezone(), host_ns())
        span = request.journal
        wire_start = span.start if span else 0
        journal.note(Opened(start_index, request.metadata.start_time, request.layout, wire_start, reads))
        self._path = writer.open(request)
        self._outcome: Future[Outcome] = Future()

    @property
    def path(self) -> "Future[Path]":
        """Where it is, once it is there."""
        return self._path

    @property
    def outcome(self) -> "Future[Outcome]":
        """How the closing went, once it is done."""
        return self._outcome

    def append(self, chunk: Chunk, end_index: int | None = None) -> None:
        """Store the rows of a read that come next, up to `end_index`. Raises RunError."""
        for rows in chunk.rows:
            fresh = rows.between(self.next_index, rows.end_index if end_index is None else end_index)
            if len(fresh):
                self.account.add(fresh)
                self.next_index = fresh.end_index
                self._waiting.append(fresh)
        self.account.add_read(chunk.losses)
        if self._waiting and self.next_index - self._waiting[0].first_index >= _BATCH_S * self._rate_hz:
            self._hand_over()

    def time_s(self, index: int | None) -> float | None:
        """Time of a sample in the base of this run; negative before it began."""
        return None if index is None else (index - self.start_index) / self._rate_hz

    def now(self) -> datetime.datetime:
        """Time of day by the clock as it stood when the run began: it may have been set meanwhile."""
        began, began_ns = self._began
        return began + datetime.timedelta(seconds=(host_ns() - began_ns) * 1e-9)

    def note_path(self) -> None:
        """Tell the journal where the file is; a recovery finds it without that too, but must look."""
        if self._path.exception() is None and not self._is_closing:
            with contextlib.suppress(JournalError):
                self._journal.note(Named(str(self._path.result())))

    def close(self, ending: Ending) -> None:
        """Begin to complete the file; `outcome` tells when it is done."""
        self._is_closing = True
        with contextlib.suppress(JournalError):
            self._journal.note(Ended(self.next_index, ending))
        threading.Thread(target=self._close, args=(ending,), name="closing", daemon=True).start()

    def _hand_over(self) -> None:
        """Give the writer what has come together; block by block would cost it several times as much."""
        waiting, self._waiting = self._waiting, []
        self._writer.append(run_block(waiting, self.start_index, self._rate_hz))

    def _close(self, ending: Ending) -> None:
        """Thread: journal first, so that the writer can copy its bytes; it goes last, when all is safe."""
        try:
            outcome = self._closed(ending)
        except FutureTimeoutError:
            message = f"the run writer gives no answer for {self._patience_s:.0f} s. {self._remedy()}"
            outcome = Outcome(self._known_path(), EndReason.WRITE_ERROR, message)
        except Exception as error:  # whatever it is, someone waits for the outcome
            outcome = Outcome(self._known_path(), end_reason(error), self._words(error))
        self._journal.leave()
        self._outcome.set_result(outcome)

    def _closed(self, ending: Ending) -> Outcome:
        if self._waiting:
            self._hand_over()
        journal_fault = self._close_journal()
        stored = self._writer.close(ending).result(self._patience_s)
        if journal_fault is not None:
            raise journal_fault
        lost = self.account.losses().samples - stored.samples
        if lost:
            message = f"{lost} samples are only in the journal. {self._remedy()}"
            return Outcome(stored.path, message=message)
        if not stored.wire_stored:
            message = f"no room for the received bytes in the run. {self._remedy()}"
            return Outcome(stored.path, message=message)
        self._journal.remove()
        return Outcome(stored.path)

    @property
    def _patience_s(self) -> float:
        """How long the writer may take to close the file."""
        size = self.account.losses().samples * ROW_BYTES + self._journal.size
        return _CLOSING_S + size / _SLOW_BYTES_PER_S

    def _words(self, error: Exception) -> str:
        said = str(error) or type(error).__name__
        if isinstance(error, JournalError):
            return said
        return f"{said.rstrip('.')}. {self._remedy()}"

    def _remedy(self) -> str:
        folder = self._journal.path.parent
        return f"All that came is in {self._journal.path}: rebuild the run with slipstand recover {folder}"

    def _close_journal(self) -> JournalError | None:
        try:
            self._journal.close()
        except JournalError as error:
            return error
        return None

    def _known_path(self) -> str:
        has_path = self._path.done() and self._path.exception() is None
        return str(self._path.result()) if has_path else ""


def run_block(rows: list[Rows], start_index: int, rate_hz: float) -> RunBlock:
    """Consecutive rows in the base of a run that begins with sample `start_index`."""
    numbers = np.arange(rows[0].first_index, rows[-1].end_index) - start_index
    return RunBlock(
        time_s=numbers / rate_hz,
        readings=np.concatenate([part.readings for part in rows]),
        status=np.concatenate([part.status for part in rows]),
        counts=np.concatenate([part.counts for part in rows]),
    )


def start_time(chunk: Chunk, start_index: int, rate_hz: float) -> datetime.datetime:
    """When sample `start_index` was taken, going by the arrival of a read that came about then or later."""
    ago_s = (host_ns() - chunk.arrival_ns) * 1e-9
    if chunk.rows:
        ago_s += (chunk.rows[-1].end_index - start_index) / rate_hz
    return datetime.datetime.now().astimezone() - datetime.timedelta(seconds=ago_s)


def end_reason(error: Exception) -> EndReason:
    """What a run that met this error has ended of."""
    is_full = isinstance(error, DiskFullError | JournalFullError)
    return EndReason.DISK_FULL if is_full else EndReason.WRITE_ERROR
