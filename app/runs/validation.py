"""Is this file a run, whole and harmless? Done before its contents are believed; see `app.runs.validator`.

Only what a run consists of may be there: groups and plain datasets, each reached by one way. Links to
elsewhere, data kept outside the file, cycles, foreign filters and shapes that the file does not fill
are refused.
"""

import math
from collections.abc import Iterator
from pathlib import Path

import h5py
import numpy as np

from app.runs import schema as names
from app.runs.errors import DamagedRunError, NotARunError

_OBJECTS_MAX = 50_000
_DEPTH_MAX = 10
_SMALL_BYTES = 1 << 20
"""Datasets up to this size need no proof that the file fills them."""
_TEXT_BYTES_MAX = 1 << 26
_TEXTS_MAX = 1000
_GZIP_RATIO_MAX = 1100
_FILTERS = {h5py.h5z.FILTER_DEFLATE, h5py.h5z.FILTER_SHUFFLE, h5py.h5z.FILTER_FLETCHER32}


def validate_file(file: h5py.File) -> None:
    """Check the structure of an open file.

    Raises
    ------
    NotARunError
        It is not a run, or one of a later program.
    DamagedRunError
        It claims to be a run, but cannot be trusted.
    """
    _check_schema(file)
    for dataset in _walk(file):
        _check_dataset(dataset)
    _check_columns(file)


def stored_rows(file: h5py.File) -> int:
    """Rows that can be trusted: all of a finished run, else up to what was surely flushed."""
    lengths = [len(file[path]) for path in _growing(file)]
    return min([int(file[names.STORED][()]), *lengths])


def signal_paths(file: h5py.File) -> list[str]:
    """Datasets of the calibrated readings, table gauge first."""
    attributes = file[names.MOTION].attrs
    leaves = [attributes["signal"], *attributes.get("auxiliary_signals", [])]
    return [f"{names.MOTION}/{names.to_python(leaf)}" for leaf in leaves]


def count_paths(file: h5py.File) -> list[str]:
    """Datasets of the readings as received; none in a simulated run."""
    return [f"{path}/data" for path in names.GAUGES if f"{path}/data" in file]


def is_finished(file: h5py.File) -> bool:
    """Tell whether the run was closed in good order."""
    return bool(names.read_text(file, names.ENDED))


def _growing(file: h5py.File) -> list[str]:
    return [names.TIME, names.STATUS, *signal_paths(file), *count_paths(file)]


def _check_schema(file: h5py.File) -> None:
    schema = file.attrs.get("slipstand_schema")
    if not isinstance(schema, np.integer):
        raise NotARunError(f"{file.filename} is HDF5, but not a Slipstand run. Give a run file")
    if schema != names.SCHEMA:
        raise NotARunError(
            f"{file.filename} has run format {schema}, this program knows 1. Use a newer program"
        )


def _walk(file: h5py.File) -> Iterator[h5py.Dataset]:
    """All datasets, each once, without following anything but hard links."""
    seen = {h5py.h5o.get_info(file.id).addr}
    pending = [(h5py.Group(file.id), "", 0)]
    while pending:
        group, path, depth = pending.pop()
        for name in group.id:
            place = f"{path}/{name.decode('utf-8', 'replace')}"
            member = _member(group, name, place, seen)
            if len(seen) > _OBJECTS_MAX or depth >= _DEPTH_MAX:
                raise _damaged(group, f"{place} lies too deep, or among too many objects")
            if isinstance(member, h5py.h5d.DatasetID):
                yield h5py.Dataset(member)
            else:
                pending.append((h5py.Group(member), place, depth + 1))


def _member(
    group: h5py.Group, name: bytes, place: str, seen: set[int]
) -> h5py.h5g.GroupID | h5py.h5d.DatasetID:
    """Open a member by h5py's lower layer, several times faster than by its upper one."""
    if group.id.links.get_info(name).type != h5py.h5l.TYPE_HARD:
        raise _damaged(group, f"{place} is a link to elsewhere")
    member = h5py.h5o.open(group.id, name)
    address = h5py.h5o.get_info(member).addr
    if isinstance(member, h5py.h5t.TypeID) or address in seen:
        raise _damaged(group, f"{place} is no plain group or dataset, or is reached twice")
    seen.add(address)
    return member


