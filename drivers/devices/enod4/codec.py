"""Frames and commands of fast SCMBus, encoded and decoded.

`02 | status u16 | value i24 | cks | 03`, most significant byte first; before a byte 02, 03 or 10 of status
and value comes a byte 10. Scaime, eNod4-B software manual NU-soft-eNod4B-E-0716, pages 15 to 18.
"""

from enum import IntEnum, StrEnum

import numpy as np

from drivers.arrays import Int32s, Ints, Records, UInt8s
from drivers.compiled import compiled, inlined
from drivers.fixed_frames import FixedFrameDecoder
from drivers.packets import MAX_GAP_S, frames_in, state_type
from drivers.samples import SampleStatus

STX, ETX, DLE = 0x02, 0x03, 0x10
MIN_FRAME_BYTES = 8
_DATA_BYTES = 5
_SUM_MARK = 0x80
"""Set in each checksum, which so is never a byte that is marked by `DLE`."""
_COMMAND_END = b"\r\xff"
"""0D, and FF in place of the CRC-8, which a device always accepts (page 17)."""
_STATE_BITS, _OVER_CAPACITY = 0x0C, 0x08
"""Bits 3-2 of the status (page 45): 00 well, 01 sensor defect, 10 over capacity, 11 beyond the converter."""
_EEPROM_FAULT = 0x40
"""With it all measurements read FFFF (page 45)."""
_SENDING = 0x80  # bit 7 is 1 in SCMBus (page 45)


class Code(IntEnum):
    """Functional commands."""

    START_NET = 0xE0
    START_FACTORY = 0xE1
    START_GROSS = 0xE2
    STOP = 0xE3


UNKNOWN_COMMAND, FAILED_COMMAND = 0xFE, 0xFF
"""In place of the command in the answer to one that was not done."""


class Checksum(StrEnum):
    """Where the sum begins. The manual says "all previous bytes" and shows no example.

    Nor does it say whether the bytes 10 that were put in count: frames are good with and without them.
    """

    FRAME = "frame"  # with the first byte
    DATA = "data"  # with the status

    @property
    def first(self) -> int:
        """What the first byte adds."""
        return STX if self is Checksum.FRAME else 0


def encode_command(address: int, code: int) -> bytes:
    """A command as sent, and as a device that does it sends it back."""
    return bytes([address, code]) + _COMMAND_END


def encode_frames(counts: Int32s, status: Ints, checksum: Checksum = Checksum.FRAME) -> list[bytes]:
    """Frames of values (n,), limited to 24 bits, with status words (n,)."""
    values = np.clip(counts, -(1 << 23), (1 << 23) - 1).tolist()
    return [_encode(value, word, checksum) for value, word in zip(values, status.tolist(), strict=True)]


def status_words(overloads: UInt8s) -> Ints:
    """Status words (n,) of a device without faults, from flags (n,) that are not 0 where it is overloaded."""
    return np.where(overloads, _SENDING | _OVER_CAPACITY, _SENDING)


def _encode(value: int, word: int, checksum: Checksum) -> bytes:
    data = word.to_bytes(2, "big") + value.to_bytes(3, "big", signed=True)
    marked = b"".join(bytes([DLE, byte] if byte in (STX, ETX, DLE) else [byte]) for byte in data)
    return bytes([STX]) + marked + bytes([checksum.first + sum(marked) & 0x7F | _SUM_MARK, ETX])


STATE = state_type("garbage begun is_marked length", "")
"""What the decoder keeps between calls: bytes since the last good frame, frames that began in them, whether
the last of them was a byte 10, and the length of the last good frame."""


