"""Lines of values, made from samples and taken apart again."""

from functools import reduce
from operator import xor

import numpy as np
from numpy.typing import NDArray

from drivers.crc import crc16
from drivers.csv_lines.columns import TIME_UNIT_S, Column, LineFormat


def encode_line(layout: LineFormat, time_s: float, table: float, relative: float, sequence: int = 0) -> bytes:
    r"""One line, ended by `\r\n` as Arduino's `println` does.

    Parameters
    ----------
    layout : LineFormat
        Columns and how they are written; `ignore` columns become 0.
    time_s : float
        Device time (s); us and ms columns are whole numbers that wrap at `counter_bits`.
    table, relative : float
        Readings; whole numbers are written without a decimal point.
    sequence : int
        Index of the sample; wraps at `counter_bits`.
    """
    fields = [
        _field(layout, column, time_s, table, relative, sequence)
        for column in layout.columns
        if column is not layout.checksum
    ]
    line = layout.separator.join(fields).encode("ascii")
    if layout.checksum is not None:
        line += layout.separator.encode("ascii") + _checksum(layout.checksum, line)
    return line + b"\r\n"


def encode_lines(
    layout: LineFormat,
    times_s: NDArray[np.float64],
    counts: NDArray[np.int32] | NDArray[np.float64],
    first_sequence: int = 0,
) -> list[bytes]:
    """A line for each row of `counts` (n, 2), at device times `times_s` (n,); see `encode_line`."""
    return [
        encode_line(layout, time_s, table, relative, first_sequence + row)
        for row, (time_s, (table, relative)) in enumerate(zip(times_s.tolist(), counts.tolist(), strict=True))
    ]


def _field(
    layout: LineFormat, column: Column, time_s: float, table: float, relative: float, sequence: int
) -> str:
    match column:
        case Column.TIME_US | Column.TIME_MS:
            return str(_wrapped(round(time_s / TIME_UNIT_S[column]), layout.counter_bits))
        case Column.TIME_S:
            return _number(round(time_s, 6), layout.decimal)
        case Column.TABLE:
            return _number(table, layout.decimal)
        case Column.RELATIVE:
            return _number(relative, layout.decimal)
        case Column.SEQUENCE:
            return str(_wrapped(sequence, layout.counter_bits))
        case _:
            return "0"


def _wrapped(value: int, bits: int) -> int:
    return value % (1 << bits) if bits else value


def _number(value: float, decimal: str) -> str:
    text = str(int(value)) if value == int(value) else repr(value)
    return text.replace(".", decimal)


def _checksum(column: Column, line: bytes) -> bytes:
    if column is Column.CRC:
        return b"%04X" % crc16(line)
    return b"%02X" % reduce(xor, line, 0)
