"""Measurement frames of a GSV, made from samples and taken apart again."""

import numpy as np
from numpy.typing import NDArray

from drivers.decoder import PacketDecoder
from drivers.gsv.commands import END, SYNC
from drivers.gsv.kernels import STREAM, count_packets, find_frames, frame_pattern
from drivers.gsv.layout import HEADER_BYTES, INDICATOR, OVERLOAD, FrameLayout, ValueKind
from drivers.lateness import LossEstimator
from drivers.rows import MAX_GAP_S, PACKET, Packets
from drivers.samples import Losses, SampleStatus

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
        self._state["rubbish"] += len(self._rest)
        super().expect_restart()

    def _read(self, data: bytes, arrival_ns: int) -> Packets | None:
        buffer = np.frombuffer(data, dtype=np.uint8)
        offsets = np.empty(len(data) // self._layout.length, dtype=np.int64)
        broken = np.empty(len(offsets), dtype=np.int64)
        found, used = find_frames(buffer, self._wanted, self._state, offsets, broken)
        self._rest = data[used:]
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
