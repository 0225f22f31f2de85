"""The journal of one run: every byte that came, with its time, on disk within a tenth of a second.

A thread of its own appends and syncs, so that a slow disk delays nobody. Each record is handed to the
system at once: what a killed engine has appended is in the file, only a power cut can take what was not
synced. From the journal a run can be built anew after a crash (`recovery`); it is removed when the run
file is closed, verified and on disk. A lock beside it tells that its engine lives.
"""

import contextlib
import errno
import os
import queue
import threading
import time
from pathlib import Path
from typing import IO

from app.acquisition.errors import JournalError, JournalFullError
from app.acquisition.notes import JournalHeader, Note, encode_note
from app.runs.disk import sync_folder
from app.runs.journal import MAGIC, RecordKind, pack
from app.runs.lock import FileLock, LockHeldError, recording_lock

_NO_ROOM = (errno.ENOSPC, getattr(errno, "EDQUOT", errno.ENOSPC))


class Journal:
    """An open journal, see `create_journal`. One thread appends; `close` waits for the disk.

    Parameters
    ----------
    file
        Written by nobody else.
    path : Path
    size : int
        Bytes that are in the file already.
    identifier : str
        Of the run.
    lock : FileLock, optional
        Held for the journal; `remove` and `leave` give it back.
    """

    _QUEUE_RECORDS = 4096
    _SYNC_S = 0.1

    def __init__(
        self,
        file: IO[bytes],
        path: Path,
        size: int = 0,
        identifier: str = "",
        lock: FileLock | None = None,
    ) -> None:
        self.path = path
        self.identifier = identifier
        self._file = file
        self._end = size
        self._lock = lock
        self._records: queue.Queue[bytes | None] = queue.Queue(self._QUEUE_RECORDS)
        self._failure: OSError | None = None
        self._thread = threading.Thread(target=self._write, name="journal", daemon=True)
        self._thread.start()

    def append(self, data: bytes, arrival_ns: int, kind: RecordKind = RecordKind.WIRE) -> int:
        """Hand a record over and return the byte of the journal at which it begins. Does not wait.

        Raises
        ------
        JournalFullError
            No space is left on the disk.
        JournalError
            The disk failed, or is too slow: thousands of records wait.
        """
        self._check()
        record = pack(data, arrival_ns, kind)
        try:
            self._records.put_nowait(record)
        except queue.Full:
            raise JournalError(
                f"{self.path}: the disk is too slow, {self._QUEUE_RECORDS} reads wait. Use a faster disk"
            ) from None
        start, self._end = self._end, self._end + len(record)
        return start

    def note(self, note: Note) -> None:
        """Append what has become known of the run. Raises like `append`."""
        self.append(encode_note(note), time.monotonic_ns(), RecordKind.NOTE)

    def close(self) -> None:
        """Bring everything to disk and close the file. Raises like `append`."""
        self._records.put(None)
        self._thread.join()
        self._check()

    def remove(self) -> None:
        """Remove the file of a closed journal whose run is safe."""
        with contextlib.suppress(OSError):
            self.path.unlink()
        self.leave()

    def leave(self) -> None:
        """Let go of a closed journal; where it was not removed, a recovery may take it."""
        if self._lock is not None:
            with contextlib.suppress(OSError):
                self._lock.release()

    def _check(self) -> None:
        if self._failure is not None:
            raise _error(self.path, self._failure)

    def _write(self) -> None:
        """Thread: append what comes, sync each tenth of a second, until told to end."""
        try:
            with self._file:
                while self._write_for(self._SYNC_S):
                    pass
        except OSError as error:
            self._failure = error
            while self._records.get() is not None:  # nobody must wait for a dead writer
                pass

    def _write_for(self, duration_s: float) -> bool:
        """Write for so long and sync; False when told to end."""
        record = self._records.get()
        deadline = time.monotonic() + duration_s
        while record is not None:
            self._file.write(record)
            self._file.flush()
            try:
                record = self._records.get(timeout=max(0.0, deadline - time.monotonic()))
            except queue.Empty:
                break
        os.fsync(self._file.fileno())
        return record is not None


def create_journal(path: Path, header: JournalHeader) -> Journal:
    """Create the journal of a run; its folder is made if there is none.

    Raises
    ------
    JournalError
        If the folder cannot be made or written to, or the name is taken.
    """
    lock = recording_lock(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        lock.take()
        file, size = _begin(path, header)
    except LockHeldError:
        raise JournalError(f"{path} is being written by another program. Record again") from None
    except OSError as error:
        lock.release()
        raise _error(path, error) from None
    return Journal(file, path, size, header.identifier, lock)


def _begin(path: Path, header: JournalHeader) -> tuple[IO[bytes], int]:
    """A new file with its first record in one piece, so that a kill hardly ever leaves one without."""
    first = MAGIC + pack(encode_note(header), time.monotonic_ns(), RecordKind.NOTE)
    file = path.open("xb")
    try:
        file.write(first)
        file.flush()
        sync_folder(path.parent)
    except OSError:
        file.close()
        path.unlink()
        raise
    return file, len(first)


def _error(path: Path, error: OSError) -> JournalError:
    if error.errno in _NO_ROOM:
        return JournalFullError(f"{path}: the disk is full. Free some space, or record to another disk")
    reason = error.strerror or str(error)
    return JournalError(f"{path} cannot be written ({reason}). Choose a folder that you may write to")
