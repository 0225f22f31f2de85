"""Compiled inner loop of the GSV decoder: find frames, and count those that came broken between them."""

import numpy as np
from numpy.typing import NDArray

from drivers.compiled import compiled, inlined
from drivers.gsv.commands import END, SYNC
from drivers.gsv.layout import INDICATOR, FrameLayout, ValueKind
from drivers.rows import LOSS_FIELDS, Record

FRAME_PATTERN = np.dtype(
    [
        ("header", np.int64),
        ("kind", np.int64),  # high half of the status byte
        ("length", np.int64),
        ("table", np.int64),  # places of the two values in a frame
        ("relative", np.int64),
        ("is_float", np.int64),
    ],
    align=True,
)
"""What a frame must look like."""

STREAM = np.dtype(
    [
        *LOSS_FIELDS,
        ("restarting", np.int64),  # the link was broken since the last good frame
        ("rubbish", np.int64),  # bytes since then
        ("begun", np.int64),  # frames that began in them
    ],
    align=True,
)
"""What the decoder remembers between calls."""

_KIND_BITS = 0xF0


def frame_pattern(layout: FrameLayout) -> NDArray[np.void]:
    """(1,) WANTED for frames of `layout`."""
    frame = np.zeros(1, dtype=FRAME_PATTERN)
    frame["header"] = layout.header
    frame["kind"] = INDICATOR | layout.kind << 4
    frame["length"] = layout.length
    frame["table"] = layout.offset(layout.table)
    frame["relative"] = layout.offset(layout.relative)
    frame["is_float"] = layout.kind is ValueKind.FLOAT32
    return frame


@compiled
def find_frames(
    buffer: NDArray[np.uint8],
    frame: NDArray[np.void],
    memory: NDArray[np.void],
    offsets: NDArray[np.int64],
    broken: NDArray[np.int64],
) -> tuple[int, int]:
    """Places of the good frames in `buffer`, and how many came broken before each.

    A frame is good if its head, its end, and the byte that begins the next one are what they must be,
    and its two values are numbers. A candidate that fails costs one byte. Returns how many were found,
    and how many bytes are done with: the rest, at most a frame and the byte after, may become one.
    `memory` (1,) is brought up to date.
    """
    want, before = frame[0], memory[0]
    at = 0
    found = 0
    while at + want.length < len(buffer):
        if _is_head(buffer, at, want):
            if _is_whole(buffer, at, want):
                offsets[found] = at
                broken[found] = max(before.begun, (2 * before.rubbish + want.length) // (2 * want.length))
                before.rubbish = before.begun = 0
                found += 1
                at += want.length
                continue
            before.begun += 1
        elif before.rubbish == 0 and buffer[at] == SYNC:
            before.begun = 1
        before.rubbish += 1
        at += 1
    before.discarded_bytes += at - found * want.length
    return found, at


@compiled
def count_packets(units: NDArray[np.void], memory: NDArray[np.void]) -> int:
    """Count `units` in `memory` (1,); returns how many rows they are."""
    stream = memory[0]
    before = stream.samples
    for unit in units:
        stream.samples += unit.damaged + unit.missing + unit.samples
        stream.damaged += unit.damaged
        stream.missing_estimated += unit.missing
        if unit.status:
            stream.overloaded += 1
    stream.restarts += stream.restarting
    stream.restarting = 0
    return int(stream.samples - before)


@inlined
def _is_head(buffer: NDArray[np.uint8], at: int, want: Record) -> bool:
    return bool(
        buffer[at] == SYNC and buffer[at + 1] == want.header and buffer[at + 2] & _KIND_BITS == want.kind
    )


@inlined
def _is_whole(buffer: NDArray[np.uint8], at: int, want: Record) -> bool:
    end = at + want.length
    if buffer[end - 1] != END or buffer[end] != SYNC:
        return False
    if want.is_float:
        return _is_number(buffer, at + want.table) and _is_number(buffer, at + want.relative)
    return True


@inlined
def _is_number(buffer: NDArray[np.uint8], at: int) -> bool:
    """Whether a big-endian 32-bit float is neither infinite nor no number."""
    return not (buffer[at] & 0x7F == 0x7F and buffer[at + 1] & 0x80)
