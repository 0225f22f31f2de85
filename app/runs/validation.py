"""Validate that a file is a whole and harmless run, before anything reads it (see `app.runs.validator`).

A run consists of groups and plain datasets, each reached by one path. Anything else is refused.
"""

import math
from collections.abc import Iterator
from pathlib import Path

import h5py
import numpy as np

from app.runs import schema
from app.runs.columns import is_finished, sample_paths, signal_paths, stored_rows
from app.runs.errors import DamagedRunError, NotARunError
from messages.i18n import N_
from messages.message import MessageError

_OBJECTS_MAX = 50_000  # a run has 200 objects and 60 more with each saved analysis
_DEPTH_MAX = 10  # a run has groups of depth 6
_SMALL_BYTES = 1 << 20  # datasets up to this size need no proof that the file fills them
_TEXT_BYTES_MAX = 1 << 26
_TEXTS_MAX = 1000
_GZIP_RATIO_MAX = 1100
"""Deflate packs by 1032 at most (zlib's technical details)."""
_FILTERS = {h5py.h5z.FILTER_DEFLATE, h5py.h5z.FILTER_SHUFFLE, h5py.h5z.FILTER_FLETCHER32}


def validate_file(file: h5py.File) -> None:
    """Check the structure of an open file. Raises NotARunError, DamagedRunError."""
    _check_schema(file)
    try:
        for dataset in _walk(file):
            _check_dataset(dataset)
        _check_columns(file)
        _check_required(file)
    except _StructureError as error:
        template = N_("{file} is damaged: {fault}. Restore a good copy, or recover it")
        raise DamagedRunError(template, file=file.filename, fault=error.message) from None


class _StructureError(MessageError):
    """What is wrong with the structure of a file."""


def _check_schema(file: h5py.File) -> None:
    version = file.attrs.get("slipstand_schema")
    if not isinstance(version, np.integer):
        raise NotARunError("{file} is HDF5, but not a Slipstand run. Give a run file", file=file.filename)
    if version != schema.SCHEMA:
        template = N_("{file} has run format {version}, this program knows {known}. Use a newer program")
        raise NotARunError(template, file=file.filename, version=version, known=schema.SCHEMA)


def _check_required(file: h5py.File) -> None:
    """Refuse a file without a field that every run has, whichever version wrote it."""
    required = [field.path for field in schema.REQUIRED_FIELDS]
    for gauge in schema.GAUGES:
        if gauge in file:
            required += [f"{gauge}/{field.path}" for field in schema.GAUGE_FIELDS if field.required]
    for path in required:
        if path not in file:
            raise _StructureError("it lacks {path}", path=path)


def _walk(file: h5py.File) -> Iterator[h5py.Dataset]:
    """All datasets, each once, along hard links only."""
    seen = {h5py.h5o.get_info(file.id).addr}
    pending = [(h5py.Group(file.id), "", 0)]
    while pending:
        group, path, depth = pending.pop()
        for name in group.id:
            place = f"{path}/{name.decode('utf-8', 'replace')}"
            member = _member(group, name, place, seen)
            if len(seen) > _OBJECTS_MAX or depth >= _DEPTH_MAX:
                raise _StructureError("{path} lies too deep, or among too many objects", path=place)
            if isinstance(member, h5py.h5d.DatasetID):
                yield h5py.Dataset(member)
            else:
                pending.append((h5py.Group(member), place, depth + 1))


def _member(
    group: h5py.Group, name: bytes, place: str, seen: set[int]
) -> h5py.h5g.GroupID | h5py.h5d.DatasetID:
    """Open a member by the low-level API of h5py, several times faster than by the high-level one."""
    if group.id.links.get_info(name).type != h5py.h5l.TYPE_HARD:
        raise _StructureError("{path} is a link to elsewhere", path=place)
    member = h5py.h5o.open(group.id, name)
    address = h5py.h5o.get_info(member).addr
    if isinstance(member, h5py.h5t.TypeID) or address in seen:
        raise _StructureError("{path} is no plain group or dataset, or is reached twice", path=place)
    seen.add(address)
    return member


