"""Polling: one request and its response, the schedule of polls, and the timing of a device."""

import math
import statistics
import time
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from drivers.errors import ProtocolError
from drivers.host_time import host_ns
from drivers.source import Link
from messages.i18n import N_
from messages.message import EMPTY, Message, message

QUASI_STATIC_HZ = 500.0
"""Below it the run gets a note: a motion of 10 Hz has fewer than 50 samples a period."""
TRIALS = 24  # trial polls before the stream; the slowest two in ten of them set the rate
_TOO_BUSY = N_(
    "this computer is too busy to poll at {rate_hz:g} Hz, more than one poll in ten is left"
    " out: close other programs, or ask for a lower rate"
)
_NS = 1_000_000_000
_MAX_WAIT_NS = 50_000_000
"""Threads that poll are stopped within this time."""
_RATE_MARGIN = 1.25
"""Period of polls over the duration that nine in ten trial polls keep to; less loses polls to jitter."""
_TOLERANCE = 0.15
_TOLERANCE_NS = 750_000
"""How far a measurement may be from its place in the grid: the greater of a share of the poll period and a
time. At 100 Hz that is 1.5 ms, 0.15 % of a period of 1 s of the stand."""
_STALE_SHARE = 0.5
_WIRE_S = 0.001
"""A response in less than this share of the shortest time is that of an earlier request, where the shortest
time is that of a wire: request and response of 8 bytes at 115200 baud take longer than 1 ms."""
_SMOOTHING = 0.05  # weight of a new response in the mean phase; twenty polls follow a change of the device
_WINDOW_NS = 2_000_000_000
_BUSY_SHARE = 0.1
"""Share of late wake-ups within 2 s at which this computer counts as busy."""
_MAX_DRAIN_READS = 8
_MAX_DRAINED_BYTES = 256  # that are kept: a frame of Modbus is no longer, and nor is a line


class PollRequest(Protocol):
    """What is sent to ask for a reading."""

    def encode(self) -> bytes: ...

    def is_complete(self, received: bytes) -> bool:
        """Whether as much came as the response has; it may still be wrong."""

    @property
    def is_repeated(self) -> bool:
        """Whether the response is the request itself, from which an echo does not differ."""


def sample_period_ns(rate_hz: float) -> int:
    """Time between two samples (ns); their grid begins at 0 of the host's clock."""
    return round(_NS / rate_hz)


def poll_rate_error(rate_hz: float, timing: "ResponseTiming") -> ProtocolError:
    """Error to raise for a rate at which the device does not answer."""
    return ProtocolError(
        "rate {rate_hz:g} Hz cannot be: a poll takes {poll_ms:.2g} ms, ask for"
        " --rate {possible_hz:g} or leave it out",
        rate_hz=rate_hz,
        poll_ms=1e3 * timing.poll_s,
        possible_hz=timing.max_rate_hz,
    )


def quasi_static_note(rate_hz: float) -> Message:
    """Note for every run that is polled so seldom that a quick motion is seen coarsely; else EMPTY."""
    template = N_("polled at {rate_hz:g} Hz, which is quasi-static: quick motion is seen coarsely")
    return message(template, rate_hz=rate_hz) if rate_hz < QUASI_STATIC_HZ else EMPTY


@dataclass(frozen=True, slots=True)
class Transaction:
    """A request on the wire, and what came after it."""

    data: bytes  # all that came, without an echo of the request; b"" after a time-out
    sent_ns: int  # host's time before the request was written
    received_ns: int  # host's time after the last byte was read
    has_echo: bool = False
    """Whether the line sent the request back, as two-wire adapters do that listen while they send."""

    @property
    def measured_ns(self) -> int:
        """Best estimate of the time of the measurement: the middle of the transaction.

        Request and response take about equally long on the wire and in this computer. The standard
        uncertainty is at most `duration_s / sqrt(12)`.
        """
        return (self.sent_ns + self.received_ns) // 2

    @property
    def duration_s(self) -> float:
        return (self.received_ns - self.sent_ns) / _NS


def transact(link: Link, request: PollRequest, timeout_s: float, *, has_echo: bool = False) -> Transaction:
    """Send a request and read its response; may raise DeviceLostError.

    Reading ends when the response is complete, after `timeout_s`, or in an incomplete response after one read
    without bytes (50 ms on a port). `has_echo`: the line is known to send back what is written to it.
    """
    sent = request.encode()
    echo = sent if has_echo or not request.is_repeated else b""
    received = b""
    sent_ns = host_ns()
    deadline_s = time.perf_counter() + timeout_s
    link.write(sent)
    while not request.is_complete(received.removeprefix(echo)) and time.perf_counter() < deadline_s:
        data = link.read()
        if received not in (b"", echo) and not data:
            break
        received += data
    is_echoed = bool(echo) and received.startswith(echo)
    return Transaction(received.removeprefix(echo), sent_ns, host_ns(), is_echoed)


