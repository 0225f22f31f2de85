r"""Layout of lines, inferred from the lines.

A SparkFun OpenScale with firmware 1.2 sends `[ms,]value,lbs|kg,[raw,][t,][t,]`, with firmware 1.0
`[ms,][t,][t,]value,lbs|kg`, each ended by `\r\n`, after a banner; at 9600 baud and two lines a second unless
set otherwise (sparkfun/OpenScale, firmware/OpenScale/OpenScale/OpenScale.ino, `loop`, and System.ino,
`set_default_settings`).
"""

import math
import re
from collections import Counter
from dataclasses import dataclass
from functools import reduce
from itertools import pairwise
from operator import xor
from typing import TypeAlias

import numpy as np

from drivers.crc import crc16
from drivers.devices.csv_lines.columns import DECIMALS, SEPARATORS, TIME_UNIT_S, Column, LineFormat
from drivers.recognition import is_text
from messages.message import EMPTY, Message, message

_COMMENT = b"#%;/"
_LINES_NEEDED = 3
_LINES_EXAMINED = 400
_ALIKE = 0.8
"""Share of the lines that must have the same form: some may be banners or damaged."""
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?", re.IGNORECASE)
_CHECKSUM = re.compile(r"[0-9a-fA-F]{2}([0-9a-fA-F]{2})?")
_LEAST_VALUES = 5
"""Different values that distinguish a counter from a reading that happens to rise."""
_STEADY = 0.5  # share of the mean step by which steps may differ
_KILOHERTZ_FACTOR = 1.2  # how far a rate may be from 1 kHz for a time in milliseconds that grows by one
_ROUNDING = 1e-6
_USUAL_US = 200
"""Without a rate, larger steps are taken for microseconds and smaller ones for milliseconds."""
_TIME_FACTOR = 3.0  # largest ratio between the rate by a time column and the rate of the lines

_Rows: TypeAlias = list[list[str]]


@dataclass(frozen=True, slots=True)
class InferredColumns:
    """A layout, the settings for it, and what is uncertain about it."""

    layout: LineFormat
    settings: dict[str, str]
    remark: Message = EMPTY


def infer_columns(data: bytes, duration_s: float | None = None) -> InferredColumns | None:
    """Layout of lines of numbers; None if `data` are not such lines.

    A column that grows in even steps at the rate of the lines (over `duration_s`) is a time, one that grows
    by one a sequence. The first two of the other columns are taken for the gauges.
    """
    every_line = _lines(data)
    if not is_text(data) or len(every_line) < _LINES_NEEDED:
        return None
    lines = every_line[-_LINES_EXAMINED:]
    rows, separator, decimal = _split(lines)
    if not rows:
        return None
    rate_hz = (len(every_line) - 1) / duration_s if duration_s else None
    columns = _roles(rows, lines, SEPARATORS[separator], rate_hz)
    if not {Column.TABLE, Column.VALUE} & set(columns):
        return None
    layout = LineFormat(tuple(columns), SEPARATORS[separator], DECIMALS[decimal])
    settings = {"columns": ",".join(columns)}
    settings |= {"separator": separator} if separator != "comma" else {}
    settings |= {"decimal": decimal} if decimal != "point" else {}
    is_certain = Column.IGNORE not in columns
    remark = EMPTY if is_certain else message("check which columns are the gauges'")
    return InferredColumns(layout, settings, remark)


def _lines(data: bytes) -> list[str]:
    parts = data.replace(b"\r", b"\n").split(b"\n")[1:-1]
    kept = [part for part in parts if part.strip() and part[:1] not in _COMMENT]
    return [part.decode("ascii", "replace") for part in kept]


def _split(lines: list[str]) -> tuple[_Rows, str, str]:
    """Fields of the lines of the same form, with the separator and decimal that give most fields."""
    best: tuple[_Rows, str, str] = ([], "comma", "point")
    for separator, mark in SEPARATORS.items():
        for decimal, point in DECIMALS.items():
            if mark == point:
                continue
            rows = [_fields(line, mark, point) for line in lines]
            width, number = Counter(map(len, rows)).most_common(1)[0]
            if number >= _ALIKE * len(lines) and width > (len(best[0][0]) if best[0] else 0):
                best = ([row for row in rows if len(row) == width], separator, decimal)
    return best


def _fields(line: str, mark: str, point: str) -> list[str]:
    """Fields with a decimal point; none unless all are numbers, the last one perhaps a checksum."""
    fields = line.split() if mark == " " else [field.strip() for field in line.split(mark)]
    if point == "," and any("." in field for field in fields):
        return []
    fields = [field.replace(point, ".") for field in fields]
    numbers = fields if len(fields) == 1 or _is_number(fields[-1]) else fields[:-1]
    is_row = all(map(_is_number, numbers)) and (numbers == fields or _CHECKSUM.fullmatch(fields[-1]))
    return fields if is_row else []


def _is_number(field: str) -> bool:
    return _NUMBER.fullmatch(field) is not None


