"""Block averages of a stream of readings, to about 500 Hz: enough for the screen and the running fit."""

import numpy as np
from numpy.typing import NDArray

from analysis.arrays import Floats
from analysis.record import Record

AVERAGED_RATE_HZ = 500.0
"""A period of 0.3 s then has 150 samples; the joint fit of a live record takes milliseconds."""


class BlockAverager:
    """Means of blocks of `count` consecutive rows; 1 keeps the rows."""

    def __init__(self, count: int) -> None:
        self._count = max(1, count)
        self._parts: list[Floats] = []
        self._rest = np.empty((3, 0))

    def add(self, time_s: Floats, table_m: Floats, relative_m: Floats) -> None:
        """Append rows (n,) that follow the last ones without a gap; NaN where there is no reading."""
        rows = np.hstack((self._rest, np.stack((time_s, table_m, relative_m))))
        whole = rows.shape[1] // self._count * self._count
        self._rest = rows[:, whole:]
        self._parts.append(block_means(rows[:, :whole], self._count))

    def discard_partial(self) -> None:
        """Drop the rows of an incomplete block, because rows are missing after them."""
        self._rest = np.empty((3, 0))

    @property
    def columns(self) -> Floats:
        """Time (s) and both displacements (m), (3, m). A mean is NaN where one of its rows is."""
        if len(self._parts) != 1:
            self._parts = [np.hstack(self._parts) if self._parts else np.empty((3, 0))]
        return self._parts[0]


def block_size(rate_hz: float) -> int:
    """Rows of a block at `rate_hz`."""
    return max(1, int(rate_hz / AVERAGED_RATE_HZ))


def average_record(record: Record) -> Record:
    """Return the record averaged to about 500 Hz."""
    rows = len(record.time_s)
    count = block_size((rows - 1) / float(record.time_s[-1] - record.time_s[0])) if rows > 1 else 1
    if count < 2:
        return record
    whole, relative = rows // count * count, record.relative_displacement_m
    table = mask(record.table_displacement_m, record.table_overload)
    if relative is not None:
        relative = block_means(mask(relative, record.relative_overload)[:whole], count)
    return record.replace(
        time_s=block_means(record.time_s[:whole], count),
        table_displacement_m=block_means(table[:whole], count),
        relative_displacement_m=relative,
        table_overload=None,
        relative_overload=None,
    )


def block_means(values: Floats, count: int) -> Floats:
    """Means of `count` neighbours along the last axis. Its length must be a multiple of `count`."""
    return np.asarray(values.reshape(*values.shape[:-1], -1, count).mean(axis=-1))


def mask(values: Floats, absent: NDArray[np.bool_] | None) -> Floats:
    """Return values with NaN where `absent`."""
    return values if absent is None else np.where(absent, np.nan, values)
