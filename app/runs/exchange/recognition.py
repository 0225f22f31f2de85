"""Which column of a foreign file is likely what, by the names and the first lines."""

import itertools
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import msgspec

from app.runs.errors import ImportFileError
from app.runs.exchange.columns import ReportShare, part_of
from app.runs.exchange.csv_layout import CsvText, Decimal, FileLayout, is_number, survey_csv, to_number
from app.runs.exchange.foreign_files import is_csv, open_foreign, unpacked
from app.runs.exchange.stamps import find_form, has_date, has_time
from app.runs.exchange.text_files import open_text
from app.runs.exchange.units import parse_unit
from messages.message import EMPTY, Message, option

_TIME = re.compile(r"^(t|time|times|zeit|temps|время|sekunden|seconds?)\b|^time|^t_", re.IGNORECASE)
_PLATE = re.compile(r"\bu_?2\b|plat|пл[иа]т|gauge.?2|ch(annel)?.?2", re.IGNORECASE)
_RELATIVE = re.compile(r"rel|отн|u_?2\s*[-−–]\s*u_?1", re.IGNORECASE)
_TABLE = re.compile(
    r"\bu_?1\b|table|tisch|стол|gauge.?1|ch(annel)?.?1|displacement|weg|перемещ", re.IGNORECASE
)
_DATE = re.compile(r"^(date|datum|дата)\b", re.IGNORECASE)
_GROUPS = re.compile(r"^(?:[^\s/]+/)+(?=\S)|^\w+\.(?=\w)")
"""Groups of HDF5 and TDMS, and structs of MATLAB, before a name."""
_LINES_SHOWN, _LINE_CHARACTERS = 60, 400
_UNPACKED_SHARE = 0.1  # of the time of a look into a file
_TIMES, _LENGTHS = {"s": 1.0, "ms": 1e-3, "us": 1e-6}, {"m": 1.0, "mm": 1e-3, "um": 1e-6}


class ParseOptions(msgspec.Struct, frozen=True):
    """What the user says of the lines of a file; None finds it out."""

    delimiter: str | None = None
    decimal: Literal[".", ","] | None = None
    skip: int = 0
    header: bool | None = None
    encoding: str | None = None


@dataclass(frozen=True, slots=True)
class FilePreview:
    """What is in a file."""

    columns: tuple[str, ...]
    """As `FileLayout` asks for them: by name, by number where a name is missing or comes twice."""
    titles: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    """Cells of the first rows; none of a file without rows."""
    options: ParseOptions
    time: str = ""
    """Which columns they are likely to be; `second` is empty where there is none, `time` too where the file
    has a time axis of its own."""
    table: str = ""
    second: str = ""
    measures: str = "relative"
    """What `second` is likely to be: `relative` or `plate`."""
    time_unit: str = ""
    unit: str = ""
    """As the names of their columns say: s, ms, us; m, mm, um; "" where they say none of these."""
    date: str = ""
    """Column of dates, where `time` is one of times of day."""
    units: tuple[str, ...] = ()
    """Of all columns as the file names them, "" where it does not."""
    numbers: tuple[int, ...] = ()
    """Of all columns, from 0: those are left out that have neither a name nor a cell in the first rows."""

    def has_layout_of(self, other: "FilePreview") -> bool:
        """Whether names and units of the columns are the same, so that both files may be read alike."""
        return (self.titles, self.units) == (other.titles, other.units)


@dataclass(frozen=True, slots=True)
class FileSurvey:
    """What can be seen of a file, also where no columns of numbers are found in it."""

    lines: tuple[str, ...] = ()
    """First lines of a text as they are; none of another file."""
    encoding: str = ""
    """In which a text is read; "" of another file."""
    preview: FilePreview | None = None
    fault: Message = EMPTY
    """Why there is no preview."""


def preview_file(
    path: Path, given: ParseOptions | None = None, report: ReportShare = lambda _: None
) -> FilePreview:
    """Look into a file that `import_foreign_file` can read. Raises ImportFileError, ExtraMissingError."""
    with unpacked(path, part_of(report, 0.0, _UNPACKED_SHARE)) as plain:
        return _preview(plain, given or ParseOptions(), part_of(report, _UNPACKED_SHARE, 1.0))


def survey_file(path: Path, given: ParseOptions, report: ReportShare = lambda _: None) -> FileSurvey:
    """Look into a file, and show its first lines whatever they hold. Raises ExtraMissingError.

    Raises ImportFileError only for a file that cannot be opened.
    """
    with unpacked(path, part_of(report, 0.0, _UNPACKED_SHARE)) as plain:
        survey = FileSurvey()
        try:
            if is_csv(plain):
                text = open_text(plain, given.encoding)
                survey = FileSurvey(text.first_lines(_LINES_SHOWN, _LINE_CHARACTERS), text.encoding)
            return replace(survey, preview=_preview(plain, given, part_of(report, _UNPACKED_SHARE, 1.0)))
        except ImportFileError as error:
            return replace(survey, fault=error.message)


def _preview(path: Path, given: ParseOptions, report: ReportShare) -> FilePreview:
    if is_csv(path):
        return _survey_text(path, given)
    has_header = given.header is not False
    table = open_foreign(path, FileLayout("", "", skip=given.skip, header=has_header), report)
    options = ParseOptions(skip=given.skip, header=has_header)
    units = [table.unit(at) for at in range(len(table.names))]
    return _recognise(_Columns(table.names, units, table.first_rows, table.has_axis), options)


