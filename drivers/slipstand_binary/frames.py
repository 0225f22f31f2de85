"""Frames of the Slipstand binary protocol, made from samples and taken apart again.

`AA 55 | version u8 | flags u8 | seq u32 | t_us u32 | n u8 | n x (i32, i32) | crc u16`, little-endian;
the CRC covers version to last sample.
"""

import struct
from enum import IntFlag

import numpy as np
from numpy.typing import NDArray

from drivers.crc import crc16
from drivers.slipstand_binary.layout import MAX_SAMPLES, SYNC, VERSION, frame_length


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
