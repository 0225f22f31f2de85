"""The journal of one run: every byte that came, with its time, on disk within a tenth of a second.

A thread of its own writes and syncs, so that a slow disk delays nobody. Each record is passed to the system
at once: what a killed engine has appended is in the file, and only a power cut can lose what was not synced.
After a crash, `recovery` rebuilds the run from its journal. The journal is removed when the run file is
closed, verified and on disk. A lock beside it shows that its engine lives. `JournalTap` puts the reads into
the journal before anything is decoded.
"""

import contextlib
import logging
import math
import queue
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path

import msgspec

from app.acquisition.errors import JournalError, JournalFullError
from app.acquisition.journal.file import JournalFile, create_journal_file
from app.acquisition.journal.records import JournalHeader, Known, Mark, MetadataRecord
from app.acquisition.pullback.plan import PullbackMeasurement
from app.acquisition.stream.connection import RawRead
from app.acquisition.stream.live_stream import DecodedRead
from app.runs.disk import NO_FILE_LEFT, is_disk_full, lacks_files
from app.runs.journal import RecordKind, encode_record
from app.runs.lock import LockHeldError
from drivers.clock import TimeBase
from drivers.host_time import host_ns
from messages.i18n import N_
from messages.message import EMPTY, Message, lacking_resource, message

_log = logging.getLogger(__name__)


class Journal:
    """An open journal, see `create_journal`. Any thread appends; `close` waits for the disk."""

    _QUEUE_RECORDS = 4096
    _SYNC_S = 0.1
    _CLOSE_S = 60.0  # a disk that has taken none of the remaining records for so long hangs

    def __init__(self, file: JournalFile, identifier: str = "") -> None:
        self.identifier = identifier
        self._file = file
        self.size = file.size  # bytes that it has, or will have once all is written
        self.written = file.size
        """Bytes that the system took; a record that begins at a later one is not in the file."""
        self._appending = threading.Lock()
        # Bounded by `append`: a queue that bounds itself takes five times as long for each record.
        self._records: queue.SimpleQueue[bytes | None] = queue.SimpleQueue()
        self._failure: OSError | None = None
        self._is_ending = False
        self._turn = threading.Lock()
        self._task: tuple[float, bytes] | None = None
        """Since when (s) the disk is at which record; an empty one for the last sync."""
        self.left: Path | None = None
        """Journal on a disk that hangs, with all that came until then."""
        self._start()

    @property
    def path(self) -> Path:
        return self._file.path

    @property
    def stalled_s(self) -> float:
        """For how long the disk has been at one record or one sync; 0 where it is at none."""
        task, sync_began_s = self._task, self._file.sync_began_s
        began = [] if task is None else [task[0]]
        began += [] if sync_began_s is None else [sync_began_s]
        return time.perf_counter() - min(began) if began else 0.0

    def leave_hanging_disk(self) -> bool:
        """Go on in a fallback folder if the disk is at one record or sync still; what it has stays there."""
        with self._turn:
            task, old = self._task, self._file
            if self.left is not None or (task is None and old.sync_began_s is None):
                return False
            self._task, self.left, self._file = None, old.path, old.successor()
            if task is not None:  # its thread hangs
                self._start(task[1])
            else:
                threading.Thread(target=_close, args=(old,), name="journal left", daemon=True).start()
        _log.error("the disk of %s hangs", old.path)
        return True

    @property
    def move_message(self) -> Message:
        if self.left is not None and self.left == self.path:  # the other one is not made yet
            return EMPTY
        if self.left is not None:
            template = N_(
                "the disk of the run hangs: what came before is in {left}, the received bytes since are kept"
                " in {path}"
            )
            return message(template, left=self.left, path=self.path)
        error = self._file.move_cause
        if error is None:
            return EMPTY
        if is_disk_full(error):
            return message(
                "the folder of the run is full: the received bytes are kept in {path}", path=self.path
            )
        template = N_(
            "the folder of the run cannot be written any more ({reason}): the received bytes are kept in"
            " {path}"
        )
        return message(template, reason=error.strerror or error, path=self.path)

    def append(self, data: bytes, arrival_ns: int, kind: RecordKind = RecordKind.WIRE) -> int:
        """Append a record without waiting; return the byte at which it begins. Raises JournalError."""
        self._check()
        if self._records.qsize() >= self._QUEUE_RECORDS:
            template = N_("{path}: the disk is too slow, {reads} reads wait. Use a faster disk")
            raise JournalError(template, path=self.path, reads=self._QUEUE_RECORDS)
        record = encode_record(data, arrival_ns, kind)
        with self._appending:
            self._records.put(record)
            start, self.size = self.size, self.size + len(record)
        return start

    def append_metadata(self, note: MetadataRecord) -> None:
        """Append what became known; a failure is reported at the next read."""
        with contextlib.suppress(JournalError):
            self.append(msgspec.json.encode(note), host_ns(), RecordKind.NOTE)

    def close(self) -> None:
        """Bring everything to disk and close the file. Raises like `append`."""
        self._records.put(None)
        self._thread.join(self._CLOSE_S)
        self._check()
        if self._thread.is_alive():
            template = N_("{path}: the disk hangs, {reads} reads wait. Check the disk, or its network")
            raise JournalError(template, path=self.path, reads=self._records.qsize())

    def remove(self) -> None:
        self._file.remove()
        self.release()

    def release(self) -> None:
        """Release the lock of a closed journal; one that hangs may still be written, and keeps it."""
        if not self._thread.is_alive():
            self._file.release()

    def _check(self) -> None:
        if self._failure is not None:
            raise _error(self.path, self._failure)

    def _start(self, first: bytes | None = None) -> None:
        self._thread = threading.Thread(target=self._write, args=(first,), name="journal", daemon=True)
        self._thread.start()

    def _write(self, first: bytes | None) -> None:
        """Thread: append records and sync them, until the end is queued."""
        file = self._file
        try:
            if first is not None:
                self._do(first)
            self._write_records()
            self._do(b"")
            self._file.close()
        except _LeftError:
            _close(file)
        except Exception as error:  # a journal that ends unseen would be taken for a slow disk
            _log.error("the journal %s has failed: %s", self.path, error)
            with contextlib.suppress(OSError):
                self._file.close()
            self._failure = (
                error if isinstance(error, OSError) else OSError(f"{type(error).__name__}: {error}")
            )
            while not self._is_ending:  # keep the queue empty
                self._next()

    def _next(self, timeout_s: float | None = None) -> bytes | None:
        record = self._records.get(timeout=timeout_s)
        self._is_ending = record is None
        return record

    def _write_records(self) -> None:
        """Append records until the end is queued; each is synced within a tenth of a second.

        A sync begins after a record where the last one began long enough before: waiting for the time at
        which it is due would wake this thread up once more.
        """
        now_s = begun_s = time.perf_counter()
        due_s = now_s + self._SYNC_S  # for a record that another thread could not append
        while True:
            try:
                record = self._next(None if due_s == math.inf else max(0.0, due_s - now_s))
            except queue.Empty:
                pass
            else:
                if record is None:
                    return
                self._do(record)
            now_s = time.perf_counter()
            due_s = min(due_s, now_s + self._SYNC_S)
            if now_s >= min(due_s, begun_s + self._SYNC_S):
                if self._file.begin_sync():
                    begun_s, due_s = now_s, math.inf
                else:
                    due_s = now_s + self._SYNC_S

    def _do(self, record: bytes) -> None:
        """Append a record; an empty one syncs. Raises OSError, _LeftError once another thread does it."""
        with self._turn:
            file, self._task = self._file, (time.perf_counter(), record)
        if record:
            file.append(record)
        else:
            file.sync()
        with self._turn:
            if threading.current_thread() is not self._thread:
                raise _LeftError
            self.written += len(record)
            self._task = None


