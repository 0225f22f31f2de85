"""A foreign file that is open: columns by name, their units, and a time axis where the format has one."""

import datetime
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.runs.errors import ImportFileError
from app.runs.exchange.units import unit_in_name
from messages.message import Message, message

SHOWN_ROWS = 8
NUMBERS_MOST = 1 << 25
"""Numbers that are loaded of a file, in all its columns. A library may show no progress meanwhile."""
_FILE_BYTES = 1 << 28  # of a file that its library loads whole
WIDTH_MOST = 16_384
"""Columns of a table, as many as a sheet of Excel has."""


@dataclass(frozen=True, eq=False, slots=True)
class TimeAxis:
    """Times that a format keeps beside a column."""

    time_s: NDArray[np.float64]
    """(n,) float64."""
    start: datetime.datetime | None = None
    """Time of day at the time 0, with zone."""
    is_even: bool = False
    """Whether the times are rows over a rate."""


def even_axis(
    rows: int, interval_s: float, first_s: float = 0.0, start: datetime.datetime | None = None
) -> TimeAxis:
    """Times of rows of one rate."""
    time_s = np.arange(rows, dtype=np.float64) * interval_s + first_s
    return TimeAxis(time_s, start, is_even=True)


def no_axis(_at: int) -> TimeAxis | None:
    """A format without times of its own."""
    return None


def row_label(row: int) -> Message:
    """Name a row by its number from 0."""
    return message("row {row}", row=row)


@dataclass(frozen=True, slots=True)
class Table:
    """A file that is open."""

    names: Sequence[str]
    """Of all columns; "" where a column has none."""
    column: Callable[[int], NDArray[Any]]
    """Reads a column (n,) by its number: float64, datetime64 or timedelta64. Raises ImportFileError."""
    row_label: Callable[[int], Message] = row_label
    units: Sequence[str] = ()
    """Of the columns, as the file names them beside their names; "" or absent where it does not."""
    axis: Callable[[int], TimeAxis | None] = no_axis
    """Reads the times that the format keeps beside a column."""
    has_axis: bool = False
    has_zone: bool = False
    """Whether date-times are in UTC; else they are in the zone of this computer."""
    first_rows: tuple[tuple[str, ...], ...] = ()
    """Cells of the first rows as text; none of a format that has no rows."""
    lengths: Sequence[int] = ()
    """Rows of each column, as the file declares them; absent where it does not."""

    def unit(self, at: int) -> str:
        """Unit of a column, beside its name or in it; "" without one."""
        return (self.units[at] if at < len(self.units) else "") or unit_in_name(self.names[at])

    def check_size(self, path: Path, positions: Sequence[int]) -> None:
        """Refuse columns that are too long, before they are read. Raises ImportFileError."""
        check_count(path, sum(self.lengths[at] for at in positions if at < len(self.lengths)))


def check_count(path: Path, count: int, most: int = NUMBERS_MOST) -> None:
    """Refuse columns that hold more numbers than can be loaded. Raises ImportFileError."""
    if count > most:
        raise ImportFileError(
            "{path}: the columns hold {count} numbers, too many to be loaded: {most} at most. Export a part",
            path=path,
            count=count,
            most=most,
        )


def check_file_size(path: Path) -> None:
    """Refuse a file that is too large to be loaded whole. Raises ImportFileError."""
    if path.stat().st_size > _FILE_BYTES:
        raise ImportFileError(
            "{path} has more than {megabytes} MB, too many to be loaded. Export a part of it",
            path=path,
            megabytes=_FILE_BYTES >> 20,
        )


def too_wide(path: Path, columns: int) -> ImportFileError:
    """Error for a table of so many columns."""
    return ImportFileError(
        "{path} has {columns} columns, more than {most}. Export those of the record",
        path=path,
        columns=columns,
        most=WIDTH_MOST,
    )
