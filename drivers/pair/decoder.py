"""Wrapped reads of two ports to rows of both gauges."""

import dataclasses
import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from drivers.envelope import StampedRead, Unwrapper
from drivers.packets import MAX_BLOCK_ROWS
from drivers.pair.channels import PairedChannel
from drivers.pair.merging import ChannelSamples, HostTimeFit, MergedRows, Merger
from drivers.samples import ABSENT, INCOMPLETE, Losses, SampleBlock, SampleStatus
from drivers.skew import Skew, SkewStatistics

_MUCH_SLOWER = 1.37
"""The device of gauge 2 makes the rows if it is so much slower. No usual rates have this ratio."""
_TABLE, _RELATIVE = np.uint8(SampleStatus.OVERLOAD_TABLE), np.uint8(SampleStatus.OVERLOAD_RELATIVE)
_ABSENT = np.uint8(ABSENT)
_NS = 1e-9


class PairDecoder:
    """Decodes each device by its own source, times its readings by the host, and lays rows of both.

    What it knows of the clocks it knows from the last seconds, so that a replay that begins amid a stream
    soon makes the very rows that were made live.

    Parameters
    ----------
    halves : tuple of Half
        Devices of gauge 1 and gauge 2.
    rates_hz : tuple of float
        Their nominal rates.
    """

    def __init__(self, halves: tuple[PairedChannel, PairedChannel], rates_hz: tuple[float, float]) -> None:
        self.base_gauge = choose_base_gauge(rates_hz)
        """Whose readings make the rows: 0 for gauge 1, 1 for gauge 2."""
        self._halves = halves
        self._rates_hz = rates_hz
        self._unwrapper = Unwrapper()
        self._lines = (HostTimeFit(), HostTimeFit())
        self._restarts = [half.source.losses.restarts for half in halves]
        self._merger = Merger(self.base_gauge, 1 / rates_hz[1 - self.base_gauge])
        self._skews = SkewStatistics(rates_hz[self.base_gauge])
        self._rows = Losses()
        self._strange_bytes = 0
        self._now_ns = 0
        self._lost_ns: list[int | None] = [None, None]
        self._last_ns = [0, 0]
        self._notes: list[str] = []

    @property
    def buffered(self) -> int:
        """Bytes and readings that are kept for the next call."""
        return self._unwrapper.unfinished_bytes + self._merger.buffered

    @property
    def losses(self) -> Losses:
        """The account until now. What is missing is known by the host's time alone: it is estimated."""
        rows, both = self._rows, [half.source.losses for half in self._halves]
        return Losses(
            samples=rows.samples,
            missing_estimated=rows.missing_estimated,
            damaged=rows.damaged,
            overloaded=rows.overloaded,
            discarded_bytes=self._unwrapper.discarded_bytes
            + self._strange_bytes
            + sum(half.discarded_bytes for half in both),
            restarts=sum(half.restarts for half in both),
            repeated=sum(half.repeated for half in both),
            unexplained_drops=sum(half.unexplained_drops for half in both),
        )

    def skew(self, first_index: int, end_index: int) -> Skew | None:
        """By how much later gauge 2 was read than gauge 1 in these rows; None where it never was."""
        return self._skews.skew(first_index, end_index)

    def take_warnings(self) -> list[str]:
        """What became of one device alone since the last call, in sentences."""
        notes, self._notes = self._notes, []
        return notes

    def expect_restart(self) -> None:
        """The links of both were broken."""
        for half, line in zip(self._halves, self._lines, strict=True):
            list(half.source.decode(b"", self._now_ns))
            line.reset()
        self._lost_ns = [None, None]

    def feed(self, data: bytes) -> Iterator[SampleBlock]:
        """Blocks that `data` completes; exhaust it."""
        for read in self._unwrapper.feed(data):
            if read.port < len(self._halves):
                yield from self._decode_read(read.port, read)
            else:
                self._strange_bytes += len(read.data)
            if self._merger.is_overdue(self._now_ns):
                yield from self._ready_blocks()
        yield from self._ready_blocks()

    def _decode_read(self, gauge: int, read: StampedRead) -> Iterator[SampleBlock]:
        """Take a read of one device; rows of a long gap come as soon as they are many: few are held."""
        self._now_ns = max(self._now_ns, read.arrival_ns)
        source = self._halves[gauge].source
        blocks = [_without_zero_counts(block) for block in source.decode(read.data, read.arrival_ns)]
        if not read.data or source.losses.restarts != self._restarts[gauge]:
            self._restarts[gauge] = source.losses.restarts
            self._lines[gauge].reset()
        if not read.data:
            self._report_lost(gauge, read.arrival_ns)
        if blocks:
            self._report_reconnected(gauge)
            self._last_ns[gauge] = read.arrival_ns
            self._lines[gauge].add(float(self._device_time_s(gauge, blocks[-1])[-1]), blocks[-1].arrival_ns)
        for block in blocks:
            self._merger.add(gauge, self._channel_samples(gauge, block, read.arrival_ns))
            if self._merger.buffered > MAX_BLOCK_ROWS:
                yield from self._ready_blocks()

    def _channel_samples(self, gauge: int, block: SampleBlock, arrival_ns: int) -> ChannelSamples:
        column = self._halves[gauge].column
        status = block.status
        if column:  # as of a gauge 1
            is_clipped = (status & _RELATIVE) != 0
            status = (status & _ABSENT) | np.where(is_clipped, _TABLE, np.uint8(0))
        host_ns = self._lines[gauge].host_ns(self._device_time_s(gauge, block))
        # A clock that leaps ahead would have all rows wait until the host's has come so far.
        return ChannelSamples(np.minimum(host_ns, arrival_ns), block.counts[:, column], status)

    def _device_time_s(self, gauge: int, block: SampleBlock) -> NDArray[np.float64]:
        """The device's own time of each row (s): its clock's, or its count over its rate."""
        if block.device_time_s is not None:
            return block.device_time_s
        return (block.first_index + np.arange(len(block))) / self._rates_hz[gauge]

    def _ready_blocks(self) -> Iterator[SampleBlock]:
        while (merged := self._merger.take(self._now_ns)) is not None:
            first_index = self._rows.samples
            lag_s = np.where(merged.is_paired, merged.lag_ns * _NS, np.nan)
            self._skews.add(first_index, lag_s, math.hypot(*(line.scatter_s for line in self._lines)))
            self._count(merged)
            yield SampleBlock(first_index, merged.counts, merged.status, self._now_ns)

    def _count(self, merged: MergedRows) -> None:
        status = merged.status
        self._rows.samples += len(merged)
        self._rows.missing_estimated += int(np.count_nonzero(status & int(INCOMPLETE)))
        self._rows.damaged += int(np.count_nonzero(status & int(SampleStatus.DAMAGED)))
        self._rows.overloaded += int(np.count_nonzero(status & (_TABLE | _RELATIVE)))

    def _report_lost(self, gauge: int, now_ns: int) -> None:
        if self._lost_ns[gauge] is None:
            self._lost_ns[gauge] = self._last_ns[gauge] or now_ns
            self._notes.append(
                f"the device of gauge {gauge + 1} is lost and is looked for: the other gauge goes on"
            )

    def _report_reconnected(self, gauge: int) -> None:
        lost_ns, self._lost_ns[gauge] = self._lost_ns[gauge], None
        if lost_ns is not None:
            away_s = (self._now_ns - lost_ns) * _NS
            self._notes.append(
                f"the device of gauge {gauge + 1} was away and is back: {away_s:.2f} s of its readings are"
                " missing and marked"
            )


def _without_zero_counts(block: SampleBlock) -> SampleBlock:
    """The same block without room for its counts where these are all 0: a gap can be minutes long."""
    if block.counts.any():
        return block
    nothing = np.zeros(block.counts.shape[1:], block.counts.dtype)
    return dataclasses.replace(block, counts=np.broadcast_to(nothing, block.counts.shape))


def choose_base_gauge(rates_hz: tuple[float, float]) -> int:
    """Whose readings make the rows: gauge 1's (0), unless gauge 2's (1) come much more seldom.

    Of the quicker device a reading is always near.
    """
    return int(rates_hz[0] > _MUCH_SLOWER * rates_hz[1])
