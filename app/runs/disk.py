"""Free space of a disk, durable and atomic writes, and the errors of storage."""

import contextlib
import errno
import os
import re
import shutil
import sys
import tempfile
import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

from app.runs.batch.parent_watchdog import cleared_at_end
from app.runs.errors import DiskFullError, RunError, RunExistsError, WriteError
from config.durable_files import (
    file_in_use,
    give_new_name,
    is_in_use,
    make_folders,
    remove_file,
    replace_file,
    sync_descriptor,
    sync_folder,
)
from messages.i18n import N_
from messages.message import lacking_resource

UNFINISHED_SUFFIX = ".making"
"""Ends the names of unfinished runs and journals. `remove_abandoned` removes those of dead processes."""

MARGIN_BYTES = 1 << 20
"""Claimed beyond the next need of a run, so that its file can still be closed in good order."""

FILES_OF_RUN = 6
"""Journal, lock and run, each with a second name while it is made, at once: fewer have made a run fail."""

_NO_SPACE = {errno.ENOSPC, errno.EFBIG, getattr(errno, "EDQUOT", errno.ENOSPC)}
"""No space on the disk, in the quota, or within the largest size of a file."""
NO_FILE_LEFT = N_("{path}: the disk takes no more files. Remove some files or take another disk")
LONGEST_PATH = 239 if sys.platform == "win32" else None
"""Windows takes 259 characters unless it is set up otherwise; names of unfinished files are 20 longer."""


def reserve_space(path: Path, size: int, more: int) -> int:
    """Make sure that a file of `size` bytes can grow by `more`. Raises DiskFullError or WriteError.

    Returns the size to which it can grow whatever happens on the disk: on Linux `size + more`, elsewhere 0.

    HDF5 can crash after a failed write, so none of its writes may be the first to find the disk full. Linux
    claims the blocks behind the end of the file, which also respects quotas; HDF5 accepts such a file.
    """
    reserved_size = 0
    try:
        if sys.platform == "linux":
            handle = os.open(path, os.O_RDWR)  # read by the C library where the file system reserves nothing
            try:
                os.posix_fallocate(handle, size, more)
            finally:
                os.close(handle)
            reserved_size = size + more
        else:
            check_free_space(path.parent, more)
    except OSError as error:
        raise storage_error(path, error) from None
    return reserved_size


def check_free_space(folder: Path, more: int) -> None:
    """Make sure that a disk has `more` free bytes. Raises DiskFullError, OSError."""
    free = shutil.disk_usage(folder).free
    if free < more:
        template = N_("{folder}: the disk has only {free:.1f} MB left. Free some space or take another disk")
        raise DiskFullError(template, folder=folder, free=free / 1e6)


def has_free_space(folder: Path, size: int) -> bool:
    """Tell whether a folder, which need not exist yet, has `size` free bytes; True where it is unknown."""
    free = free_bytes(folder)
    return free is None or free >= size


def free_bytes(folder: Path) -> int | None:
    """Free bytes where a folder is or would be made; None where the system cannot tell."""
    existing = next((path for path in (folder, *folder.parents) if path.is_dir()), folder)
    try:
        usage = shutil.disk_usage(existing)
    except OSError:
        return None
    return usage.free if usage.total else None  # some network file systems report 0 of 0


def free_files(folder: Path) -> int | None:
    """Files that can be made where a folder is or would be made; None where the disk sets no number."""
    if sys.platform == "win32":
        return None
    existing = next((path for path in (folder, *folder.parents) if path.is_dir()), folder)
    try:
        disk = os.statvfs(existing)
    except OSError:
        return None
    return disk.f_favail if disk.f_files else None


def lacks_files(folder: Path) -> bool:
    """Tell whether a disk that took nothing has free bytes, and no number for another file."""
    files, free = free_files(folder), free_bytes(folder)
    return files is not None and files < FILES_OF_RUN and (free or 0) > MARGIN_BYTES


def is_disk_full(error: OSError) -> bool:
    """Tell whether a write failed for lack of space: disk, quota, or largest size of a file."""
    return error.errno in _NO_SPACE


