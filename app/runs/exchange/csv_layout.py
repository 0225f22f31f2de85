"""Layout of a text file with columns of numbers: delimiter, decimal sign, header, units; found or given."""

import contextlib
import csv
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, NamedTuple

import msgspec

from app.runs.errors import ImportFileError
from app.runs.exchange.columns import DATE, SECOND, TABLE, TIME
from app.runs.exchange.stamps import DateOrder, find_form
from app.runs.exchange.tables import SHOWN_ROWS, WIDTH_MOST, too_wide
from app.runs.exchange.text_files import HEAD_BYTES, TextFile, open_text
from app.runs.exchange.units import parse_unit, unit_in_name
from messages.i18n import N_
from messages.message import Message, option

Decimal = Literal[".", ","]
MISSING_MARKS = (
    "", "nan", "-nan", "+nan", "na", "n/a", "#n/a", "#na", "null", "none", "nil", "missing", "-", "--", "---",
    "*", "**", "***", "1.#qnan", "-1.#ind", "1.#ind", "-1.#qnan", "#num!", "#value!", "#div/0!", "#ref!",
)  # fmt: skip
"""Cells of an absent reading, in small letters: of pandas, MATLAB, Excel, the C library of Windows."""

_WORDS = {"tab": "\t", "space": " "}
_CANDIDATES = ("\t", ";", ",", "|", " ")
_DECIMALS: tuple[Decimal, ...] = (".", ",")
_SAMPLE_LINES = 40  # of the head, the middle and the end each
_HEAD_LINES = 1000
_KINDS_MOST, _KINDS_CHARACTERS = 256, 4096
"""Cells of a line, and characters that they are in, whose kinds tell the layout."""
_SEPARATOR = re.compile(r'\s*"?sep=(.)"?\s*', re.IGNORECASE)


class FileLayout(msgspec.Struct, frozen=True):
    """What the user says of a file. A column is a name, or a number counted from 0."""

    time: str
    """Empty where `rate_hz` is given, or where the file has a time axis of its own."""
    table: str
    second: str | None = None
    delimiter: str | None = None
    """A character, `tab` or `space` (any run of blanks); None finds it out."""
    decimal: Decimal | None = None
    skip: int = 0
    """Lines left out before the header."""
    header: bool = True
    rate_hz: float | None = None
    """Rows a second, of a file without times."""
    date: str | None = None
    """Column of dates, beside times of day."""
    date_order: DateOrder | None = None
    missing: tuple[str, ...] = ()
    """Cells of an absent reading besides `MISSING_MARKS`."""
    encoding: str | None = None

    @property
    def wanted(self) -> Iterator[tuple[Message, str]]:
        """What is read from which column."""
        if self.time:
            yield TIME, self.time
            if self.date:
                yield DATE, self.date
        yield TABLE, self.table
        if self.second is not None:
            yield SECOND, self.second

    @property
    def marks(self) -> frozenset[str]:
        """Cells of an absent reading, in small letters."""
        return frozenset((*MISSING_MARKS, *(mark.lower() for mark in self.missing)))

    @property
    def missing_values(self) -> list[float]:
        """Numbers that stand for an absent reading, however they are written."""
        return [to_number(mark, ".") for mark in self.missing if is_number(mark, ".")]

    @property
    def least_numbers(self) -> int:
        """Numbers that a row has at least."""
        return 1 if self.rate_hz is not None else 2


class Line(NamedTuple):
    """A line of the file: its number counted from 1, and itself."""

    number: int
    text: str


@dataclass(frozen=True, slots=True)
class CsvText:
    """A text file taken apart as far as its first row."""

    file: TextFile
    data_line: int
    """Number of the first row's line, from 1."""
    delimiter: str
    decimal: Decimal
    names: list[str]
    """Column names; empty without a header."""
    units: list[str]
    """Of the columns, from rows below the names; empty without them."""
    sample: list[list[str]]
    """Cells of the first rows, and of some from the middle and the end."""

    @property
    def path(self) -> Path:
        return self.file.path

    def unit(self, at: int) -> str:
        """Unit of a column, from a row of units or its name; "" without one."""
        of_row = self.units[at] if at < len(self.units) else ""
        return of_row or (unit_in_name(self.names[at]) if at < len(self.names) else "")

    @property
    def first_rows(self) -> tuple[tuple[str, ...], ...]:
        return tuple(map(tuple, self.sample[:SHOWN_ROWS]))

    @property
    def width(self) -> int:
        return max(len(self.names), *(len(row) for row in self.sample[:SHOWN_ROWS]))


class _Format(NamedTuple):
    delimiter: str
    decimal: Decimal

    def cells(self, line: str) -> list[str]:
        return split_line(line, self.delimiter)

    def kinds(self, line: str) -> str:
        """A letter for each of the first cells: n number, s date or time, e empty, x text."""
        cells = self.cells(line[:_KINDS_CHARACTERS])[:_KINDS_MOST]
        return "".join(_kind(cell, self.decimal) for cell in cells)


