"""Columns of numbers out of a CSV file: quickly where all is well, else cell by cell to name the fault."""

import csv
import io
import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from app.runs.csv_layout import CsvLayout, CsvText, Line, is_data, lines_from, open_csv, to_number
from app.runs.errors import ImportFileError
from app.runs.foreign_columns import ForeignColumns


def read_columns(path: Path, layout: CsvLayout) -> ForeignColumns:
    """Read time and gauges from a CSV file.

    Raises
    ------
    ImportFileError
        Names the line and column of a cell that is not a number, or a cut line.
    """
    source = open_csv(path, layout)
    values = _quick(source)
    if values is None:
        values = _thorough(source)
    names = [source.column_name(i) for i in source.columns]
    columns = ForeignColumns(path, values, names, lambda row: f"line {_data_lines(source)[row].number}")
    columns.check()
    return columns


def _quick(source: CsvText) -> NDArray[np.float64] | None:
    """All numbers by numpy's own reader; None where it finds anything but numbers and empty cells."""
    body = source.text[source.data.offset :]
    if source.decimal == ",":
        if "." in body:
            return None
        body = body.replace(",", ".")
    values = _load(source, body)
    if values is None and source.delimiter != " ":
        values = _load(source, _with_nan(body, source.delimiter))
    return None if values is None or np.isnan(values[:, 0]).any() else values


def _load(source: CsvText, body: str) -> NDArray[np.float64] | None:
    try:
        return np.loadtxt(
            io.StringIO(body),
            delimiter=None if source.delimiter == " " else source.delimiter,
            usecols=source.columns,
            comments=None,
            quotechar='"' if '"' in body else None,
            ndmin=2,
        )
    except (ValueError, IndexError):
        return None


def _with_nan(body: str, delimiter: str) -> str:
    """Text with `nan` in its empty cells."""
    for _ in range(2):  # the first round leaves every other one of several in a row
        body = body.replace(delimiter * 2, f"{delimiter}nan{delimiter}")
    return f"{body}\n".replace(f"{delimiter}\n", f"{delimiter}nan\n").replace(
        f"\n{delimiter}", f"\nnan{delimiter}"
    )


def _thorough(source: CsvText) -> NDArray[np.float64]:
    rows = [_row(source, line) for line in _data_lines(source)]
    return np.array(rows, dtype=np.float64)


def _data_lines(source: CsvText) -> list[Line]:
    lines = lines_from(source.text, source.data.number, source.data.offset)
    blank = "" if source.delimiter == " " else source.delimiter
    return [line for line in lines if is_data(line.text) and line.text.strip(f"{blank} \t")]


def _row(source: CsvText, line: Line) -> list[float]:
    cells = _cells(line.text, source.delimiter)
    values = []
    for position in source.columns:
        name = source.column_name(position)
        if position >= len(cells):
            raise _fault(
                source, line.number, name, f"the line has only {len(cells)} cells. Complete it or delete it"
            )
        values.append(_value(source, line, name, cells[position].strip()))
    return values


def _cells(text: str, delimiter: str) -> list[str]:
    if delimiter == " ":
        return text.split()
    return next(csv.reader([text], delimiter=delimiter)) if '"' in text else text.split(delimiter)


def _value(source: CsvText, line: Line, name: str, cell: str) -> float:
    if not cell:
        return math.nan
    try:
        return to_number(cell, source.decimal)
    except ValueError:
        pass
    remedy = "Correct it, or leave the cell empty if there is no reading"
    if "," in cell and source.decimal == ".":
        remedy = "If that is a decimal comma, add --decimal ,"
    elif line.number == source.data.number:
        remedy = f"If the numbers begin below this line, add --no-header --skip {line.number}"
    raise _fault(source, line.number, name, f"{cell!r} is not a number. {remedy}")


def _fault(source: CsvText, line: int, column: str, fault: str) -> ImportFileError:
    return ImportFileError(f"{source.path}, line {line}, column {column}: {fault}")
