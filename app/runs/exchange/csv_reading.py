"""Layout of a CSV file: encoding, header and delimiter, detected or given; and its columns of numbers."""

import codecs
import csv
import io
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from app.runs.errors import ImportFileError
from app.runs.exchange.columns import ForeignColumns, cell_fault, find_columns
from messages.i18n import N_
from messages.message import Message, MessageError, message, option

_SAMPLE_LINES = 20
_WORDS = {"tab": "\t", "space": " "}
_CANDIDATES = ("\t", ";", ",", "|", " ")
_BOMS = {codecs.BOM_UTF8: "utf-8-sig", codecs.BOM_UTF16_LE: "utf-16", codecs.BOM_UTF16_BE: "utf-16"}


class CsvOptions(msgspec.Struct, frozen=True):
    """What the user says of a CSV file. A column is a name, or a number counted from 0."""

    time: str
    table: str
    second: str | None = None
    delimiter: str | None = None
    """A character, `tab` or `space` (any run of blanks); None finds it out."""
    decimal: Literal[".", ","] = "."
    skip: int = 0
    """Lines left out before the header."""
    header: bool = True

    @property
    def wanted(self) -> list[str]:
        return [name for name in (self.time, self.table, self.second) if name is not None]


class Line(NamedTuple):
    """A line of the file: its number counted from 1, its place in the text, and itself."""

    number: int
    offset: int
    text: str


@dataclass(frozen=True, slots=True)
class CsvText:
    """A CSV file taken apart as far as its header."""

    path: Path
    text: str
    data: Line
    delimiter: str
    decimal: Literal[".", ","]
    names: list[str]
    """Column names; empty without a header."""


def survey_csv(path: Path, layout: CsvOptions) -> CsvText:
    """Read a CSV file as far as its header. Raises ImportFileError.

    Where no header stands above the numbers, the last `#` line before them is it if it has as many cells.
    """
    text = _decoded(path)
    comment, lines = _head(path, text, layout.skip)
    delimiter = _delimiter(path, layout, lines)
    names, data = _header(path, layout, delimiter, comment, lines)
    return CsvText(path, text, data, delimiter, layout.decimal, names)


def split_line(line: str, delimiter: str) -> list[str]:
    """Cells of a line, without quotes, blanks at their ends, and empty cells at its end."""
    cells = line.split() if delimiter == " " else line.split(delimiter)
    cells = [cell.strip().strip('"').strip() for cell in cells]
    while cells and not cells[-1]:
        cells.pop()
    return cells


def is_number(cell: str, decimal: str) -> bool:
    """Tell whether a cell is a number."""
    try:
        to_number(cell, decimal)
    except ValueError:
        return False
    return True


def to_number(cell: str, decimal: str) -> float:
    """Value of a cell. Raises ValueError."""
    if "_" in cell or (decimal == "," and "." in cell):
        raise ValueError(cell)
    return float(cell.replace(decimal, "."))


def is_data(line: str) -> bool:
    """Tell whether a line counts: neither blank nor a comment."""
    return bool(line.strip()) and not line.lstrip().startswith("#")


def lines_from(text: str, number: int = 1, offset: int = 0) -> Iterator[Line]:
    """Lines of a text from a place on."""
    while offset < len(text):
        end = text.find("\n", offset)
        end = len(text) if end < 0 else end
        yield Line(number, offset, text[offset:end])
        number, offset = number + 1, end + 1


def _decoded(path: Path) -> str:
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        raise ImportFileError(
            "{path}: there is no such file. Give the path of a CSV file", path=path
        ) from None
    except OSError as error:
        template = N_("{path}: cannot be read ({strerror}). Give a readable CSV file")
        raise ImportFileError(template, path=path, strerror=error.strerror) from None
    encoding = next((name for bom, name in _BOMS.items() if data.startswith(bom)), "")
    if not encoding and b"\0" in data[:4096]:
        raise ImportFileError(
            "{path} is not a text file. Export it as CSV from the program that wrote it", path=path
        )
    try:
        text = data.decode(encoding or "utf-8")
    except UnicodeDecodeError:
        text = data.decode("latin-1")  # digits are the same in all of them; names of columns may look odd
    return text.replace("\r\n", "\n").replace("\r", "\n")


def _head(path: Path, text: str, skip: int) -> tuple[str, list[Line]]:
    """Last comment before the first line that counts, and the first lines that count."""
    comment, found = "", []
    for line in lines_from(text):
        if line.number > skip and is_data(line.text):
            found.append(line)
        elif line.number > skip and line.text.strip() and not found:
            comment = line.text.lstrip().lstrip("#")
        if len(found) > _SAMPLE_LINES:
            break
    if not found:
        template = N_("{path} holds no line of data. Give a file with numbers, and check {option} {skip}")
        raise ImportFileError(template, path=path, option=option("--skip"), skip=skip)
    return comment, found


def _delimiter(path: Path, layout: CsvOptions, lines: list[Line]) -> str:
    if layout.delimiter is not None:
        told = _WORDS.get(layout.delimiter, layout.delimiter)
        if len(told) != 1 or told in '\n"' or told == layout.decimal:
            raise ImportFileError(
                "{option} {delimiter!r} cannot be. Give tab, space, or a character other"
                " than the decimal sign {decimal}",
                option=option("--delimiter"),
                delimiter=layout.delimiter,
                decimal=layout.decimal,
            )
        return told
    scores = {c: _score(c, layout, lines) for c in _CANDIDATES if c != layout.decimal}
    best = max(scores, key=lambda c: scores[c])
    if scores[best] < 2:
        raise _no_numbers(path, layout, lines)
    return best


