"""Move and copy run files without overwriting any: copies, trash, recovered runs.

Only runs in the trash are ever deleted.
"""

import contextlib
import itertools
import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np

from app.runs import errors, schema
from app.runs.blocks import StoredRun
from app.runs.columns import check_samples, sample_paths, stored_rows
from app.runs.disk import atomic_write, make_folder, storage_error, sync_file
from app.runs.listing import check_folder_exists, find_run_files
from app.runs.lock import LockHeldError, is_being_recorded, recording_lock
from app.runs.metadata import EndMetadata
from app.runs.metadata_io import read_end_metadata, read_identifier
from app.runs.paths import TRASH
from app.runs.reader import check_openable, read_file
from app.runs.rewrite import editing_lock
from app.runs.validator import Validator, shared_validator
from config.durable_files import give_new_name, replace_file, sync_folder
from messages.i18n import N_

ASIDE = ".before-recovery"
"""Appended to the name of a file that a recovered run replaced, where it holds anything of its own."""

_NAMES_MAX = 10_000
_ROWS_AT_ONCE = 1 << 20


def copy_run_into(path: Path, folder: Path) -> Path:
    """Copy a run into a folder under the next name that is free. Returns the path. Raises RunError."""
    path = path.absolute()
    check_openable(path)
    if path.parent == folder.absolute():
        raise errors.RunExistsError("{path} lies in this folder already. Nothing was copied", path=path)
    with Validator.start() as validator:
        validator.validate(path)
    make_folder(folder)
    for target in _names(folder / path.name):
        with contextlib.suppress(errors.RunExistsError), atomic_write(target) as temporary:
            shutil.copyfile(path, temporary)
            return target
    raise _names_taken(folder, path)


def move_to_trash(path: Path) -> Path:
    """Move a run to the trash of its folder. Returns the new path. Raises RunError."""
    path = path.absolute()
    if path.parent.name == TRASH:
        raise errors.UnsuitableRunError(
            "{path} is in the trash already. Leave it there, or restore it", path=path
        )
    _check_movable(path)
    if path.is_symlink():
        raise errors.UnsuitableRunError(
            "{path} is a link to {target}. Give that file", path=path, target=path.resolve()
        )
    if path.suffix != schema.SUFFIX:
        template = N_("{path} is not named like a run. Give a file that ends in {suffix}")
        raise errors.UnsuitableRunError(template, path=path, suffix=schema.SUFFIX)
    make_folder(path.parent / TRASH)
    return _move(path, path.parent / TRASH)


def restore_from_trash(path: Path) -> Path:
    """Move a run from the trash back to its folder. Returns the new path. Raises RunError."""
    path = path.absolute()
    _check_trashed(path)
    return _move(path, path.parent.parent)


def delete_from_trash(path: Path) -> None:
    """Delete a run in the trash for ever. Raises RunError."""
    path = path.absolute()
    _check_trashed(path)
    try:
        path.unlink()
    except OSError as error:
        raise storage_error(path, error) from None


def list_trash(folder: Path) -> list[Path]:
    """Runs in the trash of a folder and of those below it, the latest first. Raises RunNotFoundError."""
    check_folder_exists(folder)
    found = [path.absolute() for path in folder.rglob(f"{TRASH}/*{schema.SUFFIX}")]
    return sorted(found, key=lambda path: path.stat().st_ctime, reverse=True)


def find_run_by_uuid(folder: Path, identifier: str) -> Path | None:
    """The run file of this UUID in a folder; files that are being recorded or not readable are skipped."""
    for path in find_run_files(folder):
        with contextlib.suppress(errors.RunError):
            check_openable(path)
            if shared_validator().validate(path).identifier == identifier:
                return path
    return None


@dataclass(frozen=True)
class ExistingRun:
    """Identity, length and additions of a run file that a recovered one may replace."""

    identifier: str
    samples: int
    end: EndMetadata | None
    has_additions: bool
    """Analyses or edits were added after it was recorded."""
    raw_bytes_stored: bool


def inspect_run(path: Path, *, locked: bool = False) -> ExistingRun | None:
    """Inspect a run file that may be damaged; None where it cannot be read or does not exist.

    With `locked` the process that holds the lock of the run is known to do nothing any more.
    """

    def inspect(file: h5py.File) -> ExistingRun:
        additions = bool(len(file[schema.HISTORY])) or any(
            name.startswith(schema.ANALYSIS_PREFIX) for name in file[schema.ENTRY]
        )
        has_bytes = bool(len(file[schema.WIRE_DATA.path]))
        return ExistingRun(
            read_identifier(file), stored_rows(file), read_end_metadata(file), additions, has_bytes
        )

    try:
        if not locked:
            check_openable(path)
        shared_validator().validate(path)
        return read_file(path, inspect)
    except errors.RunError:
        return None


