"""Change a closed run without opening it for writing: copy, change the copy, verify it, replace."""

import datetime
import shutil
from collections.abc import Callable
from functools import partial
from pathlib import Path

import h5py

from app.runs import schema
from app.runs.batch.parent_watchdog import cleared_at_end, end_held, leave_if_asked
from app.runs.columns import check_column, checksum, is_finished, sample_paths
from app.runs.disk import check_free_space, storage_error, sync_file, temporary_copy
from app.runs.errors import UnsuitableRunError, WriteError, being_recorded, no_such_run
from app.runs.lock import FileLock, LockHeldError, is_being_recorded
from app.runs.validation import validate_file
from config.durable_files import remove_file, replace_file, sync_folder

_PIECE_BYTES = 1 << 20
_ROOM_BYTES = 1 << 22  # beyond the size of the file: a long analysis with its tables needs less than 1 MB


def rewrite(path: Path, change: Callable[[h5py.File], None]) -> None:
    """Replace a closed run by a changed copy of itself, all at once or not at all.

    `change` adds to the copy; samples and raw bytes must be the same afterwards. Raises RunNotFoundError,
    BeingRecordedError, UnsuitableRunError, DamagedRunError, DiskFullError, WriteError (the run is unchanged).
    """
    if path.is_symlink() and path.resolve().parent != path.parent.resolve():  # which may be anybody's file
        raise UnsuitableRunError(
            "{path} is a link to {target}. Give that file", path=path, target=path.resolve()
        )
    path = path.resolve()  # of a link the file is replaced, not the link
    if is_being_recorded(path):
        raise being_recorded(path)
    copy, lock = temporary_copy(path), editing_lock(path)
    try:
        with end_held(), cleared_at_end(partial(_clear, lock, copy)):
            lock.acquire()
            _make_copy(path, copy, change)
            replace_file(copy, path)
            sync_folder(path.parent)
    except LockHeldError:
        raise UnsuitableRunError("{path} is being changed by another program. Try again", path=path) from None
    except FileNotFoundError:
        raise no_such_run(path) from None
    except (OSError, RuntimeError) as error:
        raise storage_error(path, error) from None


def _clear(lock: FileLock, copy: Path) -> None:
    try:
        remove_file(copy)
    finally:
        lock.release()


def _make_copy(path: Path, copy: Path, change: Callable[[h5py.File], None]) -> None:
    check_free_space(path.parent, path.stat().st_size + _ROOM_BYTES)
    remove_file(copy)
    with path.open("rb") as file, copy.open("xb") as made:  # which follows no link of that name
        while piece := file.read(_PIECE_BYTES):
            made.write(piece)
            leave_if_asked()
    shutil.copymode(path, copy)
    with h5py.File(copy, "r+", locking="best-effort") as file:
        if not is_finished(file):
            raise UnsuitableRunError(
                "{path} was never closed, so it takes no results yet. Run `slipstand recover`", path=path
            )
        before = _measured(file)
        for name, value in before.items():
            check_column(file[name], value, path)
        leave_if_asked()
        change(file)
        file.attrs["file_update_time"] = datetime.datetime.now().astimezone().isoformat(timespec="seconds")
    with h5py.File(copy, "r", locking="best-effort") as file:
        validate_file(file)
        if _measured(file) != before:
            raise WriteError(
                "{path}: its copy does not read back as written. Check the disk; the run is unharmed",
                path=path,
            )
    leave_if_asked()
    sync_file(copy)
    leave_if_asked()


def _measured(file: h5py.File) -> dict[str, int]:
    wire = [column.path for column in schema.WIRE_COLUMNS]
    return {path: checksum(file[path]) for path in (*sample_paths(file), *wire)}


def editing_lock(path: Path) -> FileLock:
    """Lock that the process holds which replaces a closed run."""
    return FileLock(path.with_name(f".{path.name}.editing"))
