"""HDF5 files of other programs, and MATLAB files of version 7.3, by h5py."""

import math
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np
from numpy.typing import NDArray

from app.runs.errors import ImportFileError
from app.runs.exchange.columns import ReportShare
from app.runs.exchange.csv_layout import FileLayout
from app.runs.exchange.tables import Table

COLUMNS_MOST = 256
"""Columns of a matrix: where there are more, its rows are the channels."""
_UNIT_ATTRIBUTES = ("units", "unit", "Unit", "Units", "UNIT")
_MATLAB_OWN = "#"  # begins the names of groups that MATLAB keeps for itself
_MATLAB_TEXT = "MATLAB_int_decode"
"""Attribute of what is no number in MATLAB, such as a text or a truth value."""


class _Column(NamedTuple):
    name: str
    unit: str
    rows: int
    read: Callable[[h5py.File], NDArray[Any]]


def open_table(path: Path, _layout: FileLayout, _report: ReportShare) -> Table:
    """Datasets by their paths, columns of a matrix as `path:0`, fields of a compound as `path.field`."""
    with h5py.File(path, "r", locking=False) as file:
        if "slipstand_schema" in file.attrs:
            raise ImportFileError(
                "{path} is a run of Slipstand already. Copy it to the other runs", path=path
            )
        return _table(path, [one for dataset in _datasets(file) for one in _columns(dataset)])


def open_matlab(path: Path) -> Table:
    """Variables by their names as of older MATLAB files: `x`, `X:0`, `S.u1`."""
    with h5py.File(path, "r", locking=False) as file:
        return _table(path, [one for dataset in _datasets(file) for one in _matlab_columns(dataset)])


def _table(path: Path, columns: list[_Column]) -> Table:
    if not columns:
        raise ImportFileError("{path} holds no columns of numbers. Export them as datasets", path=path)

    def column(at: int) -> NDArray[Any]:
        with h5py.File(path, "r", locking=False) as file:
            return columns[at].read(file)

    names, units = [one.name for one in columns], [one.unit for one in columns]
    return Table(names, column, units=units, lengths=[one.rows for one in columns])


def _datasets(file: h5py.File) -> Iterator[h5py.Dataset]:
    """Plain datasets; what other files hold is left out, so that no file is read that nobody gave."""
    found: list[h5py.Dataset] = []

    def visit(_name: str, item: object) -> None:
        if isinstance(item, h5py.Dataset) and not item.is_virtual and not item.external:
            found.append(item)

    file.visititems(visit)
    yield from found


def _columns(dataset: h5py.Dataset) -> Iterator[_Column]:
    path, unit, kind = dataset.name, _unit(dataset), dataset.dtype
    name = path.strip("/")
    if kind.names and dataset.ndim == 1:
        for field in kind.names:
            if kind[field].kind in "iuf" and not kind[field].shape:
                yield _Column(f"{name}.{field}", "", _rows(dataset, 0), partial(_read_field, path, field))
    elif kind.kind in "iuf" and dataset.ndim == 1:
        yield _Column(name, unit, _rows(dataset, 0), partial(_read_vector, path))
    elif kind.kind in "iuf" and dataset.ndim == 2:
        yield from _of_matrix(dataset, name, unit, is_by_column=False)


def _matlab_columns(dataset: h5py.Dataset) -> Iterator[_Column]:
    """MATLAB keeps the columns of a matrix as rows."""
    name = dataset.name.strip("/").replace("/", ".")
    is_number = dataset.dtype.kind in "iuf" and _MATLAB_TEXT not in dataset.attrs
    if (
        is_number
        and dataset.ndim == 2
        and not name.startswith(_MATLAB_OWN)
        and "MATLAB_empty" not in dataset.attrs
    ):
        yield from _of_matrix(dataset, name, "", is_by_column=True)


def _of_matrix(dataset: h5py.Dataset, name: str, unit: str, *, is_by_column: bool) -> Iterator[_Column]:
    path, shape = dataset.name, dataset.shape
    if 1 in shape:
        yield _Column(name, unit, _rows(dataset, shape.index(max(shape))), partial(_read_vector, path))
        return
    if shape[0 if is_by_column else 1] > COLUMNS_MOST:
        is_by_column = not is_by_column
    rows = _rows(dataset, 1 if is_by_column else 0)
    for at in range(min(shape[0 if is_by_column else 1], COLUMNS_MOST)):
        read = partial(_read_row if is_by_column else _read_column, path, at)
        yield _Column(f"{name}:{at}", unit, rows, read)


def _rows(dataset: h5py.Dataset, along: int) -> int:
    """Length along a dimension; of a dataset that unpacks larger chunks, as if it were one of them."""
    return max(int(dataset.shape[along]), math.prod(dataset.chunks or (1,)))


def _unit(dataset: h5py.Dataset) -> str:
    for name in _UNIT_ATTRIBUTES:
        value = dataset.attrs.get(name)
        if isinstance(value, bytes):
            value = value.decode("utf-8", "replace")
        if isinstance(value, str):
            return value
    return ""


def _read_vector(path: str, file: h5py.File) -> NDArray[Any]:
    return np.ravel(file[path][()])


def _read_field(path: str, field: str, file: h5py.File) -> NDArray[Any]:
    return np.asarray(file[path].fields(field)[:])


def _read_row(path: str, at: int, file: h5py.File) -> NDArray[Any]:
    return np.asarray(file[path][at, :])


def _read_column(path: str, at: int, file: h5py.File) -> NDArray[Any]:
    return np.asarray(file[path][:, at])
