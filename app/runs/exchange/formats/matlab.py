"""MATLAB files: up to version 7 by scipy, of version 7.3 by h5py."""

import functools
import io
import math
import struct
import zlib
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.runs.errors import ImportFileError
from app.runs.exchange.columns import ReportShare
from app.runs.exchange.csv_layout import FileLayout
from app.runs.exchange.formats.hdf5 import COLUMNS_MOST, open_matlab
from app.runs.exchange.tables import Table, check_count

_HEADER_BYTES = 128
_COMPRESSED = 15  # type of an element (MathWorks, "MAT-File Format", table 1-1)
_PIECE_BYTES = 1 << 16
_STRUCT_BYTES = 1 << 26
"""Of all structs, unpacked: the fields of a struct are known only when all of it is loaded."""
_NUMBERS = (
    "double",
    "single",
    "logical",
    *(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)),
)


class _Column(NamedTuple):
    name: str
    rows: int
    read: Callable[[], NDArray[Any]]


def open_table(path: Path, layout: FileLayout, _report: ReportShare) -> Table:
    """Vectors by their names, columns of a matrix as `name:0`, fields of a struct as `name.field`."""
    from scipy.io import whosmat  # a third of a second that only this format needs

    with path.open("rb") as file:
        if file.read(_HEADER_BYTES)[124:] in (b"\x00\x02IM", b"\x02\x00MI"):
            return open_matlab(path)
    columns: list[_Column] = []
    load = functools.lru_cache(maxsize=1)(partial(_load, path))  # columns of a matrix come one by one
    left_bytes = _STRUCT_BYTES
    for number, (name, shape, kind) in enumerate(whosmat(path)):
        if kind in _NUMBERS and not name.startswith("__"):
            columns += _columns(name, shape, partial(load, name, shape))
        elif kind == "struct" and (size_bytes := _unpacked_bytes(path, number, left_bytes)) <= left_bytes:
            left_bytes -= size_bytes
            for field, values in _fields(name, load(name, shape)):
                columns += _columns(field, values.shape, partial(np.asarray, values))
        elif kind == "struct" and any(wanted.startswith(f"{name}.") for _, wanted in layout.wanted):
            raise ImportFileError(
                "{path}: structs up to {name} take more than {megabytes} MB. Save its fields as variables",
                path=path,
                name=name,
                megabytes=_STRUCT_BYTES >> 20,
            )
    names, lengths = [one.name for one in columns], [one.rows for one in columns]
    return Table(names, lambda at: columns[at].read(), lengths=lengths)


def _columns(name: str, shape: tuple[int, ...], read: Callable[[], NDArray[Any]]) -> Iterator[_Column]:
    """Columns of a vector or matrix; its rows, where it has too many columns."""
    sides = [side for side in shape if side != 1]
    if len(sides) == 1:
        yield _Column(name, sides[0], lambda: read().ravel())
    elif len(sides) == 2:
        is_by_column = sides[1] <= COLUMNS_MOST
        rows, width = sides if is_by_column else reversed(sides)
        for at in range(min(width, COLUMNS_MOST)):
            yield _Column(f"{name}:{at}", rows, partial(_column, read, at, is_by_column=is_by_column))


def _column(read: Callable[[], NDArray[Any]], at: int, *, is_by_column: bool) -> NDArray[Any]:
    matrix = np.squeeze(read())
    return np.array(matrix[:, at] if is_by_column else matrix[at])


def _fields(name: str, value: Any) -> Iterator[tuple[str, NDArray[Any]]]:
    """Arrays of numbers in a struct, also in those within it."""
    if isinstance(value, dict):
        for key, item in value.items():
            yield from _fields(f"{name}.{key}", item)
    elif isinstance(value, np.ndarray) and value.dtype.kind in "iuf":
        yield name, value


def _load(path: Path, name: str, shape: tuple[int, ...]) -> Any:
    """A variable. Raises ImportFileError for a matrix that is too large, whichever of its columns is read."""
    from scipy.io import loadmat

    check_count(path, math.prod(shape))
    return loadmat(path, variable_names=[name], simplify_cells=True)[name]


def _unpacked_bytes(path: Path, number: int, most: int) -> int:
    """Size of a variable, counted from 0, of a file of version 5; some size above `most` if it is larger."""
    with path.open("rb") as file:
        tag = struct.Struct("<II" if file.read(_HEADER_BYTES).endswith(b"IM") else ">II")
        for _ in range(number):
            _, size_bytes = tag.unpack(file.read(tag.size))
            file.seek(size_bytes, io.SEEK_CUR)
        kind, size_bytes = tag.unpack(file.read(tag.size))
        if kind != _COMPRESSED:
            return int(size_bytes)
        unpacker, unpacked = zlib.decompressobj(), 0
        while size_bytes > 0 and unpacked <= most:
            data = file.read(min(size_bytes, _PIECE_BYTES))
            unpacked += len(unpacker.decompress(data))
            size_bytes -= len(data) or size_bytes
    return unpacked