def drain(link: Link) -> bytes:
    """Read until the line is silent, or 8 times, so that the next response is that of the next request."""
    received = b""
    for _ in range(_MAX_DRAIN_READS):
        data = link.read()
        if not data:
            break
        received = (received + data)[-_MAX_DRAINED_BYTES:]
    return received


class PollSchedule:
    """Schedule of polls: one at the beginning of each cell of the host's time, or none."""

    def __init__(self, rate_hz: float) -> None:
        self._period_ns = sample_period_ns(rate_hz)
        self._cell = host_ns() // self._period_ns + 1
        self.tolerance_ns = max(round(_TOLERANCE * self._period_ns), _TOLERANCE_NS)
        self._window_ns = self.due_ns
        self._wakeups = self._late_wakeups = 0
        self._rate_hz = rate_hz
        self._is_computer_busy = False
        self._warnings: deque[Message] = deque()

    @property
    def due_ns(self) -> int:
        return self._cell * self._period_ns

    def wait(self) -> bool:
        """Sleep until the next poll is due, 50 ms at most; returns whether it is due now."""
        now_ns = host_ns()
        if now_ns - self.due_ns > self.tolerance_ns:  # missed
            self._cell = now_ns // self._period_ns + 1
        wait_ns = self.due_ns - host_ns()
        time.sleep(max(0, min(wait_ns, _MAX_WAIT_NS)) / _NS)
        late_ns = host_ns() - self.due_ns
        if late_ns >= 0:
            self._wakeups += 1
            self._late_wakeups += late_ns > self.tolerance_ns
        if late_ns >= 0 and self.due_ns - self._window_ns > _WINDOW_NS:
            was_busy = self._is_computer_busy
            self._is_computer_busy = self._late_wakeups > _BUSY_SHARE * self._wakeups
            if self._is_computer_busy and not was_busy:
                self._warnings.append(message(_TOO_BUSY, rate_hz=self._rate_hz))
            self._window_ns, self._wakeups, self._late_wakeups = self.due_ns, 0, 0
        return 0 <= late_ns <= self.tolerance_ns

    def take_warnings(self) -> list[Message]:
        """Warnings since the last call that this computer wakes up too late for one poll in ten."""
        return [self._warnings.popleft() for _ in range(len(self._warnings))]

    def mark_used(self, measured_ns: int) -> None:
        self._cell = max(self._cell, measured_ns // self._period_ns) + 1


class ResponseTiming:
    """How quickly a device answers, measured in trials (polls in immediate succession) and in the stream."""

    def __init__(self, trials: Sequence[Sequence[Transaction]]) -> None:
        durations_s = sorted(sum(transaction.duration_s for transaction in poll) for poll in trials)
        self.poll_s = durations_s[len(durations_s) // 2]
        """Median duration of a poll (s)."""
        self._slow_s = durations_s[len(durations_s) * 9 // 10]
        self._shortest_s = min(transaction.duration_s for poll in trials for transaction in poll)
        self._phases_ns = [
            statistics.median_high(poll[i].measured_ns - poll[0].sent_ns for poll in trials)
            for i in range(len(trials[0]))
        ]

    @property
    def max_rate_hz(self) -> float:
        """Highest rate, of two digits or a multiple of five, at which the device answers nearly all polls."""
        rate_hz = 1 / (_RATE_MARGIN * self._slow_s)
        step = 5.0 if rate_hz >= 50 else 10.0 ** (math.floor(math.log10(rate_hz)) - 1)
        return float(f"{math.floor(rate_hz / step) * step:.6g}")

    def skew_s(self, first: int, last: int) -> float:
        return (self._phases_ns[last] - self._phases_ns[first]) / _NS

    def is_stale(self, transaction: Transaction) -> bool:
        """Whether a response came too quickly to be that of its request."""
        return self._shortest_s > _WIRE_S and transaction.duration_s < _STALE_SHARE * self._shortest_s

    def is_on_schedule(self, request: int, transaction: Transaction, schedule: PollSchedule) -> bool:
        """Whether a measurement is at its place in the grid: a row has the time of its cell."""
        return abs(self._deviation_ns(request, transaction, schedule)) <= schedule.tolerance_ns

    def update(self, answered: Sequence[Transaction], schedule: PollSchedule) -> None:
        """Add the responses of a poll; those off schedule too, because the device may have become slower.

        Requests that were not asked, because the poll ended early, would have been as late as the last one.
        """
        most_ns, correction_ns = schedule.tolerance_ns, 0
        for request in range(len(self._phases_ns)):
            if request < len(answered):
                self._shortest_s = min(self._shortest_s, answered[request].duration_s)
                off_ns = self._deviation_ns(request, answered[request], schedule)
                correction_ns = round(_SMOOTHING * max(-most_ns, min(off_ns, most_ns)))
            self._phases_ns[request] += correction_ns

    def _deviation_ns(self, request: int, transaction: Transaction, schedule: PollSchedule) -> int:
        return transaction.measured_ns - schedule.due_ns - self._phases_ns[request]
