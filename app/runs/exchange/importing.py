"""Foreign records into run files."""

import datetime
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any, Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from app.runs.blocks import RunBlock, StoredRun
from app.runs.errors import ImportFileError
from app.runs.exchange import csv_reading
from app.runs.exchange.columns import ForeignColumns
from app.runs.exchange.csv_reading import CsvOptions, CsvText
from app.runs.exchange.foreign_files import is_csv, list_columns, read_foreign
from app.runs.metadata import QUANTITY_UNITS, EndMetadata, Quantity, create_metadata
from app.runs.writer import write_run
from config.schema import Gauge, Gauges, Stand
from drivers.samples import DeviceIdentity, Losses, SampleStatus
from messages.i18n import N_
from messages.message import message, option

Floats = NDArray[np.float64]
_TIME_UNITS_S = {"s": 1.0, "ms": 1e-3, "us": 1e-6}
_LENGTH_UNITS_M = {"m": 1.0, "mm": 1e-3, "um": 1e-6}
_EVEN = 0.01
"""Relative spread of the time steps up to which a record has a rate."""

_LONGEST_S = 1e9


class CsvImport(msgspec.Struct, frozen=True):
    """Which columns of a CSV file are what, and in which unit. A reading is `gain * cell + offset`."""

    layout: CsvOptions
    measures: Literal["relative", "plate"] = "relative"
    """What the second column is: plate against table, or plate against base."""
    time_unit: Literal["s", "ms", "us"] = "s"
    unit: Literal["m", "mm", "um"] | None = None
    """Of the cells: this length, or this length per s or s^2; None means m."""
    gain: float | None = None
    offset: float = 0.0
    unit_name: str | None = None
    """Unit after the gain, where it is not metres (per s, per s^2): rad, V, ..."""
    gain_uncertainty: float | None = None  # relative standard uncertainty; None is "not stated"
    quantity: Quantity = "displacement"
    from_s: float | None = None
    until_s: float | None = None
    """Kept stretch, on the file's own time axis in seconds, ends included."""
    segment: int | None = None  # which of the stretches between times that go back, counted from 0


def import_csv(
    path: Path, plan: CsvImport, output: Path, stand: Stand, *, replace: bool = False, **facts: Any
) -> StoredRun:
    """Make a run of a foreign file. Raises RunError, ConfigError.

    `facts` are those of `create_metadata`: series, pullback_m, table_mass_kg, operator, note, ...
    """
    gauge, start_s, block = read_record(path, plan)
    # The nearest to the time of the test that a foreign file tells.
    changed = datetime.datetime.fromtimestamp(path.stat().st_mtime).astimezone()
    metadata = create_metadata(
        stand,
        Gauges(table=gauge, relative=gauge.replace(measures=plan.measures)),
        changed,
        device=DeviceIdentity(protocol="import", name=path.name),
        rate_hz=even_rate_hz(block.time_s),
        quantity=plan.quantity,
        unit=plan.unit_name or QUANTITY_UNITS[plan.quantity],
        source=f"imported from {path.name}, time 0 is its {start_s!r} s",
        **facts,
    )
    ending = EndMetadata(
        ended="imported",
        end_time=changed + datetime.timedelta(seconds=float(block.time_s[-1])),
        losses=Losses(samples=len(block), missing=int(np.count_nonzero(block.status))),
    )
    return write_run(output, metadata, block, ending, replace=replace)


def read_record(path: Path, plan: CsvImport) -> tuple[Gauge, float, RunBlock]:
    """Read a foreign file as it would be imported: calibration, its time of the first row (s), samples."""
    gauge = _gauge(plan)
    columns = read_foreign(path, plan.layout)
    with np.errstate(over="ignore"):  # what is too large is refused
        values = columns.values[_kept(columns, plan)]
        time_s = values[:, 0] * _TIME_UNITS_S[plan.time_unit]
        block = _block(time_s - time_s[0], values[:, 1:], gauge)
    if block.time_s[-1] > _LONGEST_S:
        raise ImportFileError(
            "{path}: its times go from {time_s:g} s to {time_s_2:g} s, too long for a record."
            " Check {time_option} {time} and {unit_option} {time_unit}",
            time_option=option("--time"),
            unit_option=option("--time-unit"),
            path=path,
            time_s=time_s[0],
            time_s_2=time_s[-1],
            time=plan.layout.time,
            time_unit=plan.time_unit,
        )
    if np.isinf(block.readings).any():
        template = N_("{path}: with {option} {value:g} its readings are too large. Check both")
        raise ImportFileError(template, path=path, option=option("--gain"), value=plan.gain or 1.0)
    return gauge, float(time_s[0]), block


