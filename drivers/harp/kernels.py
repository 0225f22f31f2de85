"""Compiled inner loop of the Harp decoder: find load cell events among messages and rubbish."""

import numpy as np
from numpy.typing import NDArray

from drivers.compiled import compiled, inlined
from drivers.harp.messages import EVENT, HAS_TIMESTAMP, MIN_MESSAGE_BYTES, PORT, S16, TICKS_PER_S, Register
from drivers.rows import Record

CHANNELS = 8
EVENT_BYTES = 28
"""Bytes of a load cell event."""
VALUES_OFFSET = 11
"""Place of its first value."""

LINE = np.dtype(
    [
        ("start", np.int64),
        ("end", np.int64),
        ("good", np.int64),
        ("time", np.float64),  # in 32 us
        ("sequence", np.float64),  # there is none
        ("table", np.float64),
        ("relative", np.float64),
        ("discarded", np.int64),  # bytes of this call that were discarded before it
    ],
    align=True,
)
"""A good event, or up to `LENGTH` bytes of rubbish; as `drivers.accounting` takes them."""

_LENGTH_BYTE = EVENT_BYTES - 2
_ADDRESS = int(Register.LOAD_CELLS)
_PAYLOAD = S16 | HAS_TIMESTAMP
_ERROR_MASK = 0xF7


@compiled
def find_events(
    buffer: NDArray[np.uint8],
    channels: NDArray[np.int64],
    rubbish: int,
    lines: NDArray[np.void],
) -> tuple[int, int, int, int]:
    """Events in `buffer` and what is none, as `lines`.

    `rubbish` are the bytes since the last whole message. Where that ended, any whole message is passed
    over; after rubbish only an event is believed, since a checksum of eight bits tells too little. Returns
    how many lines there are, how many bytes are done with and discarded, and the rubbish until then.
    """
    at = 0
    found = 0
    discarded = 0
    while at + MIN_MESSAGE_BYTES <= len(buffer):
        size = 0
        if _may_begin(buffer, at, rubbish):
            size = 2 + int(buffer[at + 1])
            if at + size > len(buffer):
                break
            if not _is_whole(buffer, at, size):
                size = 0
        if size == 0:
            if rubbish % EVENT_BYTES == 0:
                _break_line(lines[found], at)
                found += 1
            rubbish += 1
            discarded += 1
            at += 1
            continue
        if _is_event(buffer, at):
            _fill_line(lines[found], buffer, at, channels, discarded)
            found += 1
        rubbish = 0
        at += size
    return found, at, discarded, rubbish


@inlined
def _may_begin(buffer: NDArray[np.uint8], at: int, rubbish: int) -> bool:
    if rubbish:
        return _is_event(buffer, at)
    kind = buffer[at] & _ERROR_MASK
    return bool(1 <= kind <= EVENT and buffer[at + 1] >= MIN_MESSAGE_BYTES - 2)


@inlined
def _is_event(buffer: NDArray[np.uint8], at: int) -> bool:
    return bool(
        buffer[at] == EVENT
        and buffer[at + 1] == _LENGTH_BYTE
        and buffer[at + 2] == _ADDRESS
        and buffer[at + 3] == PORT
        and buffer[at + 4] == _PAYLOAD
    )


@inlined
def _is_whole(buffer: NDArray[np.uint8], at: int, size: int) -> bool:
    total = 0
    for place in range(at, at + size - 1):
        total += buffer[place]
    return bool(total & 0xFF == buffer[at + size - 1])


@inlined
def _break_line(line: Record, at: int) -> None:
    line.start = line.end = at
    line.good = 0


@inlined
def _fill_line(
    line: Record, buffer: NDArray[np.uint8], at: int, channels: NDArray[np.int64], discarded: int
) -> None:
    line.start = at
    line.end = at + EVENT_BYTES
    line.good = 1
    seconds = 0
    for place in range(3, -1, -1):
        seconds = seconds << 8 | int(buffer[at + 5 + place])
    line.time = float(seconds * TICKS_PER_S + (int(buffer[at + 9]) | int(buffer[at + 10]) << 8))
    line.table = _value(buffer, at + VALUES_OFFSET + 2 * channels[0])
    line.relative = _value(buffer, at + VALUES_OFFSET + 2 * channels[1])
    line.discarded = discarded


@inlined
def _value(buffer: NDArray[np.uint8], at: int) -> float:
    value = int(buffer[at]) | int(buffer[at + 1]) << 8
    return float(value - 65536 if value >= 32768 else value)
