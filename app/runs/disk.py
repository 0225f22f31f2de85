"""Room on the disk, and making what was written last."""

import errno
import os
import shutil
import sys
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from app.runs.errors import DiskFullError, RunError, RunExistsError, WriteError

MARGIN_BYTES = 1 << 20
"""Claimed beyond what a run needs next, so that its file can still be closed in good order."""

_NO_ROOM = {errno.ENOSPC, errno.EFBIG, getattr(errno, "EDQUOT", errno.ENOSPC)}

_CANNOT_SYNC = (errno.EINVAL, errno.ENOTSUP, errno.ENOSYS, errno.EACCES, errno.EPERM)


def reserve_space(path: Path, size: int, more: int) -> None:
    """Make sure that a file of `size` bytes can grow by `more`. Raises DiskFullError or WriteError.

    HDF5 can crash after a failed write, and leaves a file that says it is longer than it is; so no
    write of HDF5 may be the one that finds the disk full. Where the system can, the blocks are
    claimed behind the end of the file, which also meets quotas; HDF5 does not mind them.
    """
    try:
        if sys.platform == "linux":
            _claim(path, size, more)
        else:
            check_free_space(path.parent, more)
    except OSError as error:
        raise storage_error(path, error) from None


def check_free_space(folder: Path, more: int) -> None:
    """Make sure that a disk has `more` free bytes. Raises DiskFullError, OSError."""
    free = shutil.disk_usage(folder).free
    if free < more:
        raise DiskFullError(
            f"{folder}: the disk has only {free / 1e6:.1f} MB left. Free some space or take another disk"
        )


def has_free_space(folder: Path, size: int) -> bool:
    """Tell whether a folder, which need not exist yet, has `size` free bytes; yes if nobody can tell."""
    free = free_bytes(folder)
    return free is None or free >= size


def free_bytes(folder: Path) -> int | None:
    """Free bytes where a folder is or would be made; None where nobody can tell."""
    there = next((place for place in (folder, *folder.parents) if place.is_dir()), folder)
    try:
        usage = shutil.disk_usage(there)
    except OSError:
        return None
    return usage.free if usage.total else None  # some network file systems say nothing


def is_disk_full(error: OSError) -> bool:
    """Tell whether a write failed for want of room: disk, quota, or largest size of a file."""
    return error.errno in _NO_ROOM


if sys.platform == "linux":

    def _claim(path: Path, size: int, more: int) -> None:
        handle = os.open(path, os.O_WRONLY)
        try:
            os.posix_fallocate(handle, size, more)
        finally:
            os.close(handle)


def truncate(path: Path, size: int) -> None:
    """Give back what was reserved behind byte `size`."""
    if path.stat().st_size > size:
        os.truncate(path, size)


def storage_error(path: Path, error: Exception) -> RunError:
    """Say what stopped a write to `path`: full, or else; HDF5 tells its `errno` only in its words."""
    number = getattr(error, "errno", None)
    words = str(error).replace("\n", " ")
    if isinstance(error, FileExistsError):
        return RunExistsError(f"{path} exists already and is not overwritten. Choose another name")
    if number in _NO_ROOM or any(f"errno = {code}," in words for code in _NO_ROOM):
        return DiskFullError(f"{path}: the disk or its quota is full. Free some space or take another disk")
    reason = getattr(error, "strerror", None) or words
    return WriteError(f"{path}: cannot be written ({reason}). Check the folder, its rights and its disk")


def sync_file(path: Path) -> None:
    """Make the contents of a file last through a power cut."""
    with path.open("r+b") as file:
        os.fsync(file.fileno())


def sync_folder(folder: Path) -> None:
    """Make new names in a folder last through a power cut, where the system can.

    Some network shares cannot, nor can a folder that this user may write to but not read.
    """
    if sys.platform == "win32":
        return
    try:
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
    except OSError as error:
        if error.errno not in _CANNOT_SYNC:
            raise


@contextmanager
def atomic_write(path: Path, *, replace: bool = False) -> Iterator[Path]:
    """Yield a path beside `path` to write to; what stands there at the end becomes `path`.

    Raises
    ------
    RunExistsError
        `path` exists, and `replace` was not asked for.
    DiskFullError, WriteError
        Nothing is left behind then.
    """
    made = path.with_name(f".{path.stem}.{uuid.uuid4().hex[:8]}{path.suffix}")
    claimed = False
    try:
        if not replace:
            path.open("x").close()  # nobody else can take the name meanwhile
            claimed = True
        yield made
        sync_file(made)
        made.replace(path)
        claimed = False
        sync_folder(path.parent)
    except OSError as error:
        raise storage_error(path, error) from None
    finally:
        made.unlink(missing_ok=True)
        if claimed:
            path.unlink(missing_ok=True)
