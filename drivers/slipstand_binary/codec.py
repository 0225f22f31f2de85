"""Sizes and places in a Slipstand binary frame."""

import struct
from enum import IntFlag

import numpy as np
from numpy.typing import NDArray

from drivers.clock import MIN_SPAN_S, MIN_STEPS
from drivers.compiled import compiled, inlined
from drivers.crc import crc16, crc16_slice
from drivers.packets import LOSS_FIELDS, MAX_GAP_S, PACKET, PacketDecoder, Packets, Record, is_plausible_gap

SYNC = b"\xaa\x55"
VERSION = 1
HEADER_BYTES = 13
"""Bytes before the first sample: sync, version, flags, seq, t_us, n."""
SAMPLE_BYTES = 8
"""Bytes of one sample: two int32."""
MAX_SAMPLES = 32


def frame_length(samples: int) -> int:
    """Bytes of a frame that carries `samples` samples."""
    return HEADER_BYTES + SAMPLE_BYTES * samples + 2


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


_HALF = 1 << 31
_HEAD = np.dtype(
    {
        "names": ["seq", "t_us", "n"],
        "formats": ["<u4", "<u4", "u1"],
        "offsets": [4, 8, 12],
        "itemsize": HEADER_BYTES,
    }
)


class FrameFlags(IntFlag):
    """The flags byte of a frame."""

    OVERLOAD_TABLE = 0x01
    OVERLOAD_RELATIVE = 0x02
    DROPPED_BEFORE = 0x80
    """The device lost samples between the frame before and this one."""


def encode_frame(first_index: int, time_us: int, counts: NDArray[np.int32], flags: int = 0) -> bytes:
    """One frame.

    Parameters
    ----------
    first_index : int
        Index of the first sample; sent modulo 2**32.
    time_us : int
        Device time (us) of the first sample; sent modulo 2**32.
    counts : (n, 2) int32
        Readings of both channels, 1 <= n <= 32.
    flags : int
        `FrameFlags`.
    """
    samples = np.ascontiguousarray(counts, dtype="<i4").reshape(-1, 2)
    if not 1 <= len(samples) <= MAX_SAMPLES:
        raise ValueError(f"{len(samples)} samples in a frame; give 1 to {MAX_SAMPLES}")
    body = struct.pack("<BBIIB", VERSION, flags, first_index & 0xFFFFFFFF, time_us & 0xFFFFFFFF, len(samples))
    body += samples.tobytes()
    return SYNC + body + struct.pack("<H", crc16(body))


def encode_frames(
    first_index: int,
    times_us: NDArray[np.int64],
    counts: NDArray[np.int32],
    flags: int | NDArray[np.uint8] = 0,
) -> NDArray[np.uint8]:
    """Many frames of equal length, as a device that never fails would send them.

    Parameters
    ----------
    first_index : int
        Index of the very first sample; each sample has the next index.
    times_us : (frames,) int
        Device time (us) of the first sample of each frame.
    counts : (frames * n, 2) int32
        Readings of both channels, n of them a frame.
    flags : int or (frames,) uint8
        `FrameFlags` of all or of each frame.

    Returns
    -------
    (frames, 15 + 8 n) uint8
        A frame a row; `.tobytes()` is what goes onto the wire.
    """
    frames = len(times_us)
    n, rest = divmod(len(counts), max(frames, 1))
    if rest or (frames and not 1 <= n <= MAX_SAMPLES):
        raise ValueError(
            f"{len(counts)} samples do not fill {frames} frames evenly with 1 to {MAX_SAMPLES} each"
        )
    table = np.zeros(frames, dtype=_frame_dtype(n))
    table["sync"] = np.frombuffer(SYNC, dtype="<u2")
    table["version"] = VERSION
    table["flags"] = flags
    table["seq"] = (first_index + n * np.arange(frames, dtype=np.int64)) & 0xFFFFFFFF
    table["t_us"] = np.asarray(times_us, dtype=np.int64) & 0xFFFFFFFF
    table["n"] = n
    table["counts"] = np.asarray(counts).reshape(frames, n, 2)
    wire = table.view(np.uint8).reshape(frames, frame_length(n))
    table["crc"] = [crc16(row[2:-2].tobytes()) for row in wire]
    return wire


