"""Compiled parser of lines of numbers."""

import numpy as np
from numpy.typing import NDArray

from drivers.arrays import Ints, Record, Records, UInt8s, record_type
from drivers.compiled import compiled, inlined
from drivers.crc_slice import crc16_slice
from drivers.devices.csv_lines.columns import MAX_STATUS_BYTES, Column, LineFormat
from drivers.line_counting import LINE
from drivers.samples import SampleStatus

ROLE_IGNORE, ROLE_TIME, ROLE_SEQUENCE, ROLE_TABLE, ROLE_RELATIVE = range(5)
ROLE_UNIT, ROLE_EMPTY, ROLE_XOR, ROLE_CRC, ROLE_STATUS, ROLE_WORD = range(5, 11)
_ROLES = dict.fromkeys((Column.TIME_US, Column.TIME_MS, Column.TIME_S), ROLE_TIME)
_ROLES |= {Column.TABLE: ROLE_TABLE, Column.RELATIVE: ROLE_RELATIVE, Column.VALUE: ROLE_TABLE}
_ROLES |= {Column.SEQUENCE: ROLE_SEQUENCE, Column.IGNORE: ROLE_IGNORE, Column.UNIT: ROLE_UNIT}
_ROLES |= {Column.EMPTY: ROLE_EMPTY, Column.XOR: ROLE_XOR, Column.CRC: ROLE_CRC}
_ROLES |= {Column.STATUS: ROLE_STATUS, Column.WORD: ROLE_WORD}

MARKS = record_type("separator decimal overload", "")
"""Characters, and the flags of an overload that the status column reports."""
_GOOD, _OVERLOAD, _FAULT = range(3)

_LF, _CR, _BLANK, _PLUS, _MINUS, _ZERO = b"\n\r +-0"
_EXPONENT = 0x65  # "e", after setting the bit that makes a letter small
_SMALL = 0x20
_FIRST_LETTER, _LAST_LETTER, _LAST_PRINTABLE = b"az~"
_BROKEN = -1
_MAX_MANTISSA = 10**17
_MAX_EXPONENT_DIGITS = 3
_POWERS = 10.0 ** np.arange(23)
"""The powers of ten that a double holds exactly."""


def _hex_values() -> NDArray[np.uint32]:
    """(256,) values of hex digits; of other characters a number that makes any sum wrong."""
    values = np.full(256, 1 << 16, dtype=np.uint32)
    for digit in b"0123456789ABCDEFabcdef":
        values[digit] = int(chr(digit), 16)
    return values


_HEX_VALUES = _hex_values()


class LineParser:
    """Parser of lines of one layout. Its result is valid until the next call, which reuses it."""

    def __init__(self, layout: LineFormat) -> None:
        self._roles = np.array([_ROLES[column] for column in layout.columns], dtype=np.int64)
        overload = SampleStatus.OVERLOAD_TABLE
        overload |= SampleStatus.OVERLOAD_RELATIVE if layout.channels > 1 else 0
        marks = ord(layout.separator), ord(layout.decimal), int(overload)
        self._marks = np.array([marks], dtype=MARKS)
        self._words = _status_words(layout)
        self._lines = np.zeros(0, dtype=LINE)
        self._comment = np.frombuffer(layout.comment.encode("ascii"), dtype=np.uint8)
        self._unit = np.frombuffer(layout.unit.encode("ascii"), dtype=np.uint8)

    def read(self, data: bytes) -> Records:
        """(lines,) LINE of `data`, which are empty or end in a terminator."""
        most = len(data) // 2 + 1
        if len(self._lines) < most:
            self._lines = np.zeros(most, dtype=LINE)  # what has no column stays 0
        buffer = np.frombuffer(data, dtype=np.uint8)
        texts = self._comment, self._unit, self._words
        found = read_lines(buffer, self._roles, self._marks, *texts, self._lines)
        return self._lines[:found]


def _status_words(layout: LineFormat) -> UInt8s:
    """(n, 2 + longest) of the words in the status column: what it means, length, characters."""
    kinds = {_OVERLOAD: layout.overload_status, _FAULT: layout.fault_status}
    words = [(kind, word.encode("ascii")) for kind, given in kinds.items() for word in given]
    rows = [bytes([kind, len(word)]) + word.ljust(MAX_STATUS_BYTES, b"\0") for kind, word in words]
    return np.frombuffer(b"".join(rows), dtype=np.uint8).reshape(len(rows), 2 + MAX_STATUS_BYTES)


