"""Frames of the Slipstand binary protocol, made from samples and taken apart again.

`AA 55 | version u8 | flags u8 | seq u32 | t_us u32 | n u8 | n x (i32, i32) | crc u16`, little-endian;
the CRC covers version to last sample.
"""

import struct
from enum import IntFlag

import numpy as np
from numpy.typing import NDArray

from drivers.clock import MIN_SPAN_S, MIN_STEPS
from drivers.crc import crc16
from drivers.decoder import PacketDecoder
from drivers.rows import MAX_GAP_S, PACKET, Packets
from drivers.slipstand_binary.kernels import MIN_FRAME_BYTES, STREAM, count_frames, find_frames
from drivers.slipstand_binary.layout import HEADER_BYTES, MAX_SAMPLES, SYNC, VERSION, frame_length

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
        self._state["rubbish"] += len(self._rest)
        super().expect_restart()

    def _read(self, data: bytes, arrival_ns: int) -> Packets | None:
        buffer = np.frombuffer(data, dtype=np.uint8)
        offsets = np.empty(len(data) // MIN_FRAME_BYTES, dtype=np.int64)
        frames, samples, used = find_frames(buffer, offsets)
        self._rest = data[used:]
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