def _frame_dtype(n: int) -> np.dtype[np.void]:
    return np.dtype(
        [
            ("sync", "<u2"),
            ("version", "u1"),
            ("flags", "u1"),
            ("seq", "<u4"),
            ("t_us", "<u4"),
            ("n", "u1"),
            ("counts", "<i4", (n, 2)),
            ("crc", "<u2"),
        ]
    )


class FrameDecoder(PacketDecoder):
    """Bytes to sample blocks, with every lost sample accounted for.

    Between two good frames the sequence says how many samples are lost. As many of them as the
    bytes in between can have held are damaged, the others missing. A sequence that goes back, or
    leaps by more than `max_gap_s`, or after a broken link does not fit the time that has passed, is
    a new start of the device: the rows until it are estimated
    from the host's clock (`missing_estimated`), and the index goes on. The same frame twice counts
    once. Loss before the first or after the last good frame cannot be known.

    Parameters
    ----------
    rate_hz : float
        Nominal rate, > 0.
    max_gap_s : float
        Longest gap that a sequence number is believed to prove.
    """

    _piece_bytes = 1 << 18

    def __init__(self, rate_hz: float, max_gap_s: float = MAX_GAP_S) -> None:
        super().__init__(np.zeros(1, dtype=STREAM), rate_hz, max_gap_s)
        self._state["period_s"] = 1 / rate_hz
        self._state["max_gap"] = self._max_gap

    def expect_restart(self) -> None:
        """The link was broken: the sequence goes on if the host's clock bears it out, else it began anew."""
        self._state["rubbish"] += len(self._unfinished)
        super().expect_restart()

    def _read(self, data: bytes, arrival_ns: int) -> Packets | None:
        buffer = np.frombuffer(data, dtype=np.uint8)
        offsets = np.empty(len(data) // MIN_FRAME_BYTES, dtype=np.int64)
        frames, samples, used = find_frames(buffer, offsets)
        self._unfinished = data[used:]
        stream = self._state[0]
        units = np.empty(frames, dtype=PACKET)
        counts = np.empty((samples, 2), dtype=np.int32)
        first_index, last_time_s = int(stream["samples"]), float(stream["row_time_s"])
        stream["restart_rows"] = self._rows_since(arrival_ns, samples)
        found, samples = count_frames(buffer, offsets[:frames], used, self._state, units, counts)
        if not found:
            return None
        return Packets(
            packets=units[:found],
            counts=counts[:samples],
            first_index=first_index,
            rows=int(stream["samples"]) - first_index,
            last_time_s=last_time_s,
            period_s=1 / self._rate_hz,
            timed=True,
            arrival_ns=arrival_ns,
        )


def find_frame_headers(data: bytes) -> NDArray[np.void]:
    """Good frames in `data`: (frames,) with fields seq, t_us and n."""
    buffer = np.frombuffer(data, dtype=np.uint8)
    offsets = np.empty(len(data) // MIN_FRAME_BYTES, dtype=np.int64)
    found, _, _ = find_frames(buffer, offsets)
    heads = buffer[offsets[:found, None] + np.arange(_HEAD.itemsize)]
    frames: NDArray[np.void] = heads.view(_HEAD)[:, 0]
    return frames


def rate_from_frames(data: bytes) -> float | None:
    """Samples a second that the device's own times show; None while there are too few frames.

    Only the stretch after the last new start of the device counts.
    """
    frames = find_frame_headers(data)
    steps = _differences(frames["seq"])
    steps_us = _differences(frames["t_us"])
    ahead = (steps < _HALF) & (steps_us < _HALF)
    first = len(ahead) - int(np.argmin(ahead[::-1])) if not ahead.all() else 0
    span_us = int(steps_us[first:].sum())
    if len(steps) - first < MIN_STEPS or span_us < MIN_SPAN_S * 1e6:
        return None
    return float(steps[first:].sum()) / (span_us * 1e-6)


def _differences(counter: NDArray[np.uint32]) -> NDArray[np.int64]:
    """From one value to the next, of a counter that wraps."""
    return (counter[1:] - counter[:-1]).astype(np.int64)


def compile_decoder() -> None:
    """Compile what the decoder needs, or load it, so that no stream waits for it."""
    frame = encode_frame(0, 0, np.zeros((1, 2), dtype=np.int32))
    for _ in FrameDecoder(1.0).feed(frame, 0):
        pass