def _check_dataset(dataset: h5py.Dataset) -> None:
    settings, dtype = dataset.id.get_create_plist(), dataset.dtype
    if settings.get_layout() == h5py.h5d.VIRTUAL or settings.get_external_count():
        raise _damaged(dataset, f"{dataset.name} keeps its data in another file")
    filters = {settings.get_filter(i)[0] for i in range(settings.get_nfilters())}
    if not filters <= _FILTERS:
        raise _damaged(dataset, f"{dataset.name} is packed by an unknown filter")
    if dtype.kind not in "iufbSO" or dataset.id.rank > 2 or dtype.itemsize > _TEXT_BYTES_MAX:
        raise _damaged(dataset, f"{dataset.name} is of a type that runs do not have ({dtype})")
    size = math.prod(dataset.id.shape)
    if dtype.kind == "O" and (h5py.check_string_dtype(dtype) is None or size > _TEXTS_MAX):
        raise _damaged(dataset, f"{dataset.name} is of a type that runs do not have")
    claimed = size * dtype.itemsize
    if claimed > _SMALL_BYTES and not _grows(dataset):
        room = dataset.id.get_storage_size() * (_GZIP_RATIO_MAX if filters else 1)
        if claimed > room:
            raise _damaged(dataset, f"{dataset.name} claims {claimed} bytes that the file does not hold")


def _grows(dataset: h5py.Dataset) -> bool:
    """Tell whether a dataset may be longer than its file fills: no more is read than was stored."""
    path = dataset.name.lstrip("/")
    if path in (names.WIRE_DATA, names.WIRE_ARRIVAL, names.WIRE_END):
        return not is_finished(dataset.file)
    return path.startswith(f"{names.MOTION}/") or path in [f"{gauge}/data" for gauge in names.GAUGES]


def _check_columns(file: h5py.File) -> None:
    """Columns have their types, and the chunks behind every row that will be read lie in the file."""
    try:
        rows = stored_rows(file)
        columns = [file[path] for path in _growing(file)]
        gauges = len(signal_paths(file))
    except (KeyError, TypeError, ValueError) as error:
        raise DamagedRunError(
            f"{file.filename} lacks a part of every run ({error}). Restore a copy"
        ) from None
    if gauges > len(names.GAUGES):
        raise _damaged(file, f"it has {gauges} gauges")
    size = Path(file.filename).stat().st_size
    for column in columns:
        if not _is_plain(column):
            raise _damaged(column, f"{column.name} is not a plain column of numbers")
        if is_finished(file) and len(column) != rows:
            raise _damaged(column, f"{column.name} has {len(column)} rows instead of {rows}")
        if rows * column.dtype.itemsize > size:
            raise _damaged(column, f"{column.name} claims {rows} rows that the file does not hold")
        _check_chunks(column, rows, size)


def _is_plain(column: h5py.Dataset) -> bool:
    filters = column.id.get_create_plist().get_nfilters()
    return column.ndim == 1 and column.dtype.kind in "iuf" and column.chunks is not None and not filters


def _check_chunks(column: h5py.Dataset, rows: int, size: int) -> None:
    there: set[int] = set()

    def visit(chunk: h5py.h5d.StoreInfo) -> None:
        if chunk.byte_offset + chunk.size <= size:
            there.add(chunk.chunk_offset[0])

    if rows:
        column.id.chunk_iter(visit)
    (length,) = column.chunks
    if not all(first in there for first in range(0, rows, length)):
        raise _damaged(column, f"{column.name} lacks a part of its {rows} rows")


def _damaged(where: h5py.Group | h5py.Dataset, fault: str) -> DamagedRunError:
    return DamagedRunError(f"{where.file.filename} is damaged: {fault}. Restore a good copy, or recover it")