def _gauge(plan: CsvImport) -> Gauge:
    """Calibration that turns cells into readings. Raises ImportFileError."""
    if plan.gain is not None and plan.unit is not None:
        template = N_(
            "{unit_option} and {gain_option} exclude each other: a gain says the unit. Give one of them"
        )
        raise ImportFileError(template, unit_option=option("--unit"), gain_option=option("--gain"))
    if plan.unit_name and plan.gain is None:
        raise ImportFileError(
            "{name_option} {unit_name!r} needs {gain_option}, the {unit_name} of one cell unit",
            name_option=option("--unit-name"),
            gain_option=option("--gain"),
            unit_name=plan.unit_name,
        )
    gain = _LENGTH_UNITS_M[plan.unit or "m"] if plan.gain is None else plan.gain
    if not math.isfinite(gain) or gain == 0.0:
        template = N_(
            "{option} {value:g} cannot be. Give a finite number other than 0; a negative one turns the gauge"
        )
        raise ImportFileError(template, option=option("--gain"), value=gain)
    if not math.isfinite(plan.offset / gain):
        template = N_("{option} {value:g} cannot be. Give a finite number")
        raise ImportFileError(template, option=option("--offset"), value=plan.offset)
    try:
        return Gauge(
            gain_m_per_count=gain,
            zero_count=-plan.offset / gain if plan.offset else 0.0,
            gain_relative_standard_uncertainty=plan.gain_uncertainty,
        )
    except ValueError:
        template = N_("{option} {value} cannot be. Give a finite share of the gain, 0 or above")
        value = plan.gain_uncertainty
        raise ImportFileError(template, option=option("--gain-uncertainty"), value=value) from None


def _kept(columns: ForeignColumns, plan: CsvImport) -> slice:
    """Rows of the segment and stretch that were asked for, their times rising. Raises ImportFileError."""
    time = columns.values[:, 0]
    segment = _segment(columns, plan.segment)
    _check_rising(columns, segment)
    scale = _TIME_UNITS_S[plan.time_unit]
    first = -math.inf if plan.from_s is None else plan.from_s
    last = math.inf if plan.until_s is None else plan.until_s
    inside = np.flatnonzero((time[segment] * scale >= first) & (time[segment] * scale <= last))
    if not len(inside):
        low, high = time[segment][0] * scale, time[segment][-1] * scale
        raise ImportFileError(
            "{path}: no row lies between {first:g} s and {last:g} s. Its times go from {low:g}"
            " s to {high:g} s: change {from_option} and {until_option}",
            from_option=option("--from"),
            until_option=option("--until"),
            path=columns.path,
            first=first,
            last=last,
            low=low,
            high=high,
        )
    return slice(segment.start + int(inside[0]), segment.start + int(inside[-1]) + 1)


def _segment(columns: ForeignColumns, number: int | None) -> slice:
    time = columns.values[:, 0]
    if number is None:
        return slice(0, len(time))
    bounds = [0, *(np.flatnonzero(np.diff(time) < 0.0) + 1).tolist(), len(time)]
    count = len(bounds) - 1
    if not 0 <= number < count:
        template = N_(
            "{path}: there is no segment {number}. Its times rise in {count} stretches: give 0 to {count_2}"
        )
        raise ImportFileError(template, path=columns.path, number=number, count=count, count_2=count - 1)
    return slice(bounds[number], bounds[number + 1])


