"""Excel workbooks, by openpyxl."""

import contextlib
import datetime
import math
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.runs.errors import ImportFileError
from app.runs.exchange.columns import cell_fault
from app.runs.exchange.content import import_optional
from app.runs.exchange.csv_layout import MISSING_MARKS, CsvOptions
from app.runs.exchange.tables import LARGEST_BYTES, Table
from app.runs.exchange.units import parse_unit
from messages.i18n import N_
from messages.message import Message, message, option

_Rows = list[tuple[Any, ...]]


def open_table(path: Path, layout: CsvOptions) -> Table:
    """Columns of the first sheet that has those asked for. Raises ImportFileError, ExtraMissingError."""
    with zipfile.ZipFile(path) as archive:
        if sum(entry.file_size for entry in archive.infolist()) > LARGEST_BYTES:
            raise ImportFileError("{path} unpacks to more than can be loaded. Export it as CSV", path=path)
    book = import_optional("openpyxl", "Excel").load_workbook(path, read_only=True, data_only=True)
    with contextlib.closing(book):
        sheet, header, rows = _sheet(path, book, layout)
    first = layout.skip + (2 if layout.header else 1)
    units: list[str] = []
    if layout.header and len(rows) > 1 and _is_unit_row(rows[0]):
        units, first = ["" if cell is None else str(cell).strip("[]() ") for cell in rows.pop(0)], first + 1
    width = max(len(header), *(len(row) for row in rows))
    names = [*header, *[""] * (width - len(header))]

    def row_label(row: int) -> Message:
        return message("sheet {sheet}, row {row}", sheet=sheet, row=first + row)

    def number(row: int, at: int) -> float:
        cell = rows[row][at] if at < len(rows[row]) else None
        if cell is None or (isinstance(cell, str) and cell.strip().lower() in MISSING_MARKS):
            return math.nan
        if isinstance(cell, bool) or not isinstance(cell, int | float):
            remedy = message("Correct it, or leave the cell empty if there is no reading")
            fault = message("{cell!r} is not a number. {remedy}", cell=str(cell)[:40], remedy=remedy)
            raise cell_fault(path, row_label(row), names[at] or str(at), fault)
        return float(cell)

    def column(at: int) -> NDArray[Any]:
        cells: list[Any] = [row[at] if at < len(row) else None for row in rows]
        if all(isinstance(cell, datetime.datetime) for cell in cells):
            return np.array(cells, "M8[us]")
        if all(isinstance(cell, datetime.time) for cell in cells):
            midnight = datetime.date(1970, 1, 1)
            return np.array([datetime.datetime.combine(midnight, cell) for cell in cells], "M8[us]").astype(
                "m8[us]"
            )
        return np.array([number(row, at) for row in range(len(rows))])

    return Table(names, column, row_label, units)


def _is_unit_row(row: tuple[Any, ...]) -> bool:
    texts = [cell for cell in row if cell is not None]
    return bool(texts) and all(isinstance(cell, str) and parse_unit(cell) is not None for cell in texts)


def _sheet(path: Path, book: Any, layout: CsvOptions) -> tuple[str, list[str], _Rows]:
    """Name, header and rows of the first sheet that has the columns, or of the first one."""
    found: list[tuple[str, list[str], _Rows]] = []
    for sheet in book.worksheets:
        rows = list(sheet.iter_rows(min_row=layout.skip + 1, values_only=True))
        head = rows[0] if layout.header and rows else ()
        header = ["" if cell is None else str(cell).strip() for cell in head]
        rows = rows[1:] if layout.header else rows
        while rows and all(cell is None for cell in rows[-1]):
            rows.pop()
        if rows:
            found.append((str(sheet.title), header, rows))
        if rows and all(name.strip() in header for _, name in layout.wanted):
            return found[-1]
    if not found:
        template = N_("{path} holds no rows. Give a workbook with numbers, and check {option}")
        raise ImportFileError(template, path=path, option=option("--skip"))
    return found[0]