def _no_numbers(path: Path, layout: CsvOptions, lines: list[Line]) -> ImportFileError:
    if layout.header and len(lines) < 2:
        return ImportFileError(
            "{path} holds a header but no line of data. Give a file with numbers", path=path
        )
    return ImportFileError(
        "{path}, line {number}: no columns of numbers are found in {text!r}. Check"
        " {skip_option}, {delimiter_option} and {decimal_option}",
        skip_option=option("--skip"),
        delimiter_option=option("--delimiter"),
        decimal_option=option("--decimal"),
        path=path,
        number=lines[-1].number,
        text=lines[-1].text[:60],
    )


def _score(delimiter: str, layout: CsvOptions, lines: list[Line]) -> int:
    """How many cells of the middling sample line are numbers, 0 where the header has fewer cells."""
    header, *data = [split_line(line.text, delimiter) for line in lines]
    numbers = sorted(sum(is_number(cell, layout.decimal) for cell in cells) for cells in data or [header])
    middling = numbers[len(numbers) // 2]
    return middling if len(header) >= middling else 0


def _header(
    path: Path, layout: CsvOptions, delimiter: str, comment: str, lines: list[Line]
) -> tuple[list[str], Line]:
    cells = split_line(lines[0].text, delimiter)
    if not layout.header:
        return [], lines[0]
    if not all(is_number(cell, layout.decimal) for cell in cells):
        if len(lines) < 2:
            raise _no_numbers(path, layout, lines)
        return cells, lines[1]
    names = split_line(comment, delimiter)
    if len(names) == len(cells):
        return names, lines[0]
    raise ImportFileError(
        "{path}, line {number}: {text!r} is data, not column names. Add {option} and give columns by number",
        option=option("--no-header"),
        path=path,
        number=lines[0].number,
        text=lines[0].text[:60],
    )


def read_columns(path: Path, layout: CsvOptions) -> ForeignColumns:
    """Read time and gauges from a CSV file. Raises ImportFileError, which names line and column."""
    source = survey_csv(path, layout)
    width = max(len(source.names), len(split_line(source.data.text, source.delimiter)))
    positions = find_columns(path, layout.wanted, source.names, width)
    names = [repr(source.names[i]) if i < len(source.names) else str(i) for i in positions]
    values = _quick(source, positions)
    if values is None:
        values = _thorough(source, dict(zip(names, positions, strict=True)))
    columns = ForeignColumns(path, values, names, lambda row: _label(_data_lines(source)[row]))
    columns.check()
    return columns


def _quick(source: CsvText, positions: list[int]) -> NDArray[np.float64] | None:
    """All numbers by numpy's own reader; None where it finds anything but numbers and empty cells."""
    body = source.text[source.data.offset :]
    if source.decimal == ",":
        if "." in body:
            return None
        body = body.replace(",", ".")
    values = _load(body, source.delimiter, positions)
    if values is None and source.delimiter != " ":
        values = _load(_with_nan(body, source.delimiter), source.delimiter, positions)
    return None if values is None or np.isnan(values[:, 0]).any() else values


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


class _CellError(MessageError):
    """A cell that is absent or not a number."""


def _thorough(source: CsvText, positions: dict[str, int]) -> NDArray[np.float64]:
    """All numbers, cell by cell, of columns given by name. Raises ImportFileError."""
    rows: list[list[float]] = []
    for line in _data_lines(source):
        cells = _cells(line.text, source.delimiter)
        row: list[float] = []
        rows.append(row)
        for name, position in positions.items():
            try:
                row.append(_value(source, line, cells, position))
            except _CellError as error:
                raise cell_fault(source.path, _label(line), name, error.message) from None
    return np.array(rows, dtype=np.float64)


def _label(line: Line) -> Message:
    return message("line {line}", line=line.number)


def _data_lines(source: CsvText) -> list[Line]:
    lines = lines_from(source.text, source.data.number, source.data.offset)
    blank = "" if source.delimiter == " " else source.delimiter
    return [line for line in lines if is_data(line.text) and line.text.strip(f"{blank} \t")]


def _cells(text: str, delimiter: str) -> list[str]:
    if delimiter == " ":
        return text.split()
    return next(csv.reader([text], delimiter=delimiter)) if '"' in text else text.split(delimiter)


def _value(source: CsvText, line: Line, cells: list[str], position: int) -> float:
    if position >= len(cells):
        raise _CellError("the line has only {cells} cells. Complete it or delete it", cells=len(cells))
    cell = cells[position].strip()
    try:
        return to_number(cell, source.decimal) if cell else math.nan
    except ValueError:
        remedy = message("Correct it, or leave the cell empty if there is no reading")
    if "," in cell and source.decimal == ".":
        remedy = message("If that is a decimal comma, add {option} ,", option=option("--decimal"))
    elif line.number == source.data.number:
        remedy = message(
            "If the numbers begin below this line, add {header_option} {skip_option} {number}",
            header_option=option("--no-header"),
            skip_option=option("--skip"),
            number=line.number,
        )
    raise _CellError("{cell!r} is not a number. {remedy}", cell=cell, remedy=remedy)
