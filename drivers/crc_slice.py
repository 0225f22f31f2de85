"""CRC-16/CCITT-FALSE for slices of a buffer in compiled code."""

import numpy as np
from numpy.typing import NDArray

from drivers.arrays import UInt8s
from drivers.compiled import compiled
from drivers.crc import CRC_START

_POLYNOMIAL = 0x1021
_SLICES = 8
# Unsigned throughout: mixed signs would make numba compute in floats and check for negative indices.
_START = np.uint64(CRC_START)
_BYTE = np.uint64(8)
_LOW = np.uint64(0xFF)


def _tables() -> NDArray[np.uint16]:
    """(8, 256) remainders: row k is that of a byte followed by k zero bytes (slicing by 8)."""
    rows = np.zeros((_SLICES, 256), dtype=np.uint16)
    for byte in range(256):
        remainder = byte << 8
        for _ in range(8):
            remainder = (remainder << 1) ^ (_POLYNOMIAL if remainder & 0x8000 else 0)
        rows[0, byte] = remainder & 0xFFFF
    for row in range(1, _SLICES):
        before = rows[row - 1]
        rows[row] = (before << 8) ^ rows[0][before >> 8]
    return rows


_T = _tables()


@compiled
def crc16_slice(buffer: UInt8s, start: int, end: int) -> np.uint64:
    """CRC-16/CCITT-FALSE of `buffer[start:end]`, eight and four bytes a step, for other compiled code."""
    crc = _START
    at = start
    while at + 8 <= end:
        crc = np.uint64(
            _T[7, buffer[at] ^ (crc >> _BYTE)]
            ^ _T[6, buffer[at + 1] ^ (crc & _LOW)]
            ^ _T[5, buffer[at + 2]]
            ^ _T[4, buffer[at + 3]]
            ^ _T[3, buffer[at + 4]]
            ^ _T[2, buffer[at + 5]]
            ^ _T[1, buffer[at + 6]]
            ^ _T[0, buffer[at + 7]]
        )
        at += 8
    if at + 4 <= end:
        crc = np.uint64(
            _T[3, buffer[at] ^ (crc >> _BYTE)]
            ^ _T[2, buffer[at + 1] ^ (crc & _LOW)]
            ^ _T[1, buffer[at + 2]]
            ^ _T[0, buffer[at + 3]]
        )
        at += 4
    while at < end:
        crc = ((crc & _LOW) << _BYTE) ^ np.uint64(_T[0, (crc >> _BYTE) ^ buffer[at]])
        at += 1
    return crc