@compiled
def read_lines(
    buffer: UInt8s,
    roles: Ints,
    marks: Records,
    comment: UInt8s,
    unit: UInt8s,
    words: UInt8s,
    lines: Records,
) -> int:
    """Read all lines of `buffer`, whose last byte is a terminator; returns how many have content.

    A number of at most 15 digits and a power of ten up to 22 is read exactly; others to within 1e-15 of
    themselves, from 1e-280 to 1e280.
    """
    at = 0
    found = 0
    while at < len(buffer):
        if buffer[at] == _LF or buffer[at] == _CR:
            at += 1
            continue
        line = lines[found]
        line.start = at
        commented = _is_in(buffer[at], comment)
        end = _BROKEN if commented else _read_line(buffer, at, roles, marks[0], unit, words, line)
        line.good = end != _BROKEN
        if end == _BROKEN:
            end = at
            while buffer[end] != _LF and buffer[end] != _CR:
                end += 1
        line.end = end
        if not commented:
            found += 1
        at = end + 1
    return found


@inlined
def _is_in(character: int, characters: UInt8s) -> bool:
    for one in characters:  # noqa: SIM110 (plain loops compile to better code)
        if one == character:
            return True
    return False


@inlined
def _read_line(
    buffer: UInt8s, start: int, roles: Ints, mark: Record, unit: UInt8s, words: UInt8s, line: Record
) -> int:
    """Position of the line's end; `_BROKEN` if it is damaged. One of an overload may end after its status."""
    line.overload = 0
    at = _read_columns(buffer, start, roles, mark, unit, words, line)
    if at != _BROKEN or not line.overload or roles[-1] == ROLE_XOR or roles[-1] == ROLE_CRC:
        return at
    line.table = line.relative = 0.0
    at = start
    while buffer[at] != _LF and buffer[at] != _CR:
        at += 1
    return at


@inlined
def _read_columns(
    buffer: UInt8s, start: int, roles: Ints, mark: Record, unit: UInt8s, words: UInt8s, line: Record
) -> int:
    at = start
    for column in range(len(roles)):
        role = roles[column]
        if role < ROLE_UNIT:
            value, at = _read_number(buffer, at, mark.separator, mark.decimal)
            if role == ROLE_TIME:
                line.time = value
            elif role == ROLE_TABLE:
                line.table = value
            elif role == ROLE_RELATIVE:
                line.relative = value
            elif role == ROLE_SEQUENCE:
                line.sequence = value
        elif role == ROLE_STATUS:
            kind, at = _read_status(buffer, at, mark.separator, words)
            if kind == _FAULT:
                return _BROKEN
            if kind == _OVERLOAD:
                line.overload = mark.overload
        elif role == ROLE_WORD:
            at = _end_of_word(buffer, _skip_blanks(buffer, at, -1), mark.separator)
        elif role >= ROLE_XOR:
            at = _check(buffer, start, at, role)
        elif role == ROLE_UNIT:
            at = _read_word(buffer, at, unit)
        else:
            at = _skip_blanks(buffer, at, mark.separator)
        if at == _BROKEN:
            return _BROKEN
        if column < len(roles) - 1:
            if buffer[at] == mark.separator:
                at += 1
            elif roles[column + 1] != ROLE_UNIT or buffer[at - 1] != _BLANK:
                return _BROKEN
    at = _skip_blanks(buffer, at, -1)
    return at if buffer[at] == _LF or buffer[at] == _CR else _BROKEN


@inlined
def _end_of_word(buffer: UInt8s, start: int, separator: int) -> int:
    """Position after characters that can be printed; `_BROKEN` if there is none."""
    at = start
    while _BLANK < buffer[at] <= _LAST_PRINTABLE and buffer[at] != separator:
        at += 1
    return at if at > start else _BROKEN


