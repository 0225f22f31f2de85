"""Checksums of the columns, kept in the run file: a bit that flips on a disk must not pass for a reading.

HDF5 has checksums of its own only for datasets that go through its filters, and those do not survive a
`kill -9` while they grow (docs/decisions/0016).
"""

import zlib
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from app.runs import schema as names
from app.runs.errors import DamagedRunError
from app.runs.validation import is_finished

_ROWS_AT_ONCE = 1 << 20


def checksum(dataset: h5py.Dataset) -> int:
    """CRC-32 of a column's bytes, read a piece at a time."""
    value = 0
    for first in range(0, len(dataset), _ROWS_AT_ONCE):
        value = zlib.crc32(dataset[first : first + _ROWS_AT_ONCE].data, value)
    return value


def reserve_checksum(file: h5py.File, column: str) -> None:
    """Make room for the checksum of a column, which is known when the run is closed."""
    file.create_dataset(names.checksum_path(column), data=np.uint32(0))


def keep_checksum(file: h5py.File, column: str, value: int) -> None:
    """Fill the room."""
    file[names.checksum_path(column)][()] = value


def read_column(dataset: h5py.Dataset, rows: slice) -> NDArray[Any]:
    """Rows of a column; where they are all of a finished run, only if they are what was stored.

    Raises
    ------
    DamagedRunError
        They are not.
    """
    values: NDArray[Any] = dataset[rows]
    if len(values) == len(dataset) and is_finished(dataset.file):
        check_column(dataset, zlib.crc32(values.data), dataset.file.filename)
    return values


def check_column(dataset: h5py.Dataset, value: int, run: Path | str) -> None:
    """Hold the checksum of a column of a finished run against that which was kept when it was closed.

    Parameters
    ----------
    dataset : h5py.Dataset
    value : int
        Its checksum now.
    run : Path or str
        What to call the file.

    Raises
    ------
    DamagedRunError
        It is another. Runs from before there were checksums are taken as they are.
    """
    kept = names.read_number(dataset.file, names.checksum_path(dataset.name.lstrip("/")))
    if kept is not None and kept != value:
        raise DamagedRunError(
            f"{run} is damaged: {dataset.name} is not what was stored, by its checksum. Restore a good copy"
        )