def finished_run(path: Path, samples: int) -> StoredRun | None:
    """A run of so many samples that a writer finished which gave no answer, once it is sound and on disk.

    The writer holds its lock still, and may not have read the file again and synced it. None for any other.
    """
    run = inspect_run(path, locked=True)
    if run is None or run.end is None or run.samples != samples:
        return None
    try:
        read_file(path, check_samples)
        sync_file(path)
        sync_folder(path.parent)
    except (errors.RunError, OSError):
        return None
    return StoredRun(str(path), samples, run.raw_bytes_stored)


def contains_all_samples(rebuilt: Path, other: Path) -> bool:
    """Tell whether a sound run begins with all samples of another sound one, bit for bit."""
    with (
        h5py.File(rebuilt, "r", locking="best-effort") as ours,
        h5py.File(other, "r", locking="best-effort") as theirs,
    ):
        rows = stored_rows(theirs)
        return all(_begins_with(ours.get(path), theirs[path], rows) for path in sample_paths(theirs))


def move_to_free_name(rebuilt: Path, target: Path) -> Path:
    """Move a file to `target` or to the next number that is free. Returns the new path. Raises RunError."""
    stem, _, number = target.stem.rpartition("_")
    first = int(number)
    for k in range(first, first + _NAMES_MAX):
        path = target.with_name(f"{stem}_{k:03d}{schema.SUFFIX}")
        try:
            with recording_lock(path):  # as a recording holds it that looks for a name
                if not path.exists():
                    replace_file(rebuilt, path)
                    sync_folder(path.parent)
                    return path
        except LockHeldError:
            continue
        except OSError as error:
            raise storage_error(path, error) from None
    raise _names_taken(target.parent, target)


def replace_by_recovered(rebuilt: Path, target: Path, *, keep: bool) -> Path | None:
    """Replace a file by a recovered one; `keep` moves it aside and returns its path. Raises RunError."""
    aside = _aside_name(target) if keep else None
    try:
        with recording_lock(target), editing_lock(target):  # also removes the lock file of a dead writer
            if aside is not None:
                replace_file(target, aside)
                sync_folder(target.parent)
            replace_file(rebuilt, target)
            sync_folder(target.parent)
    except LockHeldError:
        raise errors.WriteError(
            "{path} is being changed by another program. Try again", path=target
        ) from None
    except OSError as error:
        raise storage_error(target, error) from None
    return aside


def _names_taken(folder: Path, path: Path) -> errors.RunExistsError:
    return errors.RunExistsError(
        "{folder}: all names like {name} are taken. Move some runs elsewhere", folder=folder, name=path.name
    )


def _check_trashed(path: Path) -> None:
    if path.parent.name != TRASH:
        raise errors.UnsuitableRunError(
            "{path} is not in a trash folder. Give a run in a folder named {trash}", path=path, trash=TRASH
        )
    _check_movable(path)


def _check_movable(path: Path) -> None:
    if path.is_dir():
        raise errors.NotARunError("{path} is a folder. Give a run file in it", path=path)
    if not path.is_file():
        raise errors.no_such_run(path)
    if is_being_recorded(path):
        raise errors.being_recorded(path)


def _move(path: Path, folder: Path) -> Path:
    """Move to a free name: nothing is overwritten, whoever else moves at the same time."""
    for target in _names(folder / path.name):
        try:
            give_new_name(path, target)
        except FileExistsError:
            continue
        except OSError as error:
            raise storage_error(path, error) from None
        for changed in (folder, path.parent):
            with contextlib.suppress(OSError):  # the run is moved; only a power cut could still undo that
                sync_folder(changed)
        return target
    raise _names_taken(folder, path)


def _names(path: Path) -> Iterator[Path]:
    """Names to try for a file, the wanted one first."""
    yield path
    yield from (path.with_name(f"{path.stem}-{number}{path.suffix}") for number in range(2, _NAMES_MAX))


def _begins_with(ours: h5py.Dataset | None, theirs: h5py.Dataset, rows: int) -> bool:
    if ours is None or len(ours) < rows or ours.dtype != theirs.dtype:
        return False
    parts = (slice(first, min(first + _ROWS_AT_ONCE, rows)) for first in range(0, rows, _ROWS_AT_ONCE))
    return all(np.array_equal(ours[part].view("u1"), theirs[part].view("u1")) for part in parts)


def _aside_name(path: Path) -> Path:
    numbers = itertools.chain([""], map(str, itertools.count(2)))
    names = (path.with_name(f"{path.name}{ASIDE}{number}") for number in numbers)
    return next(name for name in names if not name.exists())
