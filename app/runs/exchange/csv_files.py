"""CSV: samples with all their digits, absent readings empty; coefficients in a file of their own beside."""

import csv
import re
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from app.runs.disk import atomic_write
from app.runs.exchange.content import COEFFICIENT_COLUMNS, ExportedRun, SampleColumn, coefficient_rows

_ROWS_AT_ONCE = 10_000
_FORMULA = re.compile(
    r"^(?=[\t\r\n])|(?:^|(?<=[;\t\r\n]))(?=(?:[^\S\t\r\n]|[\ufeff\u200b])*[=+\-@＝＋－＠−﹢﹣﹦﹫])"
)
"""Where a spreadsheet could begin to read a formula: at the beginning, behind blanks that it may leave out,
and behind what it may take for the end of a cell; full-width signs count as signs in some countries."""


def write_samples(columns: Sequence[SampleColumn], path: Path, *, replace: bool = False) -> None:
    """Write columns of samples. Raises RunExistsError, DiskFullError, WriteError."""
    with (
        atomic_write(path.absolute(), replace=replace) as made,
        made.open("x", encoding="utf-8", newline="") as file,
    ):
        file.writelines(_lines(columns))


def write_coefficients(runs: Iterable[ExportedRun], path: Path, *, replace: bool = False) -> None:
    """Write a line a quantity. Raises RunExistsError, DiskFullError, WriteError."""
    with (
        atomic_write(path.absolute(), replace=replace) as made,
        made.open("x", encoding="utf-8", newline="") as file,
    ):
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COEFFICIENT_COLUMNS)
        for exported in runs:
            writer.writerows([csv_cell(value) for value in row] for row in coefficient_rows(exported))


def csv_cell(value: Any) -> str:
    """Text that no spreadsheet takes for a formula; numbers with all their digits."""
    if value is None:
        return ""
    if not isinstance(value, str):
        return repr(value)
    return _FORMULA.sub("'", value)


def _lines(columns: Sequence[SampleColumn]) -> Iterator[str]:
    yield ",".join(column.name for column in columns) + "\n"
    for first in range(0, len(columns[0].values), _ROWS_AT_ONCE):
        rows = slice(first, first + _ROWS_AT_ONCE)
        cells = [_cells(column, rows) for column in columns]
        for row in zip(*cells, strict=True):
            yield ",".join(row) + "\n"


def _cells(column: SampleColumn, rows: slice) -> list[str]:
    values = column.values[rows]
    if values.dtype.kind != "f":
        return [str(x) for x in values.tolist()]
    return ["" if x != x else repr(x) for x in values.astype(np.float64).tolist()]
