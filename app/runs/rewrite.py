"""Changes a closed run without ever opening it for writing: copy, change the copy, check it, replace."""

import datetime
import os
import shutil
import time
from collections.abc import Callable
from pathlib import Path

import h5py

from app.runs import schema as names
from app.runs.checksums import check_column, checksum
from app.runs.disk import check_free_space, storage_error, sync_file, sync_folder
from app.runs.errors import BeingRecordedError, RunNotFoundError, UnsuitableRunError, WriteError
from app.runs.lock import FileLock, LockHeldError, is_being_recorded
from app.runs.validation import count_paths, is_finished, signal_paths, validate_file

_ROOM_BYTES = 1 << 22
_REPLACE_S = 5.0


def rewrite(path: Path, change: Callable[[h5py.File], None]) -> None:
    """Replace a closed run by a changed copy of itself, all at once or not at all.

    Parameters
    ----------
    path
        A run that has been opened, and so examined, before.
    change
        Adds to the copy. What was measured is compared afterwards, and must be the same.

    Raises
    ------
    RunNotFoundError, BeingRecordedError
    UnsuitableRunError
        The run was never closed, or is being changed by another program.
    DamagedRunError
        What was measured is not what was stored when it was closed.
    DiskFullError, WriteError
        The run is as it was before.
    """
    path = path.resolve()  # of a link the file is replaced, not the link
    if is_being_recorded(path):
        raise BeingRecordedError(f"{path} is being recorded. Wait until the run has ended")
    copy = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        with editing_lock(path):
            _make_copy(path, copy, change)
            replace_run(copy, path)
    except LockHeldError:
        raise UnsuitableRunError(f"{path} is being changed by another program. Try again") from None
    except FileNotFoundError:
        raise RunNotFoundError(f"{path}: there is no such file. Give the path of a run") from None
    except (OSError, RuntimeError) as error:
        raise storage_error(path, error) from None
    finally:
        copy.unlink(missing_ok=True)


def _make_copy(path: Path, copy: Path, change: Callable[[h5py.File], None]) -> None:
    check_free_space(path.parent, path.stat().st_size + _ROOM_BYTES)
    shutil.copy(path, copy)
    with h5py.File(copy, "r+", locking="best-effort") as file:
        if not is_finished(file):
            raise UnsuitableRunError(
                f"{path} was never closed, so it takes no results yet. Run `slipstand recover`"
            )
        before = _measured(file)
        for name, value in before.items():
            check_column(file[name], value, path)
        change(file)
        file.attrs["file_update_time"] = datetime.datetime.now().astimezone().isoformat(timespec="seconds")
    with h5py.File(copy, "r", locking="best-effort") as file:
        validate_file(file)
        if _measured(file) != before:
            raise WriteError(
                f"{path}: its copy does not read back as written. Check the disk; the run is unharmed"
            )
    sync_file(copy)


def _measured(file: h5py.File) -> dict[str, int]:
    """Checksum of everything that may never change."""
    columns = [names.TIME, names.STATUS, *signal_paths(file), *count_paths(file)]
    wire = [names.WIRE_DATA, names.WIRE_ARRIVAL, names.WIRE_END]
    return {path: checksum(file[path]) for path in (*columns, *wire)}


def editing_lock(path: Path) -> FileLock:
    """Lock that is held by whoever replaces a closed run."""
    return FileLock(path.with_name(f".{path.name}.editing"))


def replace_run(copy: Path, path: Path) -> None:
    """Put the copy in place; Windows refuses while somebody reads the run, so it is tried for a while."""
    deadline = time.monotonic() + _REPLACE_S
    while True:
        try:
            copy.replace(path)
            break
        except PermissionError:
            if os.name != "nt" or time.monotonic() > deadline:
                raise
            time.sleep(0.05)
    sync_folder(path.parent)
