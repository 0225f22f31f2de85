"""Frames and commands of the Slipstand binary protocol, encoded and decoded.

`AA 55 | version u8 | flags u8 | seq u32 | t_us u32 | n u8 | n x (i32, i32) | crc u16`, little-endian;
the CRC covers version to last sample.
"""

import re
from dataclasses import dataclass
from enum import IntFlag

import numpy as np

from drivers.arrays import Counts, Int32s, Ints, Record, Records, UInt8s, record_type
from drivers.clock import MIN_SPAN_S, MIN_STEPS
from drivers.compiled import compiled, inlined
from drivers.crc import crc16
from drivers.crc_slice import crc16_slice
from drivers.errors import ProtocolError, SettingsError
from drivers.packets import MAX_GAP_S, PACKET, PacketDecoder, count_packet, is_plausible_gap, state_type
from messages.i18n import N_

START = b"S"
STOP = b"P"
IDENTIFY = b"I"

SYNC = b"\xaa\x55"
VERSION = 1
HEADER_BYTES = 13
"""Before the first sample: sync, version, flags, seq, t_us, n."""
SAMPLE_BYTES = 8  # two int32
MAX_SAMPLES = 32
MIN_FRAME_BYTES = HEADER_BYTES + SAMPLE_BYTES + 2

_IDENTITY = re.compile(rb"slipstand-fw (\S{1,100}) (\d{1,9}(?:\.\d{1,9})?) (\d{1,9})\r?\n")
_ENDLESS_IDENTITY = re.compile(rb"slipstand-fw [!-~]{101}")
_FRAMES_PER_S = 200.0
"""Frames a second below 6.4 kHz: a sample waits for its frame for 5 ms at most."""
_MAX_RATE_HZ = 1_000_000
_HALF = 1 << 31
_U32 = 0xFFFFFFFF
FRAME = record_type("start end flags seq t_us n", "")
"""A good frame in a buffer: its place and its header."""


class FrameFlags(IntFlag):
    """The flags byte of a frame."""

    OVERLOAD_TABLE = 0x01
    OVERLOAD_RELATIVE = 0x02
    DROPPED_BEFORE = 0x80  # the device lost samples before this frame


@dataclass(frozen=True, slots=True)
class FirmwareIdentity:
    """The answer to `IDENTIFY`."""

    version: str
    rate_hz: float
    channels: int


def encode_rate(rate_hz: float) -> bytes:
    r"""Command that sets the sample rate, `R<hz>\n`. Raises SettingsError unless it is in whole hertz."""
    if not (1 <= rate_hz <= _MAX_RATE_HZ and rate_hz == int(rate_hz)):
        template = N_("rate {rate_hz:g} Hz cannot be set: give whole hertz from 1 to {most}")
        raise SettingsError(template, rate_hz=rate_hz, most=_MAX_RATE_HZ)
    return b"R%d\n" % int(rate_hz)


def encode_identity(identity: FirmwareIdentity) -> bytes:
    """Answer of a device to `IDENTIFY`."""
    return f"slipstand-fw {identity.version} {identity.rate_hz:g} {identity.channels}\n".encode("ascii")


def find_identity(received: bytes) -> FirmwareIdentity | None:
    """Identity line in `received`; None while it is incomplete.

    Raises ProtocolError without 2 channels, and for a version that does not end.
    """
    match = _IDENTITY.search(received)
    if match is None:
        if _ENDLESS_IDENTITY.search(received):
            raise ProtocolError(
                "the device states a version of more than 100 characters: flash its firmware anew"
            )
        return None
    identity = FirmwareIdentity(match[1].decode("ascii", "replace"), float(match[2]), int(match[3]))
    if identity.channels != 2:
        raise ProtocolError(
            "the device has {channels} channels and 2 are needed (table, relative): "
            "flash firmware for two channels",
            channels=identity.channels,
        )
    return identity


