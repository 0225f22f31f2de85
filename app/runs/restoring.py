"""Puts a run that was rebuilt from its journal where it belongs, and loses nothing that is there already."""

from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np

from app.runs import schema as names
from app.runs.disk import storage_error, sync_folder
from app.runs.errors import RunError, RunExistsError, WriteError
from app.runs.listing import find_run_files
from app.runs.lock import LockHeldError, recording_lock
from app.runs.metadata import EndMetadata
from app.runs.reader import check_openable, read_end_metadata, read_file
from app.runs.rewrite import editing_lock, replace_run
from app.runs.validation import count_paths, signal_paths, stored_rows
from app.runs.validator import Validator

ASIDE = ".before-recovery"
"""Added to the name of a file that a recovered one took the place of, where it holds anything of its own."""

_ROWS_AT_ONCE = 1 << 20
_TRIES = 10_000


def find_run_by_uuid(folder: Path, identifier: str) -> Path | None:
    """The run file of this UUID in a folder; those being recorded or not readable are passed over."""
    with Validator() as validator:
        for path in find_run_files(folder):
            try:
                check_openable(path)
                if validator.validate(path).identifier == identifier:
                    return path
            except RunError:
                continue
    return None


@dataclass(frozen=True)
class ExistingRun:
    """What a run file holds beside its samples."""

    identifier: str
    samples: int
    ending: EndMetadata | None
    has_additions: bool
    """Analyses or edits were added after it was recorded."""


def inspect_run(path: Path) -> ExistingRun | None:
    """Look at a run file that may be damaged; None where it cannot be read, or is not there."""

    def look(file: h5py.File) -> ExistingRun:
        additions = bool(len(file[names.HISTORY])) or any(
            name.startswith(names.ANALYSIS_PREFIX) for name in file[names.ENTRY]
        )
        identifier = names.read_text(file, f"{names.ENTRY}/entry_identifier_uuid")
        return ExistingRun(identifier, stored_rows(file), read_end_metadata(file), additions)

    try:
        check_openable(path)
        with Validator() as validator:
            validator.validate(path)
        return read_file(path, look)
    except RunError:
        return None


def contains_all_samples(rebuilt: Path, other: Path) -> bool:
    """Tell whether a run has all samples of another one, from the same first one on, to the bit.

    Both must have been examined or written by this program.
    """
    with (
        h5py.File(rebuilt, "r", locking="best-effort") as ours,
        h5py.File(other, "r", locking="best-effort") as theirs,
    ):
        columns = [names.TIME, names.STATUS, *signal_paths(theirs), *count_paths(theirs)]
        rows = stored_rows(theirs)
        return all(_begins_with(ours.get(path), theirs[path], rows) for path in columns)


def move_to_free_name(rebuilt: Path, target: Path) -> Path:
    """Move a file to a name that is free, `target` or the next number. Returns the name.

    Raises
    ------
    RunError
        It cannot be moved there.
    """
    stem, _, number = target.stem.rpartition("_")
    first = int(number)
    for k in range(first, first + _TRIES):
        path = target.with_name(f"{stem}_{k:03d}{names.SUFFIX}")
        lock = recording_lock(path)
        try:
            with lock:  # as a recording does that looks for a name
                if not path.exists():
                    rebuilt.rename(path)
                    sync_folder(path.parent)
                    return path
        except LockHeldError:
            continue
        except OSError as error:
            raise storage_error(path, error) from None
    raise RunExistsError(f"{target.parent}: all names {stem}_NNN are taken. Move some runs elsewhere")


def replace_by_recovered(rebuilt: Path, target: Path, *, keep: bool) -> Path | None:
    """Let a file take the place of an earlier one.

    Parameters
    ----------
    keep : bool
        Move the earlier one aside first; its new name is returned.

    Raises
    ------
    RunError
        It cannot be done; both files are where they were, or the earlier one is aside.
    """
    aside = _free_name(target) if keep else None
    try:
        with recording_lock(target), editing_lock(target):  # a dead writer's lock file goes with it
            if aside is not None:
                target.rename(aside)
                sync_folder(target.parent)
            replace_run(rebuilt, target)
    except LockHeldError:
        raise WriteError(f"{target} is being changed by another program. Try again") from None
    except OSError as error:
        raise storage_error(target, error) from None
    return aside


def _begins_with(ours: h5py.Dataset | None, theirs: h5py.Dataset, rows: int) -> bool:
    if ours is None or len(ours) < rows or ours.dtype != theirs.dtype:
        return False
    parts = (slice(first, min(first + _ROWS_AT_ONCE, rows)) for first in range(0, rows, _ROWS_AT_ONCE))
    return all(np.array_equal(ours[part].view("u1"), theirs[part].view("u1")) for part in parts)


def _free_name(path: Path) -> Path:
    for number in range(1, _TRIES):
        aside = path.with_name(f"{path.name}{ASIDE}{'' if number == 1 else number}")
        if not aside.exists():
            return aside
    raise RunExistsError(f"{path.parent}: too many files {path.name}{ASIDE}. Move them elsewhere")
