"""The interfaces between a port, a device and the application."""

import contextlib
import threading
from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

from drivers.clock import Skew
from drivers.errors import DeviceLostError
from drivers.samples import DeviceIdentity, Losses, SampleBlock
from messages.message import EMPTY, Message


class Link(Protocol):
    """An open byte connection; `drivers.port.Port` is one."""

    def read(self) -> bytes:
        """Wait at most 50 ms and return what came, b"" if nothing. Raises DeviceLostError."""

    def write(self, data: bytes) -> None:
        """Send all of `data`. Raises DeviceLostError."""


@dataclass(frozen=True, slots=True)
class LineSettings:
    """Baud rate and parity of a serial port."""

    baud: int
    parity: str = "N"

    def __str__(self) -> str:
        return f"{self.baud} baud 8{self.parity}1"


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


class SampleSource(ABC):
    """One device: its conversation and its decoder.

    `start` and `stop` talk to the device. `decode` uses no port, clock or thread, so that recorded bytes are
    decoded by the code that decoded them live. The caller runs the loop: `data = source.start(link)`, then
    `source.decode(data, arrival_ns)` for that and for all that `source.read(link)` returns, then
    `source.stop(link)`. Where the connection broke, the caller passes `source.decode(b"", arrival_ns)`, in a
    replay too, and decodes next what `source.resume(link)` returns.
    """

    batch_delay_s = 0.0
    """How long `read` may let bytes collect (s); set by the caller. Polled devices ignore it."""
    stop_command = b""
    """What asks the device to stop sending."""

    is_polled = False
    """Whether the device is polled on a grid of the host's clock, see `set_poll_rate`."""

    @property
    def channels(self) -> int:
        """Gauges that the device reads, 1 or 2; the column of a missing one is 0."""
        return 2

    @property
    @abstractmethod
    def identity(self) -> DeviceIdentity:
        """Known after `start`; before it, the protocol alone."""

    @property
    @abstractmethod
    def rate_hz(self) -> float:
        """Nominal samples a second, from settings, `start` or device times. Raises ProtocolError before."""

    @property
    @abstractmethod
    def losses(self) -> Losses:
        """Counts until now."""

    @property
    def run_note(self) -> Message:
        """Remark to store with every run of this device, known after `start`; empty for most."""
        return EMPTY

    def take_warnings(self) -> list[Message]:
        """Warnings about the stream since the last call; to be called after each `decode`."""
        return []

    def skew(self, first_index: int, end_index: int) -> Skew | None:  # noqa: ARG002
        """Skew of samples first_index <= index < end_index; None where one converter reads both gauges."""
        return None

    def set_poll_rate(self, rate_hz: float) -> None:
        """Lower the rate of polls of a polled device, after the start and before anything is decoded."""
        raise NotImplementedError

    @abstractmethod
    def prepare(self) -> None:
        """Compile what decoding needs, which takes seconds on the very first use; `start` does it too."""

    @abstractmethod
    def start(self, link: Link) -> bytes:
        """Bring the device into a known state, set it up and start the stream.

        Returns what was read of the stream, to be decoded first. Raises NoDataError within about 3 s where
        nothing intelligible comes, ProtocolError where the device does not do what is asked.
        """

    def resume(self, link: Link) -> bytes:
        """Continue with a device that was lost and found again; else as `start`.

        A device that is still sending is left alone: its sequence then proves what is missing.
        """
        return self.start(link)

    def read(self, link: Link) -> bytes:
        """Next bytes to decode, b"" if none came within a fraction of a second.

        A polled device is asked once, when its poll is due. One thread may call this while another decodes.
        Raises DeviceLostError.
        """
        return link.read()

    def stop(self, link: Link) -> None:
        """Send the stop command, if the device has one; nothing happens where it is gone."""
        if self.stop_command:
            with contextlib.suppress(DeviceLostError):
                link.write(self.stop_command)

    @abstractmethod
    def decode(self, data: bytes, arrival_ns: int) -> Iterator[SampleBlock]:
        """Samples completed by `data`; an unfinished rest of bounded size is kept. Exhaust the iterator.

        b"" marks where the connection broke. Missing rows are counted from the device's sequence or time
        where the host's clock agrees with it, else estimated from the host's clock.
        """
