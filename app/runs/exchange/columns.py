"""Columns of numbers out of a foreign file, of whatever kind it is."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from app.runs.errors import ImportFileError
from messages.i18n import N_
from messages.message import Message, message


@dataclass(frozen=True, eq=False, slots=True)
class ForeignColumns:
    """What was asked of a foreign file."""

    path: Path
    values: NDArray[np.float64]
    """(n, 2 or 3) float64: time, table and perhaps the second gauge, as written; NaN where absent."""
    names: list[str]
    row_label: Callable[[int], Message]
    """Names a row of `values` as the file counts it: `line 4`."""

    def fault(self, row: int, column: int, fault: Message) -> ImportFileError:
        return cell_fault(self.path, self.row_label(row), self.names[column], fault)

    def check(self) -> None:
        """Refuse what cannot be a record. Raises ImportFileError."""
        endless = np.argwhere(np.isinf(self.values))
        if len(endless):
            row, column = endless[0]
            fault = message("the number is infinite. Leave the cell empty if there is no reading")
            raise self.fault(row, column, fault)
        absent = np.flatnonzero(np.isnan(self.values[:, 0]))
        if len(absent):
            raise self.fault(absent[0], 0, message("the time is missing. Give it or delete the line"))


def cell_fault(path: Path, row_label: Message, column: str, fault: Message) -> ImportFileError:
    """Error in one cell of a foreign file."""
    template = N_("{path}, {row_label}, column {names}: {fault}")
    return ImportFileError(template, path=path, row_label=row_label, names=column, fault=fault)


_OF_TIME_AND_GAUGES = ("the time", "gauge 1", "gauge 2")


def find_columns(path: Path, wanted: list[str], names: list[str], width: int) -> list[int]:
    """Positions of the columns of time, gauge 1 and perhaps gauge 2. Raises ImportFileError."""
    found: list[int] = []
    for one, name in zip(_OF_TIME_AND_GAUGES, wanted, strict=False):
        at = _find_column(path, name, names, width)
        if at in found:
            other = _OF_TIME_AND_GAUGES[found.index(at)]
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
    there = ", ".join(filter(None, names)) or f"numbers 0 to {width - 1}"
    raise ImportFileError(
        "{path} has no column {wanted!r}. Choose from: {there}", path=path, wanted=wanted, there=there
    )
