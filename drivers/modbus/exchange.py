"""One request and its answer on a link, with the time for which the answer stands."""

import time
from dataclasses import dataclass

from drivers.host_time import host_ns
from drivers.modbus.frames import LONGEST, Request, is_complete
from drivers.source import Link

_NS = 1_000_000_000
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
