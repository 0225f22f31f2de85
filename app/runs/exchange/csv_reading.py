"""Columns of numbers of a text file, read piece by piece."""

import csv
import functools
import importlib
import io
import math
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.runs.errors import ImportFileError
from app.runs.exchange.columns import DATE, TIME, ForeignColumns, cell_fault, find_columns
from app.runs.exchange.csv_layout import (
    MISSING_MARKS,
    CsvOptions,
    CsvText,
    is_data,
    is_number,
    survey_csv,
    to_number,
)
from app.runs.exchange.stamps import (
    NS,
    StampColumn,
    StampError,
    ambiguous_date,
    date_order,
    find_form,
    to_datetime,
)
from app.runs.exchange.text_files import PIECE_BYTES, Piece
from app.runs.exchange.units import unit_in_name
from messages.i18n import N_
from messages.message import Message, MessageError, message, option

_FOOTER_BYTES = 1 << 16
"""Lines at the end that are no rows are a footer if they are no more than this."""
_ROOM, _SHARE_MIN = 1.02, 1e-3
"""Room beyond the rows expected from the share of the file that was read; that share is at least this."""
_NUMERIC = re.compile(r"\s*[-+.,]*\d")
_SHOWN = 40  # characters of a footer in a note

ReportShare = Callable[[float], object]
Values = list[NDArray[Any]]
"""Of each column (n,): float64, or int64 nanoseconds of stamps."""


def read_columns(path: Path, layout: CsvOptions, report: ReportShare = lambda _: None) -> ForeignColumns:
    """Read time and gauges from a text file. Raises ImportFileError, which names line and column.

    `report` is called with the share of the file that has been read.
    """
    source = survey_csv(path, layout)
    reader = _Reader(source, layout)
    values = reader.read(report)
    columns = reader.columns(values)
    columns.check()
    return columns


@dataclass(frozen=True, slots=True)
class _Wanted:
    """A column that is read."""

    position: int
    name: str  # as messages call it
    stamps: StampColumn | None = None


class _CellError(MessageError):
    """A cell that is absent or not a number."""


