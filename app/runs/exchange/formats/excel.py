"""Excel workbooks, by openpyxl."""

import contextlib
import datetime
import functools
import io
import itertools
import math
import re
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.runs.errors import ImportFileError
from app.runs.exchange.columns import ReportShare, cell_fault, find_columns, part_of
from app.runs.exchange.content import import_optional
from app.runs.exchange.csv_layout import FileLayout
from app.runs.exchange.stamps import (
    StampColumn,
    StampError,
    ambiguous_date,
    date_order,
    find_form,
    stamp_fault,
    to_datetime,
)
from app.runs.exchange.tables import SHOWN_ROWS, Table
from app.runs.exchange.units import parse_unit
from messages.i18n import N_
from messages.message import Message, message, option

_Row = tuple[Any, ...]
_ROWS_MOST = 1_048_576  # of a sheet (Microsoft, "Excel specifications and limits")
_SHEET_BYTES, _OTHER_BYTES = 1 << 30, 1 << 27
"""Of all sheets, and of the texts and styles, when they are unpacked."""
_PIECE_BYTES = 1 << 20
_ROW = re.compile(rb"<(?:\w+:)?row[ >/]")
_CHECKED_SHARE, _FOUND_SHARE = 0.05, 0.1
"""What of the time of reading is over when the sizes are checked, and when the sheet is found."""
_SHOWN = 40  # characters of a cell in a message
_NAT_NS = np.iinfo(np.int64).min
_MICROSECOND, _NO_OFFSET = datetime.timedelta(microseconds=1), datetime.timedelta(0)
_MIDNIGHT = datetime.datetime(1970, 1, 1)  # noqa: DTZ001 - a time of day counts from it


def open_table(path: Path, layout: FileLayout, report: ReportShare) -> Table:
    """Columns of the first sheet that has those asked for. Raises ImportFileError, ExtraMissingError."""
    _check_size(path, part_of(report, 0.0, _CHECKED_SHARE))
    with _open_book(path, part_of(report, _CHECKED_SHARE, _FOUND_SHARE)) as book:
        sheet = _find_sheet(path, book, layout)
    reader = _Reader(path, sheet, layout, part_of(report, _FOUND_SHARE, 1.0))
    return Table(sheet.names, reader.column, reader.row_label, sheet.units, first_rows=sheet.first_rows)


@dataclass(frozen=True, slots=True)
class _Sheet:
    title: str
    names: list[str]
    units: list[str]
    first_row: int
    """Number of the first row of numbers, from 1."""
    first_rows: tuple[tuple[str, ...], ...]


class _Reader:
    """Reads the rows of a sheet when the first column is asked for."""

    def __init__(self, path: Path, sheet: _Sheet, layout: FileLayout, report: ReportShare) -> None:
        self._path = path
        self._sheet = sheet
        self._layout = layout
        self._report = report

    @functools.cached_property
    def _columns(self) -> dict[int, list[Any]]:
        """Cells of the columns that are asked for, up to the last row that has any."""
        names = self._sheet.names
        wanted = find_columns(self._path, list(self._layout.wanted), names, len(names))
        columns: dict[int, list[Any]] = {at: [] for at in wanted}
        with _open_book(self._path, self._report) as book:
            for row in _rows(self._path, book[self._sheet.title], self._sheet.first_row):
                for at, cells in columns.items():
                    cells.append(row[at] if at < len(row) else None)
        while columns[wanted[0]] and all(cells[-1] is None for cells in columns.values()):
            for cells in columns.values():
                cells.pop()
        return columns

    def row_label(self, row: int) -> Message:
        return message("sheet {sheet}, row {row}", sheet=self._sheet.title, row=self._sheet.first_row + row)

    def column(self, at: int) -> NDArray[Any]:
        cells = self._columns[at]
        present = [cell for cell in cells if cell is not None]
        kinds = {type(cell) for cell in present}
        if kinds == {datetime.datetime}:
            return np.array(cells, "M8[us]")
        if kinds == {datetime.time}:
            since = [cell and datetime.datetime.combine(_MIDNIGHT, cell) - _MIDNIGHT for cell in cells]
            return np.array(since, "m8[us]")
        if kinds == {datetime.timedelta}:
            return np.array(cells, "m8[us]")
        if kinds == {str} and (form := find_form(present[0])) is not None:
            order = self._layout.date_order or date_order(present)
            if order is None:
                raise ambiguous_date(self._path, present[0])
            return self._stamps(StampColumn(form, order), cells, at)
        return np.array([self._number(cell, row, at) for row, cell in enumerate(cells)], np.float64)

    def _stamps(self, stamps: StampColumn, cells: list[str | None], at: int) -> NDArray[Any]:
        times_ns = np.full(len(cells), _NAT_NS)
        for row, cell in enumerate(cells):
            if cell is not None:
                try:
                    times_ns[row] = stamps.parse(cell)
                except StampError:
                    raise self._fault(row, at, stamp_fault(cell)) from None
        if stamps.has_zone:  # those of a workbook have none: they count as local
            is_there = times_ns != _NAT_NS
            begin = to_datetime(int(times_ns[is_there][0]), has_zone=True).astimezone()
            times_ns[is_there] += (begin.utcoffset() or _NO_OFFSET) // _MICROSECOND * 1000
        return times_ns.view("M8[ns]" if stamps.has_date else "m8[ns]")

    def _number(self, cell: Any, row: int, at: int) -> float:
        if cell is None or (isinstance(cell, str) and cell.strip().lower() in self._layout.marks):
            return math.nan
        if isinstance(cell, bool) or not isinstance(cell, int | float):
            remedy = message("Correct it, or leave the cell empty if there is no reading")
            fault = message("{cell!r} is not a number. {remedy}", cell=str(cell)[:_SHOWN], remedy=remedy)
            raise self._fault(row, at, fault)
        return float(cell)

    def _fault(self, row: int, at: int, fault: Message) -> ImportFileError:
        return cell_fault(self._path, self.row_label(row), self._sheet.names[at] or str(at), fault)


