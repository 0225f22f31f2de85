"""The file of a journal, which moves to another folder when its own takes no more."""

import contextlib
import errno
import logging
import os
import queue
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import IO

import msgspec

from app.acquisition.journal.records import Continued
from app.runs.disk import has_free_space, unfinished_name
from app.runs.journal import MAGIC, RecordKind, encode_record, is_read
from app.runs.lock import FileLock, LockHeldError, recording_lock
from app.runs.paths import make_private_folder
from config.durable_files import give_new_name, make_folders, sync_descriptor, sync_folder
from drivers.host_time import host_ns

_log = logging.getLogger(__name__)

_PIECE_BYTES = 1 << 20
_REPEATED_BYTES = 4096  # more than a frame of any device
_ROOM_BYTES = 32 << 20
"""Least free space of a fallback folder beyond what is copied: with less it would be full as soon."""


class FileSync(threading.Thread):
    """Syncs a file each time `begin` is called; the file may be closed meanwhile."""

    def __init__(self, descriptor: int) -> None:
        super().__init__(name="journal sync", daemon=True)
        self.began_s: float | None = None
        """When the sync began that is under way, by `time.perf_counter`; None for none."""
        self._failure: OSError | None = None
        self._is_idle = threading.Event()
        self._is_idle.set()
        self._goes_on: queue.SimpleQueue[bool] = queue.SimpleQueue()
        self._descriptor = os.dup(descriptor)
        self.start()

    def begin(self) -> None:
        """Begin a sync; none may be under way."""
        self._is_idle.clear()
        self.began_s = time.perf_counter()
        self._goes_on.put(True)

    def take_failure(self) -> OSError | None:
        """Wait for the end of a sync that is under way; returns what failed since the last call."""
        self._is_idle.wait()
        failure, self._failure = self._failure, None
        return failure

    def end(self) -> None:
        """End the thread, after the sync that is under way; waits only where there is none."""
        self._goes_on.put(False)
        if self._is_idle.is_set():  # Windows removes no file that is open
            self.join()

    def run(self) -> None:
        while self._goes_on.get():
            try:
                sync_descriptor(self._descriptor)
            except OSError as error:
                self._failure = error
            self.began_s = None
            self._is_idle.set()
        os.close(self._descriptor)


