"""What all sources share: bytes wait until the rate is known, then a decoder takes them."""

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from typing import Protocol

from drivers.diagnosis import describe_unreadable
from drivers.errors import NoDataError, ProtocolError
from drivers.read_batching import BatchedReader
from drivers.samples import DeviceIdentity, Losses, SampleBlock
from drivers.source import Link

_MAX_HELD_BYTES = 1 << 20
_STOOD_S = 0.5
"""A read waits for a fraction of it: whoever comes back later stood still."""
_LEAST_S = 0.1
"""What waits in the port is looked at even if the time for it has passed, as while the device was asked."""


class Decoder(Protocol):
    """Bytes in, sample blocks out, as the device folders have them."""

    @property
    def losses(self) -> Losses:
        """The account until now."""

    def expect_restart(self) -> None:
        """The link was broken: what comes next may be a new start of the device."""

    def feed(self, data: bytes, arrival_ns: int) -> Iterator[SampleBlock]:
        """Blocks that `data` completes."""


class StreamSource(ABC):
    """A `SampleSource` around a decoder that needs to know the rate.

    Parameters
    ----------
    identity : DeviceIdentity
        Until the device says better.
    baud : int
        The device's usual baud rate, for messages.
    rate_hz : float or None
        Samples a second where it is known beforehand.
    """

    timeout_s = 3.0
    """How long `start` waits for the first good data."""
    batch_delay_s = 0.0
    """See `drivers.source.SampleSource`."""

    def __init__(self, identity: DeviceIdentity, baud: int, rate_hz: float | None) -> None:
        self._identity = identity
        self._baud = baud
        self._rate_hz = rate_hz
        self._decoder: Decoder | None = None
        self._pending = b""
        self._reader = BatchedReader()

    @property
    def channels(self) -> int:
        """Both gauges, of most devices."""
        return 2

    @property
    def identity(self) -> DeviceIdentity:
        """What the device said of itself, or its protocol alone."""
        return self._identity

    @property
    def rate_hz(self) -> float:
        """Nominal samples a second. Raises ProtocolError while it is not known."""
        if self._rate_hz is None:
            raise ProtocolError(f"{self._identity.protocol}: the rate is not known before the first samples")
        return self._rate_hz

    @property
    def losses(self) -> Losses:
        """The account until now."""
        return self._decoder.losses if self._decoder else Losses()

    @property
    def run_note(self) -> str:
        """Nothing; see `drivers.source.SampleSource`."""
        return ""

    def take_warnings(self) -> list[str]:
        """Nothing; see `drivers.source.SampleSource`."""
        return []

    @abstractmethod
    def prepare(self) -> None:
        """Compile what decoding needs, so that no stream waits for it; `start` does it too."""

    @abstractmethod
    def start(self, link: Link) -> bytes:
        """See `drivers.source.SampleSource`."""

    def resume(self, link: Link) -> bytes:
        """See `drivers.source.SampleSource`."""
        return self.start(link)

    def read(self, link: Link) -> bytes:
        """What the device sent by itself; see `drivers.source.SampleSource`."""
        return self._reader.read(link, self.batch_delay_s)

    @abstractmethod
    def stop(self, link: Link) -> None:
        """See `drivers.source.SampleSource`."""

    @abstractmethod
    def make_decoder(self, data: bytes) -> Decoder | None:
        """A decoder, once `data` (all that came yet) tell what it needs to know."""

    def decode(self, data: bytes, arrival_ns: int) -> Iterator[SampleBlock]:
        """Samples completed by `data`, b"" for a broken link; exhaust it. See `drivers.source.SampleSource`.

        Raises
        ------
        NoDataError
            If a megabyte did not tell what a decoder needs to know.
        """
        if not data and self._decoder is not None:
            self._decoder.expect_restart()
        data, self._pending = self._pending + data, b""
        if self._decoder is None:
            self._decoder = self.make_decoder(data)
        if self._decoder is not None:
            yield from self._decoder.feed(data, arrival_ns)
        elif len(data) > _MAX_HELD_BYTES:
            raise self.no_data_error(data)
        else:
            self._pending = data

    def await_data(self, link: Link, deadline_s: float, good: Callable[[bytes], bool]) -> tuple[bytes, bool]:
        """All that came until it was good or `time.monotonic()` past the deadline; whether it was good.

        While this computer stands still nobody listens: that does not count.
        """
        received, looked_s = b"", time.monotonic()
        deadline_s = max(deadline_s, looked_s + _LEAST_S)
        while looked_s < deadline_s:
            data = link.read()
            received += data
            if data and good(received):
                return received, True
            before_s, looked_s = looked_s, time.monotonic()
            if looked_s - before_s > _STOOD_S:
                deadline_s += looked_s - before_s
        return received, False

    def no_data_error(self, received: bytes) -> NoDataError:
        """Error that says what came instead."""
        return NoDataError(
            f"no good data in {self.timeout_s:g} s:"
            f" {describe_unreadable(received, self._identity.protocol, self._baud)}"
        )
