"""The interfaces between a port, a device and a decoder."""

import threading
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

from drivers.clock import Skew
from drivers.errors import DeviceLostError
from drivers.samples import Losses, SampleBlock
from messages.message import Message


@dataclass(frozen=True, slots=True)
class CollectLimit:
    """How many bytes may collect in a port before they are read, so that a late read loses none.

    The defaults suit any port: the smallest buffers of systems and adapters hold 4 kB.
    """

    calm_bytes: int = 2048
    busy_bytes: int = 512  # on a busy computer, where a sleep ends late


class Link(Protocol):
    """An open byte connection; `drivers.port.Port` is one."""

    def read(self) -> bytes:
        """Wait at most 50 ms and return what came, b"" if nothing. Raises DeviceLostError."""

    def write(self, data: bytes) -> None:
        """Send all of `data`. Raises DeviceLostError."""


@dataclass(frozen=True, slots=True)
class LineSettings:
    """Baud rate, parity and stop bits of a serial port."""

    baud: int
    parity: str = "N"
    stop_bits: int = 1

    def __str__(self) -> str:
        return f"{self.baud} baud 8{self.parity}{self.stop_bits}"


class CancellableLink:
    """A link that raises DeviceLostError from the moment `cancelled` is set, so that a start can be ended."""

    def __init__(self, link: Link, cancelled: threading.Event) -> None:
        self._link = link
        self._cancelled = cancelled

    def read(self) -> bytes:
        self._check()
        return self._link.read()

    def write(self, data: bytes) -> None:
        self._check()
        self._link.write(data)

    def _check(self) -> None:
        if self._cancelled.is_set():
            raise DeviceLostError("the connection was cancelled: connect again")


Read = tuple[bytes, int]
"""Bytes of one read, and the host's monotonic time (ns) after it."""


class Decoder(ABC):
    """Bytes in, sample blocks out. It uses no port, clock or thread: recorded bytes give the same blocks."""

    @property
    @abstractmethod
    def losses(self) -> Losses:
        """Counts until now; later ones do not change what is returned."""

    @abstractmethod
    def feed(self, data: bytes, arrival_ns: int) -> Iterator[SampleBlock]:
        """Samples completed by `data`; an unfinished rest of bounded size is kept. Exhaust the iterator."""

    def feed_reads(self, reads: Sequence[Read]) -> list[SampleBlock]:
        """Samples of consecutive reads: the rows and losses that `feed` of each read gives."""
        return [block for data, arrival_ns in reads for block in self.feed(data, arrival_ns)]

    @abstractmethod
    def expect_restart(self) -> None:
        """The connection broke: what comes next may be a new start of the device."""

    def skew(self, first_index: int, end_index: int) -> Skew | None:  # noqa: ARG002
        """Skew of samples first_index <= index < end_index; None where one converter reads both gauges."""
        return None

    def take_warnings(self) -> list[Message]:
        """Warnings about the stream since the last call."""
        return []