def _check_dataset(dataset: h5py.Dataset) -> None:
    settings, dtype = dataset.id.get_create_plist(), dataset.dtype
    if settings.get_layout() == h5py.h5d.VIRTUAL or settings.get_external_count():
        raise _StructureError("{dataset} keeps its data in another file", dataset=dataset.name)
    filters = {settings.get_filter(i)[0] for i in range(settings.get_nfilters())}
    if not filters <= _FILTERS:
        raise _StructureError("{dataset} is packed by an unknown filter", dataset=dataset.name)
    if dtype.kind not in "iufbSO" or dataset.id.rank > 2 or dtype.itemsize > _TEXT_BYTES_MAX:
        raise _StructureError(
            "{dataset} is of a type that runs do not have ({dtype})", dataset=dataset.name, dtype=dtype
        )
    size = math.prod(dataset.id.shape)
    if dtype.kind == "O" and (h5py.check_string_dtype(dtype) is None or size > _TEXTS_MAX):
        raise _StructureError("{dataset} is of a type that runs do not have", dataset=dataset.name)
    claimed = size * dtype.itemsize
    if claimed > _SMALL_BYTES and not _grows(dataset):
        room = dataset.id.get_storage_size() * (_GZIP_RATIO_MAX if filters else 1)
        if claimed > room:
            template = N_("{dataset} claims {claimed} bytes that the file does not hold")
            raise _StructureError(template, dataset=dataset.name, claimed=claimed)


def _grows(dataset: h5py.Dataset) -> bool:
    """Tell whether a dataset may be longer than the file fills: only stored rows are read."""
    path = dataset.name.lstrip("/")
    if path in (column.path for column in schema.WIRE_COLUMNS):
        return not is_finished(dataset.file)
    return path.startswith(f"{schema.MOTION}/") or path in map(schema.count_path, range(len(schema.GAUGES)))


def _check_columns(file: h5py.File) -> None:
    """Columns have their types, and the chunks behind every row that will be read lie in the file."""
    try:
        rows = stored_rows(file)
        columns = [file[path] for path in sample_paths(file)]
        gauges = len(signal_paths(file))
    except (KeyError, TypeError, ValueError) as error:
        raise _StructureError("it lacks a part of every run ({error})", error=error) from None
    if gauges > len(schema.GAUGES):
        raise _StructureError("it has {gauges} gauges", gauges=gauges)
    size = Path(file.filename).stat().st_size
    for column in columns:
        if not _is_plain(column):
            raise _StructureError("{column} is not a plain column of numbers", column=column.name)
        if is_finished(file) and len(column) != rows:
            template = N_("{column} has {length} rows instead of {rows}")
            raise _StructureError(template, column=column.name, length=len(column), rows=rows)
        if rows * column.dtype.itemsize > size:
            raise _StructureError(
                "{column} claims {rows} rows that the file does not hold", column=column.name, rows=rows
            )
        _check_chunks(column, rows, size)


def _is_plain(column: h5py.Dataset) -> bool:
    filters = column.id.get_create_plist().get_nfilters()
    return column.ndim == 1 and column.dtype.kind in "iuf" and column.chunks is not None and not filters


def _check_chunks(column: h5py.Dataset, rows: int, size: int) -> None:
    present: set[int] = set()

    def visit(chunk: h5py.h5d.StoreInfo) -> None:
        if chunk.byte_offset + chunk.size <= size:
            present.add(chunk.chunk_offset[0])

    if rows:
        column.id.chunk_iter(visit)
    (length,) = column.chunks
    if not all(first in present for first in range(0, rows, length)):
        raise _StructureError("{column} lacks a part of its {rows} rows", column=column.name, rows=rows)