def _close(file: JournalFile) -> None:
    """Close a journal that was left and release its lock, once its disk goes on."""
    with contextlib.suppress(OSError):
        file.close()
    file.release()


class _LeftError(Exception):
    """The disk went on after its journal was left."""


def create_journal(path: Path, header: JournalHeader, fallback_folders: Sequence[Path] = ()) -> Journal:
    """Create a journal, which moves to a fallback folder when its own fails. Raises JournalError."""
    record = encode_record(msgspec.json.encode(header), host_ns(), RecordKind.NOTE)
    try:
        file = create_journal_file(path, record, fallback_folders)
    except LockHeldError:
        raise JournalError("{path} is being written by another program. Record again", path=path) from None
    except OSError as error:
        raise _error(path, error) from None
    _log.info("journal %s begun", path)
    return Journal(file, header.identifier)


def _error(path: Path, error: OSError) -> JournalError:
    if lacking := lacking_resource(error):
        return JournalError("{path}: {fault}", path=path, fault=lacking)
    if is_disk_full(error) and lacks_files(path.parent):
        return JournalFullError(NO_FILE_LEFT, path=path)
    if is_disk_full(error):
        return JournalFullError(
            "{path}: the disk is full. Free some space, or record to another disk", path=path
        )
    reason = error.strerror or str(error)
    return JournalError(
        "{path} cannot be written ({reason}). Choose a folder that you may write to", path=path, reason=reason
    )


_EVERY_S = 1.0


class JournalTap:
    """Puts each read into a journal as it comes, and knows its place there once it is decoded."""

    def __init__(self, journal: Journal) -> None:
        self.decoded_reads = 0
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
        """Note the next read's samples; no run begins before `oldest_index` any more. Raises JournalError."""
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
        """Take what is known after so many reads."""
        known = msgspec.convert(measurement, Known, from_attributes=True)
        if known == self._known and next_index < self._due:
            return
        self._known, self._due = known, next_index + self._every
        time_base = self._time_base(self._armed_index, next_index)
        mark = Mark(next_index, self._armed_index, known, time_base, reads)
        self._journal.append_metadata(mark)
