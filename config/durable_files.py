"""Changes of files that last through a power cut, and that wait for other programs to let go of a file."""

import contextlib
import errno
import os
import re
import sys
import time
from collections.abc import Callable
from pathlib import Path

from messages.message import MessageError

_PATIENCE_S = 5.0
"""Longest that a program is waited for. A whole run is read in less; a virus scanner takes up to a second."""
_RETRY_S = 0.05
_ACCESS_DENIED = 5
"""What Windows reports of a file that is to be replaced while it is open: of missing rights too."""
_IN_USE = (32, 33)  # sharing and lock violation of Windows
_CANNOT_SYNC = (errno.EINVAL, errno.ENOTSUP, errno.ENOSYS, errno.EACCES, errno.EPERM)
_HDF5_IN_USE = re.compile(r"GetLastError\(\) = (32|33)\b")


class FileInUseError(MessageError, OSError):
    """Another program has the file open and lets nobody else read or replace it, as is usual on Windows."""


def file_in_use(path: Path | str) -> FileInUseError:
    """Error for a file that another program has open."""
    return FileInUseError("{path} is open in another program. Close it there and try again", path=path)


def is_in_use(error: BaseException, path: Path | None = None) -> bool:
    """Tell whether Windows refused a file for being open in another program.

    HDF5 tells it only in words. Python's `open` tells it of no file: `path` is then looked at again.
    """
    if getattr(error, "winerror", None) in _IN_USE or _HDF5_IN_USE.search(str(error)):
        return True
    if isinstance(error, PermissionError) and path is not None:
        return is_held_elsewhere(path)
    return isinstance(error, FileInUseError)


def replace_file(source: Path, target: Path) -> None:
    """Give a file the name of another, which it replaces; waits while a program has either open on Windows.

    Raises FileInUseError, OSError.
    """
    _wait_for_others(lambda: source.replace(target), source, target)


def give_new_name(source: Path, target: Path) -> None:
    """Give a file a name that nothing has, in one step; nothing is overwritten, and no cut loses the file.

    Waits like `replace_file`. Raises FileExistsError, FileInUseError, OSError.
    """
    if sys.platform == "win32":  # where `rename` replaces nothing
        _wait_for_others(lambda: source.rename(target), source)
        return
    try:
        os.link(source, target)
    except FileExistsError:
        raise
    except OSError:  # a file system without links, or another user's file
        target.open("x").close()
        try:
            source.replace(target)
        except OSError:
            target.unlink()
            raise
        return
    if source.parent != target.parent:  # before a cut can make the removal of the old name last alone
        with contextlib.suppress(OSError):
            sync_folder(target.parent)
    source.unlink()


def remove_file(path: Path) -> None:
    """Remove a file, if it is there; waits like `replace_file`. Raises FileInUseError, OSError."""
    _wait_for_others(lambda: path.unlink(missing_ok=True), path)


def sync_descriptor(descriptor: int) -> None:
    """Bring a file to disk, so that it lasts through a power cut. Raises OSError.

    On macOS `fsync` leaves the data in the memory of the drive, as its manual says.
    """
    if sys.platform == "darwin":
        import fcntl

        try:
            fcntl.fcntl(descriptor, fcntl.F_FULLFSYNC)
        except OSError:  # a network share or a drive that does not have it
            os.fsync(descriptor)
    else:
        os.fsync(descriptor)


def sync_folder(folder: Path) -> None:
    """Bring the names in a folder to disk where system, share and rights allow it. Raises OSError."""
    if sys.platform == "win32":
        return
    try:
        handle = os.open(folder, os.O_RDONLY)
        try:
            sync_descriptor(handle)
        finally:
            os.close(handle)
    except OSError as error:
        if error.errno not in _CANNOT_SYNC:
            raise


def make_folders(folder: Path) -> None:
    """Make a folder with its parents, so that they last through a power cut. Raises OSError."""
    missing = [path for path in (folder, *folder.parents) if not path.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    for path in reversed(missing):
        sync_folder(path.parent)


def _wait_for_others(change: Callable[[], object], *paths: Path) -> None:
    end_s = time.perf_counter() + _PATIENCE_S
    while True:
        try:
            change()
        except PermissionError as error:
            number = getattr(error, "winerror", None)
            held = next((path for path in reversed(paths) if path.exists()), paths[0])
            if number not in (*_IN_USE, _ACCESS_DENIED):
                raise
            if time.perf_counter() > end_s:
                if number in _IN_USE or is_held_elsewhere(held, is_written=True):
                    raise file_in_use(held) from None
                raise
            time.sleep(_RETRY_S)
        else:
            return


if sys.platform == "win32":
    import _winapi

    _ALL_SHARED, _OPEN_EXISTING = 0x7, 3

    def is_held_elsewhere(path: Path, *, is_written: bool = False) -> bool:
        """Tell whether a file that could not be used is open in another program, rather than forbidden.

        Python's `open` reports both alike. A file that can be opened now is held in a part of it, or against
        being replaced.
        """
        access = _winapi.GENERIC_READ | (_winapi.GENERIC_WRITE if is_written else 0)
        try:
            handle = _winapi.CreateFile(str(path), access, _ALL_SHARED, 0, _OPEN_EXISTING, 0, 0)
        except OSError as error:
            return is_in_use(error)
        _winapi.CloseHandle(handle)
        return True

else:

    def is_held_elsewhere(path: Path, *, is_written: bool = False) -> bool:  # noqa: ARG001
        """Tell whether a file that could not be used is open in another program: only Windows does that."""
        return False
