"""What the columns of lines are that nobody has described, as far as the lines tell it."""

import math
import re
from collections import Counter
from dataclasses import dataclass
from functools import reduce
from operator import xor
from typing import TypeAlias

import numpy as np

from drivers.crc import crc16
from drivers.csv_lines.columns import TIME_UNIT_S, Column, LineFormat
from drivers.diagnosis import is_text

_COMMENT = b"#%;/"
_LINES_NEEDED = 3
_LINES_LOOKED_AT = 400
_ALIKE = 0.8
"""Part of the lines that must look the same."""
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?", re.IGNORECASE)
_SEPARATORS = {"tab": "\t", "semicolon": ";", "comma": ",", "space": " "}
_DECIMALS = {"point": ".", "comma": ","}
_LEAST_VALUES = 5
"""Different values that tell a counter from a reading that happens to rise."""
_STEADY = 0.5
"""Part of the mean step by which steps may differ."""
_KILOHERTZ_FACTOR = 1.2
_ROUNDING = 1e-6
_USUAL_US = 200
"""A step of so much and more is rather one in microseconds than in milliseconds."""
_TIME_FACTOR = 3.0
"""By which a time's own rate and that of the lines may differ."""

_Rows: TypeAlias = list[list[str]]


@dataclass(frozen=True, slots=True)
class InferredColumns:
    """A layout, the settings that give it, and what is uncertain about it."""

    layout: LineFormat
    settings: dict[str, str]
    remark: str = ""


def infer_columns(data: bytes, duration_s: float | None = None) -> InferredColumns | None:
    """Layout of lines of numbers; None if `data` are not such lines.

    A time is what grows in steady steps that fit the rate at which the lines came (over `duration_s`), a
    sequence what grows by one. Of other columns the first two are taken for the gauges'.
    """
    every_line = _lines(data)
    if not is_text(data) or len(every_line) < _LINES_NEEDED:
        return None
    lines = every_line[-_LINES_LOOKED_AT:]
    rows, separator, decimal = _split(lines)
    if not rows:
        return None
    rate_hz = (len(every_line) - 1) / duration_s if duration_s else None
    columns = _roles(rows, lines, _SEPARATORS[separator], rate_hz)
    if not {Column.TABLE, Column.VALUE} & set(columns):
        return None
    layout = LineFormat(tuple(columns), _SEPARATORS[separator], _DECIMALS[decimal])
    settings = {"columns": ",".join(columns)}
    settings |= {"separator": separator} if separator != "comma" else {}
    settings |= {"decimal": decimal} if decimal != "point" else {}
    remark = "" if Column.IGNORE not in columns else "check which columns are the gauges'"
    return InferredColumns(layout, settings, remark)


def _lines(data: bytes) -> list[str]:
    """Whole lines that are neither blank nor comments."""
    parts = data.replace(b"\r", b"\n").split(b"\n")[1:-1]
    kept = [part for part in parts if part.strip() and part[:1] not in _COMMENT]
    return [part.decode("ascii", "replace") for part in kept]


def _split(lines: list[str]) -> tuple[_Rows, str, str]:
    """Fields of the lines that look alike, by the separator and decimal that part them into most."""
    best: tuple[_Rows, str, str] = ([], "comma", "point")
    for separator, mark in _SEPARATORS.items():
        for decimal, point in _DECIMALS.items():
            if mark == point:
                continue
            rows = _alike([_fields(line, mark, point) for line in lines])
            if len(rows) >= _ALIKE * len(lines) and _width(rows) > _width(best[0]):
                best = (rows, separator, decimal)
    return best


def _fields(line: str, mark: str, point: str) -> list[str]:
    """Fields with a decimal point; empty if they are no numbers, save the last, which may be a checksum."""
    fields = line.split() if mark == " " else [field.strip() for field in line.split(mark)]
    if point == "," and any("." in field for field in fields):
        return []
    fields = [field.replace(point, ".") for field in fields]
    numbers = fields if len(fields) == 1 or _is_number(fields[-1]) else fields[:-1]
    is_row = all(map(_is_number, numbers)) and (len(numbers) == len(fields) or _is_hex(fields[-1]))
    return fields if is_row else []


def _alike(rows: _Rows) -> _Rows:
    width, _ = Counter(map(len, rows)).most_common(1)[0]
    return [row for row in rows if len(row) == width] if width else []


def _width(rows: _Rows) -> int:
    return len(rows[0]) if rows else 0


def _is_number(field: str) -> bool:
    return _NUMBER.fullmatch(field) is not None


def _is_hex(field: str) -> bool:
    return len(field) in (2, 4) and all(digit in "0123456789abcdefABCDEF" for digit in field)


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
    """What the last column is of, if it agrees with most lines."""
    agree = {Column.XOR: 0, Column.CRC: 0}
    for line in lines:
        before, _, said = line.strip().rpartition(separator)
        data = before.encode("ascii", "replace")
        agree[Column.XOR] += said.upper() == f"{reduce(xor, data, 0):02X}"
        agree[Column.CRC] += said.upper() == f"{crc16(data):04X}"
    found = max(agree, key=lambda column: agree[column])
    return found if agree[found] >= _ALIKE * len(lines) else None


def _counter(fields: list[str], rate_hz: float | None, may_be_time: bool) -> Column | None:
    """The time or sequence that a column holds."""
    values = np.array([float(field) for field in fields])
    steps = np.diff(values)
    onward = steps[steps >= 0]
    if len(onward) < _ALIKE * len(steps) or len(np.unique(values)) < min(_LEAST_VALUES, len(values)):
        return None
    finest = 10.0 ** -max(len(field.partition(".")[2]) for field in fields)
    low, high = np.quantile(onward, (0.1, 0.9))
    step = float(onward[onward <= 2 * high + finest].mean())
    if float(np.mean(steps == 1)) >= _ALIKE and not (may_be_time and _is_kilohertz(rate_hz)):
        return Column.SEQUENCE
    unit = _unit(step, finest, rate_hz) if may_be_time else None
    return unit if high - low <= _STEADY * step + finest * (1 + _ROUNDING) else None


def _is_kilohertz(rate_hz: float | None) -> bool:
    """Whether lines come so often that a time in milliseconds grows by one."""
    return rate_hz is not None and abs(math.log(rate_hz / 1000)) < math.log(_KILOHERTZ_FACTOR)


def _unit(step: float, finest: float, rate_hz: float | None) -> Column | None:
    """Unit in which `step` is the time between lines; without their rate the most usual one."""
    if rate_hz is None:
        whole = Column.TIME_US if step >= _USUAL_US else Column.TIME_MS
        return whole if finest == 1 else Column.TIME_S
    misfits = {column: abs(math.log(step * unit_s * rate_hz)) for column, unit_s in TIME_UNIT_S.items()}
    best = min(misfits, key=lambda column: misfits[column])
    return best if misfits[best] <= math.log(_TIME_FACTOR) else None
