"""What is in a foreign file before it is imported: columns, first lines, which column is likely what."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Literal

import msgspec

from app.runs.errors import ImportFileError
from app.runs.exchange.csv_reading import (
    CsvOptions,
    CsvText,
    is_data,
    is_number,
    lines_from,
    split_line,
    survey_csv,
)
from app.runs.exchange.foreign_files import is_csv, list_columns

_LINES = 8
_DECIMALS: tuple[Literal[".", ","], ...] = (".", ",")
_TIME = re.compile(r"^(t|time|times|zeit|temps|время|sekunden|seconds?)\b|^time|^t_", re.IGNORECASE)
_PLATE = re.compile(r"\bu_?2\b|plate|gauge.?2|ch(annel)?.?2", re.IGNORECASE)
_RELATIVE = re.compile(r"rel|u_?2\s*[-−–]\s*u_?1", re.IGNORECASE)
_TABLE = re.compile(r"\bu_?1\b|table|gauge.?1|ch(annel)?.?1|displacement|weg|перемещ", re.IGNORECASE)
_UNIT = re.compile(r"(?:^|[\s,_(\[/])(us|µs|μs|ms|s|um|µm|μm|mm|m)[\])]?$")
_PLAIN = {"µs": "us", "μs": "us", "µm": "um", "μm": "um"}
_TIMES, _LENGTHS = {"s", "ms", "us"}, {"m", "mm", "um"}


class ParseOptions(msgspec.Struct, frozen=True):
    """What the user says of the lines of a file; None finds it out."""

    delimiter: str | None = None
    decimal: Literal[".", ","] | None = None
    skip: int = 0
    header: bool | None = None


@dataclass(frozen=True, slots=True)
class FilePreview:
    """What is in a file.

    Attributes
    ----------
    columns : tuple of str
        As `CsvLayout` asks for them: by name, by number where a name is missing or comes twice.
    titles : tuple of str
        The same for people.
    rows : tuple of tuple of str
        Cells of the first lines of a text; none of other files.
    told : Told
        How the lines are read, found out or told.
    time, table, second : str
        Which columns they are likely to be; `second` is empty where there is none.
    measures : str
        What `second` is likely to be: `relative` or `plate`.
    time_unit, unit : str
        As the names of the columns say; empty where they do not.
    """

    columns: tuple[str, ...]
    titles: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    options: ParseOptions
    time: str = ""
    table: str = ""
    second: str = ""
    measures: str = "relative"
    time_unit: str = ""
    unit: str = ""


def preview_file(path: Path, told: ParseOptions | None = None) -> FilePreview:
    """Look into a file that `import_csv` can read.

    Raises
    ------
    ImportFileError, ExtraMissingError
    """
    told = told or ParseOptions()
    if is_csv(path):
        return _survey_text(path, told)
    has_header = told.header is not False
    names = list_columns(path, CsvOptions("", "", skip=told.skip, header=has_header))
    return _recognise(names, (), ParseOptions(skip=told.skip, header=has_header))


def _survey_text(path: Path, told: ParseOptions) -> FilePreview:
    """Read with what was told, and else in the usual way that makes the most of the cells numbers."""
    found: list[tuple[float, CsvText]] = []
    faults = []
    for header in (True, False) if told.header is None else (told.header,):
        for decimal in _DECIMALS if told.decimal is None else (told.decimal,):
            try:
                source = survey_csv(
                    path, CsvOptions("", "", None, told.delimiter, decimal, told.skip, header)
                )
                found.append((_numeric_share(source), source))
            except ImportFileError as error:
                faults.append(error)
    if not found:
        raise faults[0]
    share, source = max(found, key=lambda pair: pair[0])
    if not share:
        raise ImportFileError(
            "{path}: no columns of numbers. Check --skip, --delimiter and --decimal", path=path
        )
    rows = _first_rows(source)
    width = max(len(source.names), *(len(row) for row in rows))
    names = [*source.names, *[""] * (width - len(source.names))]
    return _recognise(
        names, rows, ParseOptions(source.delimiter, source.decimal, told.skip, bool(source.names))
    )


def _numeric_share(source: CsvText) -> float:
    """How many of the first cells are numbers, 0 to 1."""
    cells = [is_number(cell, source.decimal) for row in _first_rows(source) for cell in row]
    return sum(cells) / max(len(cells), 1)


def _first_rows(source: CsvText) -> tuple[tuple[str, ...], ...]:
    lines = (line.text for line in lines_from(source.text, source.data.number, source.data.offset))
    return tuple(tuple(split_line(text, source.delimiter)) for text in islice(filter(is_data, lines), _LINES))


def _recognise(names: Sequence[str], rows: tuple[tuple[str, ...], ...], told: ParseOptions) -> FilePreview:
    """Say which column is likely what; a file without names has time first, then table, then relative."""
    columns = tuple(
        name if name and names.count(name) == 1 else str(number) for number, name in enumerate(names)
    )
    titles = tuple(name or f"column {number}" for number, name in enumerate(names))
    time = _first(names, _TIME, ()) if any(names) else None
    time = 0 if time is None and names else time
    relative = _first(names, _RELATIVE, (time,))
    plate = _first(names, _PLATE, (time, relative)) if relative is None else None
    second = relative if plate is None else plate
    table = _first(names, _TABLE, (time, second))
    rest = [number for number in range(len(names)) if number not in (time, table, second)]
    if table is None and rest:
        table = rest.pop(0)
    if second is None and rest and not any(names):
        second = rest[0]
    return FilePreview(
        columns, titles, rows, told,
        time=_at(columns, time), table=_at(columns, table), second=_at(columns, second),
        measures="relative" if plate is None else "plate",
        time_unit=_unit(names, time, _TIMES), unit=_unit(names, table, _LENGTHS),
    )  # fmt: skip


def _first(names: Sequence[str], pattern: re.Pattern[str], taken: tuple[int | None, ...]) -> int | None:
    return next((i for i, name in enumerate(names) if i not in taken and pattern.search(name)), None)


def _at(columns: tuple[str, ...], number: int | None) -> str:
    return "" if number is None or number >= len(columns) else columns[number]


def _unit(names: Sequence[str], number: int | None, known: set[str]) -> str:
    found = _UNIT.search(names[number].strip()) if number is not None and number < len(names) else None
    unit = _PLAIN.get(found[1], found[1]) if found else ""
    return unit if unit in known else ""