class _Reader:
    """Reads the wanted columns of one file."""

    def __init__(self, source: CsvText, layout: CsvOptions) -> None:
        self._source = source
        self._layout = layout
        wanted = list(layout.wanted)
        positions = find_columns(source.path, wanted, source.names, source.width)
        self._columns = [
            _Wanted(at, self._name(at), self._stamps(at) if what in (TIME, DATE) else None)
            for (what, _), at in zip(wanted, positions, strict=True)
        ]
        self._has_time = bool(wanted) and wanted[0][0] == TIME
        self._has_date = len(wanted) > 1 and wanted[1][0] == DATE
        self._marks = frozenset(mark.lower() for mark in (*MISSING_MARKS, *layout.missing))
        self._starts: list[tuple[int, int]] = []  # first row of each piece, and its line
        self._notes: list[Message] = []
        self._check_stamps()

    def read(self, report: ReportShare) -> Values:
        """All rows of the wanted columns, in arrays that grow with what is expected to come."""
        size_bytes = max(self._source.file.size_bytes, 1)
        kinds = [np.float64 if column.stamps is None else np.int64 for column in self._columns]
        joined: Values = [np.empty(0, kind) for kind in kinds]
        rows = 0
        for piece in self._data_pieces():
            self._starts.append((rows, piece.line))
            values = _quick(self._source, piece.data, self._columns, self._marks)
            ended = False
            if values is None:
                values, ended = self._thorough(piece)
            end, share = rows + len(values[0]), min(piece.end_bytes / size_bytes, 1.0)
            if end > len(joined[0]):
                room = int(_ROOM * end / max(share, _SHARE_MIN)) + 1
                for column in joined:
                    column.resize(room, refcheck=False)
            for column, part in zip(joined, values, strict=True):
                column[rows:end] = part
            rows = end
            report(share)
            if ended:
                break
        return [column[:rows] for column in joined]

    def columns(self, values: Values) -> ForeignColumns:
        """Time and gauges from what was read."""
        path, start, is_stamped = self._source.path, None, False
        gauges = self._columns[self._has_time + self._has_date :]
        cells = values[len(values) - len(gauges) :]
        time: NDArray[Any]
        names, units = [column.name for column in gauges], [self._unit(column) for column in gauges]
        if not self._has_time:
            time = np.arange(len(cells[0])) / (self._layout.rate_hz or 1.0)
            names, units = ["time", *names], ["s", *units]
        else:
            names, units = [self._columns[0].name, *names], [self._unit(self._columns[0]), *units]
            time = values[0]
            stamps = self._columns[0].stamps
            if stamps is not None:
                is_stamped, units[0] = True, "s"
                time = stamps.going_on(time) if not self._has_date else time + values[1]
                first = int(time[0]) if len(time) else 0
                if stamps.has_date or self._has_date:
                    start = to_datetime(first, has_zone=stamps.has_zone)
                time = (time - first) / NS
        return ForeignColumns(
            path, np.asarray(time, np.float64), cells, names, self._label, units, start, is_stamped,
            not self._has_time, notes=self._notes,
        )  # fmt: skip

    def _name(self, at: int) -> str:
        names = self._source.names
        return repr(names[at]) if at < len(names) and names[at] else str(at)

    def _unit(self, column: _Wanted) -> str:
        units, names, at = self._source.units, self._source.names, column.position
        of_row = units[at] if at < len(units) else ""
        return of_row or (unit_in_name(names[at]) if at < len(names) else "")

    def _stamps(self, at: int) -> StampColumn | None:
        """What reads the cells of a column of date-times; None of numbers."""
        cells = [row[at] for row in self._source.sample if at < len(row)]
        first = next((cell for cell in cells if cell), "")
        form = None if is_number(first, self._source.decimal) else find_form(first)
        if form is None:
            return None
        order = self._layout.date_order or date_order(cells)
        if order is None:
            raise ambiguous_date(self._source.path, first)
        return StampColumn(form, order)

    def _check_stamps(self) -> None:
        if not self._has_date:
            return
        time, date = self._columns[0], self._columns[1]
        if time.stamps is None or time.stamps.has_date or date.stamps is None or not date.stamps.has_date:
            raise ImportFileError(
                "{path}: {option} takes dates beside times of day such as 14:03:00, and {time} and {date}"
                " are not that. Leave it out",
                path=self._source.path,
                option=option("--date"),
                time=time.name,
                date=date.name,
            )

    def _data_pieces(self) -> Iterator[Piece]:
        for piece in self._source.file.pieces(PIECE_BYTES):
            skipped = self._source.data_line - piece.line
            if skipped <= 0:
                yield piece
                continue
            place = _line_start(piece.data, skipped)
            if place < len(piece.data):
                yield Piece(self._source.data_line, piece.data[place:], piece.end_bytes)

    def _thorough(self, piece: Piece) -> tuple[Values, bool]:
        """All numbers of a piece, cell by cell, and whether a footer follows. Raises ImportFileError."""
        rows: list[list[float]] = []
        ended = False
        for number, text in self._lines(piece):
            try:
                rows.append(self._row(text, number))
            except _RowError as fault:
                if not fault.is_first or not self._is_footer(number, text):
                    raise fault.error from None
                ended = True
                break
        columns = zip(*rows, strict=True) if rows else ([] for _ in self._columns)
        kinds = (np.float64 if column.stamps is None else np.int64 for column in self._columns)
        return [np.array(values, kind) for values, kind in zip(columns, kinds, strict=True)], ended

    def _row(self, text: str, line: int) -> list[float]:
        cells = _cells(text, self._source.delimiter)
        row: list[float] = []
        for column in self._columns:
            try:
                row.append(self._value(cells, column, line))
            except _CellError as error:
                fault = cell_fault(self._source.path, _line_label(line), column.name, error.message)
                is_first = not row and (
                    len(cells) <= column.position or not _NUMERIC.match(cells[column.position])
                )
                raise _RowError(fault, is_first) from None
        return row

    def _value(self, cells: Sequence[str], column: _Wanted, line: int) -> float:
        if column.position >= len(cells):
            raise _CellError("the line has only {cells} cells. Complete it or delete it", cells=len(cells))
        cell = cells[column.position].strip()
        if column.stamps is not None:
            try:
                return column.stamps.parse(cell)
            except StampError:
                template = N_("{cell!r} is no time like those above. Correct it or delete the line")
                raise _CellError(template, cell=cell[:_SHOWN]) from None
        try:
            return math.nan if cell.lower() in self._marks else to_number(cell, self._source.decimal)
        except ValueError:
            remedy = message("Correct it, or leave the cell empty if there is no reading")
        if "," in cell and self._source.decimal == ".":
            remedy = message("If that is a decimal comma, add {option} ,", option=option("--decimal"))
        elif line == self._source.data_line:
            remedy = message(
                "If the numbers begin below this line, add {header_option} {skip_option} {number}",
                header_option=option("--no-header"),
                skip_option=option("--skip"),
                number=line,
            )
        raise _CellError("{cell!r} is not a number. {remedy}", cell=cell[:_SHOWN], remedy=remedy)

    def _is_footer(self, line: int, text: str) -> bool:
        """Tell whether no row follows from a line to the end; a note says what is left out."""
        rest = 0
        for piece in self._data_pieces():
            for number, other in self._lines(piece):
                if number < line:
                    continue
                rest += len(other)
                if rest > _FOOTER_BYTES or (number > line and self._is_row(other, number)):
                    return False
        note = N_("from line {line} on there are no rows ({text!r}). They are left out")
        self._notes.append(message(note, line=line, text=text.strip()[:_SHOWN]))
        return True

    def _is_row(self, text: str, line: int) -> bool:
        try:
            row = self._row(text, line)
        except _RowError:
            return False
        return not math.isnan(row[0])

    def _lines(self, piece: Piece) -> Iterator[tuple[int, str]]:
        """Lines of a piece that count, and their numbers."""
        blank = "" if self._source.delimiter == " " else self._source.delimiter
        for number, line in enumerate(self._source.file.decode(piece.data).split("\n")[:-1], piece.line):
            if is_data(line) and line.strip(f"{blank} \t"):
                yield number, line

    def _label(self, row: int) -> Message:
        """Line of a row, found by reading again."""
        first_row, first_line = max(start for start in self._starts if start[0] <= row)
        for piece in self._data_pieces():
            if piece.line == first_line:
                for count, (number, _) in enumerate(self._lines(piece)):
                    if count == row - first_row:
                        return _line_label(number)
        return message("row {row}", row=row)


