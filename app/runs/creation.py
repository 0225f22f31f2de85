"""Create a run file under a temporary name, then give it the final name and open it for rows.

A process that is killed before HDF5 has written all objects leaves a file that nothing can open
(docs/decisions/0018). Objects made while recording can be lost by a `kill -9` inside a flush. So every object
exists before the first sample, and values that are known at the end only are filled in place.
"""

import contextlib
import dataclasses
import datetime
import tempfile
from pathlib import Path
from typing import Literal

import h5py
import numpy as np

from app.runs import schema
from app.runs.blocks import BlockLayout
from app.runs.disk import (
    MARGIN_BYTES,
    UNFINISHED_SUFFIX,
    check_free_space,
    reserve_space,
    storage_error,
    sync_file,
    unfinished_name,
)
from app.runs.errors import RunError
from app.runs.fields import make_group, reserve_fields
from app.runs.lock import RECORDING_SUFFIX, FileLock, LockHeldError, is_held, recording_lock
from app.runs.metadata import RunMetadata
from app.runs.metadata_io import write_metadata
from app.runs.schema import Column
from app.version import __version__
from config.durable_files import give_new_name

_CHECK_ROWS = 1000
_PAGE_BYTES = 4096
"""An interrupted write ends at a page boundary, so no chunk index may lie across one."""
_INDEX_BYTES = 2096  # size of one node of a chunk index in HDF5
_METADATA_BYTES = 1 << 17
"""Room claimed at once for chunk indices. An index that grows then lies within the size that the superblock
states: a kill in the flush that grows it would otherwise hide the earlier chunks too."""
_CHUNKS_CACHED_BYTES = 1 << 19
"""Of each column. Only the last chunk is written again; HDF5 would keep 8 MB of each column."""
_METADATA_CACHED_BYTES = 1 << 16  # of the whole file. HDF5 would keep every index node as the file grows.


def create_file(
    path: Path, metadata: RunMetadata, layout: BlockLayout, identifier: str = "", *, has_wire: bool = True
) -> h5py.File:
    """Create a run file and leave it open. Raises RunError, OSError and RuntimeError of HDF5.

    `has_wire`: the bytes of a device are stored at its end.
    """
    if path.exists():
        raise FileExistsError(str(path))
    check_free_space(path.parent, MARGIN_BYTES)
    temporary = unfinished_name(path)
    try:
        with _open(temporary, "x") as file:
            create_template(file, path.name, metadata, layout, identifier, has_wire=has_wire)
            # What HDF5 has not written yet is a hole in the file, which needs room later.
            reserve_space(temporary, 0, file.id.get_filesize() + MARGIN_BYTES)
            wire = [column.path for column in schema.WIRE_COLUMNS]
            _create_chunk_indices(file, [*column_paths(metadata, layout), *wire])
        sync_file(temporary)
        give_new_name(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)
    try:
        return _open_for_rows(path)
    except BaseException:
        path.unlink()
        raise


def column_paths(metadata: RunMetadata, layout: BlockLayout) -> list[str]:
    """Datasets that grow while recording: time, readings of each gauge, status, counts of each gauge."""
    counts = [schema.count_path(gauge) for gauge in range(layout.channels)] if layout.counts else []
    return [schema.TIME, *_signals(metadata, layout), schema.STATUS, *counts]


def create_template(
    file: h5py.File,
    name: str,
    metadata: RunMetadata,
    layout: BlockLayout,
    identifier: str = "",
    *,
    has_wire: bool = True,
) -> None:
    """Create everything but the rows, in a new file whose final name is `name`. Raises MetadataError."""
    file.attrs.update(
        {
            "NX_class": "NXroot",
            "default": "entry",
            "slipstand_schema": schema.SCHEMA,
            "creator": "slipstand",
            "creator_version": __version__,
            "file_name": name,
            "file_time": datetime.datetime.now().astimezone().isoformat(timespec="seconds"),
            "HDF5_Version": h5py.version.hdf5_version,
            "h5py_version": h5py.version.version,
        }
    )
    for path, nx_class in schema.GROUPS.items():
        if path != schema.GAUGES[1] or layout.channels == 2:
            make_group(file, path, nx_class)
    file[schema.ENTRY].attrs["default"] = "motion"
    write_metadata(file, metadata, identifier)
    _create_motion(file, metadata, layout)
    if layout.counts:
        attributes = {"units": "count", "long_name": "readings as received (count)"}
        for gauge in range(layout.channels):
            _create_column(file, Column(schema.count_path(gauge), "", layout.counts, attributes))
    for column in schema.WIRE_COLUMNS:
        # rhdf5 of R fails on a column of 64-bit integers in which there is none.
        dtype = "int32" if column.dtype.endswith("64") and not has_wire else column.dtype
        _create_column(file, dataclasses.replace(column, dtype=dtype))
    reserve_fields(file, schema.END_FIELDS)
    file.create_dataset(schema.STORED, data=0, dtype="uint64")
    for path in column_paths(metadata, layout):
        file.create_dataset(schema.checksum_path(path), data=np.uint32(0))


