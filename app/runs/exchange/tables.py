"""A foreign file that is open: columns by name, their units, and a time axis where the format has one."""

import datetime
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.runs.exchange.units import unit_in_name
from messages.message import Message, message

SHOWN_ROWS = 8
LARGEST_BYTES = 4 << 30  # a file that unpacks to more than this is refused before it is unpacked


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

    def unit(self, at: int) -> str:
        """Unit of a column, beside its name or in it; "" without one."""
        return (self.units[at] if at < len(self.units) else "") or unit_in_name(self.names[at])
