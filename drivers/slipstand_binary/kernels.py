"""Compiled inner loops of the Slipstand binary decoder: find frames, then account for them."""

import numpy as np
from numpy.typing import NDArray

from drivers.compiled import compiled, inlined
from drivers.crc import crc16_slice
from drivers.rows import LOSS_FIELDS, Record, is_plausible_gap
from drivers.slipstand_binary.layout import (
    HEADER_BYTES,
    MAX_SAMPLES,
    SAMPLE_BYTES,
    SYNC,
    VERSION,
    frame_length,
)

MIN_FRAME_BYTES = frame_length(1)
_SYNC_0, _SYNC_1 = SYNC
_DROPPED_BEFORE = 0x80
_OVERLOADS = 0x03
_OVERLOAD_SHIFT = 2
"""Moves the overload bits of the frame onto those of `SampleStatus`."""
_U32 = 0xFFFFFFFF

STREAM = np.dtype(
    [
        *LOSS_FIELDS,
        ("period_s", np.float64),  # nominal, between samples
        ("max_gap", np.int64),  # a larger leap of the sequence, or one back, is a new start of the device
        ("started", np.int64),
        ("restarting", np.int64),  # the link was broken, and the device may have begun anew
        ("restart_rows", np.int64),  # rows that stand for the time until it, by the host's clock
        ("next_seq", np.int64),  # sequence number that would follow without a loss
        ("last_seq", np.int64),
        ("last_t_us", np.int64),
        ("unit_us", np.int64),  # unwrapped device time of the last frame, from 0 at the first
        ("row_time_s", np.float64),  # and of its last sample
        ("rubbish", np.int64),  # bytes since the last good frame
    ],
    align=True,
)
"""What the decoder remembers between calls."""


@compiled
def find_frames(buffer: NDArray[np.uint8], offsets: NDArray[np.int64]) -> tuple[int, int, int]:
    """Places of the good frames in `buffer`.

    A candidate that fails costs one byte. Returns their number, how many samples they hold, and
    how many bytes are done with: the rest (at most 270) may become a frame.
    """
    at = 0
    frames = 0
    samples = 0
    while at + MIN_FRAME_BYTES <= len(buffer):
        if buffer[at] == _SYNC_0 and buffer[at + 1] == _SYNC_1 and buffer[at + 2] == VERSION:
            n = int(buffer[at + 12])
            end = at + HEADER_BYTES + SAMPLE_BYTES * n + 2
            if 1 <= n <= MAX_SAMPLES:
                if end > len(buffer):
                    break
                if crc16_slice(buffer, at + 2, end - 2) == buffer[end - 2] | (
                    np.uint64(buffer[end - 1]) << 8
                ):
                    offsets[frames] = at
                    frames += 1
                    samples += n
                    at = end
                    continue
        at += 1
    return frames, samples, at


@compiled
def count_frames(
    buffer: NDArray[np.uint8],
    offsets: NDArray[np.int64],
    used: int,
    memory: NDArray[np.void],
    units: NDArray[np.void],
    counts: NDArray[np.int32],
) -> tuple[int, int]:
    """Units (frames,) and counts (samples, 2) of the good frames at `offsets`; returns how many.

    `used` bytes of the buffer will not be seen again; `memory` (1,) is brought up to date.
    """
    stream = memory[0]
    found = 0
    sample = 0
    end = 0
    for at in offsets:
        _discard(stream, at - end)
        n = int(buffer[at + 12])
        end = at + HEADER_BYTES + SAMPLE_BYTES * n + 2
        if _is_repeated(stream, buffer, at):
            stream.repeated += 1
            stream.discarded_bytes += end - at
            continue
        gap, new_start = _gap_before(stream, buffer, at)
        damaged = min(gap, -(-stream.rubbish // (end - at)) * n)
        unit = units[found]
        unit.damaged = damaged
        unit.missing = gap - damaged
        unit.time_s = _time_s(stream, buffer, at, gap, new_start)
        unit.samples = n
        unit.status = (buffer[at + 3] & _OVERLOADS) << _OVERLOAD_SHIFT
        _count(stream, unit, new_start)
        _remember(stream, buffer, at, unit)
        _read_samples(buffer, at + HEADER_BYTES, counts[sample : sample + n])
        sample += n
        found += 1
    _discard(stream, used - end)
    return found, sample


@inlined
def _discard(stream: Record, size: int) -> None:
    stream.rubbish += size
    stream.discarded_bytes += size


@inlined
def _is_repeated(stream: Record, buffer: NDArray[np.uint8], at: int) -> bool:
    """Whether the very frame that came last came again."""
    if not stream.started or stream.restarting:
        return False
    return bool(_u32(buffer, at + 4) == stream.last_seq and _u32(buffer, at + 8) == stream.last_t_us)


@inlined
def _gap_before(stream: Record, buffer: NDArray[np.uint8], at: int) -> tuple[int, bool]:
    """Rows lost before the frame, and whether a new start makes that an estimate."""
    if not stream.started:
        return 0, False
    gap = (_u32(buffer, at + 4) - stream.next_seq) & _U32
    if gap > stream.max_gap or (stream.restarting and not is_plausible_gap(stream, gap)):
        absent = stream.restart_rows
        stream.restart_rows = 0  # the time of a second one in the same read is not known apart
        return absent, True
    if gap == 0 and buffer[at + 3] & _DROPPED_BEFORE:
        stream.unexplained_drops += 1
    return gap, False


@inlined
def _time_s(stream: Record, buffer: NDArray[np.uint8], at: int, gap: int, new_start: bool) -> float:
    """Unwrapped device time of the frame; after a new start it goes on as if nothing were."""
    if not stream.started:
        stream.unit_us = 0
    elif new_start:
        stream.unit_us = np.int64(np.rint((stream.row_time_s + (gap + 1) * stream.period_s) * 1e6))
    else:
        step = (_u32(buffer, at + 8) - stream.last_t_us) & _U32
        stream.unit_us += step if step < _U32 // 2 else step - _U32 - 1
    return float(stream.unit_us * 1e-6)


@inlined
def _count(stream: Record, unit: Record, new_start: bool) -> None:
    stream.damaged += unit.damaged
    if new_start:
        stream.restarts += 1
        stream.missing_estimated += unit.missing
    else:
        stream.missing += unit.missing
    if unit.status:
        stream.overloaded += unit.samples
    stream.samples += unit.damaged + unit.missing + unit.samples


@inlined
def _remember(stream: Record, buffer: NDArray[np.uint8], at: int, unit: Record) -> None:
    stream.started = 1
    stream.restarting = 0
    stream.rubbish = 0
    stream.last_seq = _u32(buffer, at + 4)
    stream.last_t_us = _u32(buffer, at + 8)
    stream.next_seq = (stream.last_seq + unit.samples) & _U32
    stream.row_time_s = unit.time_s + (unit.samples - 1) * stream.period_s


@inlined
def _read_samples(buffer: NDArray[np.uint8], at: int, counts: NDArray[np.int32]) -> None:
    for k in range(len(counts)):
        counts[k, 0] = np.int32(_u32(buffer, at + SAMPLE_BYTES * k))
        counts[k, 1] = np.int32(_u32(buffer, at + SAMPLE_BYTES * k + 4))


@inlined
def _u32(buffer: NDArray[np.uint8], at: int) -> int:
    low = np.int64(buffer[at]) | np.int64(buffer[at + 1]) << 8
    return int(low | np.int64(buffer[at + 2]) << 16 | np.int64(buffer[at + 3]) << 24)
