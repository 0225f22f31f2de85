"""What sources share: settings, the conversation with a device, and decoding once the rate is known."""

import logging
import time
from abc import abstractmethod
from collections.abc import Callable, Iterator
from typing import Protocol, TypeVar

import msgspec

from drivers.errors import NoDataError, ProtocolError, SettingsError
from drivers.port_reader import BatchedReader
from drivers.recognition import describe_unreadable
from drivers.samples import DeviceIdentity, Losses, SampleBlock
from drivers.source import Link, SampleSource
from messages.message import MessageError

_log = logging.getLogger(__name__)
_Settings = TypeVar("_Settings", bound=msgspec.Struct)
_Answer = TypeVar("_Answer")

RATE_TOLERANCE = 0.02
"""Two rates that differ by less are the same: resonators of cheap boards are off by up to 0.5 %, and a rate
from half a second of times of 1 ms is good to 0.4 %."""
_MAX_PENDING_BYTES = 1 << 20
_STALL_S = 0.5
"""A read waits for 50 ms: where more time has passed, this computer stood still."""
_MIN_WAIT_S = 0.1
"""Bytes that wait in the port are looked at, even if the deadline has passed."""
_DRAIN_S = 0.3
"""Devices that were told to stop still send what is in their buffers."""


class Decoder(Protocol):
    """Bytes in, sample blocks out."""

    @property
    def losses(self) -> Losses:
        """Counts until now."""

    def expect_restart(self) -> None:
        """The connection broke: what comes next may be a new start of the device."""

    def feed(self, data: bytes, arrival_ns: int) -> Iterator[SampleBlock]:
        """Blocks that `data` completes."""


class StreamSource(SampleSource):
    """A `SampleSource` around a decoder that needs to know the rate.

    `identity` holds until the device reports its own; `rate_hz` is None where it is not known beforehand.
    """

    timeout_s = 3.0
    """How long `start` waits for the first good data."""
    answer_timeout_s = 0.4
    """How long an answer to one request is waited for."""

    def __init__(self, identity: DeviceIdentity, baud: int, rate_hz: float | None) -> None:
        self._identity = identity
        self._baud = baud
        self._rate_hz = rate_hz
        self._decoder: Decoder | None = None
        self._pending = b""
        self._reader = BatchedReader()

    @property
    def identity(self) -> DeviceIdentity:
        """See `SampleSource`."""
        return self._identity

    @property
    def rate_hz(self) -> float:
        """See `SampleSource`."""
        if self._rate_hz is None:
            raise ProtocolError(
                "{protocol}: the rate is not known before the first samples", protocol=self._identity.protocol
            )
        return self._rate_hz

    @property
    def losses(self) -> Losses:
        """See `SampleSource`."""
        return self._decoder.losses if self._decoder else Losses()

    def read(self, link: Link) -> bytes:
        """See `SampleSource`."""
        return self._reader.read(link, self.batch_delay_s)

    @abstractmethod
    def make_decoder(self, data: bytes) -> Decoder | None:
        """Decoder, once `data` (all that came so far) tell what it needs to know."""

    def decode(self, data: bytes, arrival_ns: int) -> Iterator[SampleBlock]:
        """Samples completed by `data`, see `SampleSource`.

        Raises NoDataError if a megabyte did not tell what a decoder needs to know.
        """
        if not data and self._decoder is not None:
            self._decoder.expect_restart()
        data, self._pending = self._pending + data, b""
        if self._decoder is None:
            self._decoder = self.make_decoder(data)
        if self._decoder is not None:
            yield from self._decoder.feed(data, arrival_ns)
        elif len(data) > _MAX_PENDING_BYTES:
            raise self.no_data_error(data)
        else:
            self._pending = data

    def await_data(
        self, link: Link, timeout_s: float, is_good: Callable[[bytes], bool]
    ) -> tuple[bytes, bool]:
        """Read until all that came is good, or for `timeout_s`; returns what came and whether it is good.

        Time in which this computer stands still does not count.
        """
        received, now_s = b"", time.monotonic()
        deadline_s = now_s + max(timeout_s, _MIN_WAIT_S)
        while now_s < deadline_s:
            data = link.read()
            received += data
            if data and is_good(received):
                return received, True
            before_s, now_s = now_s, time.monotonic()
            if now_s - before_s > _STALL_S:
                deadline_s += now_s - before_s
        return received, False

    def request(
        self, link: Link, command: bytes, find: Callable[[bytes], _Answer | None], tries: int = 1
    ) -> _Answer | None:
        """Send a command until its answer is found in what comes; None without one."""
        for _ in range(tries):
            link.write(command)
            received, good = self.await_data(link, self.answer_timeout_s, lambda data: find(data) is not None)
            if good:
                return find(received)
        return None

    def silence(self, link: Link) -> bytes:
        """Send the stop command; returns what was still sent."""
        link.write(self.stop_command)
        received = b""
        end_s = time.monotonic() + _DRAIN_S
        while (data := link.read()) and time.monotonic() < end_s:
            received += data
        return received

    def no_data_error(self, received: bytes) -> NoDataError:
        """Error that says what came instead of good data."""
        what = describe_unreadable(received, self._identity.protocol, self._baud)
        _log.info("no good data: %s", what)
        return NoDataError("no good data in {timeout_s:g} s: {what}", timeout_s=self.timeout_s, what=what)


def parse_settings(kind: type[_Settings], given: dict[str, str], protocol: str) -> _Settings:
    """Device settings, given as text, as the driver's typed struct.

    Raises SettingsError if a key is unknown or a value cannot be read.
    """
    allowed = [field.name for field in msgspec.structs.fields(kind)]
    unknown = next((key for key in given if key not in allowed), None)
    if unknown is not None and allowed:
        raise SettingsError(
            "setting {key!r} is not known to {protocol}: allowed are {allowed}",
            key=unknown,
            protocol=protocol,
            allowed=allowed,
        )
    if unknown is not None:
        raise SettingsError(
            "setting {key!r} is not known to {protocol}: it has none", key=unknown, protocol=protocol
        )
    try:
        return msgspec.convert(given, kind, strict=False)
    except msgspec.ValidationError as error:
        cause = error.__cause__
        fault = cause.message if isinstance(cause, MessageError) else str(error)
        raise SettingsError("settings of {protocol}: {fault}", protocol=protocol, fault=fault) from error


def check_gauge_channels(table: int, relative: int, allowed: range) -> None:
    """Check the channels that two gauges are wired to. Raises SettingsError."""
    for name, channel in (("table", table), ("relative", relative)):
        if channel not in allowed:
            raise SettingsError(
                "{name} {channel} is no channel: give {first} to {last}",
                name=name,
                channel=channel,
                first=allowed[0],
                last=allowed[-1],
            )
    if table == relative:
        raise SettingsError(
            "table and relative are both channel {channel}: give each gauge its own", channel=table
        )