@dataclass(frozen=True, slots=True)
class _RowError(Exception):
    """Fault of a row; `is_first` where its first wanted cell does not even begin as a number."""

    error: ImportFileError
    is_first: bool


def _line_label(line: int) -> Message:
    return message("line {line}", line=line)


def _line_start(data: bytes, lines: int) -> int:
    """Place behind so many newlines, or the end."""
    place = 0
    for _ in range(lines):
        place = data.find(b"\n", place) + 1
        if not place:
            return len(data)
    return place


def _cells(text: str, delimiter: str) -> list[str]:
    if delimiter == " ":
        return text.replace('"', "").split()
    return next(csv.reader([text], delimiter=delimiter)) if '"' in text else text.split(delimiter)


def _quick(source: CsvText, data: bytes, columns: Sequence[_Wanted], marks: frozenset[str]) -> Values | None:
    """All numbers of a piece by a reader for tables; None where it finds anything else."""
    if b"#" in data:
        data = re.sub(rb"(?m)^[ \t]*#.*\n", b"", data)
    delimiter = source.delimiter
    if delimiter == " ":
        data = _single_blanks(data)
    if not data.strip():
        return None
    arrow = _arrow()
    read = _by_numpy if arrow is None else functools.partial(_by_arrow, arrow)
    values = read(source, data, columns, marks)
    if values is None or (columns[0].stamps is None and np.isnan(values[0]).any()):
        return None
    return values


