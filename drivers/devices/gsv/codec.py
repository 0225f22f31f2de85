"""Measurement frames of a GSV, encoded and decoded: `AA | header | status | payload | 85`."""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from drivers.arrays import Counts, Floats, Ints, Record, Records, UInt8s, record_type
from drivers.compiled import compiled, inlined
from drivers.devices.gsv.commands import END, SYNC
from drivers.errors import ProtocolError
from drivers.fixed_frames import FixedFrameDecoder, read_numbers
from drivers.packets import MAX_GAP_S, frames_in, state_type
from drivers.samples import SampleStatus
from messages.i18n import N_

HEADER_BYTES = 3
MAX_CHANNELS = 16
MAX_FRAME_BYTES = HEADER_BYTES + 4 * MAX_CHANNELS + 1
MEASUREMENT = 0x10
"""Header: type 00, serial interface; its low four bits are the number of channels less one."""
TYPE_AND_INTERFACE = 0xF0
INDICATOR = 0x80
"""Set in the status of every measurement frame."""
OVERLOAD = 0x03  # status bits: an input is overloaded (0), a six-axis sensor is out of its range (1)
_BOTH_OVERLOADED = int(SampleStatus.OVERLOAD_TABLE | SampleStatus.OVERLOAD_RELATIVE)


class ValueKind(IntEnum):
    """Format of a channel's value, as in bits 6-4 of the status."""

    INT16 = 1
    INT24 = 2
    FLOAT32 = 3

    @property
    def size(self) -> int:
        return self + 1


_ZERO = {ValueKind.INT16: 1 << 15, ValueKind.INT24: 1 << 23}
"""Offset that is added to whole numbers on the wire."""


@dataclass(frozen=True, slots=True)
class FrameLayout:
    """What all measurement frames of a stream share. Raises ProtocolError without a gauge's channel."""

    channels: int  # values in a frame, 1 to 16
    kind: ValueKind = ValueKind.FLOAT32
    table: int = 1
    """Channels of the two gauges, from 1."""
    relative: int = 2

    def __post_init__(self) -> None:
        for name, channel in (("table", self.table), ("relative", self.relative)):
            if not 1 <= channel <= self.channels:
                template = N_(
                    "the device sends {channels} channels and the {name} gauge is to be {channel}: "
                    "set {name} to its channel, or let the device send that channel too"
                )
                raise ProtocolError(template, channels=self.channels, name=name, channel=channel)

    @property
    def length(self) -> int:
        return HEADER_BYTES + self.channels * self.kind.size + 1

    @property
    def header(self) -> int:
        return MEASUREMENT | (self.channels - 1)

    def offset(self, channel: int) -> int:
        return HEADER_BYTES + (channel - 1) * self.kind.size


def find_layout(data: bytes) -> tuple[int, ValueKind] | None:
    """Channels and kind of frames in `data`; None without two in a row: one could be bytes of a value."""
    at = data.find(SYNC)
    while 0 <= at <= len(data) - HEADER_BYTES:
        found = _layout_at(data, at)
        if found is not None and _layout_at(data, at + FrameLayout(*found, 1, 1).length) == found:
            return found
        at = data.find(SYNC, at + 1)
    return None


def _layout_at(data: bytes, at: int) -> tuple[int, ValueKind] | None:
    if len(data) < at + HEADER_BYTES or data[at] != SYNC or data[at + 1] & TYPE_AND_INTERFACE != MEASUREMENT:
        return None
    kind = (data[at + 2] & ~INDICATOR) >> 4
    if not data[at + 2] & INDICATOR or kind not in tuple(ValueKind):
        return None
    channels = (data[at + 1] & 0x0F) + 1
    end = at + HEADER_BYTES + channels * ValueKind(kind).size
    return (channels, ValueKind(kind)) if len(data) > end and data[end] == END else None


