"""How a CSV file is laid out: its encoding, header and delimiter, found out or told."""

import codecs
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import msgspec

from app.runs.errors import ImportFileError
from app.runs.foreign_columns import find_columns

_SAMPLE_LINES = 20
_WORDS = {"tab": "\t", "space": " "}
_CANDIDATES = ("\t", ";", ",", "|", " ")
_BOMS = {codecs.BOM_UTF8: "utf-8-sig", codecs.BOM_UTF16_LE: "utf-16", codecs.BOM_UTF16_BE: "utf-16"}


class CsvLayout(msgspec.Struct, frozen=True):
    """What the user says of a CSV file. A column is a name, or a number counted from 0."""

    time: str
    table: str
    second: str | None = None
    """Column of gauge 2, if there is one."""
    delimiter: str | None = None
    """A character, `tab` or `space` (any run of blanks); None finds it out."""
    decimal: Literal[".", ","] = "."
    skip: int = 0
    """Lines left out before the header."""
    header: bool = True


@dataclass(frozen=True, slots=True)
class Line:
    """A line of the file: its number counted from 1, its place in the text, and itself."""

    number: int
    offset: int
    text: str


@dataclass(frozen=True, slots=True)
class CsvText:
    """A CSV file taken apart as far as its header.

    Attributes
    ----------
    path : Path
    text : str
        The whole file, its lines ended by single newlines.
    data : Line
        First line of data.
    delimiter, decimal : str
    names : list of str
        Column names; empty without a header.
    columns : list of int
        Positions of time, table and, if asked for, the second gauge.
    """

    path: Path
    text: str
    data: Line
    delimiter: str
    decimal: Literal[".", ","]
    names: list[str]
    columns: list[int]

    def column_name(self, position: int) -> str:
        """How to name a column in a message."""
        return repr(self.names[position]) if position < len(self.names) else str(position)


def open_csv(path: Path, layout: CsvLayout) -> CsvText:
    """Read a CSV file as far as its header, and find the columns.

    Lines that are blank or begin with `#` are left out; where no header stands above the numbers,
    the last `#` line before them is taken for it if it has as many cells.

    Raises
    ------
    ImportFileError
    """
    source = survey_csv(path, layout)
    width = max(len(source.names), len(split_line(source.data.text, source.delimiter)))
    wanted = [layout.time, layout.table, *([] if layout.second is None else [layout.second])]
    return replace(source, columns=find_columns(path, wanted, source.names, width))


def survey_csv(path: Path, layout: CsvLayout) -> CsvText:
    """Read a CSV file as far as its header, whatever columns are wanted. Raises ImportFileError."""
    text = _decoded(path)
    comment, lines = _head(path, text, layout.skip)
    delimiter = _delimiter(path, layout, lines)
    names, data = _header(path, layout, delimiter, comment, lines)
    return CsvText(path, text, data, delimiter, layout.decimal, names, [])


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
        raise ImportFileError(f"{path}: there is no such file. Give the path of a CSV file") from None
    except OSError as error:
        raise ImportFileError(
            f"{path}: cannot be read ({error.strerror}). Give a readable CSV file"
        ) from None
    encoding = next((name for bom, name in _BOMS.items() if data.startswith(bom)), "")
    if not encoding and b"\0" in data[:4096]:
        raise ImportFileError(f"{path} is not a text file. Export it as CSV from the program that wrote it")
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
        raise ImportFileError(
            f"{path} holds no line of data. Give a file with numbers, and check --skip {skip}"
        )
    return comment, found


def _delimiter(path: Path, layout: CsvLayout, lines: list[Line]) -> str:
    if layout.delimiter is not None:
        told = _WORDS.get(layout.delimiter, layout.delimiter)
        if len(told) != 1 or told in '\n"' or told == layout.decimal:
            raise ImportFileError(
                f"--delimiter {layout.delimiter!r} cannot be. Give tab, space, or a character other than"
                f" the decimal sign {layout.decimal}"
            )
        return told
    scores = {c: _score(c, layout, lines) for c in _CANDIDATES if c != layout.decimal}
    best = max(scores, key=lambda c: scores[c])
    if scores[best] < 2:
        raise _no_numbers(path, layout, lines)
    return best


def _no_numbers(path: Path, layout: CsvLayout, lines: list[Line]) -> ImportFileError:
    if layout.header and len(lines) < 2:
        return ImportFileError(f"{path} holds a header but no line of data. Give a file with numbers")
    return ImportFileError(
        f"{path}, line {lines[-1].number}: no columns of numbers are found in {lines[-1].text[:60]!r}."
        " Check --skip, --delimiter and --decimal"
    )


def _score(delimiter: str, layout: CsvLayout, lines: list[Line]) -> int:
    """How many cells of the middling sample line are numbers, 0 where the header has fewer cells."""
    header, *data = [split_line(line.text, delimiter) for line in lines]
    numbers = sorted(sum(is_number(cell, layout.decimal) for cell in cells) for cells in data or [header])
    middling = numbers[len(numbers) // 2]
    return middling if len(header) >= middling else 0


def _header(
    path: Path, layout: CsvLayout, delimiter: str, comment: str, lines: list[Line]
) -> tuple[list[str], Line]:
    """Column names, and the first line of data."""
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
        f"{path}, line {lines[0].number}: {lines[0].text[:60]!r} is data, not column names."
        " Add --no-header and give columns by number"
    )