def truncate(path: Path, size: int) -> None:
    """Give back what was reserved behind byte `size`."""
    if path.stat().st_size > size:
        os.truncate(path, size)


def storage_error(path: Path, error: Exception) -> RunError:
    """Convert an error of a write to `path`. HDF5 states its `errno` only in its text."""
    number = getattr(error, "errno", None)
    words = str(error).replace("\n", " ")
    if is_in_use(error, path):
        return WriteError(file_in_use(path).message)
    if lacking := lacking_resource(error):
        return WriteError("{path}: {fault}", path=path, fault=lacking)
    if isinstance(error, FileExistsError):
        return RunExistsError("{path} exists already and is not overwritten. Choose another name", path=path)
    if number == errno.ENOSPC and lacks_files(path.parent):
        return DiskFullError(NO_FILE_LEFT, path=path)
    if number in _NO_SPACE or any(f"errno = {code}," in words for code in _NO_SPACE):
        return DiskFullError(
            "{path}: the disk or its quota is full. Free some space or take another disk", path=path
        )
    if LONGEST_PATH is not None and len(str(path)) > LONGEST_PATH and isinstance(error, FileNotFoundError):
        template = N_("{path}: Windows takes no path of {length} characters. Choose a folder near its drive")
        return WriteError(template, path=path, length=len(str(path)))
    template = N_("{path}: cannot be written ({reason}). Check the folder, its rights and its disk")
    return WriteError(template, path=path, reason=getattr(error, "strerror", None) or words)


def is_writable(folder: Path) -> bool:
    """Tell whether files can be made in a folder. Only the attempt shows it on Windows."""
    try:
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        return False
    return True


def make_folder(folder: Path) -> None:
    """Make a folder with its parents; one that exists stays. Raises DiskFullError, WriteError."""
    try:
        make_folders(folder)
    except FileExistsError:
        raise WriteError(
            "{folder} is a file and cannot be written into. Choose a folder", folder=folder
        ) from None
    except OSError as error:
        raise storage_error(folder, error) from None


def sync_file(path: Path) -> None:
    """Bring the contents of a file to disk, so that they last through a power cut."""
    with path.open("r+b") as file:
        sync_descriptor(file.fileno())


_LEFT_S = 600.0  # no copy of a run takes so long; younger ones may still be written
_TEMPORARY = re.compile(r"\..+\.(\d+\.tmp|[0-9a-f]{8}\.\w+)")
"""Names of `temporary_copy` and of `atomic_write`."""


def unfinished_name(path: Path) -> Path:
    """Path beside a file for its contents until they are on disk, when they get its name."""
    return path.with_name(f".{path.name}.{uuid.uuid4().hex[:8]}{UNFINISHED_SUFFIX}")


def temporary_copy(path: Path) -> Path:
    """Path beside a file for a copy of it that replaces it."""
    return path.with_name(f".{path.name}.{os.getpid()}.tmp")


def leftover_files(folder: Path) -> list[Path]:
    """Temporary files in a folder and below that a program left which was killed while it wrote them."""
    found = []
    for place, _, names in os.walk(folder):
        for path in (Path(place) / name for name in names if _TEMPORARY.fullmatch(name)):
            with contextlib.suppress(OSError):  # gone meanwhile
                if time.time() - path.stat().st_mtime > _LEFT_S:
                    found.append(path)
    return sorted(found)


@contextmanager
def atomic_write(path: Path, *, replace: bool = False) -> Iterator[Path]:
    """Yield a temporary path; its file becomes `path` in the end. Raises RunExistsError, WriteError."""
    temporary = path.with_name(f".{path.stem}.{uuid.uuid4().hex[:8]}{path.suffix}")
    try:
        if not replace and os.path.lexists(path):
            raise FileExistsError(str(path))
        with cleared_at_end(partial(remove_file, temporary)):
            yield temporary
            sync_file(temporary)
            if replace:
                replace_file(temporary, path)
            else:
                give_new_name(temporary, path)
            sync_folder(path.parent)
    except OSError as error:
        raise storage_error(path, error) from None