def samples_per_frame(rate_hz: float) -> int:
    """Samples the device puts into a frame: at most 32, and below 6.4 kHz at most 5 ms of them."""
    return int(min(max(rate_hz / _FRAMES_PER_S, 1), MAX_SAMPLES))


def frame_length(samples: int) -> int:
    """Bytes of a frame that carries `samples` samples."""
    return HEADER_BYTES + SAMPLE_BYTES * samples + 2


def encode_frame(first_index: int, time_us: int, counts: Int32s, flags: int = 0) -> bytes:
    """One frame of counts (n, 2); see `encode_frames`."""
    return encode_frames(first_index, np.array([time_us]), np.asarray(counts).reshape(-1, 2), flags).tobytes()


def encode_frames(first_index: int, times_us: Ints, counts: Int32s, flags: int | UInt8s = 0) -> UInt8s:
    """Many frames of equal length, as a device without faults sends them.

    `first_index` is that of the first sample, `times_us` (frames,) the device time of the first sample of
    each frame (us); both are sent modulo 2**32. `counts` (frames * n, 2) fill n samples, 1 to 32, into each
    frame (else ValueError); `flags` are `FrameFlags`. Returns (frames, 15 + 8 n) uint8, a frame a row.
    """
    frames = len(times_us)
    n, rest = divmod(len(counts), max(frames, 1))
    if rest or (frames and not 1 <= n <= MAX_SAMPLES):
        raise ValueError(
            f"{len(counts)} samples do not fill {frames} frames evenly with 1 to {MAX_SAMPLES} each"
        )
    head = [("sync", "<u2"), ("version", "u1"), ("flags", "u1"), ("seq", "<u4"), ("t_us", "<u4")]
    table = np.zeros(frames, dtype=[*head, ("n", "u1"), ("counts", "<i4", (n, 2)), ("crc", "<u2")])
    table["sync"] = np.frombuffer(SYNC, dtype="<u2")
    table["version"] = VERSION
    table["flags"] = flags
    table["seq"] = (first_index + n * np.arange(frames, dtype=np.int64)) & _U32
    table["t_us"] = np.asarray(times_us, dtype=np.int64) & _U32
    table["n"] = n
    table["counts"] = np.asarray(counts).reshape(frames, n, 2)
    wire = table.view(np.uint8).reshape(frames, frame_length(n))
    table["crc"] = [crc16(row[2:-2].tobytes()) for row in wire]
    return wire


