"""Locks that die with their holder: who records or edits a run, on every operating system."""

import contextlib
import errno
import os
import sys
import time
from pathlib import Path
from typing import IO, Self

RECORDING_SUFFIX = ".recording"
"""Added to the name of a run file: the lock that its writer holds until the file is closed."""

_PATIENCE_S = 0.5
_TEST_MODE = "r+b" if sys.platform == "win32" else "rb"
"""A shared lock is had on a file that can only be read too, as on a disk that is mounted so."""
_BYTE = 1 << 30
"""Windows locks bytes, and hides locked ones from readers: so one far behind the text is locked."""


class LockHeldError(Exception):
    """Another process holds the lock."""


class FileLock:
    """Exclusive lock on a small file of its own, removed on release; use with `with` or `take`/`release`."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._file: IO[bytes] | None = None

    def acquire(self) -> Self:
        """Take the lock. Raises LockHeldError, or OSError where the folder cannot be written to."""
        deadline = time.perf_counter() + _PATIENCE_S
        while True:  # a reader may hold it for the blink of its own test
            file = open(self.path, "a+b", opener=_open_itself)  # noqa: SIM115
            if _try_lock(file) and _is_still_at(file, self.path):
                self._file = file
                return self
            file.close()
            if time.perf_counter() > deadline:
                raise LockHeldError(str(self.path))
            time.sleep(0.01)

    def release(self) -> None:
        """Give the lock back and remove its file; harmless when not held."""
        if self._file is None:
            return
        if sys.platform != "win32":  # while it is still held, so that nobody's new lock is removed
            self.path.unlink(missing_ok=True)
        self._file.close()
        self._file = None
        if sys.platform == "win32":
            with contextlib.suppress(PermissionError):  # somebody looks at it just now; it may stay
                self.path.unlink(missing_ok=True)

    def __enter__(self) -> Self:
        return self.acquire()

    def __exit__(self, *_: object) -> None:
        self.release()


def _open_itself(path: str, flags: int) -> int:
    """Open a file, and nothing elsewhere that a link of its name leads to."""
    return os.open(path, flags | getattr(os, "O_NOFOLLOW", 0), 0o666)


def recording_lock(run: Path) -> FileLock:
    """Lock that the writer of `run` holds while it records."""
    return FileLock(run.with_name(run.name + RECORDING_SUFFIX))


def remove_lock(run: Path) -> None:
    """Remove the lock of a writer that was killed, as soon as it is dead; another one's stays."""
    with contextlib.suppress(LockHeldError, OSError), recording_lock(run):
        pass


def is_being_recorded(run: Path) -> bool:
    """Tell whether a living process is recording `run`."""
    return is_held(run.with_name(run.name + RECORDING_SUFFIX))


def is_held(path: Path) -> bool:
    """Tell whether a living process holds the lock on `path`; a file left by a dead one does not count."""
    try:
        with path.open(_TEST_MODE) as file:
            return not _try_lock(file, shared=True)
    except (FileNotFoundError, IsADirectoryError, ValueError):  # the last: a name that no file can have
        return False
    except PermissionError:  # of another user: its state is unknown, so it counts as alive
        return not path.is_dir()  # what Windows says of a folder


def _is_still_at(file: IO[bytes], path: Path) -> bool:
    """Tell whether `path` is still this file: its last holder may have removed it meanwhile."""
    try:
        return os.path.samestat(os.fstat(file.fileno()), path.stat())
    except FileNotFoundError:
        return False


if sys.platform == "win32":
    import msvcrt

    def _try_lock(file: IO[bytes], *, shared: bool = False) -> bool:  # noqa: ARG001
        file.seek(_BYTE)
        try:
            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
        except OSError:
            return False
        return True

else:
    import fcntl

    _NO_LOCKS = (errno.ENOLCK, errno.ENOSYS, errno.ENOTSUP)
    """A file system without locks, as some network shares are: better unlocked than not recorded."""

    def _try_lock(file: IO[bytes], *, shared: bool = False) -> bool:
        kind = fcntl.LOCK_SH if shared else fcntl.LOCK_EX
        try:
            fcntl.flock(file.fileno(), kind | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        except OSError as error:
            if error.errno not in _NO_LOCKS:
                raise
        return True