_COMMAS, _DECIMAL_COMMAS = _Format(",", "."), _Format(" ", ",")


def survey_csv(path: Path, layout: FileLayout) -> CsvText:
    """Read a text file as far as its first row. Raises ImportFileError.

    Lines above the names are left out. Where no names stand above the numbers, the last `#` line before them
    is it if it has as many cells.
    """
    file = open_text(path, layout.encoding)
    lines, comments, separator = _head(file, layout)
    given = layout.delimiter or separator
    more = [line for place in (0.5, 0.9) for line in file.tail_lines(place, _SAMPLE_LINES) if is_data(line)]
    sample = [*(line.text for line in lines[-_SAMPLE_LINES:]), *more]
    form = _format(path, layout, given, lines, sample)
    if (width := max(_width(form, line) for line in sample)) > WIDTH_MOST:
        raise too_wide(path, width)
    pattern = _pattern(form, sample, layout)
    first = _first_row(path, layout, form, lines, pattern)
    names, units = _names(path, layout, form, lines, first, pattern, comments)
    rows = [
        form.cells(line) for line in (*(line.text for line in lines[first : first + _SAMPLE_LINES]), *more)
    ]
    return CsvText(file, lines[first].number, form.delimiter, form.decimal, names, units, rows)


def split_line(line: str, delimiter: str) -> list[str]:
    """Cells of a line, without quotes, blanks at their ends, and empty cells at its end."""
    cells = [cell.strip().strip('"').strip() for cell in split_quoted(line, delimiter)]
    while cells and not cells[-1]:
        cells.pop()
    return cells


def split_quoted(line: str, delimiter: str) -> list[str]:
    """Cells of a line as they are; a delimiter between quotes separates none."""
    if delimiter == " ":
        return line.replace('"', "").split()
    if '"' in line:
        with contextlib.suppress(csv.Error):  # a cell of more than 128 kB
            return next(csv.reader([line], delimiter=delimiter))
    return line.split(delimiter)


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
    return float(cell.replace(decimal, ".").replace("\u2212", "-"))


def is_data(line: str) -> bool:
    """Tell whether a line counts: neither blank nor a comment."""
    return bool(line.strip()) and not line.lstrip().startswith("#")


def _kind(cell: str, decimal: str) -> str:
    if cell.lower() in MISSING_MARKS:
        return "e"
    if is_number(cell, decimal):
        return "n"
    return "s" if find_form(cell) else "x"


def _head(file: TextFile, layout: FileLayout) -> tuple[list[Line], list[Line], str]:
    """First lines that count, comments among them, and the delimiter that a `sep=` line names."""
    lines: list[Line] = []
    comments: list[Line] = []
    separator = ""
    for piece in file.pieces():
        for number, text in enumerate(file.decode(piece.data).split("\n")[:-1], piece.line):
            named = _SEPARATOR.fullmatch(text) if not lines else None
            if named:
                separator = named[1]
            elif number > layout.skip and is_data(text):
                lines.append(Line(number, text))
            elif number > layout.skip and text.strip():
                comments.append(Line(number, text.lstrip().lstrip("#")))
            if len(lines) >= _HEAD_LINES:
                break
        if len(lines) > 1 and (len(lines) >= _HEAD_LINES or piece.end_bytes >= HEAD_BYTES):
            break
    if not lines:
        template = N_("{path} holds no line of data. Give a file with numbers, and check {option} {skip}")
        raise ImportFileError(template, path=file.path, option=option("--skip"), skip=layout.skip)
    return lines, comments, separator


def _format(
    path: Path, layout: FileLayout, given: str | None, lines: Sequence[Line], sample: Sequence[str]
) -> _Format:
    """Delimiter and decimal sign that make most cells of most lines numbers."""
    decimals = _DECIMALS if layout.decimal is None else (layout.decimal,)
    delimiters: Sequence[str] = _CANDIDATES
    if given:
        character = _WORDS.get(given, given)
        decimals = tuple(sign for sign in decimals if sign != character)
        if len(character) != 1 or character in '\n"' or not decimals:
            raise ImportFileError(
                "{option} {delimiter!r} cannot be. Give tab, space, or a character other"
                " than the decimal sign {decimal}",
                option=option("--delimiter"),
                delimiter=given,
                decimal=layout.decimal or ".",
            )
        delimiters = (character,)
    # Between quotes a decimal comma stands beside commas as delimiters.
    is_quoted = any('"' in line for line in sample)
    formats = [_Format(d, s) for s in decimals for d in delimiters if d != s or is_quoted]
    scores = {form: _score(form, sample, layout.least_numbers) for form in formats}
    best = max(formats, key=lambda form: scores[form])
    if not scores[best] and (not given or layout.decimal is None):
        raise _no_numbers(path, layout, lines)
    if best == _COMMAS and _DECIMAL_COMMAS in formats:
        return _one_or_two(path, layout, lines, sample)
    return best