class JournalFile:
    """Whole records, one after another; make it with `create_journal_file`.

    When the disk is full, the network share gone, or the folder read-only, all that was written moves to the
    first of the fallback folders that takes it, and the rest is appended there. What can no longer be read
    stays where it is; the new file then begins with `first`, the magic and the record that identifies the
    run, tells how many reads stay there, and repeats the last of them, since a frame may lie across two.
    """

    def __init__(
        self, path: Path, file: IO[bytes], first: bytes, lock: FileLock, fallback_folders: Sequence[Path] = ()
    ) -> None:
        self.path = path
        self.move_cause: OSError | None = None
        self._file = file
        self._first = first
        self.size = len(first)  # bytes of all whole records
        self._reads = 0  # of the run, in this file and in those that it continues
        self._recent: deque[bytes] = deque()  # the last of them, as records
        self._lock = lock
        self._fallback_folders = list(fallback_folders)
        self._sync: FileSync | None = None
        self._is_copied = False
        self._is_made = True

    def successor(self) -> "JournalFile":
        """A journal of the same run that begins in a fallback folder; the first `append` makes its file."""
        made = JournalFile(self.path, self._file, self._first, self._lock, self._fallback_folders)
        made._is_made, made._reads, made._recent = False, self._reads, self._recent.copy()
        return made

    @property
    def sync_began_s(self) -> float | None:
        """As `FileSync.began_s`."""
        sync = self._sync
        return None if sync is None else sync.began_s

    def append(self, record: bytes) -> None:
        """Write a record. Raises OSError where no folder takes it."""
        while not self._is_made:
            self._begin()
        while True:
            try:
                _write_all(self._file, record)
            except OSError as error:
                self._move(error)
            else:
                self.size += len(record)
                if is_read(record):
                    self._remember(record)
                return

    def begin_sync(self) -> bool:
        """Begin a sync in a thread unless one is under way; returns whether nothing waits for another.

        Raises OSError where no folder takes it.
        """
        if not self._is_made:
            return True
        if self.sync_began_s is not None:
            return False
        self._finish_sync()
        if self._sync is None:
            self._sync = FileSync(self._file.fileno())
        self._sync.begin()
        return True

    def sync(self) -> None:
        """Wait until all is on disk. Raises OSError where no folder takes it."""
        if not self._is_made:
            return
        self._finish_sync()
        try:
            sync_descriptor(self._file.fileno())
        except OSError as error:
            self._move(error)

    def _finish_sync(self) -> None:
        failure = None if self._sync is None else self._sync.take_failure()
        if failure is not None:
            self._move(failure)

    def close(self) -> None:
        if self._sync is not None:
            self._sync.end()
            self._sync.join()
        if self._is_made:
            self._file.close()

    def remove(self) -> None:
        with contextlib.suppress(OSError):
            self.path.unlink()

    def release(self) -> None:
        """Release the lock: if the file is still there, a recovery may take it."""
        with contextlib.suppress(OSError):
            self._lock.release()

    def _begin(self) -> None:
        """Make the file in the next fallback folder that takes it. Raises OSError where none does."""
        while self._fallback_folders:
            folder = self._fallback_folders.pop(0)
            path = folder / self.path.name
            with contextlib.suppress(OSError, LockHeldError):
                make_private_folder(folder)
                file, lock = _make_file(path, self._begin_in)
                self.path, self._file, self._lock, self._is_made = path, file, lock, True
                return
        raise TimeoutError(errno.ETIMEDOUT, os.strerror(errno.ETIMEDOUT))

    def _remember(self, record: bytes) -> None:
        self._reads += 1
        self._recent.append(record)
        while sum(map(len, self._recent)) - len(self._recent[0]) >= _REPEATED_BYTES:
            self._recent.popleft()

    def _begin_in(self, file: IO[bytes]) -> None:
        """Begin a file that continues one which cannot be read."""
        continued = msgspec.json.encode(Continued(self._reads - len(self._recent)))
        beginning = self._first + encode_record(continued, host_ns(), RecordKind.NOTE)
        beginning += b"".join(self._recent)
        _write_all(file, beginning)
        self.size = len(beginning)

    def _move(self, error: OSError) -> None:
        while self._fallback_folders:
            folder = self._fallback_folders.pop(0)
            if has_free_space(folder, self.size + _ROOM_BYTES):
                with contextlib.suppress(OSError, LockHeldError):
                    make_private_folder(folder)
                    self._move_to(folder / self.path.name)
                    self.move_cause = self.move_cause or error
                    _log.warning("journal moved to %s: %s", self.path, error)
                    return
        _log.error("%s cannot be written: %s", self.path, error)
        raise error

    def _move_to(self, path: Path) -> None:
        file, lock = _make_file(path, self._copy_to)
        if self._sync is not None:
            self._sync.end()
            self._sync = None  # one of the old file that fails now does not concern the new one
        with contextlib.suppress(OSError):
            self._file.close()
        if self._is_copied:  # its run file may need the space
            self.remove()
        self.release()
        self.path, self._file, self._lock = path, file, lock

    def _copy_to(self, file: IO[bytes]) -> None:
        """Copy all records to another file, or the first one where no more can be had."""
        self._is_copied = True
        try:
            for piece in self._pieces():
                _write_all(file, piece)
        except _UnreadableError:
            self._is_copied = False
            file.seek(0)
            file.truncate()
            self._begin_in(file)

    def _pieces(self) -> Iterator[bytes]:
        left = self.size
        try:
            with self.path.open("rb") as old:
                while left:
                    piece = old.read(min(left, _PIECE_BYTES))
                    if not piece:
                        raise _UnreadableError
                    left -= len(piece)
                    yield piece
        except OSError:
            raise _UnreadableError from None


class _UnreadableError(Exception):
    pass


def create_journal_file(
    path: Path, first_record: bytes, fallback_folders: Sequence[Path] = ()
) -> JournalFile:
    """Create a journal with its first record. Raises OSError, FileExistsError, LockHeldError."""
    first = MAGIC + first_record
    file, lock = _make_file(path, lambda made: _write_all(made, first))
    return JournalFile(path, file, first, lock, fallback_folders)


def _make_file(path: Path, write: Callable[[IO[bytes]], None]) -> tuple[IO[bytes], FileLock]:
    """Create a file with its folder and lock; it has its name once all that `write` writes is on disk."""
    make_folders(path.parent)
    lock = recording_lock(path).acquire()
    temporary = unfinished_name(path)
    with contextlib.ExitStack() as undo:
        undo.callback(lock.release)
        undo.callback(temporary.unlink, missing_ok=True)
        with temporary.open("xb", buffering=0) as made:
            write(made)
            sync_descriptor(made.fileno())
        give_new_name(temporary, path)
        undo.callback(path.unlink)
        sync_folder(path.parent)
        file = path.open("ab", buffering=0)
        undo.pop_all()
    return file, lock


def _write_all(file: IO[bytes], data: bytes) -> None:
    """An unbuffered write may take a part only, as when the disk is just about full."""
    rest = memoryview(data)
    while rest:
        rest = rest[file.write(rest) :]