def _single_blanks(data: bytes) -> bytes:
    data = data.replace(b"\t", b" ")
    while b"  " in data:
        data = data.replace(b"  ", b" ")
    return data.replace(b"\n ", b"\n").replace(b" \n", b"\n").lstrip(b" ")


@functools.cache
def _arrow() -> Any:
    """The reader of pyarrow, of the extra `exchange`; None where it is not installed."""
    try:
        importlib.import_module("pyarrow")
        return importlib.import_module("pyarrow.csv")
    except ImportError:
        return None


def _by_arrow(
    arrow: Any, source: CsvText, data: bytes, columns: Sequence[_Wanted], marks: frozenset[str]
) -> Values | None:
    pa = importlib.import_module("pyarrow")
    first = data[: data.find(b"\n")].decode("latin-1")
    width = len(_cells(first, source.delimiter))
    if max(column.position for column in columns) >= width:
        return None
    names = [str(number) for number in range(width)]
    types = {
        str(column.position): pa.float64() if column.stamps is None else pa.binary() for column in columns
    }
    spelt = [form for mark in marks for form in {mark, mark.upper(), mark.capitalize(), mark.title()}]
    try:
        table = arrow.read_csv(
            pa.BufferReader(data),
            read_options=arrow.ReadOptions(use_threads=False, column_names=names, block_size=len(data) + 1),
            parse_options=arrow.ParseOptions(delimiter=source.delimiter),
            convert_options=arrow.ConvertOptions(
                check_utf8=False,
                column_types=types,
                include_columns=list(types),
                null_values=[*spelt, "NaN"],
                decimal_point=source.decimal,
            ),
        )
    except (pa.ArrowException, ValueError):
        return None
    values = [_of_arrow(table.column(str(column.position)), column.stamps) for column in columns]
    return (
        None if any(value is None for value in values) else [value for value in values if value is not None]
    )


def _of_arrow(column: Any, stamps: StampColumn | None) -> NDArray[Any] | None:
    array = column.combine_chunks()
    if stamps is None:
        return np.array(array.to_numpy(zero_copy_only=False), np.float64)
    _, offsets, text = array.buffers()
    ends = np.frombuffer(offsets, np.int32)[array.offset : array.offset + len(array) + 1]
    lengths = np.diff(ends)
    if len(lengths) and (lengths == lengths[0]).all() and lengths[0]:
        matrix = np.frombuffer(text, np.uint8)[ends[0] : ends[-1]].reshape(len(array), lengths[0])
        if (found := stamps.parse_matrix(matrix)) is not None:
            return found
    try:
        return stamps.parse_all(array.to_pylist())
    except StampError:
        return None


def _by_numpy(
    source: CsvText, data: bytes, columns: Sequence[_Wanted], _marks: frozenset[str]
) -> Values | None:
    """Numbers by numpy's own reader, empty cells as NaN."""
    if any(column.stamps is not None for column in columns):
        return None
    body = data.decode("latin-1")
    if source.decimal == ",":
        if "." in body:
            return None
        body = body.replace(",", ".")
    positions = [column.position for column in columns]
    values = _load(body, source.delimiter, positions)
    if values is None and source.delimiter != " ":
        values = _load(_with_nan(body, source.delimiter), source.delimiter, positions)
    return None if values is None else list(np.ascontiguousarray(values.T))


def _load(body: str, delimiter: str, positions: list[int]) -> NDArray[np.float64] | None:
    try:
        return np.loadtxt(
            io.StringIO(body),
            delimiter=None if delimiter == " " else delimiter,
            usecols=positions,
            comments=None,
            quotechar='"' if '"' in body else None,
            ndmin=2,
        )
    except (ValueError, IndexError):
        return None


def _with_nan(body: str, delimiter: str) -> str:
    for _ in range(2):  # the first round leaves every other one of several in a row
        body = body.replace(delimiter * 2, f"{delimiter}nan{delimiter}")
    return f"{body}\n".replace(f"{delimiter}\n", f"{delimiter}nan\n").replace(
        f"\n{delimiter}", f"\nnan{delimiter}"
    )
