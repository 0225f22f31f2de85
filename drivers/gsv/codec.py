"""How a measurement frame of a GSV is laid out: `AA | header | status | payload | 85`."""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from drivers.compiled import compiled, inlined
from drivers.errors import ProtocolError
from drivers.gsv.commands import END, SYNC
from drivers.loss_estimate import LossEstimator
from drivers.packets import LOSS_FIELDS, MAX_GAP_S, PACKET, PacketDecoder, Packets, Record
from drivers.samples import Losses, SampleStatus

HEADER_BYTES = 3
MAX_CHANNELS = 16
MAX_FRAME_BYTES = HEADER_BYTES + 4 * MAX_CHANNELS + 1
MEASUREMENT = 0x10
"""Header: type 00, serial interface; its low four bits are the number of channels less one."""
TYPE_AND_INTERFACE = 0xF0
INDICATOR = 0x80
"""Set in the status of every measurement frame."""
OVERLOAD = 0x03
"""Status bits: an input is overloaded (0), a six-axis sensor is out of its range (1)."""


class ValueKind(IntEnum):
    """How a channel's value is written, as in bits 6-4 of the status."""

    INT16 = 1
    INT24 = 2
    FLOAT32 = 3

    @property
    def size(self) -> int:
        """Bytes of a value."""
        return self + 1


@dataclass(frozen=True, slots=True)
class FrameLayout:
    """What all measurement frames of a stream have in common.

    Attributes
    ----------
    channels : int
        Values in a frame, 1 to 16.
    kind : ValueKind
    table, relative : int
        Channels of the two gauges, from 1 on.

    Raises
    ------
    ProtocolError
        If a gauge's channel is not in the frame.
    """

    channels: int
    kind: ValueKind = ValueKind.FLOAT32
    table: int = 1
    relative: int = 2

    def __post_init__(self) -> None:
        for name, channel in (("table", self.table), ("relative", self.relative)):
            if not 1 <= channel <= self.channels:
                raise ProtocolError(
                    f"the device sends {self.channels} channels and the {name} gauge is to be {channel}: "
                    f"set {name} to its channel, or let the device send that channel too"
                )

    @property
    def length(self) -> int:
        """Bytes of a frame."""
        return HEADER_BYTES + self.channels * self.kind.size + 1

    @property
    def header(self) -> int:
        """Second byte of a frame."""
        return MEASUREMENT | (self.channels - 1)

    def offset(self, channel: int) -> int:
        """Place of a channel's value (from 1 on) in a frame."""
        return HEADER_BYTES + (channel - 1) * self.kind.size


def find_layout(data: bytes) -> tuple[int, ValueKind] | None:
    """Channels and kind of the measurement frames in `data`; None while there are not two in a row.

    A second frame just after the first must be whole as well, since the bytes that begin and end a
    frame may stand in a value too.
    """
    at = data.find(SYNC)
    while 0 <= at <= len(data) - HEADER_BYTES:
        found = _layout_at(data, at)
        if found is not None and _layout_at(data, at + HEADER_BYTES + found[0] * found[1].size + 1) == found:
            return found
        at = data.find(SYNC, at + 1)
    return None


def _layout_at(data: bytes, at: int) -> tuple[int, ValueKind] | None:
    """Channels and kind of a frame that is whole at `at`."""
    if len(data) < at + HEADER_BYTES or data[at] != SYNC or data[at + 1] & TYPE_AND_INTERFACE != MEASUREMENT:
        return None
    kind = (data[at + 2] & ~INDICATOR) >> 4
    if not data[at + 2] & INDICATOR or kind not in tuple(ValueKind):
        return None
    channels = (data[at + 1] & 0x0F) + 1
    end = at + HEADER_BYTES + channels * ValueKind(kind).size
    return (channels, ValueKind(kind)) if len(data) > end and data[end] == END else None


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


_ZERO = {ValueKind.INT16: 1 << 15, ValueKind.INT24: 1 << 23}
"""Whole numbers are sent with this added."""
_BOTH = int(SampleStatus.OVERLOAD_TABLE | SampleStatus.OVERLOAD_RELATIVE)


def encode_frames(
    layout: FrameLayout,
    counts: NDArray[np.int32] | NDArray[np.float64],
    flags: int | NDArray[np.uint8] = 0,
) -> NDArray[np.uint8]:
    """Frames as a device that never fails would send them; channels of no gauge are 0.

    Parameters
    ----------
    layout : FrameLayout
    counts : (n, 2)
        Table and relative; whole numbers are cut to the range of their kind.
    flags : int or (n,) uint8
        Low bits of the status: 1 overload, 2 six-axis error.

    Returns
    -------
    (n, layout.length) uint8
        A frame a row; `.tobytes()` is what goes onto the wire.
    """
    wire = np.zeros((len(counts), layout.length), dtype=np.uint8)
    wire[:, :2] = SYNC, layout.header
    wire[:, 2] = INDICATOR | layout.kind << 4 | np.asarray(flags)
    values = np.zeros((len(counts), layout.channels))
    values[:, layout.table - 1] = counts[:, 0]
    values[:, layout.relative - 1] = counts[:, 1]
    wire[:, HEADER_BYTES:-1] = _encode_values(layout.kind, values)
    wire[:, -1] = END
    return wire