def _roles(rows: _Rows, lines: list[str], separator: str, rate_hz: float | None) -> list[Column]:
    width = len(rows[0])
    columns = [Column.IGNORE] * width
    checksum = _checksum(lines, separator) if width > 1 else None
    if checksum is not None:
        columns[-1] = checksum
    for at in range(width - (checksum is not None)):
        may_be_time = not set(TIME_UNIT_S) & set(columns)
        role = _counter([row[at] for row in rows], rate_hz, may_be_time)
        if role is not None and role not in columns:
            columns[at] = role
    free = [at for at, column in enumerate(columns) if column is Column.IGNORE]
    if len(free) == 1:
        columns[free[0]] = Column.VALUE
    elif free:
        columns[free[0]], columns[free[1]] = Column.TABLE, Column.RELATIVE
    return columns


def _checksum(lines: list[str], separator: str) -> Column | None:
    agree = {Column.XOR: 0, Column.CRC: 0}
    for line in lines:
        before, _, checksum = line.strip().rpartition(separator)
        data = before.encode("ascii", "replace")
        agree[Column.XOR] += checksum.upper() == f"{reduce(xor, data, 0):02X}"
        agree[Column.CRC] += checksum.upper() == f"{crc16(data):04X}"
    found = max(agree, key=lambda column: agree[column])
    return found if agree[found] >= _ALIKE * len(lines) else None


def _counter(fields: list[str], rate_hz: float | None, may_be_time: bool) -> Column | None:
    values = np.array([float(field) for field in fields])
    steps = np.diff(values)
    onward = steps[steps >= 0]
    if len(onward) < _ALIKE * len(steps) or len(np.unique(values)) < min(_LEAST_VALUES, len(values)):
        return None
    finest = 10.0 ** -max(len(field.partition(".")[2]) for field in fields)
    low, high = np.quantile(onward, (0.1, 0.9))
    step = float(onward[onward <= 2 * high + finest].mean())
    # At about 1 kHz a time in milliseconds grows by one too.
    is_kilohertz = rate_hz is not None and abs(math.log(rate_hz / 1000)) < math.log(_KILOHERTZ_FACTOR)
    if float(np.mean(steps == 1)) >= _ALIKE and not (may_be_time and is_kilohertz):
        return Column.SEQUENCE
    unit = _unit(step, finest, rate_hz) if may_be_time else None
    return unit if high - low <= _STEADY * step + finest * (1 + _ROUNDING) else None


def _unit(step: float, finest: float, rate_hz: float | None) -> Column | None:
    """Unit in which `step` is the time between lines; the most usual one where their rate is unknown."""
    if rate_hz is None:
        whole = Column.TIME_US if step >= _USUAL_US else Column.TIME_MS
        return whole if finest == 1 else Column.TIME_S
    misfits = {column: abs(math.log(step * unit_s * rate_hz)) for column, unit_s in TIME_UNIT_S.items()}
    best = min(misfits, key=lambda column: misfits[column])
    return best if misfits[best] <= math.log(_TIME_FACTOR) else None


OPENSCALE_UNITS = ("kg", "lbs")
OPENSCALE_FORMAT = LineFormat((Column.TIME_MS, Column.VALUE, Column.UNIT, Column.EMPTY), unit="kg")
"""As shipped: a time, no temperatures, kg."""
_OPENSCALE_LINES = 3


def find_openscale_format(data: bytes) -> LineFormat | None:
    """Layout of an OpenScale from the first three consecutive lines of the same form; None without such.

    A first field is a time only where it grows from line to line in whole numbers: a temperature without a
    sensor is 0.
    """
    lines = [line for line in data[: data.rfind(b"\n") + 1].splitlines() if line]
    rows = [line.decode("ascii", "replace").split(",") for line in lines]
    shapes = [_shape(row) for row in rows]
    starts = range(len(rows) - _OPENSCALE_LINES + 1)
    alike = (at for at in starts if shapes[at] and len(set(shapes[at : at + _OPENSCALE_LINES])) == 1)
    start = next(alike, None)
    if start is None:
        return None
    fields = rows[start]
    unit_at = next(at for at, field in enumerate(fields) if field in OPENSCALE_UNITS)
    columns = [Column.IGNORE if field else Column.EMPTY for field in fields]
    columns[unit_at - 1 : unit_at + 1] = Column.VALUE, Column.UNIT
    times = [row[0] for row in rows[start : start + _OPENSCALE_LINES]]
    are_whole = all(time.removeprefix("-").isdigit() for time in times)
    if unit_at > 1 and are_whole and all(int(before) < int(after) for before, after in pairwise(times)):
        columns[0] = Column.TIME_MS
    return LineFormat(tuple(columns), unit=fields[unit_at])


def _shape(fields: list[str]) -> tuple[str, ...] | None:
    units = [at for at, field in enumerate(fields) if field in OPENSCALE_UNITS]
    numbers = [field for field in fields if field and field not in OPENSCALE_UNITS]
    are_numbers = all(field.removeprefix("-").replace(".", "", 1).isdigit() for field in numbers)
    if len(units) != 1 or units[0] == 0 or "" in fields[:-1] or not are_numbers:
        return None
    return tuple(field if field in OPENSCALE_UNITS else "number" if field else "" for field in fields)