class _ReportedFile(io.FileIO):
    """File that reports how much has been read of it: openpyxl reads a large sheet for long."""

    def __init__(self, path: Path, report: ReportShare) -> None:
        super().__init__(path)
        self._report = report
        self._size_bytes, self._done_bytes = max(path.stat().st_size, 1), 0

    def read(self, size: int | None = -1, /) -> bytes:
        data = super().read(size) or b""
        self._done_bytes += len(data)
        self._report(min(self._done_bytes / self._size_bytes, 1.0))
        return data


def _check_size(path: Path, report: ReportShare) -> None:
    """Refuse what no program for sheets writes, before it is read. Raises ImportFileError."""
    with _ReportedFile(path, report) as file, zipfile.ZipFile(file) as archive:
        entries = archive.infolist()
        sheets = [entry for entry in entries if "worksheets/" in entry.filename]
        sheet_bytes = sum(entry.file_size for entry in sheets)
        if sheet_bytes > _SHEET_BYTES or sum(e.file_size for e in entries) - sheet_bytes > _OTHER_BYTES:
            raise ImportFileError("{path} unpacks to more than can be loaded. Export it as CSV", path=path)
        for sheet in sheets:
            _count_rows(path, archive, sheet)


def _count_rows(path: Path, archive: zipfile.ZipFile, sheet: zipfile.ZipInfo) -> None:
    """Count rows where they would fit no sheet. Raises ImportFileError."""
    rows, rest = 0, b""
    with archive.open(sheet) as file:
        while data := file.read(_PIECE_BYTES):
            whole, begun, rest = (rest + data).rpartition(b"<")
            rows += len(_ROW.findall(whole))
            rest = begun + rest
            if rows > _ROWS_MOST:
                raise _too_many_rows(path, Path(sheet.filename).stem)


def _too_many_rows(path: Path, sheet: str) -> ImportFileError:
    return ImportFileError(
        "{path}, sheet {sheet}: it has more than {most} rows, as no sheet has. Export it as CSV",
        path=path,
        sheet=sheet,
        most=_ROWS_MOST,
    )


@contextlib.contextmanager
def _open_book(path: Path, report: ReportShare) -> Iterator[Any]:
    openpyxl = import_optional("openpyxl", "Excel")
    with _ReportedFile(path, report) as file:
        with _unsized_sheets():
            book = openpyxl.load_workbook(file, read_only=True, data_only=True)
        with contextlib.closing(book):
            yield book


@contextlib.contextmanager
def _unsized_sheets() -> Iterator[None]:
    """Keep openpyxl from looking for the size of a sheet: where the sheet tells none, it reads all of it."""
    sheet = import_optional("openpyxl.worksheet._read_only", "Excel").ReadOnlyWorksheet
    look, sheet._get_size = sheet._get_size, lambda _sheet: None
    try:
        yield
    finally:
        sheet._get_size = look


def _rows(path: Path, sheet: Any, first_row: int) -> Iterator[_Row]:
    """Rows of a sheet from one on; empty ones stand for those that it leaves out. Raises ImportFileError."""
    sheet.reset_dimensions()  # some programs write wrong ones, beyond which nothing would be read
    rows = sheet.iter_rows(min_row=first_row, max_row=_ROWS_MOST + 1, values_only=True)
    for number, row in enumerate(rows, start=first_row):
        if number > _ROWS_MOST:
            raise _too_many_rows(path, str(sheet.title))
        yield row


def _find_sheet(path: Path, book: Any, layout: FileLayout) -> _Sheet:
    """The first sheet that has the columns, else the first one with rows. Raises ImportFileError."""
    sheets = [found for sheet in book.worksheets if (found := _open_sheet(path, sheet, layout)) is not None]
    if not sheets:
        template = N_("{path} holds no rows. Give a workbook with numbers, and check {option}")
        raise ImportFileError(template, path=path, option=option("--skip"))
    wanted = {name.strip() for _, name in layout.wanted}
    return next((sheet for sheet in sheets if wanted <= set(sheet.names)), sheets[0])


def _open_sheet(path: Path, sheet: Any, layout: FileLayout) -> _Sheet | None:
    """Names and units of a sheet; None of one without rows."""
    rows = _rows(path, sheet, layout.skip + 1)
    header = next(rows, ()) if layout.header else ()
    first_row = layout.skip + 1 + layout.header
    first = next(rows, ())
    units: list[str] = []
    if layout.header and _is_unit_row(first):
        units = ["" if cell is None else str(cell).strip("[]() ") for cell in first]
        first, first_row = next(rows, ()), first_row + 1
    shown = [first, *itertools.islice(rows, SHOWN_ROWS - 1)]
    if all(map(_is_blank, itertools.chain(shown, rows))):
        return None
    names = ["" if cell is None else str(cell).strip() for cell in header]
    names += [""] * (len(first) - len(names))
    first_rows = tuple(tuple("" if cell is None else str(cell) for cell in row) for row in shown)
    return _Sheet(str(sheet.title), names, units, first_row, first_rows)


def _is_blank(row: _Row) -> bool:
    return all(cell is None for cell in row)


def _is_unit_row(row: _Row) -> bool:
    texts = [cell for cell in row if cell is not None]
    return bool(texts) and all(isinstance(cell, str) and parse_unit(cell) is not None for cell in texts)
