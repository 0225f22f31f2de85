"""Answers of a polled transmitter, in the envelopes that say when they came, as sample blocks."""

from collections.abc import Iterator

import numpy as np

from drivers.envelope import StampedRead, Unwrapper, wrap
from drivers.modbus.frames import ExceptionResponse, RegisterResponse, parse_response
from drivers.modbus.registers import ChannelValue, Poll
from drivers.packets import MAX_GAP_S, PACKET, Packets, sample_blocks
from drivers.samples import Losses, SampleBlock, SampleStatus
from drivers.skew import Skew, SkewStatistics

LATE = 0x80
"""Bit of an envelope's port: the answer does not tell when it was measured."""
_NS = 1_000_000_000
_OVERLOADS = (int(SampleStatus.OVERLOAD_TABLE), int(SampleStatus.OVERLOAD_RELATIVE))


def sample_period_ns(rate_hz: float) -> int:
    """Time between two samples (ns), which lie in a grid that begins with the host's clock."""
    return round(_NS / rate_hz)


def wrap_response(request: int, measured_ns: int, data: bytes, *, is_late: bool = False) -> bytes:
    """Envelope of an answer as it came, which says to which request of a poll, and when it was measured."""
    return wrap(request | (LATE if is_late else 0), measured_ns, data)


class ResponseDecoder:
    """Bytes to sample blocks, each reading in the place that its time has in the host's grid.

    The time between two samples is a grid on the host's clock, and each poll is made at the beginning of a
    cell of its own. So the cell in which an answer was measured is the number of its row: a cell without
    any is missing for certain, and nothing has to be guessed from lateness. An answer that is damaged, says
    that its sensor fails, or does not tell when it was measured makes the row of its cell a damaged one; one
    with a Modbus exception leaves it missing.

    `device_time_s` is the time at which the answers were measured, and `arrival_ns` that of the last row.

    Parameters
    ----------
    poll : Poll
    columns : tuple of int
        Column of each of its channels: 0 is table, 1 relative.
    rate_hz : float
    max_gap_s : float
        Longest gap that is believed.
    """

    def __init__(
        self, poll: Poll, columns: tuple[int, ...], rate_hz: float, max_gap_s: float = MAX_GAP_S
    ) -> None:
        self.losses = Losses()
        """The account until now."""
        self._poll = poll
        self._columns = columns
        self._period_ns = sample_period_ns(rate_hz)
        self._max_gap = round(max_gap_s * rate_hz)
        self._unwrapper = Unwrapper()
        self._answers: list[bytes] | None = None
        self._measured_ns = 0
        self._asked_ns: list[int] = []
        self._read_in = (poll.values[0].request, poll.values[-1].request)
        self._skews = SkewStatistics(rate_hz) if self._read_in[0] != self._read_in[1] else None
        self._last_ns: int | None = None
        self._broken = 0
        self._row_time_s = 0.0
        self._units: list[tuple[int, int, float, int, int]] = []
        self._counts: list[tuple[float, float]] = []

    @property
    def unfinished_bytes(self) -> int:
        """Bytes kept for the next call, fewer than an envelope of the largest size has."""
        return self._unwrapper.unfinished_bytes

    def skew(self, first_index: int, end_index: int) -> Skew | None:
        """By how much later gauge 2 was read than gauge 1 in these rows; None for both in one request."""
        return self._skews.skew(first_index, end_index) if self._skews else None

    def expect_restart(self) -> None:
        """The link was broken: a poll that had begun is not ended. The grid goes on with the host's clock."""
        self._answers = None

    def feed(self, data: bytes, arrival_ns: int) -> Iterator[SampleBlock]:  # noqa: ARG002 - they tell it
        """Blocks that `data` completes; bytes of an unfinished envelope are kept. Exhaust it."""
        first_index, last_time_s = self.losses.samples, self._row_time_s
        discarded = self._unwrapper.discarded_bytes
        for read in self._unwrapper.feed(data):
            self._add_response(read)
        self.losses.discarded_bytes += self._unwrapper.discarded_bytes - discarded
        if self._units:
            yield from sample_blocks(self._packets(first_index, last_time_s))

    def _packets(self, first_index: int, last_time_s: float) -> Packets:
        units, counts = np.array(self._units, dtype=PACKET), np.array(self._counts)
        self._units, self._counts = [], []
        return Packets(
            packets=units,
            counts=counts,
            first_index=first_index,
            rows=self.losses.samples - first_index,
            last_time_s=last_time_s,
            period_s=self._period_ns / _NS,
            timed=True,
            arrival_ns=self._last_ns or 0,
        )

    def _add_response(self, read: StampedRead) -> None:
        number = read.port & ~LATE
        if number == 0:
            self._answers, self._asked_ns, self._measured_ns = [], [], read.arrival_ns
        if self._answers is None or number != len(self._answers):
            self.losses.discarded_bytes += len(read.data)
            return
        self._asked_ns.append(read.arrival_ns)
        answer = parse_response(self._poll.requests[number], read.data)
        if isinstance(answer, RegisterResponse) and not read.port & LATE:
            self._answers.append(answer.data)
        else:
            self._leave_out(read.data, is_refused=isinstance(answer, ExceptionResponse))
        if self._answers is not None and len(self._answers) == len(self._poll.requests):
            self._add_sample(self._poll.channel_values(self._answers))

    def _leave_out(self, data: bytes, *, is_refused: bool) -> None:
        self._answers = None
        if not is_refused:
            self._broken += 1
            self.losses.discarded_bytes += len(data)

    def _add_sample(self, readings: list[ChannelValue]) -> None:
        self._answers = None
        if any(reading.is_faulty for reading in readings):
            self._broken += 1
            return
        gap = self._gap()
        if gap is None:
            self.losses.repeated += 1
            return
        status, counts = 0, [0.0, 0.0]
        for column, reading in zip(self._columns, readings, strict=True):
            counts[column] = reading.counts
            status |= _OVERLOADS[column] if reading.is_overloaded else 0
        self._append_row(gap, status, (counts[0], counts[1]))

    def _gap(self) -> int | None:
        """Rows between the last one and this; None where both have the same place. Keeps the time."""
        last_ns, self._last_ns = self._last_ns, self._measured_ns
        if last_ns is None:
            return 0
        step = self._measured_ns // self._period_ns - last_ns // self._period_ns
        if step == 0:
            return None
        if not 0 < step <= self._max_gap + 1:
            self.losses.restarts += 1
            self._row_time_s += self._period_ns / _NS
            return 0
        self._row_time_s += (self._measured_ns - last_ns) / _NS
        return step - 1

    def _append_row(self, gap: int, status: int, counts: tuple[float, float]) -> None:
        damaged = min(gap, self._broken)
        if self._skews is not None:
            first, last = (self._asked_ns[request] for request in self._read_in)
            self._skews.add(self.losses.samples + gap, np.array([(last - first) / _NS]), 0.0)
        self._units.append((damaged, gap - damaged, self._row_time_s, 1, status))
        self._counts.append(counts)
        self.losses.samples += gap + 1
        self.losses.damaged += damaged
        self.losses.missing += gap - damaged
        self.losses.overloaded += bool(status)
        self._broken = 0
