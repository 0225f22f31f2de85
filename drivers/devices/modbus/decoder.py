"""Responses of a polled transmitter, in envelopes with their time, decoded to sample blocks."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from drivers.clock import Skew, SkewStatistics
from drivers.devices.modbus.registers import ChannelValue, Poll
from drivers.envelope import StampedRead, Unwrapper, wrap
from drivers.packets import MAX_GAP_S, PACKET, sample_blocks
from drivers.polling import sample_period_ns
from drivers.samples import Losses, SampleBlock, SampleStatus
from drivers.source import Decoder

LATE = 0x80  # bit of an envelope's port: the time of the measurement is not known
_NS = 1_000_000_000
_OVERLOADS = (int(SampleStatus.OVERLOAD_TABLE), int(SampleStatus.OVERLOAD_RELATIVE))


def wrap_response(request: int, measured_ns: int, data: bytes, *, is_late: bool = False) -> bytes:
    """Envelope of a response as received, with the number of its request and the time of measurement."""
    return wrap(request | (LATE if is_late else 0), measured_ns, data)


class ResponseDecoder(Decoder):
    """Bytes to sample blocks; the time of each response gives its row.

    The host's time is divided into cells of one sample period, and each poll is made at the beginning of a
    cell. So the cell of a measurement is the number of its row, and a cell without one is certainly missing.
    The row of a response that is damaged, has a fault bit, or has no known time is damaged; the row of a
    Modbus exception is missing.

    `device_time_s` of the blocks is the time of measurement, `arrival_ns` that of the last row. `columns` are
    those of the channels of `poll`: 0 is table, 1 relative.
    """

    def __init__(
        self, poll: Poll, columns: tuple[int, ...], rate_hz: float, max_gap_s: float = MAX_GAP_S
    ) -> None:
        self._losses = Losses()
        self._poll = poll
        self._columns = columns
        self._period_ns = sample_period_ns(rate_hz)
        self._max_gap = round(max_gap_s * rate_hz)
        self._unwrapper = Unwrapper()
        self._responses: list[bytes] | None = None
        self._measured_ns = 0
        self._request_times_ns: list[int] = []
        first, last = self._gauge_requests = poll.gauge_requests
        self._skew_statistics = SkewStatistics(rate_hz) if first != last else None
        self._last_ns: int | None = None
        self._broken = 0
        self._row_time_s = 0.0
        self._rows: list[tuple[int, int, float, int, int]] = []
        self._counts: list[list[float]] = []

    @property
    def losses(self) -> Losses:
        return replace(self._losses)

    @property
    def unfinished_bytes(self) -> int:
        return self._unwrapper.unfinished_bytes

    def skew(self, first_index: int, end_index: int) -> Skew | None:
        return self._skew_statistics.skew(first_index, end_index) if self._skew_statistics else None

    def expect_restart(self) -> None:
        """The connection broke: an unfinished poll is discarded. The grid goes on with the host's clock."""
        self._responses = None

    def feed(self, data: bytes, arrival_ns: int) -> Iterator[SampleBlock]:
        first_index, last_time_s = self._losses.samples, self._row_time_s
        discarded = self._unwrapper.discarded_bytes
        for read in self._unwrapper.feed(data):
            self._add_response(read)
        self._losses.discarded_bytes += self._unwrapper.discarded_bytes - discarded
        if self._rows:
            rows, counts = np.array(self._rows, dtype=PACKET), np.array(self._counts)
            self._rows, self._counts = [], []
            indices = range(first_index, self._losses.samples)
            arrival_ns = self._last_ns or 0
            yield from sample_blocks(rows, counts, indices, last_time_s, self._period_ns / _NS, arrival_ns)

    def _add_response(self, read: StampedRead) -> None:
        number = read.port & ~LATE
        if number == 0:
            self._responses, self._request_times_ns, self._measured_ns = [], [], read.arrival_ns
        if self._responses is None or number != len(self._responses):
            self._losses.discarded_bytes += len(read.data)
            return
        self._request_times_ns.append(read.arrival_ns)
        response = self._poll.requests[number].parse_response(read.data)
        if response.fault or read.port & LATE:
            self._responses = None
            if not response.is_exception:
                self._broken += 1
                self._losses.discarded_bytes += len(read.data)
            return
        self._responses.append(response.data)
        if len(self._responses) == len(self._poll.requests):
            self._add_sample(self._poll.channel_values(self._responses))

    def _add_sample(self, values: list[ChannelValue]) -> None:
        self._responses = None
        if any(value.is_faulty for value in values):
            self._broken += 1
            return
        gap = self._gap()
        if gap is None:
            self._losses.repeated += 1
            return
        status, counts = 0, [0.0, 0.0]
        for column, value in zip(self._columns, values, strict=True):
            counts[column] = value.counts
            status |= _OVERLOADS[column] if value.is_overloaded else 0
        if self._skew_statistics is not None:
            first, last = (self._request_times_ns[request] for request in self._gauge_requests)
            self._skew_statistics.add(self._losses.samples + gap, np.array([(last - first) / _NS]), 0.0)
        damaged, self._broken = min(gap, self._broken), 0
        self._rows.append((damaged, gap - damaged, self._row_time_s, 1, status))
        self._counts.append(counts)
        self._losses += Losses(gap + 1, gap - damaged, damaged=damaged, overloaded=bool(status))

    def _gap(self) -> int | None:
        last_ns, self._last_ns = self._last_ns, self._measured_ns
        if last_ns is None:
            return 0
        step = self._measured_ns // self._period_ns - last_ns // self._period_ns
        if step == 0:
            return None
        if not 0 < step <= self._max_gap + 1:
            self._losses.restarts += 1
            self._row_time_s += self._period_ns / _NS
            return 0
        self._row_time_s += (self._measured_ns - last_ns) / _NS
        return step - 1