def _check_rising(columns: ForeignColumns, rows: slice) -> None:
    time = columns.values[rows, 0]
    wrong = np.flatnonzero(np.diff(time) <= 0.0)
    if not len(wrong):
        return
    row = rows.start + int(wrong[0]) + 1
    before, now = columns.values[row - 1 : row + 1, 0]
    if now < before:
        fault = message(
            "time goes back from {before} to {now}. Pick one stretch with {option} N, from 0",
            before=str(before),
            now=str(now),
            option=option("--segment"),
        )
    else:
        fault = message(
            "time {now} comes twice. Export the times with more digits, or delete the line", now=str(now)
        )
    raise columns.fault(row, 0, fault)


def _block(time_s: Floats, cells: Floats, gauge: Gauge) -> RunBlock:
    readings = gauge.gain_m_per_count * (cells - gauge.zero_count)
    absent = np.isnan(cells).all(axis=1)
    status = np.where(absent, SampleStatus.MISSING, SampleStatus.GOOD).astype(np.uint8)
    return RunBlock(time_s, readings, status, np.ascontiguousarray(cells))


def even_rate_hz(time_s: Floats) -> float | None:
    """Samples a second of an even record, None of an uneven one."""
    steps = np.diff(time_s)
    if not len(steps):
        return None
    middling = float(np.median(steps))
    return 1.0 / middling if np.all(np.abs(steps - middling) <= _EVEN * middling) else None


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
    """What is in a file."""

    columns: tuple[str, ...]
    """As `CsvLayout` asks for them: by name, by number where a name is missing or comes twice."""
    titles: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    """Cells of the first lines of a text; none of other files."""
    options: ParseOptions
    time: str = ""
    """Which columns they are likely to be; `second` is empty where there is none."""
    table: str = ""
    second: str = ""
    measures: str = "relative"
    """What `second` is likely to be: `relative` or `plate`."""
    time_unit: str = ""
    unit: str = ""


def preview_file(path: Path, given: ParseOptions | None = None) -> FilePreview:
    """Look into a file that `import_csv` can read. Raises ImportFileError, ExtraMissingError."""
    given = given or ParseOptions()
    if is_csv(path):
        return _survey_text(path, given)
    has_header = given.header is not False
    names = list_columns(path, CsvOptions("", "", skip=given.skip, header=has_header))
    return _recognise(names, (), ParseOptions(skip=given.skip, header=has_header))


def _survey_text(path: Path, given: ParseOptions) -> FilePreview:
    """Read with the given options, and else in the usual way that makes the most of the cells numbers."""
    found: list[tuple[float, CsvText]] = []
    faults = []
    for header in (True, False) if given.header is None else (given.header,):
        for decimal in _DECIMALS if given.decimal is None else (given.decimal,):
            try:
                source = csv_reading.survey_csv(
                    path, CsvOptions("", "", None, given.delimiter, decimal, given.skip, header)
                )
                found.append((_numeric_share(source), source))
            except ImportFileError as error:
                faults.append(error)
    if not found:
        raise faults[0]
    share, source = max(found, key=lambda pair: pair[0])
    if not share:
        raise ImportFileError(
            "{path}: no columns of numbers. Check {skip_option}, {delimiter_option} and {decimal_option}",
            path=path,
            skip_option=option("--skip"),
            delimiter_option=option("--delimiter"),
            decimal_option=option("--decimal"),
        )
    rows = _first_rows(source)
    width = max(len(source.names), *(len(row) for row in rows))
    names = [*source.names, *[""] * (width - len(source.names))]
    return _recognise(
        names, rows, ParseOptions(source.delimiter, source.decimal, given.skip, bool(source.names))
    )


def _numeric_share(source: CsvText) -> float:
    cells = [csv_reading.is_number(cell, source.decimal) for row in _first_rows(source) for cell in row]
    return sum(cells) / max(len(cells), 1)


def _first_rows(source: CsvText) -> tuple[tuple[str, ...], ...]:
    lines = (
        line.text for line in csv_reading.lines_from(source.text, source.data.number, source.data.offset)
    )
    return tuple(
        tuple(csv_reading.split_line(text, source.delimiter))
        for text in islice(filter(csv_reading.is_data, lines), _LINES)
    )


def _recognise(names: Sequence[str], rows: tuple[tuple[str, ...], ...], given: ParseOptions) -> FilePreview:
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
        columns, titles, rows, given,
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
