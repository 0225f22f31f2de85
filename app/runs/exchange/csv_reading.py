"""Columns of numbers of a text file, read piece by piece."""

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.runs.errors import ImportFileError
from app.runs.exchange.columns import DATE, TIME, ForeignColumns, ReportShare, cell_fault, find_columns
from app.runs.exchange.csv_bulk import TextColumn, Values, parse_piece
from app.runs.exchange.csv_layout import (
    CsvText,
    FileLayout,
    is_data,
    is_number,
    split_quoted,
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
    no_date_beside,
    stamp_fault,
    to_datetime,
    unwrap_times,
)
from app.runs.exchange.tables import TimeAxis, check_count
from app.runs.exchange.text_files import PIECE_BYTES, Piece
from messages.i18n import N_
from messages.message import Message, MessageError, message, option

_FOOTER_BYTES = 1 << 16
"""Lines at the end that are no rows are a footer if they are no more than this."""
_ROOM, _SHARE_MIN = 1.02, 1e-3
"""Room beyond the rows expected from the share of the file that was read; that share is at least this."""
_NUMBERS_MOST = 1 << 26  # with what is needed beside them they take 0.9 GB
_NUMERIC = re.compile(r"\s*[-+.,]*\d")
_ROWS_AT_ONCE = 1 << 17
_SHOWN = 40  # characters of a footer in a note


def read_columns(path: Path, layout: FileLayout, report: ReportShare = lambda _: None) -> ForeignColumns:
    """Read time and gauges from a text file. Raises ImportFileError, which names line and column.

    `report` is called with the share of the file that has been read.
    """
    source = survey_csv(path, layout)
    reader = _Reader(source, layout)
    values = reader.read(report)
    columns = reader.columns(values)
    columns.check()
    return columns


class _CellError(MessageError):
    """A cell that is absent or not a number."""


class _Reader:
    """Reads the wanted columns of one file."""

    def __init__(self, source: CsvText, layout: FileLayout) -> None:
        self._source = source
        self._layout = layout
        wanted = list(layout.wanted)
        positions = find_columns(source.path, wanted, source.names, source.width)
        self._columns = [
            TextColumn(at, self._name(at), self._stamps(at) if what in (TIME, DATE) else None)
            for (what, _), at in zip(wanted, positions, strict=True)
        ]
        self._has_time = bool(wanted) and wanted[0][0] == TIME
        self._has_date = len(wanted) > 1 and wanted[1][0] == DATE
        self._marks = layout.marks
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
            values = parse_piece(self._source, piece.data, self._columns, self._marks)
            ended = False
            if values is None:
                values, ended = self._thorough(piece)
            end, share = rows + len(values[0]), min(piece.end_bytes / size_bytes, 1.0)
            if end > len(joined[0]):
                check_count(self._source.path, end * len(joined), _NUMBERS_MOST)
                room = int(_ROOM * end / max(share, _SHARE_MIN)) + 1
                room = max(min(room, _NUMBERS_MOST // len(joined)), end)
                joined = [_with_room(column[:rows], room) for column in joined]
            for column, part in zip(joined, values, strict=True):
                column[rows:end] = part
            rows = end
            report(share)
            if ended:
                break
        return [column[:rows] for column in joined]

    def columns(self, values: Values) -> ForeignColumns:
        """Time and gauges from what was read."""
        gauges = self._columns[self._has_time + self._has_date :]
        cells = values[len(values) - len(gauges) :]
        axis = self._axis(values, len(cells[0]))
        names, units, is_stamped = ["time"], [""], False
        if self._has_time:
            time = self._columns[0]
            names, units, is_stamped = (
                [time.name],
                [self._source.unit(time.position)],
                time.stamps is not None,
            )
        names += [gauge.name for gauge in gauges]
        units += [self._source.unit(gauge.position) for gauge in gauges]
        return ForeignColumns(
            self._source.path, axis.time_s, cells, names, self._label, units, axis.start, is_stamped,
            axis.is_even, notes=self._notes,
        )  # fmt: skip

    def _axis(self, values: Values, rows: int) -> TimeAxis:
        if not self._has_time:
            return TimeAxis(np.arange(rows) / (self._layout.rate_hz or 1.0), is_even=True)
        time, stamps = values[0], self._columns[0].stamps
        if stamps is None:
            return TimeAxis(np.asarray(time, np.float64))
        has_date = stamps.has_date or self._has_date
        if self._has_date:
            time = time + values[1]
        elif not has_date:
            time = unwrap_times(time, stamps.period_ns)
        first_ns = int(time[0]) if rows else 0
        start = to_datetime(first_ns, has_zone=stamps.has_zone) if has_date else None
        return TimeAxis(_seconds(time, first_ns), start)

    def _name(self, at: int) -> str:
        names = self._source.names
        return repr(names[at]) if at < len(names) and names[at] else str(at)

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
            raise no_date_beside(self._source.path, time.name, date.name)

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
        cells = split_quoted(text, self._source.delimiter)
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

    def _value(self, cells: Sequence[str], column: TextColumn, line: int) -> float:
        if column.position >= len(cells):
            raise _CellError("the line has only {cells} cells. Complete it or delete it", cells=len(cells))
        cell = cells[column.position].strip()
        if column.stamps is not None:
            try:
                return column.stamps.parse(cell)
            except StampError:
                raise _CellError(stamp_fault(cell)) from None
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
        _, current = self._starts[-1]
        for piece in self._data_pieces():
            for number, other in self._lines(piece) if piece.line >= current else ():
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


def _with_room(column: NDArray[Any], room: int) -> NDArray[Any]:
    """Column with room for so many rows. What is not written yet takes no memory, as zeros would."""
    roomy = np.empty(room, column.dtype)
    roomy[: len(column)] = column
    return roomy


def _seconds(times_ns: NDArray[np.int64], first_ns: int) -> NDArray[np.float64]:
    """Seconds (n,) since the first time, in the memory of the nanoseconds."""
    time_s = times_ns.view(np.float64)
    for first in range(0, len(time_s), _ROWS_AT_ONCE):
        rows = slice(first, first + _ROWS_AT_ONCE)
        time_s[rows] = (times_ns[rows] - first_ns) / NS
    return time_s


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
