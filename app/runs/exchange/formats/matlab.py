"""MATLAB files: up to version 7 by scipy, of version 7.3 by h5py."""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.runs.errors import ImportFileError
from app.runs.exchange.columns import ReportShare
from app.runs.exchange.csv_layout import FileLayout
from app.runs.exchange.formats.hdf5 import COLUMNS_MOST, open_matlab
from app.runs.exchange.tables import LARGEST_BYTES, Table


def open_table(path: Path, _layout: FileLayout, _report: ReportShare) -> Table:
    """Vectors by their names, columns of a matrix as `name:0`, fields of a struct as `name.field`."""
    from scipy.io import loadmat, whosmat  # a third of a second that only this format needs

    with path.open("rb") as file:
        if file.read(128)[124:128] in (b"\x00\x02IM", b"\x02\x00MI"):
            return open_matlab(path)
    if sum(8 * math.prod(shape) for _, shape, _ in whosmat(path)) > LARGEST_BYTES:
        raise ImportFileError("{path} holds more numbers than can be loaded. Save a part of them", path=path)
    content = loadmat(path, simplify_cells=True)
    vectors = dict(_vectors("", {k: v for k, v in content.items() if not k.startswith("__")}))
    values = list(vectors.values())
    return Table(list(vectors), values.__getitem__)


def _vectors(name: str, value: Any) -> Iterator[tuple[str, NDArray[np.float64]]]:
    if isinstance(value, dict):
        for key, item in value.items():
            yield from _vectors(f"{name}.{key}" if name else str(key), item)
    elif isinstance(value, np.ndarray) and value.dtype.kind in "iuf" and value.ndim in (1, 2):
        if value.ndim == 1 or 1 in value.shape:
            yield name, value.ravel().astype(np.float64)
        else:
            columns = value.T if value.shape[1] <= COLUMNS_MOST else value[:COLUMNS_MOST]
            yield from ((f"{name}:{i}", column.astype(np.float64)) for i, column in enumerate(columns))