def _encode_values(kind: ValueKind, values: NDArray[np.float64]) -> NDArray[np.uint8]:
    if kind is ValueKind.FLOAT32:
        return values.astype(">f4").view(np.uint8)
    zero = _ZERO[kind]
    whole = (np.clip(np.rint(values), -zero, zero - 1) + zero).astype(">u4")
    return whole.view(np.uint8).reshape(*values.shape, 4)[:, :, 4 - kind.size :].reshape(len(values), -1)


class FrameDecoder(PacketDecoder):
    """Bytes to sample blocks. There is no checksum and no number in a frame to tell what is lost.

    A row stands for each frame that came broken; frames that did not come at all are estimated from the
    host's clock, in `losses` alone. A wrong bit within a value is taken for good. A frame is given once
    the next one has begun. After a broken link, rows stand for the time until the next frame.

    An overload is marked on both gauges, since the device does not say on which input it is.

    Parameters
    ----------
    layout : FrameLayout
    rate_hz : float
        Nominal rate, > 0.
    max_gap_s : float
        Longest time that rows stand for.
    """

    def __init__(self, layout: FrameLayout, rate_hz: float, max_gap_s: float = MAX_GAP_S) -> None:
        super().__init__(np.zeros(1, dtype=STREAM), rate_hz, max_gap_s)
        self._layout = layout
        self._wanted = frame_pattern(layout)
        self._lateness = LossEstimator(rate_hz)

    @property
    def losses(self) -> Losses:
        """The account until now."""
        losses = super().losses
        losses.missing_estimated += self._lateness.lost
        return losses

    def expect_restart(self) -> None:
        """The link was broken: rows are to stand for the time until the next frame."""
        self._state["rubbish"] += len(self._unfinished)
        super().expect_restart()

    def _read(self, data: bytes, arrival_ns: int) -> Packets | None:
        buffer = np.frombuffer(data, dtype=np.uint8)
        offsets = np.empty(len(data) // self._layout.length, dtype=np.int64)
        broken = np.empty(len(offsets), dtype=np.int64)
        found, used = find_frames(buffer, self._wanted, self._state, offsets, broken)
        self._unfinished = data[used:]
        if not found:
            return None
        units = self._units(buffer, offsets[:found], broken[:found], arrival_ns)
        first_index = int(self._state[0]["samples"])
        rows = count_packets(units, self._state)
        self._lateness.add(first_index + rows, arrival_ns)
        return Packets(
            packets=units,
            counts=self._values(buffer, offsets[:found]),
            first_index=first_index,
            rows=rows,
            last_time_s=0.0,
            period_s=1 / self._rate_hz,
            timed=False,
            arrival_ns=arrival_ns,
        )

    def _units(
        self,
        buffer: NDArray[np.uint8],
        offsets: NDArray[np.int64],
        broken: NDArray[np.int64],
        arrival_ns: int,
    ) -> NDArray[np.void]:
        units = np.zeros(len(offsets), dtype=PACKET)
        units["samples"] = 1
        units["status"] = np.where(buffer[offsets + 2] & OVERLOAD, _BOTH, 0)
        units["damaged"] = broken
        if self._arrival_ns is None:
            units["damaged"][0] = 0
        if self._state[0]["restarting"]:
            gap = self._rows_since(arrival_ns, len(offsets))
            units["damaged"][0] = min(gap, broken[0])
            units["missing"][0] = gap - units["damaged"][0]
        return units

    def _values(self, buffer: NDArray[np.uint8], offsets: NDArray[np.int64]) -> NDArray[np.float64]:
        kind, size = self._layout.kind, self._layout.kind.size
        starts = [self._layout.offset(channel) for channel in (self._layout.table, self._layout.relative)]
        places = np.add.outer(offsets, np.add.outer(starts, np.arange(size)))
        if kind is ValueKind.FLOAT32:
            return buffer[places].view(">f4")[:, :, 0].astype(np.float64)
        weights = 256.0 ** np.arange(size - 1, -1, -1)
        values: NDArray[np.float64] = buffer[places] @ weights - _ZERO[kind]
        return values


def compile_decoder() -> None:
    """Compile what the decoder needs, or load it, so that no stream waits for it."""
    layout = FrameLayout(2)
    frames = encode_frames(layout, np.zeros((2, 2)))
    for _ in FrameDecoder(layout, 1.0).feed(frames.tobytes(), 0):
        pass
