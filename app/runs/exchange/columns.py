"""Columns of numbers out of a foreign file, of whatever kind it is."""

import datetime
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from app.runs.errors import ImportFileError
from messages.i18n import N_
from messages.message import Message, message

Floats = NDArray[np.float64]
ReportShare = Callable[[float], object]
"""Is called with the share of a file that has been read, which grows at least every few seconds."""
_SHOWN_NAMES, _SHOWN_CHARACTERS = 20, 40  # columns in a message, and of the name of each


def part_of(report: ReportShare, first: float, last: float) -> ReportShare:
    """What reports the share of a part of the work that goes from one share of the whole to another."""
    return lambda share: report(first + (last - first) * share)


@dataclass(eq=False, slots=True)
class ForeignColumns:
    """What was asked of a foreign file."""

    path: Path
    time: Floats
    """(n,) float64: as written, or seconds since the first stamp; NaN where absent."""
    cells: list[Floats]
    """One or two of (n,) float64: table and perhaps the second gauge, as written; NaN where absent."""
    names: list[str]
    """Of time and gauges."""
    row_label: Callable[[int], Message]
    """Names a row as the file counts it: `line 4`."""
    units: list[str] = field(default_factory=list)
    """Of time and gauges as the file names them; "" where it does not. The time of stamps is in s."""
    start: datetime.datetime | None = None
    """Time of day at the time 0 of `time`, where the file tells it."""
    is_stamped: bool = False
    """Whether times are seconds since the first of the file's date-times, or the file's own axis."""
    is_even: bool = False
    """Whether the times were made of a rate, and thus are exactly even."""
    interval_uncertainty: float = 0.0
    """Relative standard uncertainty of the row interval, where that was worked out from rounded stamps."""
    notes: list[Message] = field(default_factory=list)
    """What was concluded or left out."""

    @property
    def values(self) -> Floats:
        """(n, 2 or 3) float64: time and gauges."""
        return np.column_stack([self.time, *self.cells])

    def __len__(self) -> int:
        return len(self.time)

    def fault(self, row: int, column: int, fault: Message) -> ImportFileError:
        return cell_fault(self.path, self.row_label(row), self.names[column], fault)

    def leave_out(self, values: Iterable[float]) -> None:
        """Make readings of these values absent ones."""
        for value in values:
            self.cells = [np.where(cells == value, np.nan, cells) for cells in self.cells]

    def check(self) -> None:
        """Refuse what cannot be a record. Raises ImportFileError."""
        fault = message("the number is infinite. Leave the cell empty if there is no reading")
        for number, values in enumerate([self.time, *self.cells]):
            endless = np.isinf(values)
            if endless.any():
                raise self.fault(int(np.flatnonzero(endless)[0]), number, fault)
        absent = np.isnan(self.time)
        if absent.any():
            fault = message("the time is missing. Give it or delete the line")
            raise self.fault(int(np.flatnonzero(absent)[0]), 0, fault)


def cell_fault(path: Path, row_label: Message, column: str, fault: Message) -> ImportFileError:
    """Error in one cell of a foreign file."""
    template = N_("{path}, {row_label}, column {names}: {fault}")
    return ImportFileError(template, path=path, row_label=row_label, names=column, fault=fault)


TIME, DATE, TABLE, SECOND = (
    message("the time"), message("the date"), message("gauge 1"), message("gauge 2")
)  # fmt: skip


def find_columns(path: Path, wanted: list[tuple[Message, str]], names: list[str], width: int) -> list[int]:
    """Positions of columns by what they hold and their name or number. Raises ImportFileError."""
    found: list[int] = []
    for one, name in wanted:
        at = _find_column(path, name, names, width)
        if at in found:
            other = wanted[found.index(at)][0]
            template = N_("column {name!r} is given for {other} and {one}. Give each its own")
            raise ImportFileError(template, name=name, other=other, one=one)
        found.append(at)
    return found


def _find_column(path: Path, wanted: str, names: list[str], width: int) -> int:
    name = wanted.strip().lstrip("\ufeff")
    count = names.count(name)
    if name and count > 1:
        template = N_("{path} has {count} columns named {name!r}. Give its number, from 0")
        raise ImportFileError(template, path=path, count=count, name=name)
    if name and count:
        return names.index(name)
    if name.isdecimal() and int(name) < width:
        return int(name)
    named = [one[:_SHOWN_CHARACTERS] for one in names if one]
    if len(named) > _SHOWN_NAMES:
        raise ImportFileError(
            "{path} has no column {wanted!r}. Choose one of {count}: {there}, ...",
            path=path,
            wanted=wanted,
            count=len(named),
            there=", ".join(named[:_SHOWN_NAMES]),
        )
    there = ", ".join(named) or f"numbers 0 to {width - 1}"
    raise ImportFileError(
        "{path} has no column {wanted!r}. Choose from: {there}", path=path, wanted=wanted, there=there
    )
