"""Brings a new run file into being: made whole under another name, then named, then opened for its rows.

HDF5 writes the head of a file at once and what it points to much later, so that a process which is
killed meanwhile leaves a file that nothing can open (docs/decisions/0018).
"""

import contextlib
import os
import secrets
from pathlib import Path
from typing import Literal

import h5py

from app.runs.blocks import BlockLayout
from app.runs.disk import MARGIN_BYTES, check_free_space, reserve_space
from app.runs.file_template import column_paths, create_template
from app.runs.lock import RECORDING_SUFFIX, FileLock, LockHeldError, is_held, recording_lock
from app.runs.metadata import RunMetadata
from app.runs.schema import WIRE_ARRIVAL, WIRE_DATA, WIRE_END

UNFINISHED_SUFFIX = ".making"
"""Ends the name of a run file that is not yet whole; a dead process may leave one."""

_PAGE_BYTES = 4096
"""A write that is interrupted ends between two of these, so no index of chunks may lie across that border."""
_INDEX_BYTES = 2096
"""Size of one node of an index of chunks."""
_METADATA_BYTES = 1 << 17
"""Claimed at once for the indices of the chunks, so that one that grows lies within what the superblock
calls the file: a kill in the flush that grows it would else hide the earlier chunks too."""
_CHUNKS_CACHED_BYTES = 1 << 19
"""Of each column: only its last chunk is written again. HDF5 would keep 8 MB of each."""
_METADATA_CACHED_BYTES = 1 << 16
"""Of the whole file, where HDF5 would keep every node of the indices as the file grows."""


def create_file(path: Path, metadata: RunMetadata, layout: BlockLayout, identifier: str = "") -> h5py.File:
    """Make a new run file without samples and leave it open.

    Raises
    ------
    OSError, RuntimeError
        From HDF5, FileExistsError among them.
    MetadataError, DiskFullError, WriteError
    """
    if path.exists():
        raise FileExistsError(str(path))
    check_free_space(path.parent, MARGIN_BYTES)
    made = path.with_name(f".{path.name}.{secrets.token_hex(4)}{UNFINISHED_SUFFIX}")
    try:
        _make(made, path.name, metadata, layout, identifier)
        _name(made, path)
    finally:
        made.unlink(missing_ok=True)
    try:
        return _open_for_rows(path)
    except BaseException:
        path.unlink()
        raise


def remove_abandoned(folder: Path) -> None:
    """Remove locks and unfinished files that dead processes left in a folder and in those below it."""
    for lock in folder.rglob(f"*{RECORDING_SUFFIX}"):
        if _is_empty_file(lock) and not is_held(lock):  # else it is something of somebody else
            _remove_held(FileLock(lock))
    for made in folder.rglob(f".*{UNFINISHED_SUFFIX}"):
        run = made.name.removeprefix(".").removesuffix(UNFINISHED_SUFFIX).rpartition(".")[0]
        _remove_held(recording_lock(made.with_name(run)), made)


def _is_empty_file(path: Path) -> bool:
    return path.is_file() and path.stat().st_size == 0


def _remove_held(lock: FileLock, *paths: Path) -> None:
    """Remove a lock and what it guards, unless somebody has it; held meanwhile, so that nothing new goes."""
    with contextlib.suppress(LockHeldError, OSError), lock:
        for path in paths:
            path.unlink()


def _make(made: Path, name: str, metadata: RunMetadata, layout: BlockLayout, identifier: str) -> None:
    with _open(made, "x") as file:
        create_template(file, name, metadata, layout, identifier)
        reserve_space(made, 0, file.id.get_filesize() + MARGIN_BYTES)  # what is not yet written is a hole
        _make_indices(file, [*column_paths(metadata, layout), WIRE_DATA, WIRE_ARRIVAL, WIRE_END])


def _make_indices(file: h5py.File, growing: list[str]) -> None:
    """Have HDF5 make the index of chunks of each dataset, as it else does with the first rows."""
    for rows in (1, 0):
        for path in growing:
            file[path].resize((rows,))
            file[path][:] = 0
        file.flush()


def _name(made: Path, path: Path) -> None:
    """Give a file its name as well, in one step and only if nothing has it. Raises FileExistsError."""
    try:
        os.link(made, path)
    except FileExistsError:
        raise
    except OSError:  # a file system without links
        if path.exists():
            raise FileExistsError(str(path)) from None
        made.rename(path)


def _open_for_rows(path: Path) -> h5py.File:
    file = _open(path, "r+")
    cache = file.id.get_mdc_config()
    cache.set_initial_size, cache.initial_size = True, _METADATA_CACHED_BYTES
    cache.min_size = cache.max_size = _METADATA_CACHED_BYTES
    cache.incr_mode = cache.decr_mode = cache.flash_incr_mode = 0
    file.id.set_mdc_config(cache)
    return file


def _open(path: Path, mode: Literal["x", "r+"]) -> h5py.File:
    return h5py.File(
        path,
        mode,
        locking="best-effort",
        meta_block_size=_METADATA_BYTES,
        alignment_threshold=_INDEX_BYTES,
        alignment_interval=_PAGE_BYTES,
        rdcc_nbytes=_CHUNKS_CACHED_BYTES,
    )