def _one_or_two(path: Path, layout: FileLayout, lines: Sequence[Line], sample: Sequence[str]) -> _Format:
    """Format of rows such as `1,25` without times: one number where the line above them has no comma.

    Raises ImportFileError where none stands above.
    """
    ones = [line for line in sample if _DECIMAL_COMMAS.kinds(line) == "n"]
    if layout.least_numbers > 1 or 2 * len(ones) < len(sample):
        return _COMMAS
    above = [line for line in lines if _DECIMAL_COMMAS.kinds(line.text) != "n"]
    if layout.header and above:
        return _COMMAS if "," in above[-1].text else _DECIMAL_COMMAS
    raise ImportFileError(
        "{path}: {text!r} may be one number or two. Add {decimal_option} , or {delimiter_option} ,",
        path=path,
        text=ones[0],
        decimal_option=option("--decimal"),
        delimiter_option=option("--delimiter"),
    )


def _score(form: _Format, sample: Sequence[str], least: int) -> int:
    score = 0
    for line in sample:
        kinds = form.kinds(line)
        numbers = kinds.count("n") + kinds.count("s")
        if numbers >= least:
            score += max(numbers - kinds.count("x"), 1)
    return score


def _no_numbers(path: Path, layout: FileLayout, lines: Sequence[Line]) -> ImportFileError:
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


def _pattern(form: _Format, sample: Sequence[str], layout: FileLayout) -> str:
    """Kinds of the cells of a row, as in most of the lines that have numbers."""
    rows = [form.kinds(line) for line in sample]
    rows = [kinds for kinds in rows if kinds.count("n") + kinds.count("s") >= layout.least_numbers]
    width = max(map(len, rows), default=0)
    return "".join(
        Counter(kinds[at] for kinds in rows if at < len(kinds)).most_common(1)[0][0] for at in range(width)
    )


def _first_row(path: Path, layout: FileLayout, form: _Format, lines: Sequence[Line], pattern: str) -> int:
    """Index of the first line whose cells are those of rows."""
    if not layout.header:
        return 0
    numeric = [at for at, kind in enumerate(pattern) if kind in "ns"]

    def alike(line: Line) -> list[int]:
        kinds = form.kinds(line.text)
        return [at for at in numeric if at < len(kinds) and kinds[at] == pattern[at]]

    for index, line in enumerate(lines):
        at, width = alike(line), _width(form, line.text)
        if not at or at[0] != numeric[0]:
            continue
        if len(at) < layout.least_numbers and width != _width(form, lines[-1].text):
            continue
        # A row with a fault right below the names is a row all the same: the fault is to be named.
        above = lines[index - 1]
        return index - 1 if index > 1 and alike(above) and _width(form, above.text) == width else index
    raise _no_numbers(path, layout, lines)


def _width(form: _Format, line: str) -> int:
    return len(line.split()) if form.delimiter == " " else line.count(form.delimiter)


def _names(
    path: Path,
    layout: FileLayout,
    form: _Format,
    lines: Sequence[Line],
    first: int,
    pattern: str,
    comments: Sequence[Line],
) -> tuple[list[str], list[str]]:
    """Names and units above the first row."""
    if not layout.header:
        return [], []
    block: list[list[str]] = []
    least = min(len(pattern), max(2, sum(kind in "ns" for kind in pattern)))
    for line in reversed(lines[:first]):
        cells = form.cells(line.text)
        if len(cells) < least:
            break
        block.insert(0, cells)
    if not block:
        above = [line for line in comments if line.number < lines[first].number]
        names = form.cells(above[-1].text) if above else []
        if len(names) == len(form.cells(lines[first].text)):
            return names, []
        raise ImportFileError(
            "{path}, line {number}: {text!r} is data, not column names. Add {option} and give columns by"
            " number",
            option=option("--no-header"),
            path=path,
            number=lines[first].number,
            text=lines[first].text[:60],
        )
    place = _names_row(block, [name for _, name in layout.wanted])
    units = next((row for row in block[place + 1 :] if _is_unit_row(row)), [])
    return block[place], [unit.strip("[](){}<> ") if parse_unit(unit) else "" for unit in units]


def _names_row(block: Sequence[Sequence[str]], wanted: Sequence[str]) -> int:
    """Which row has the names: the one with those asked for, else that above the units, else the last."""
    named = [name.strip() for name in wanted if name and not name.strip().isdecimal()]
    for index, row in enumerate(block):
        if named and all(name in row for name in named):
            return index
    units = [index for index, row in enumerate(block) if index and _is_unit_row(row)]
    return units[0] - 1 if units else len(block) - 1


def _is_unit_row(cells: Sequence[str]) -> bool:
    return any(cells) and all(not cell or cell in "-[]()" or parse_unit(cell) for cell in cells)
