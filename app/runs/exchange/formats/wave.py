"""WAV files, by scipy."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.runs.exchange.columns import ReportShare
from app.runs.exchange.csv_layout import FileLayout
from app.runs.exchange.tables import Table, TimeAxis, check_file_size, even_axis


def open_table(path: Path, _layout: FileLayout, _report: ReportShare) -> Table:
    """Channels by their numbers from 0; a cell of 1 is full scale."""
    from scipy.io import wavfile  # a third of a second that only this format needs

    check_file_size(path)
    rate_hz, data = wavfile.read(path)
    data = data[:, np.newaxis] if data.ndim == 1 else data

    def column(at: int) -> NDArray[Any]:
        values = data[:, at].astype(np.float64)
        if data.dtype.kind == "f":
            return values
        full = 2.0 ** (8 * data.dtype.itemsize - 1)
        return (values - full if data.dtype.kind == "u" else values) / full

    def axis(_at: int) -> TimeAxis | None:
        return even_axis(len(data), 1.0 / rate_hz)

    names = [f"channel {at}" for at in range(data.shape[1])]
    lengths = [len(data)] * len(names)
    return Table(names, column, units=["full scale"] * len(names), axis=axis, has_axis=True, lengths=lengths)