def check_folder(folder: Path) -> None:
    """Write a small HDF5 file as a run is written, read it and remove it. Raises RunError."""
    written = np.arange(_CHECK_ROWS, dtype=np.float64)
    try:
        with tempfile.TemporaryDirectory(prefix=".slipstand-check-", dir=folder) as inside:
            path, final = Path(inside) / "check.h5", Path(inside) / "checked.h5"
            with h5py.File(path, "w") as file:
                file.create_dataset("data", data=written, maxshape=(None,), chunks=(_CHECK_ROWS,))
                file.flush()
            path.replace(final)
            with h5py.File(final, "r") as file:
                read = file["data"][:]
    except OSError as error:
        raise storage_error(folder, error) from None
    if not np.array_equal(written, read):
        raise RunError("{folder}: what was written reads back otherwise. Take another disk", folder=folder)


def remove_abandoned(folder: Path) -> None:
    """Remove locks and unfinished files of dead processes in a folder and in those below it."""
    for lock in folder.rglob(f"*{RECORDING_SUFFIX}"):
        # A file with content under this name belongs to somebody else.
        if lock.is_file() and not lock.stat().st_size and not is_held(lock):
            _remove_unless_held(FileLock(lock))
    for temporary in folder.rglob(f".*{UNFINISHED_SUFFIX}"):
        run = temporary.name.removeprefix(".").removesuffix(UNFINISHED_SUFFIX).rpartition(".")[0]
        _remove_unless_held(recording_lock(temporary.with_name(run)), temporary)


def _remove_unless_held(lock: FileLock, *paths: Path) -> None:
    """Remove a lock and its files. The lock is held meanwhile, so that no new file is removed."""
    with contextlib.suppress(LockHeldError, OSError), lock:
        for path in paths:
            path.unlink()


def _signals(metadata: RunMetadata, layout: BlockLayout) -> list[str]:
    measures = metadata.gauges.relative.measures
    return [schema.signal_path(gauge, metadata.quantity, measures) for gauge in range(layout.channels)]


def _create_motion(file: h5py.File, metadata: RunMetadata, layout: BlockLayout) -> None:
    time = _create_column(file, schema.TIME_COLUMN)
    if metadata.start_time is not None:
        time.attrs["start"] = metadata.start_time.isoformat()
    time.make_scale("time")
    attributes = {
        "units": metadata.unit,
        "quantity": metadata.quantity,
        "zero": schema.ZERO_OF_CALIBRATION if layout.counts else schema.ZERO_OF_SOURCE,
    }
    signals = _signals(metadata, layout)
    leaves = [path.rpartition("/")[2] for path in signals]
    for path, leaf in zip(signals, leaves, strict=True):
        named = {**attributes, "long_name": f"{leaf.replace('_', ' ')} ({metadata.unit})"}
        _create_column(file, Column(path, "", "float64", named, fill=float("nan")))
    _create_column(file, schema.STATUS_COLUMN)
    for path in [*signals, schema.STATUS]:
        file[path].dims[0].attach_scale(time)
    motion = file[schema.MOTION]
    motion.attrs.update({"signal": leaves[0], "axes": ["time"], "time_indices": [0]})
    if leaves[1:]:
        motion.attrs["auxiliary_signals"] = leaves[1:]


def _create_column(file: h5py.File, column: Column) -> h5py.Dataset:
    filters = {"compression": "gzip", "compression_opts": 1, "shuffle": column.dtype != "uint8"}
    dataset = file.create_dataset(
        column.path,
        shape=(0,),
        maxshape=(None,),
        chunks=(column.chunk or schema.CHUNK,),
        dtype=column.dtype,
        fillvalue=column.fill,
        **(filters if column.compressed else {}),
    )
    dataset.attrs.update(column.attributes)
    return dataset


def _create_chunk_indices(file: h5py.File, growing: list[str]) -> None:
    """Have HDF5 create the chunk index of each dataset, which it does with the first rows otherwise."""
    for rows in (1, 0):
        for path in growing:
            file[path].resize((rows,))
            file[path][:] = 0
        file.flush()


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
