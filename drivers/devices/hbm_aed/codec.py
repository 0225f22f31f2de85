"""Measured values of an AED or FIT in the formats COF8 and COF11 (HBM, AD104 manual, pages 15, 21 and 38)."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from drivers.arrays import Counts, Int32s, Ints, UInt8s
from drivers.fixed_frames import FrameMarks, MarkedFrameDecoder, read_numbers
from drivers.packets import MAX_GAP_S
from drivers.samples import SampleStatus

MAX_COUNT = 2**23 - 1
"""Of a value of three bytes; 5,120,000 at nominal load unless the device is scaled (NOV)."""
_NOT_GOOD = 0x07 | 0xC0
"""Bits of the status: net, gross and converter overflow; value and status do not belong together."""
_CR_LF = (0x0D, 0x0A)
_SIGN_BITS = 1 << 24
_VALUE_CHARACTERS = 8
_STATUS_AT, _STATUS_CHARACTERS = 9, 3
_COMMA, _MINUS, _DIGIT_0 = 0x2C, 0x2D, 0x30


class Format(StrEnum):
    """How values are sent."""

    BINARY = "binary"
    """Three bytes, high byte first, the status, CR LF."""
    ASCII = "ascii"  # eight characters, a comma, the status in three, CR LF


@dataclass(frozen=True, slots=True)
class OutputFormat:
    """A format, its command and its frames."""

    code: int  # parameter of `COF`
    marks: FrameMarks


_TEXT = tuple((place, 0xE0, 0x20) for place in range(_VALUE_CHARACTERS))
"""Digits, signs and blanks are 20 to 3F."""
FORMATS = {
    Format.BINARY: OutputFormat(8, FrameMarks(6, ((4, 0xFF, 0x0D), (5, 0xFF, 0x0A)), ahead=0, confirming=3)),
    Format.ASCII: OutputFormat(
        11,
        FrameMarks(
            14, (*_TEXT, (_VALUE_CHARACTERS, 0xFF, _COMMA), (12, 0xFF, 0x0D), (13, 0xFF, 0x0A)), ahead=0
        ),
    ),
}


def encode_frames(kind: Format, counts: Int32s, status: int | UInt8s = 0) -> list[bytes]:
    """Frames as a device without faults sends them.

    The first column of `counts` (n, 2) is sent, limited to the range, with the status byte `status`, of all
    or (n,).
    """
    values = np.clip(counts[:, 0], -MAX_COUNT - 1, MAX_COUNT).tolist()
    flags = np.broadcast_to(status, len(values)).tolist()
    if kind is Format.ASCII:
        return [b"%8d,%03d\r\n" % pair for pair in zip(values, flags, strict=True)]
    both = zip(values, flags, strict=True)
    return [value.to_bytes(3, "big", signed=True) + bytes([flag, *_CR_LF]) for value, flag in both]


class ValueDecoder(MarkedFrameDecoder):
    """A `MarkedFrameDecoder` of the only gauge; a value with an overflow in its status is an overload."""

    def __init__(self, kind: Format, rate_hz: float, max_gap_s: float = MAX_GAP_S) -> None:
        super().__init__(FORMATS[kind].marks, rate_hz, max_gap_s)
        self._kind = kind

    def _read_frames(self, buffer: UInt8s, offsets: Ints) -> tuple[Counts, Ints]:
        if self._kind is Format.ASCII:
            values, status = _read_text(buffer, offsets)
        else:
            numbers = read_numbers(buffer, offsets, [0], 3)[:, 0]
            values = np.where(numbers > MAX_COUNT, numbers - _SIGN_BITS, numbers)
            status = buffer[offsets + 3].astype(np.int64)
        counts = np.zeros((len(offsets), 2), dtype=np.int32)
        counts[:, 0] = values
        return counts, np.where(status & _NOT_GOOD, int(SampleStatus.OVERLOAD_TABLE), 0)


def _read_text(buffer: UInt8s, offsets: Ints) -> tuple[Ints, Ints]:
    """Values and status of lines at `offsets` (n,), each (n,)."""
    characters = buffer[np.add.outer(offsets, np.arange(_VALUE_CHARACTERS))]
    size = _decimal(characters)
    values = np.where((characters == _MINUS).any(axis=1), -size, size)
    status = buffer[np.add.outer(offsets, _STATUS_AT + np.arange(_STATUS_CHARACTERS))]
    return np.clip(values, -MAX_COUNT - 1, MAX_COUNT), _decimal(status)


def _decimal(characters: UInt8s) -> Ints:
    """Number of each row of characters, those that are no digits left out."""
    is_digit = (characters >= _DIGIT_0) & (characters < _DIGIT_0 + 10)
    number = np.zeros(len(characters), dtype=np.int64)
    for place in range(characters.shape[1]):
        grown = 10 * number + (characters[:, place] & 0x0F)
        number = np.where(is_digit[:, place], grown, number)
    return number


def count_frames(kind: Format, data: bytes) -> int:
    """Frames in `data`."""
    return sum(map(len, ValueDecoder(kind, 1.0).feed(data, 0)))