@inlined
def _read_status(buffer: UInt8s, start: int, separator: int, words: UInt8s) -> tuple[int, int]:
    """What a status means and the position after it; `_BROKEN` if there is none."""
    first = _skip_blanks(buffer, start, -1)
    end = _end_of_word(buffer, first, separator)
    if end == _BROKEN:
        return _FAULT, _BROKEN
    kind = _GOOD
    for word in words:
        is_same = word[1] == end - first
        for place in range(word[1] if is_same else 0):
            is_same = is_same and buffer[first + place] == word[2 + place]
        if is_same:
            kind = int(word[0])
    return kind, _skip_blanks(buffer, end, separator)


@inlined
def _read_word(buffer: UInt8s, start: int, word: UInt8s) -> int:
    """Position after `word`, or after any word if that is empty; `_BROKEN` if there is none."""
    first = _skip_blanks(buffer, start, -1)
    at = first
    while _FIRST_LETTER <= buffer[at] | _SMALL <= _LAST_LETTER:
        if len(word) and (at - first >= len(word) or buffer[at] != word[at - first]):
            return _BROKEN
        at += 1
    return at if at > first and at - first >= len(word) else _BROKEN


@inlined
def _read_number(buffer: UInt8s, at: int, separator: int, decimal: int) -> tuple[float, int]:
    """A number, maybe with blanks around it, and the position after it; `_BROKEN` if there is none."""
    at = _skip_blanks(buffer, at, -1)
    negative = buffer[at] == _MINUS
    if negative or buffer[at] == _PLUS:
        at = _skip_blanks(buffer, at + 1, separator)  # balances right-justify the digits behind the sign
    first = at
    mantissa, kept, at = _read_digits(buffer, at, 0)
    digits = at - first
    power = digits - kept
    if buffer[at] == decimal:
        first = at + 1
        mantissa, kept, at = _read_digits(buffer, first, mantissa)
        digits += at - first
        power -= kept
    if digits == 0:
        return 0.0, _BROKEN
    if buffer[at] | _SMALL == _EXPONENT:
        exponent, at = _read_exponent(buffer, at + 1)
        power += exponent
    value = _scaled(float(mantissa), power)
    if at != _BROKEN:
        at = _skip_blanks(buffer, at, separator)
    return (-value if negative else value), at


@inlined
def _read_digits(buffer: UInt8s, at: int, mantissa: int) -> tuple[int, int, int]:
    """`mantissa` with the digits from `at` on appended, the number of them, and the position after them."""
    kept = 0
    while True:
        digit = int(buffer[at]) - _ZERO
        if digit < 0 or digit > 9:
            return mantissa, kept, at
        if mantissa < _MAX_MANTISSA:
            mantissa = 10 * mantissa + digit
            kept += 1
        at += 1


@inlined
def _read_exponent(buffer: UInt8s, at: int) -> tuple[int, int]:
    """A whole number of at most three digits and the position after it; `_BROKEN` if there is none."""
    negative = buffer[at] == _MINUS
    if negative or buffer[at] == _PLUS:
        at += 1
    value, kept, end = _read_digits(buffer, at, 0)
    if not 1 <= kept <= _MAX_EXPONENT_DIGITS:
        return 0, _BROKEN
    return (-value if negative else value), end


@inlined
def _scaled(mantissa: float, power: int) -> float:
    """`mantissa` times ten to `power`, rounded once where both are exact."""
    if power == 0:
        return mantissa
    if 0 < power < len(_POWERS):
        return float(mantissa * _POWERS[power])
    if -len(_POWERS) < power < 0:
        return float(mantissa / _POWERS[-power])
    return float(mantissa * 10.0**power)


@inlined
def _skip_blanks(buffer: UInt8s, at: int, separator: int) -> int:
    """Position of the next character that is no blank, or is the separator."""
    while buffer[at] == _BLANK and separator != _BLANK:
        at += 1
    return at


@inlined
def _check(buffer: UInt8s, start: int, at: int, role: int) -> int:
    """Position after a checksum that agrees with the line before it, else `_BROKEN`."""
    digits = 4 if role == ROLE_CRC else 2
    if at + digits >= len(buffer):
        return _BROKEN
    sent = 0
    for place in range(at, at + digits):
        sent = sent << 4 | int(_HEX_VALUES[buffer[place]])
    if role == ROLE_CRC:
        found = int(crc16_slice(buffer, start, at - 1))
    else:
        found = 0
        for place in range(start, at - 1):
            found ^= int(buffer[place])
    return at + digits if sent == found else _BROKEN