def encode_frames(layout: FrameLayout, counts: Counts, flags: int | UInt8s = 0) -> UInt8s:
    """Frames as a device without faults sends them; channels without a gauge are 0.

    `counts` (n, 2) are table and relative; whole numbers are limited to the range of their kind. `flags`, of
    all or (n,), are the low bits of the status: 1 overload, 2 six-axis error. Returns (n, layout.length)
    uint8, a frame a row.
    """
    wire = np.zeros((len(counts), layout.length), dtype=np.uint8)
    wire[:, :2] = SYNC, layout.header
    wire[:, 2] = INDICATOR | layout.kind << 4 | np.asarray(flags)
    values = np.zeros((len(counts), layout.channels))
    values[:, layout.table - 1] = counts[:, 0]
    values[:, layout.relative - 1] = counts[:, 1]
    if layout.kind is ValueKind.FLOAT32:
        encoded = values.astype(">f4").view(np.uint8)
    else:
        zero = _ZERO[layout.kind]
        whole = (np.clip(np.rint(values), -zero, zero - 1) + zero).astype(">u4")
        encoded = whole.view(np.uint8).reshape(*values.shape, 4)[:, :, 4 - layout.kind.size :]
    wire[:, HEADER_BYTES:-1] = encoded.reshape(len(counts), -1)
    wire[:, -1] = END
    return wire


class FrameDecoder(FixedFrameDecoder):
    """A `FixedFrameDecoder` of a GSV. The sample of a frame is given once the next frame has begun.

    An overload is marked on both gauges, because the device does not report its input.
    """

    def __init__(self, layout: FrameLayout, rate_hz: float, max_gap_s: float = MAX_GAP_S) -> None:
        super().__init__(STATE, layout.length, rate_hz, max_gap_s)
        self._layout = layout
        self._pattern = frame_pattern(layout)

    def _find_frames(self, buffer: UInt8s, offsets: Ints, broken: Ints) -> tuple[int, int]:
        return find_frames(buffer, self._pattern, self._state, offsets, broken)

    def _read_frames(self, buffer: UInt8s, offsets: Ints) -> tuple[Floats, Ints]:
        status = np.where(buffer[offsets + 2] & OVERLOAD, _BOTH_OVERLOADED, 0)
        kind = self._layout.kind
        places = [self._layout.offset(channel) for channel in (self._layout.table, self._layout.relative)]
        numbers = read_numbers(buffer, offsets, places, kind.size)
        if kind is ValueKind.FLOAT32:
            return numbers.astype(np.uint32).view(np.float32).astype(np.float64), status
        return (numbers - _ZERO[kind]).astype(np.float64), status


FRAME_PATTERN = record_type("header kind length table relative is_float", "")
"""What a good frame looks like: its header, high half of its status, length, positions of both values."""

STATE = state_type("garbage begun", "")
"""What the decoder keeps between calls: bytes since the last good frame, and frames that began in them."""

_KIND_BITS = 0xF0


def frame_pattern(layout: FrameLayout) -> Records:
    """(1,) FRAME_PATTERN for frames of `layout`."""
    places = layout.offset(layout.table), layout.offset(layout.relative)
    kind = INDICATOR | layout.kind << 4
    values = (layout.header, kind, layout.length, *places, layout.kind is ValueKind.FLOAT32)
    return np.array([values], dtype=FRAME_PATTERN)


@compiled
def find_frames(
    buffer: UInt8s, patterns: Records, states: Records, offsets: Ints, broken: Ints
) -> tuple[int, int]:
    """Offsets of the good frames in `buffer`, and how many came broken before each.

    In a good frame the header, the end, and the byte that begins the next frame match the pattern, and both
    values are finite. A bad candidate costs one byte. Returns the number of frames and the number of bytes
    that were used: the rest, at most a frame and the byte after, may become one. `states` (1,) is updated.
    """
    pattern, state = patterns[0], states[0]
    at = found = 0
    while at + pattern.length < len(buffer):
        is_begun = buffer[at] == SYNC and buffer[at + 1] == pattern.header
        if is_begun and buffer[at + 2] & _KIND_BITS == pattern.kind:
            if _is_whole(buffer, at, pattern):
                offsets[found] = at
                broken[found] = max(state.begun, frames_in(state.garbage, pattern.length))
                state.garbage = state.begun = 0
                found += 1
                at += pattern.length
                continue
            state.begun += 1
        elif state.garbage == 0 and buffer[at] == SYNC:
            state.begun = 1
        state.garbage += 1
        at += 1
    state.discarded_bytes += at - found * pattern.length
    return found, at


@inlined
def _is_whole(buffer: UInt8s, at: int, pattern: Record) -> bool:
    end = at + pattern.length
    if buffer[end - 1] != END or buffer[end] != SYNC:
        return False
    if pattern.is_float:
        return _is_finite(buffer, at + pattern.table) and _is_finite(buffer, at + pattern.relative)
    return True


@inlined
def _is_finite(buffer: UInt8s, at: int) -> bool:
    return not (buffer[at] & 0x7F == 0x7F and buffer[at + 1] & 0x80)  # big-endian, its exponent all ones
