"""Decoder of two devices: enveloped reads of two ports to rows of both gauges."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from drivers.arrays import Floats
from drivers.clock import Skew, SkewStatistics
from drivers.envelope import StampedRead, Unwrapper
from drivers.packets import MAX_BLOCK_ROWS
from drivers.pair.merging import ChannelSamples, HostTimeFit, Merger
from drivers.samples import ABSENT, INCOMPLETE, Losses, SampleBlock, SampleStatus
from drivers.source import Decoder
from drivers.stream import SampleSource
from messages.i18n import N_
from messages.message import Message, message

_MUCH_SLOWER = 1.37
"""Gauge 2 makes the rows if its device is so much slower. No two usual rates have this ratio: the
choice does not depend on their tolerance."""
_TABLE, _RELATIVE = np.uint8(SampleStatus.OVERLOAD_TABLE), np.uint8(SampleStatus.OVERLOAD_RELATIVE)
_ABSENT = np.uint8(ABSENT)
_NS = 1e-9
_LOST = N_("the device of gauge {gauge} is lost and is looked for: the other gauge goes on")
_RECONNECTED = N_(
    "the device of gauge {gauge} was away and is back: {away_s:.2f} s of its readings are missing and marked"
)


@dataclass(frozen=True, slots=True)
class PairedChannel:
    """One device of a pair."""

    source: SampleSource
    column: int
    """Column of its readings in a block."""


class PairDecoder(Decoder):
    """Decodes each device by its own source, converts its times to the host's, and makes rows of both.

    The clocks are compared over the last seconds only, so a replay that begins within a stream soon makes the
    same rows as the live decoder. `channels` are the devices of gauge 1 and gauge 2, `rates_hz` their nominal
    rates.
    """

    def __init__(self, channels: tuple[PairedChannel, PairedChannel], rates_hz: tuple[float, float]) -> None:
        self.base_gauge = choose_base_gauge(rates_hz)
        """Gauge whose readings make the rows: 0 for gauge 1, 1 for gauge 2."""
        self._channels = channels
        self._rates_hz = rates_hz
        self._unwrapper = Unwrapper()
        self._time_fits = (HostTimeFit(), HostTimeFit())
        self._restarts = [channel.source.losses.restarts for channel in channels]
        self._merger = Merger(self.base_gauge, 1 / rates_hz[1 - self.base_gauge])
        self._skew_statistics = SkewStatistics(rates_hz[self.base_gauge])
        self._rows = Losses()
        self._foreign_bytes = 0
        self._now_ns = 0
        self._lost_ns: list[int | None] = [None, None]
        self._last_ns = [0, 0]
        self._warnings: list[Message] = []

    @property
    def buffered(self) -> int:
        """Bytes and readings kept for the next call."""
        return self._unwrapper.unfinished_bytes + self._merger.buffered

    @property
    def losses(self) -> Losses:
        """Counts until now. Missing readings are known from the host's time alone, so they are estimates."""
        both = self._channels[0].source.losses + self._channels[1].source.losses
        return replace(
            self._rows,
            discarded_bytes=both.discarded_bytes + self._unwrapper.discarded_bytes + self._foreign_bytes,
            restarts=both.restarts,
            repeated=both.repeated,
            unexplained_drops=both.unexplained_drops,
        )

    def skew(self, first_index: int, end_index: int) -> Skew | None:
        return self._skew_statistics.skew(first_index, end_index)

    def take_warnings(self) -> list[Message]:
        warnings, self._warnings = self._warnings, []
        return warnings

    def expect_restart(self) -> None:
        for channel, line in zip(self._channels, self._time_fits, strict=True):
            list(channel.source.decode(b"", self._now_ns))
            line.reset()
        self._lost_ns = [None, None]

    def feed(self, data: bytes, arrival_ns: int) -> Iterator[SampleBlock]:  # noqa: ARG002 - in envelopes
        for read in self._unwrapper.feed(data):
            if read.port < len(self._channels):
                yield from self._decode_read(read.port, read)
            else:
                self._foreign_bytes += len(read.data)
            if self._merger.is_overdue(self._now_ns):
                yield from self._ready_blocks()
        yield from self._ready_blocks()

    def _decode_read(self, gauge: int, read: StampedRead) -> Iterator[SampleBlock]:
        """Add a read of one device; yields rows early where a long gap makes many, to bound the memory."""
        self._now_ns = max(self._now_ns, read.arrival_ns)
        source = self._channels[gauge].source
        blocks = [_without_zero_counts(block) for block in source.decode(read.data, read.arrival_ns)]
        if not read.data or source.losses.restarts != self._restarts[gauge]:
            self._restarts[gauge] = source.losses.restarts
            self._time_fits[gauge].reset()
        if not read.data and self._lost_ns[gauge] is None:
            self._lost_ns[gauge] = self._last_ns[gauge] or read.arrival_ns
            self._warnings.append(message(_LOST, gauge=gauge + 1))
        if blocks:
            lost_ns, self._lost_ns[gauge], self._last_ns[gauge] = self._lost_ns[gauge], None, read.arrival_ns
            if lost_ns is not None:
                away_s = (self._now_ns - lost_ns) * _NS
                self._warnings.append(message(_RECONNECTED, gauge=gauge + 1, away_s=away_s))
            own_s = float(self._device_time_s(gauge, blocks[-1])[-1])
            self._time_fits[gauge].add(own_s, blocks[-1].arrival_ns)
        column = self._channels[gauge].column
        for block in blocks:
            status = block.status
            if column:  # flags as of gauge 1
                is_clipped = (status & _RELATIVE) != 0
                status = (status & _ABSENT) | np.where(is_clipped, _TABLE, np.uint8(0))
            host_ns = self._time_fits[gauge].host_ns(self._device_time_s(gauge, block))
            # After a forward leap of the device's clock, rows would else wait until the host's clock follows.
            host_ns = np.minimum(host_ns, read.arrival_ns)
            self._merger.add(gauge, ChannelSamples(host_ns, block.counts[:, column], status))
            if self._merger.buffered > MAX_BLOCK_ROWS:
                yield from self._ready_blocks()

    def _device_time_s(self, gauge: int, block: SampleBlock) -> Floats:
        if block.device_time_s is not None:
            return block.device_time_s
        return (block.first_index + np.arange(len(block))) / self._rates_hz[gauge]

    def _ready_blocks(self) -> Iterator[SampleBlock]:
        while (merged := self._merger.take(self._now_ns)) is not None:
            first_index = self._rows.samples
            lag_s = np.where(merged.is_paired, merged.lag_ns * _NS, np.nan)
            scatter_s = math.hypot(*(line.scatter_s for line in self._time_fits))
            self._skew_statistics.add(first_index, lag_s, scatter_s)
            missing, damaged, overloaded = (
                int(np.count_nonzero(merged.status & int(flags)))
                for flags in (INCOMPLETE, SampleStatus.DAMAGED, _TABLE | _RELATIVE)
            )
            self._rows += Losses(len(merged), 0, missing, damaged, overloaded)
            yield SampleBlock(first_index, merged.counts, merged.status, self._now_ns)


def _without_zero_counts(block: SampleBlock) -> SampleBlock:
    """The same block without memory for its counts where these are all 0: a gap may last minutes."""
    if block.counts.any():
        return block
    nothing = np.zeros(block.counts.shape[1:], block.counts.dtype)
    return replace(block, counts=np.broadcast_to(nothing, block.counts.shape))


def choose_base_gauge(rates_hz: tuple[float, float]) -> int:
    """Gauge whose readings make the rows: 1 if gauge 2 is much slower, so that others are near each row."""
    return int(rates_hz[0] > _MUCH_SLOWER * rates_hz[1])
