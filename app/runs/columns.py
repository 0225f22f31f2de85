"""Columns of an open run file: their paths, the rows to trust, and their checksums.

HDF5 has checksums only for datasets with filters, and those do not survive a `kill -9` while they grow
(docs/decisions/0016). So the CRC-32 of each column is kept in the file when the run is closed.
"""

import zlib
from pathlib import Path
from typing import Any

import h5py
from numpy.typing import NDArray

from app.runs import schema
from app.runs.errors import DamagedRunError
from app.runs.fields import read_number, read_text, to_python
from messages.i18n import N_

_ROWS_AT_ONCE = 1 << 18
"""2 MiB of float64: enough for the speed of the disk, and room in the cache of a processor."""


def is_finished(file: h5py.File) -> bool:
    """Tell whether the run was closed in good order."""
    return bool(read_text(file, schema.ENDED))


def signal_paths(file: h5py.File) -> list[str]:
    """Columns of the calibrated readings, gauge 1 first."""
    attributes = file[schema.MOTION].attrs
    leaves = [attributes["signal"], *attributes.get("auxiliary_signals", [])]
    return [f"{schema.MOTION}/{to_python(leaf)}" for leaf in leaves]


def count_paths(file: h5py.File) -> list[str]:
    """Columns of the readings as received; none in a simulated run."""
    return [path for path in map(schema.count_path, range(len(schema.GAUGES))) if path in file]


def sample_paths(file: h5py.File) -> list[str]:
    """All columns with a row a sample."""
    return [schema.TIME, schema.STATUS, *signal_paths(file), *count_paths(file)]


def stored_rows(file: h5py.File) -> int:
    """Rows that can be trusted: all of a finished run, else those that were flushed for certain."""
    lengths = [len(file[path]) for path in sample_paths(file)]
    return min([int(file[schema.STORED][()]), *lengths])


def checksum(dataset: h5py.Dataset) -> int:
    """CRC-32 of a column's bytes, read a piece at a time."""
    value = 0
    for first in range(0, len(dataset), _ROWS_AT_ONCE):
        value = zlib.crc32(dataset[first : first + _ROWS_AT_ONCE].data, value)
    return value


def read_column(dataset: h5py.Dataset, rows: slice) -> NDArray[Any]:
    """Read rows of a column; all rows are checked by their checksum. Raises DamagedRunError."""
    values: NDArray[Any] = dataset[rows]
    if len(values) == len(dataset) and is_finished(dataset.file):
        check_column(dataset, zlib.crc32(values.data), dataset.file.filename)
    return values


def check_samples(file: h5py.File) -> None:
    """Compare the checksums of all columns of samples with the stored ones. Raises DamagedRunError."""
    if is_finished(file):
        for path in sample_paths(file):
            check_column(file[path], checksum(file[path]), file.filename)


def check_column(dataset: h5py.Dataset, value: int, run: Path | str) -> None:
    """Compare the checksum of a column of the finished `run` with the stored one. Raises DamagedRunError."""
    stored = read_number(dataset.file, schema.checksum_path(dataset.name.lstrip("/")))
    if stored is not None and stored != value:
        template = N_(
            "{run} is damaged: {column} is not what was stored, by its checksum. Restore a good copy"
        )
        raise DamagedRunError(template, run=run, column=dataset.name)