class FrameDecoder(FixedFrameDecoder):
    """A `FixedFrameDecoder` of frames of 8 to 13 bytes, of one gauge: the second column is 0.

    A frame whose status reports a fault is a damaged row.
    """

    def __init__(
        self, rate_hz: float, checksum: Checksum = Checksum.FRAME, max_gap_s: float = MAX_GAP_S
    ) -> None:
        super().__init__(STATE, MIN_FRAME_BYTES, rate_hz, max_gap_s)
        self._state["length"] = MIN_FRAME_BYTES
        self._first = checksum.first

    def _find_frames(self, buffer: UInt8s, offsets: Ints, broken: Ints) -> tuple[int, int]:
        found, used = find_frames(buffer, self._first, self._state, offsets, broken)
        return int(found), int(used)

    def _read_frames(self, buffer: UInt8s, offsets: Ints) -> tuple[Int32s, Ints]:
        words = np.empty((len(offsets), 2), dtype=np.int64)
        read_frames(buffer, offsets, words)
        counts = np.zeros((len(offsets), 2), dtype=np.int32)
        counts[:, 0] = words[:, 1]
        is_over = words[:, 0] & _STATE_BITS == _OVER_CAPACITY
        return counts, np.where(is_over, int(SampleStatus.OVERLOAD_TABLE), 0)


def measure_frames(data: bytes, checksum: Checksum) -> tuple[int, int]:
    """Good frames in `data`, and their bytes."""
    decoder = FrameDecoder(1.0, checksum)
    frames = sum(
        int(np.count_nonzero(block.status != int(SampleStatus.DAMAGED))) for block in decoder.feed(data, 0)
    )
    return frames, len(data) - decoder.losses.discarded_bytes - decoder.unfinished_bytes


@compiled
def find_frames(buffer: UInt8s, first: int, states: Records, offsets: Ints, broken: Ints) -> tuple[int, int]:
    """Fill offsets of good frames and how many came broken before each; returns frames and used bytes.

    A bad candidate costs one byte; an unfinished frame, at most 13 bytes, is left. `states` (1,) is updated.
    """
    state = states[0]
    at = found = 0
    while at < len(buffer):
        end, fault = _frame_end(buffer, at, first)
        if end == 0:
            break
        if end > 0 and not fault:
            offsets[found] = at
            broken[found] = max(state.begun, frames_in(state.garbage, state.length))
            state.length = end - at
            state.garbage = state.begun = state.is_marked = 0
            found += 1
            at = end
            continue
        length = end - at if end > 0 else 1
        state.begun += buffer[at] == STX and not state.is_marked
        state.is_marked = buffer[at] == DLE
        state.garbage += length
        state.discarded_bytes += length
        at += length
    return found, at


@compiled
def read_frames(buffer: UInt8s, offsets: Ints, words: Ints) -> None:
    """Fill `words` (n, 2) with status and value of the good frames at `offsets` (n,)."""
    for i in range(len(offsets)):
        at, data = offsets[i] + 1, 0
        for _ in range(_DATA_BYTES):
            at += buffer[at] == DLE
            data = data << 8 | buffer[at]
            at += 1
        words[i, 0] = data >> 24
        words[i, 1] = (data & 0xFFFFFF ^ 0x800000) - 0x800000


@inlined
def _frame_end(buffer: UInt8s, at: int, first: int) -> tuple[int, bool]:
    """End of the frame at `at`, and whether it reports a fault; -1: there is none; 0: it is unfinished."""
    if buffer[at] != STX:
        return -1, False
    total, marks, word, place = first, 0, 0, at + 1
    for i in range(_DATA_BYTES):
        if place >= len(buffer):
            return 0, False
        byte = buffer[place]
        if byte == DLE:
            place += 1
            marks += DLE
            if place >= len(buffer):
                return 0, False
            byte = buffer[place]
            if byte not in (STX, ETX, DLE):
                return -1, False
        elif byte in (STX, ETX):
            return -1, False
        total += byte
        if i < 2:
            word = word << 8 | byte
        place += 1
    if place + 1 >= len(buffer):
        return 0, False
    is_sum = buffer[place] == total & 0x7F | _SUM_MARK or buffer[place] == (total + marks) & 0x7F | _SUM_MARK
    if not is_sum or buffer[place + 1] != ETX:
        return -1, False
    state = word & _STATE_BITS
    return place + 2, bool(word & _EEPROM_FAULT or (state and state != _OVER_CAPACITY))
