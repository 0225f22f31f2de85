"""When to ask: a grid of cells on the host's clock, and how punctually a device answers in them."""

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass

from drivers.host_time import host_ns
from drivers.modbus.decoder import sample_period_ns
from drivers.modbus.frames import LONGEST, Request, is_complete
from drivers.source import Link

_NS = 1_000_000_000
_LONGEST_WAIT_NS = 50_000_000
_HELD_BELOW = 1.25
"""Polls are so much further apart than nine in ten of the trials lasted."""
_OFF_GRID = 0.15
_OFF_GRID_NS = 750_000
"""A reading belongs to its cell if it is off by less than the greater of these, part of a cell and time."""
_TOO_QUICK = 0.5
"""An answer that took so much of the quickest that there was is that of an earlier request..."""
_WIRE_S = 0.001
"""... where the quickest was on a wire, which needs as long for the shortest request and answer."""
_FORGETS = 0.05
_WINDOW_NS = 2_000_000_000
_BUSY = 0.1


_QUIET_READS = 8


@dataclass(frozen=True, slots=True)
class Transaction:
    """What came after a request.

    Attributes
    ----------
    data : bytes
        All of it; none after a time-out.
    sent_ns, answered_ns : int
        Host's time before the request was written and after the last byte was read.
    """

    data: bytes
    sent_ns: int
    answered_ns: int

    @property
    def measured_ns(self) -> int:
        """Host's time that stands best for the reading: the middle.

        A transmitter takes its reading between the end of the request and the beginning of its answer, both
        of which are about as long on the wire and as late in this computer. Its standard uncertainty is
        `lasted_s / sqrt(12)` at most.
        """
        return (self.sent_ns + self.answered_ns) // 2

    @property
    def duration_s(self) -> float:
        """From the request to the end of the answer (s)."""
        return (self.answered_ns - self.sent_ns) / _NS


def transact(link: Link, request: Request, timeout_s: float) -> Transaction:
    """Send a request and wait for as many bytes as answer it, or until nothing follows.

    An answer that stops in the middle is given up after one silent read (50 ms on a port).
    Raises DeviceLostError.
    """
    received = b""
    sent_ns = host_ns()
    deadline_s = time.monotonic() + timeout_s
    link.write(request.encode())
    while not is_complete(request, received) and time.monotonic() < deadline_s:
        data = link.read()
        if received and not data:
            break
        received += data
    return Transaction(received, sent_ns, host_ns())


def drain(link: Link) -> bytes:
    """Read until the line is silent, so that the next answer is that of the next request.

    Gives up after a few reads: a device that never stops is none that is asked. Raises DeviceLostError.
    """
    received = b""
    for _ in range(_QUIET_READS):
        data = link.read()
        if not data:
            break
        received = (received + data)[-LONGEST:]
    return received


class PollSchedule:
    """Cells of the host's time, in each of which one poll is begun at its beginning, or none.

    Parameters
    ----------
    rate_hz : float
        Cells a second.
    """

    def __init__(self, rate_hz: float) -> None:
        self._period_ns = sample_period_ns(rate_hz)
        self._cell = host_ns() // self._period_ns + 1
        self.tolerance_ns = max(round(_OFF_GRID * self._period_ns), _OFF_GRID_NS)
        """By how much readings may be off their places in the grid."""
        self._window_ns = self.due_ns
        self._slept = self._overslept = 0
        self.is_computer_busy = False
        """Whether this computer lately woke up too late for one cell in ten or more."""

    @property
    def due_ns(self) -> int:
        """Host's time at which the cell begins that was waited for."""
        return self._cell * self._period_ns

    def wait(self) -> bool:
        """Sleep until the next cell begins; False where it is too far, or began too long ago."""
        self._skip_missed()
        wait_ns = self.due_ns - host_ns()
        time.sleep(max(0, min(wait_ns, _LONGEST_WAIT_NS)) / _NS)
        late_ns = host_ns() - self.due_ns
        if late_ns >= 0:
            self._update_load(late_ns > self.tolerance_ns)
        return 0 <= late_ns <= self.tolerance_ns

    def mark_used(self, measured_ns: int) -> None:
        """Use no more the cell that was waited for, and that in which the reading was measured."""
        self._cell = max(self._cell, measured_ns // self._period_ns) + 1

    def _update_load(self, has_overslept: bool) -> None:
        self._slept += 1
        self._overslept += has_overslept
        if self.due_ns - self._window_ns > _WINDOW_NS:
            self.is_computer_busy = self._overslept > _BUSY * self._slept
            self._window_ns, self._slept, self._overslept = self.due_ns, 0, 0

    def _skip_missed(self) -> None:
        """Leave out cells that began too long ago."""
        now_ns = host_ns()
        if now_ns - self.due_ns > self.tolerance_ns:
            self._cell = now_ns // self._period_ns + 1


class ResponseTiming:
    """How a device answers the requests of a poll, learnt from trials and ever since.

    Parameters
    ----------
    trials : sequence of sequence of Exchange
        Polls made one right after the other.
    """

    def __init__(self, trials: Sequence[Sequence[Transaction]]) -> None:
        lasted_s = sorted(sum(exchange.duration_s for exchange in poll) for poll in trials)
        self.poll_s = lasted_s[len(lasted_s) // 2]
        """Usual time of a poll (s)."""
        self._slow_s = lasted_s[len(lasted_s) * 9 // 10]
        self._quickest_s = min(exchange.duration_s for poll in trials for exchange in poll)
        self._phases_ns = [
            _median([poll[i].measured_ns - poll[0].sent_ns for poll in trials]) for i in range(len(trials[0]))
        ]

    @property
    def max_rate_hz(self) -> float:
        """Polls a second that the device answers nearly always."""
        return round_down(1 / (_HELD_BELOW * self._slow_s))

    def skew_s(self, first: int, last: int) -> float:
        """From the reading in the answer to one request to that in another (s)."""
        return (self._phases_ns[last] - self._phases_ns[first]) / _NS

    def is_stale(self, exchange: Transaction) -> bool:
        """Whether an answer is quicker than its wire, so that it was there before."""
        return self._quickest_s > _WIRE_S and exchange.duration_s < _TOO_QUICK * self._quickest_s

    def is_on_schedule(self, request: int, exchange: Transaction, cells: PollSchedule) -> bool:
        """Whether a reading was measured where its place in the grid is.

        A row stands for the place that its cell has in the grid, so a reading that is much earlier or later
        than others are in theirs would be a wrong one.
        """
        return abs(self._deviation_ns(request, exchange, cells)) <= cells.tolerance_ns

    def update(self, request: int, exchange: Transaction, cells: PollSchedule) -> None:
        """Take notice of an answer, a little even of one that is off: the device may be slower for good."""
        self._quickest_s = min(self._quickest_s, exchange.duration_s)
        off_ns, most_ns = self._deviation_ns(request, exchange, cells), cells.tolerance_ns
        self._phases_ns[request] += round(_FORGETS * max(-most_ns, min(off_ns, most_ns)))

    def _deviation_ns(self, request: int, exchange: Transaction, cells: PollSchedule) -> int:
        return exchange.measured_ns - cells.due_ns - self._phases_ns[request]


def round_down(rate_hz: float) -> float:
    """A rate that can be read and typed: two digits of it, or whole fives."""
    step = 5.0 if rate_hz >= 50 else 10.0 ** (math.floor(math.log10(rate_hz)) - 1)
    return float(f"{math.floor(rate_hz / step) * step:.6g}")


def _median(values: list[int]) -> int:
    return sorted(values)[len(values) // 2]