@dataclass(frozen=True, slots=True)
class _Columns:
    """Names and units of the columns of a file, and its first rows."""

    names: Sequence[str]
    units: Sequence[str]
    """Of all columns; "" where the file names none."""
    rows: tuple[tuple[str, ...], ...]
    has_axis: bool = False
    decimal: Decimal = "."

    def unit(self, number: int | None, known: dict[str, float]) -> str:
        """Unit of a column, if it is one of the known."""
        unit = parse_unit(self.units[number]) if number is not None and number < len(self.units) else None
        if unit is None or (known is _TIMES) != unit.is_time:
            return ""
        return next((name for name, scale in known.items() if scale == unit.scale), "")

    def stamps(self, number: int | None) -> tuple[bool, bool]:
        """Whether a column has dates, and whether it has times of day."""
        cell = next((row[number] for row in self.rows if number is not None and number < len(row)), "")
        form = find_form(cell)
        return (False, False) if form is None else (has_date(form), has_time(form))

    def is_empty(self, number: int) -> bool:
        """Whether a column has neither a name nor a cell among the first rows."""
        cells = (row[number] for row in self.rows if number < len(row))
        return bool(self.rows) and not self.names[number] and not any(cells)

    def may_be_time(self, number: int) -> bool:
        """Whether the first cells of a column that is named as no gauge rise."""
        name = self.names[number] if number < len(self.names) else ""
        if not self.rows or any(pattern.search(name) for pattern in (_RELATIVE, _PLATE, _TABLE)):
            return False
        cells = [row[number] if number < len(row) else "" for row in self.rows]
        if not all(is_number(cell, self.decimal) for cell in cells):
            return False
        return all(
            now > before for before, now in itertools.pairwise(to_number(c, self.decimal) for c in cells)
        )

    def find(self, pattern: re.Pattern[str], taken: tuple[int | None, ...] = ()) -> int | None:
        """First column that is not taken and whose name has a pattern, with or without its groups."""
        for at, name in enumerate(self.names):
            if at not in taken and (pattern.search(name) or pattern.search(_GROUPS.sub("", name))):
                return at
        return None


def _survey_text(path: Path, given: ParseOptions) -> FilePreview:
    """Read with the given options, and else with names above the numbers, if there are any."""
    faults = []
    for header in (True, False) if given.header is None else (given.header,):
        layout = FileLayout(
            "", "", None, given.delimiter, given.decimal, given.skip, header, encoding=given.encoding
        )
        try:
            source = survey_csv(path, layout)
        except ImportFileError as error:
            faults.append(error)
            continue
        if any(is_number(cell, source.decimal) for row in source.first_rows for cell in row):
            return _of_text(source, given)
    if faults:
        raise faults[0]
    raise ImportFileError(
        "{path}: no columns of numbers. Check {skip_option}, {delimiter_option} and {decimal_option}",
        path=path,
        skip_option=option("--skip"),
        delimiter_option=option("--delimiter"),
        decimal_option=option("--decimal"),
    )


def _of_text(source: CsvText, given: ParseOptions) -> FilePreview:
    names = [*source.names, *[""] * (source.width - len(source.names))]
    found = ParseOptions(source.delimiter, source.decimal, given.skip, bool(source.names), given.encoding)
    units = [source.unit(at) for at in range(len(names))]
    return _recognise(_Columns(names, units, source.first_rows, decimal=source.decimal), found)


def _recognise(table: _Columns, given: ParseOptions) -> FilePreview:
    """Say which column is likely what; a file without names has time first, then table, then relative."""
    names = table.names
    columns = tuple(
        name if name and names.count(name) == 1 else str(number) for number, name in enumerate(names)
    )
    time, date = _time_and_date(table)
    relative = table.find(_RELATIVE, (time, date))
    plate = table.find(_PLATE, (time, date, relative)) if relative is None else None
    second = relative if plate is None else plate
    gauge = table.find(_TABLE, (time, date, second))
    kept = [number for number in range(len(names)) if not table.is_empty(number)]
    rest = [number for number in kept if number not in (time, date, gauge, second)]
    if gauge is None and rest:
        gauge = rest.pop(0)
    if second is None and rest and not any(names):
        second = rest[0]
    return FilePreview(
        tuple(columns[number] for number in kept),
        tuple(names[number] or f"column {number}" for number in kept),
        tuple(tuple(row[number] if number < len(row) else "" for number in kept) for row in table.rows),
        given,
        time=_at(columns, time), date=_at(columns, date),
        table=_at(columns, gauge), second=_at(columns, second),
        measures="relative" if plate is None else "plate",
        time_unit=table.unit(time, _TIMES), unit=table.unit(gauge, _LENGTHS),
        units=tuple(table.units[number] for number in kept), numbers=tuple(kept),
    )  # fmt: skip


def _time_and_date(table: _Columns) -> tuple[int | None, int | None]:
    """Columns of time, None where the file has an axis of its own, and of dates beside times of day."""
    names = table.names
    if table.has_axis:
        return None, None
    time = table.find(_TIME)
    if time is None:
        stamped = (number for number in range(len(names)) if any(table.stamps(number)))
        time = next(stamped, 0 if table.may_be_time(0) else None)
    date = table.find(_DATE, (time,))
    if date is None and table.stamps(time) == (True, False):
        date, time = time, next((n for n in range(len(names)) if table.stamps(n) == (False, True)), time)
    is_beside = table.stamps(time) == (False, True) and table.stamps(date) == (True, False)
    return time, date if is_beside else None


def _at(columns: tuple[str, ...], number: int | None) -> str:
    return "" if number is None or number >= len(columns) else columns[number]