class FrameDecoder(PacketDecoder):
    """Bytes to sample blocks with every lost sample counted.

    Between two good frames the sequence proves how many samples are lost. As many of them as the bytes in
    between can have held are damaged, the others missing. A sequence that goes back, leaps by more than
    `max_gap_s`, or contradicts the host's clock after a broken connection is a restart of the device: the
    rows until it are estimated from the host's clock (`missing_estimated`), and the index goes on. A frame
    that comes twice counts once, and one that comes late not at all; one with the number of a frame of the
    last quarter of a second, and other contents, is a restart. Losses before the first and after the last
    good frame cannot be known.
    """

    _piece_bytes = 1 << 18
    _is_timed_at_restarts_only = True

    def __init__(self, rate_hz: float, max_gap_s: float = MAX_GAP_S) -> None:
        super().__init__(STATE, rate_hz, max_gap_s)
        self._state["max_gap"] = self._max_gap
        self._recent = np.zeros(_RECENT_FRAMES, dtype=RECENT)

    def expect_restart(self) -> None:
        self._state["garbage"] += len(self._unfinished)
        super().expect_restart()

    def _find_packets(self, data: bytes, arrival_ns: int) -> tuple[Records, Counts]:
        buffer = np.frombuffer(data, dtype=np.uint8)
        frames = np.empty(len(data) // MIN_FRAME_BYTES, dtype=FRAME)
        found, samples, used = scan_frames(buffer, frames)
        self._unfinished = data[used:]
        packets = np.empty(found, dtype=PACKET)
        counts = np.empty((samples, 2), dtype=np.int32)
        self._state["restart_rows"] = self._rows_since(arrival_ns, samples)
        found, samples = count_frames(
            buffer, frames[:found], used, self._state, self._recent, packets, counts
        )
        return packets[:found], counts[:samples]


def find_frames(data: bytes) -> Records:
    """Good frames (f,) FRAME in `data`."""
    frames = np.empty(len(data) // MIN_FRAME_BYTES, dtype=FRAME)
    found, _, _ = scan_frames(np.frombuffer(data, dtype=np.uint8), frames)
    return frames[:found]


def has_frame(data: bytes) -> bool:
    """Whether there is a good frame in `data`."""
    return len(find_frames(data)) > 0


def rate_from_frames(data: bytes) -> float | None:
    """Samples a second by device times since the last restart; None while there are too few frames."""
    frames = find_frames(data)
    steps = np.diff(frames["seq"]) & _U32
    steps_us = np.diff(frames["t_us"]) & _U32
    is_ahead = (steps < _HALF) & (steps_us < _HALF)
    first = len(is_ahead) - int(np.argmin(is_ahead[::-1])) if not is_ahead.all() else 0
    span_us = int(steps_us[first:].sum())
    if len(steps) - first < MIN_STEPS or span_us < MIN_SPAN_S * 1e6:
        return None
    return float(steps[first:].sum()) / (span_us * 1e-6)


_SYNC_0, _SYNC_1 = SYNC
_DROPPED_BEFORE = int(FrameFlags.DROPPED_BEFORE)
_OVERLOADS = int(FrameFlags.OVERLOAD_TABLE | FrameFlags.OVERLOAD_RELATIVE)
_OVERLOAD_SHIFT = 2
"""Shifts the overload bits of the frame onto those of `SampleStatus`."""

_LATE_S = 0.25
_RECENT_FRAMES = 4096  # a power of two; more than a device at 16 kHz or below sends within `_LATE_S`
_LATE_TOLERANCE_S = 0.01

STATE = state_type("max_gap next_seq last_seq last_t_us packet_us garbage", "")
"""What the decoder keeps between calls: the longest step of the sequence that is no restart; the sequence
number that follows without a loss; sequence, time and unwrapped time (us) of the last frame; bytes since."""


RECENT = record_type("seq checksum", "")
"""A frame that came lately: its sequence number plus one, and its checksum, which stands for its contents."""


@compiled
def scan_frames(buffer: UInt8s, frames: Records) -> tuple[int, int, int]:
    """Fill `frames` with the good ones in `buffer`; a bad candidate costs one byte.

    Returns the numbers of frames, of their samples, and of bytes that were used: the rest (at most 270) may
    become a frame.
    """
    at = found = samples = 0
    while at + MIN_FRAME_BYTES <= len(buffer):
        if buffer[at] == _SYNC_0 and buffer[at + 1] == _SYNC_1 and buffer[at + 2] == VERSION:
            n = int(buffer[at + 12])
            end = at + HEADER_BYTES + SAMPLE_BYTES * n + 2
            if 1 <= n <= MAX_SAMPLES:
                if end > len(buffer):
                    break
                crc = buffer[end - 2] | (np.uint64(buffer[end - 1]) << 8)
                if crc16_slice(buffer, at + 2, end - 2) == crc:
                    frame = frames[found]
                    frame.start = at
                    frame.end = end
                    frame.flags = buffer[at + 3]
                    frame.seq = _u32(buffer, at + 4)
                    frame.t_us = _u32(buffer, at + 8)
                    frame.n = n
                    found += 1
                    samples += n
                    at = end
                    continue
        at += 1
    return found, samples, at


@compiled
def count_frames(
    buffer: UInt8s,
    frames: Records,
    used: int,
    states: Records,
    recent: Records,
    packets: Records,
    counts: Int32s,
) -> tuple[int, int]:
    """Fill packets (frames,) and counts (samples, 2) of `frames`; returns how many.

    `used` bytes of the buffer will not be passed again; `states` (1,) and `recent` are updated.
    """
    state = states[0]
    found = sample = end = 0
    for frame in frames:
        _discard(state, frame.start - end)
        end = frame.end
        same = recent[(frame.seq // frame.n) & (_RECENT_FRAMES - 1)]
        checksum = np.int64(buffer[end - 2]) | np.int64(buffer[end - 1]) << 8
        is_other = same.seq == frame.seq + 1 and same.checksum != checksum
        same.seq, same.checksum = frame.seq + 1, checksum
        if state.started and not state.restarting and not is_other and _is_late(state, frame):
            state.repeated += 1
            state.discarded_bytes += end - frame.start
            continue
        gap, is_restart = _gap_before(state, frame)
        packet = packets[found]
        packet.damaged = min(gap, -(-state.garbage // (end - frame.start)) * frame.n)
        packet.missing = gap - packet.damaged
        packet.time_s = _time_s(state, frame, gap, is_restart)
        packet.samples = frame.n
        packet.status = (frame.flags & _OVERLOADS) << _OVERLOAD_SHIFT
        count_packet(state, packet, is_restart)
        state.restarts += is_restart
        state.started = 1
        state.restarting = state.garbage = 0
        state.last_seq = frame.seq
        state.last_t_us = frame.t_us
        state.next_seq = (frame.seq + frame.n) & _U32
        state.row_time_s = packet.time_s + (frame.n - 1) * state.period_s
        for at in range(frame.start + HEADER_BYTES, end - 2, SAMPLE_BYTES):
            counts[sample, 0] = np.int32(_u32(buffer, at))
            counts[sample, 1] = np.int32(_u32(buffer, at + 4))
            sample += 1
        found += 1
    _discard(state, used - end)
    return found, sample


@inlined
def _discard(state: Record, size: int) -> None:
    state.garbage += size
    state.discarded_bytes += size


@inlined
def _is_late(state: Record, frame: Record) -> bool:
    """Tell whether a frame may have come before, or after ones that were sent later.

    Its rows are counted by then.
    """
    behind_s = ((state.last_seq - frame.seq) & _U32) * state.period_s
    behind_by_time_s = ((state.last_t_us - frame.t_us) & _U32) * 1e-6
    is_late: bool = behind_s <= _LATE_S and abs(behind_by_time_s - behind_s) <= _LATE_TOLERANCE_S
    return is_late


@inlined
def _gap_before(state: Record, frame: Record) -> tuple[int, bool]:
    """Rows lost before the frame, and whether a restart makes that an estimate."""
    if not state.started:
        return 0, False
    gap = (frame.seq - state.next_seq) & _U32
    if gap > state.max_gap or (state.restarting and not is_plausible_gap(state, gap)):
        absent = state.restart_rows
        state.restart_rows = 0  # two restarts in one read share their time
        return absent, True
    if gap == 0 and frame.flags & _DROPPED_BEFORE:
        state.unexplained_drops += 1
    return gap, False


@inlined
def _time_s(state: Record, frame: Record, gap: int, is_restart: bool) -> float:
    """Unwrapped device time of the frame; it goes on over a restart."""
    if not state.started:
        state.packet_us = 0
    elif is_restart:
        state.packet_us = np.int64(np.rint((state.row_time_s + (gap + 1) * state.period_s) * 1e6))
    else:
        step = (frame.t_us - state.last_t_us) & _U32
        state.packet_us += step if step < _U32 // 2 else step - _U32 - 1
    return float(state.packet_us * 1e-6)


@inlined
def _u32(buffer: UInt8s, at: int) -> int:
    low = np.int64(buffer[at]) | np.int64(buffer[at + 1]) << 8
    return int(low | np.int64(buffer[at + 2]) << 16 | np.int64(buffer[at + 3]) << 24)
