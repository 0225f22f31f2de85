"""Sources of samples: the conversation with a device, its settings, and the thread that reads its port."""

import contextlib
import logging
import math
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import TypeVar

import msgspec

from drivers.clock import Skew
from drivers.errors import DeviceLostError, NoDataError, ProtocolError, QueueFullError, SettingsError
from drivers.host_time import ArrivalRate, host_ns
from drivers.recognition import describe_unreadable
from drivers.samples import ChannelFilter, DeviceIdentity, Losses, SampleBlock
from drivers.source import CollectLimit, Decoder, Link, Read
from messages.i18n import N_
from messages.message import EMPTY, Message, MessageError, message, message_of

_log = logging.getLogger(__name__)
_Settings = TypeVar("_Settings", bound=msgspec.Struct)
_Answer = TypeVar("_Answer")

RATE_TOLERANCE = 0.02
"""Two rates that differ by less are the same: resonators of cheap boards are off by up to 0.5 %, and a rate
from half a second of times of 1 ms is good to 0.4 %."""
_MAX_PENDING_BYTES = 1 << 20
_MAX_AWAITED_BYTES = 1 << 24  # what the fastest devices send in 3 s
RATE_GROWTH = 1 / 8
"""Growth of the data until a rate is looked for again: told up to 0.06 s late, for a fifth of the work."""
_STALL_S = 0.5
"""A read waits for 50 ms: where more time has passed, this computer stood still."""
_MIN_WAIT_S = 0.1  # bytes that wait in the port are looked at, even if the deadline has passed
_DRAIN_S = 0.3  # stopped devices still send what is in their buffers

_WINDOW_S = 0.5
_WINDOW_SAMPLES = 20
"""How long, and for how many samples, arrivals are counted at least."""
_MOST_ARRIVING, _LEAST_ARRIVING = 1.1, 0.9
"""Arrivals by the rate that are right at once: bytes come late by up to 50 ms on a common computer."""
_LEAST_OF_BUSY = 0.5
"""Share that a busy computer may go on losing; where fewer come, the device has another rate."""


class SampleSource(ABC):
    """One device: its conversation and its decoder.

    `start` and `stop` talk to the device. `decode` uses no port, clock or thread, so that recorded bytes are
    decoded by the code that decoded them live. The caller runs the loop: `data = source.start(link)`, then
    `source.decode(data, arrival_ns)` for that and for all that `source.read(link)` returns, then
    `source.stop(link)`. Where the connection broke, the caller passes `source.decode(b"", arrival_ns)`, in a
    replay too, and decodes next what `source.resume(link)` returns.

    `baud` is the usual one; the nominal rate is None until settings, `start` or device times show it.
    """

    batch_delay_s = 0.0
    """How long `read` may let bytes collect (s); set by the caller. Polled devices ignore it."""
    collect_limit = CollectLimit()
    """How many bytes may collect before `read` reads them; set by the caller."""
    stop_command = b""  # what asks the device to stop sending
    is_polled = False  # whether the device is polled on a grid of the host's clock, see `set_poll_rate`
    timeout_s = 3.0  # how long `start` waits for the first good data
    answer_timeout_s = 0.4

    def __init__(self, identity: DeviceIdentity, baud: int, rate_hz: float | None) -> None:
        self._identity = identity
        self._baud = baud
        self._rate_hz = rate_hz
        self._decoder: Decoder | None = None
        self._pending = b""
        self._reader = BatchedReader()

    @property
    def channels(self) -> int:
        """Gauges that the device reads, 1 or 2; the column of a missing one is 0."""
        return 2

    @property
    def identity(self) -> DeviceIdentity:
        """Known after `start`; before it, the protocol alone."""
        return self._identity

    @property
    def rate_hz(self) -> float:
        """Nominal samples a second. Raises ProtocolError before it is known."""
        if self._rate_hz is None:
            template = N_("{protocol}: the rate is not known before the first samples")
            raise ProtocolError(template, protocol=self._identity.protocol)
        return self._rate_hz

    @property
    def losses(self) -> Losses:
        return self._decoder.losses if self._decoder else Losses()

    @property
    def filters(self) -> tuple[ChannelFilter | None, ChannelFilter | None]:
        """Filter of each gauge's channel, where the device is known to have one; known after `start`."""
        return None, None

    @property
    def run_note(self) -> Message:
        """Remark to store with every run of this device, known after `start`; empty for most."""
        return EMPTY

    def take_warnings(self) -> list[Message]:
        return self._decoder.take_warnings() if self._decoder else []

    def skew(self, first_index: int, end_index: int) -> Skew | None:
        return self._decoder.skew(first_index, end_index) if self._decoder else None

    def set_poll_rate(self, rate_hz: float) -> None:
        """Lower the rate of polls of a polled device, after the start and before anything is decoded."""
        raise NotImplementedError

    @abstractmethod
    def prepare(self) -> None:
        """Compile what decoding needs, which takes seconds on the very first use; `start` does it too."""

    @abstractmethod
    def start(self, link: Link) -> bytes:
        """Set the device up and start the stream; returns what was read of it, to be decoded first.

        Raises NoDataError where nothing intelligible comes within about 3 s, ProtocolError where the device
        does not do what is asked.
        """

    def resume(self, link: Link) -> bytes:
        """As `start`, after a loss; a device that still sends is left alone: its sequence proves the loss."""
        return self.start(link)

    def read(self, link: Link) -> bytes:
        """Next bytes to decode, b"" if none came within a fraction of a second. Raises DeviceLostError.

        A polled device is asked once, when its poll is due. One thread may call this while another decodes.
        """
        return self._reader.read(link, self.batch_delay_s, self.collect_limit)

    def stop(self, link: Link) -> None:
        """Send the stop command, if the device has one; nothing happens where it is gone."""
        if self.stop_command:
            with contextlib.suppress(DeviceLostError):
                link.write(self.stop_command)

    @abstractmethod
    def make_decoder(self, data: bytes) -> Decoder | None:
        """Decoder, once `data` (all bytes until now) show what it needs."""

    def decode(self, data: bytes, arrival_ns: int) -> Iterator[SampleBlock]:
        """Samples completed by `data`; an unfinished rest of bounded size is kept. Exhaust the iterator.

        b"" marks where the connection broke. Missing rows are counted from the device's sequence or time
        where the host's clock agrees with it, else estimated from the host's clock. Raises NoDataError if a
        megabyte does not show what a decoder needs to know.
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

    def decode_reads(self, reads: Sequence[Read]) -> list[SampleBlock]:
        """Samples completed by consecutive reads: the rows and losses that `decode` of each read gives."""
        if self._decoder is not None and all(data for data, _ in reads):
            return self._decoder.feed_reads(reads)
        return [block for data, arrival_ns in reads for block in self.decode(data, arrival_ns)]

    def await_data(
        self, link: Link, timeout_s: float, is_good: Callable[[bytes], object], growth: float = 0.0
    ) -> tuple[bytes, bool]:
        """Read until all is good, or for `timeout_s` of running time; returns it and whether it is good.

        All is examined after each read that brings data. With `growth` it is examined when it has grown by
        that share, when a read brings nothing, and at the end.
        """
        received, examined, now_s = b"", 0, time.perf_counter()
        deadline_s = now_s + max(timeout_s, _MIN_WAIT_S)
        while now_s < deadline_s and len(received) < _MAX_AWAITED_BYTES:
            data = link.read()
            received += data
            if len(received) >= (1 + growth) * examined if data else len(received) > examined:
                examined = len(received)
                if is_good(received):
                    return received, True
            before_s, now_s = now_s, time.perf_counter()
            if now_s - before_s > _STALL_S:
                deadline_s += now_s - before_s
        return received, len(received) > examined and bool(is_good(received))

    def await_stream(
        self, link: Link, is_good: Callable[[bytes], object], timeout_s: float, growth: float = 0.0
    ) -> bytes:
        received, good = self.await_data(link, timeout_s, is_good, growth)
        if not good:
            raise self.no_data_error(received)
        return received

    def is_same_rate(self, measured_hz: float | None) -> bool:
        if self._rate_hz is None or measured_hz is None:
            return True
        return abs(measured_hz / self._rate_hz - 1) <= RATE_TOLERANCE

    def time_stream(self, link: Link, frame_bytes: float) -> tuple[bytes, float | None]:
        """Read until frames come at the nominal rate; returns what came, and the rate where it is another.

        Only a steady rate that is far off counts: a busy computer loses samples, now more, now less.
        """
        arrivals = ArrivalRate(max(_WINDOW_S, _WINDOW_SAMPLES / self.rate_hz))

        def is_right(received: bytes) -> bool:
            arrivals.add(len(received) / frame_bytes if frame_bytes else 0.0)
            return bool(arrivals.windows_hz) and self._may_be(arrivals.windows_hz[-1], _LEAST_ARRIVING)

        received, agreed = self.await_data(link, self.timeout_s, is_right)
        sent_hz = arrivals.steady_hz
        if agreed or sent_hz is None or self._may_be(sent_hz, _LEAST_OF_BUSY):
            return received, None
        return received, sent_hz

    def _may_be(self, arrival_hz: float, least: float) -> bool:
        return least <= arrival_hz / self.rate_hz <= _MOST_ARRIVING

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
        end_s = time.perf_counter() + _DRAIN_S
        while (data := link.read()) and time.perf_counter() < end_s:
            received += data
        return received

    def no_answer_error(self, received: bytes, *, sends: bool) -> NoDataError:
        """Error for a device that does not answer; `received` before it was asked is its stream or not."""
        if not sends:
            return self.no_data_error(received)
        return NoDataError(
            "the device sends and does not answer: check the line from this computer to the device"
        )

    def no_rate_error(self) -> ProtocolError:
        """Error for a device that was asked for its rate and tells none."""
        return ProtocolError("the device does not tell its rate: switch it off and on, and try again")

    def no_data_error(self, received: bytes) -> NoDataError:
        what = describe_unreadable(received, self._identity.protocol, self._baud)
        _log.info("no good data: %s", what)
        return NoDataError("no good data in {timeout_s:g} s: {what}", timeout_s=self.timeout_s, what=what)


def parse_settings(kind: type[_Settings], given: dict[str, str], protocol: str) -> _Settings:
    """Device settings, given as text, as the driver's typed struct. Raises SettingsError."""
    allowed = [field.name for field in msgspec.structs.fields(kind)]
    for unknown in sorted(given.keys() - set(allowed)):
        template = N_("setting {key!r} is not known to {protocol}: it has none")
        if allowed:
            template = N_("setting {key!r} is not known to {protocol}: allowed are {allowed}")
        raise SettingsError(template, key=unknown, protocol=protocol, allowed=allowed)
    try:
        return msgspec.convert(given, kind, strict=False)
    except msgspec.ValidationError as error:
        cause = error.__cause__
        fault = cause.message if isinstance(cause, MessageError) else str(error)
        raise SettingsError("settings of {protocol}: {fault}", protocol=protocol, fault=fault) from error


def check_rate(rate_hz: float | None) -> None:
    """Check a rate that was asked for. Raises SettingsError."""
    if rate_hz is not None and not 0 < rate_hz < math.inf:
        template = N_("rate {rate_hz:g} Hz cannot be: give samples a second, for example 80")
        raise SettingsError(template, rate_hz=rate_hz)


def check_gauge_channels(table: int, relative: int, allowed: range) -> None:
    """Check the channels that two gauges are wired to. Raises SettingsError."""
    for name, channel in (("table", table), ("relative", relative)):
        if channel not in allowed:
            template = N_("{name} {channel} is no channel: give {first} to {last}")
            raise SettingsError(template, name=name, channel=channel, first=allowed[0], last=allowed[-1])
    if table == relative:
        template = N_("table and relative are both channel {channel}: give each gauge its own")
        raise SettingsError(template, channel=table)


_LIMIT = CollectLimit()
_BUSY_DELAY_S = 0.002
_LATE_S = 0.005
"""A sleep that lasts so much longer than asked shows a busy computer. Quiet ones wake up within 1 ms."""
_BUSY_S = 5.0
"""How long a computer counts as busy after a late sleep; a balance of processor time against lost bytes."""
_FULL_READ_BYTES = 4000  # after a read of so many bytes, more may wait that had no room
_INITIAL_BYTES_PER_S = 1e6  # assumed before anything is measured; high, so that the first delays are short
_MAX_BATCH_BYTES = 1 << 20
_WAITED_S = 2e-4
"""A read that takes so long has waited for its bytes, so the time after it is that of their arrival."""
_PUNCTUAL_INTERVAL_S = 0.05
"""How often a read must wait for its bytes: the clock fit takes the earliest arrival of each 0.1 s."""


class BatchedReader:
    """Lets bytes collect in a port before it reads them.

    A read costs about the same whatever it brings, so fewer and larger reads cost less. Every 50 ms it waits
    for the next byte, because the clock fit needs arrival times without delay (docs/decisions/0013).
    """

    def __init__(self) -> None:
        self._bytes_per_s = _INITIAL_BYTES_PER_S
        self._ended_s = self._waited_s = time.perf_counter()
        self._busy_until_s = 0.0
        self._limit = _LIMIT

    def read(self, link: Link, batch_delay_s: float, limit: CollectLimit = _LIMIT) -> bytes:
        """What came, or comes within the next 50 ms; b"" if nothing. Raises DeviceLostError.

        Bytes collect for `batch_delay_s`, or less where they would be more than `limit`. What came before the
        port was gone is returned by the call before.
        """
        self._limit = limit
        parts: list[bytes] = []
        try:
            self._fetch(link, batch_delay_s, parts)
        except DeviceLostError:
            if not parts:
                raise
        began_s, self._ended_s = self._ended_s, time.perf_counter()
        data = b"".join(parts)
        self._bytes_per_s = max(len(data), 1) / max(self._ended_s - began_s, _WAITED_S)
        return data

    def _fetch(self, link: Link, batch_delay_s: float, parts: list[bytes]) -> None:
        due_s = time.perf_counter() + batch_delay_s
        size, is_full = 0, False
        while (left_s := due_s - time.perf_counter()) > 0.0 and size < _MAX_BATCH_BYTES:
            longest_s = self._longest_delay_s()
            if not is_full:
                self._sleep(min(left_s, longest_s))
            if is_full or longest_s < left_s:
                parts.append(link.read())
                size += len(parts[-1])
                is_full = len(parts[-1]) >= _FULL_READ_BYTES
        has_waited = self._read_once(link, parts)
        is_due = time.perf_counter() - self._waited_s > _PUNCTUAL_INTERVAL_S
        if not has_waited and batch_delay_s and is_due:
            self._read_once(link, parts)
            self._waited_s = time.perf_counter()

    def _longest_delay_s(self) -> float:
        if time.perf_counter() < self._busy_until_s:
            return max(self._limit.busy_bytes / self._bytes_per_s, _BUSY_DELAY_S)
        return self._limit.calm_bytes / self._bytes_per_s

    def _sleep(self, duration_s: float) -> None:
        due_s = time.perf_counter() + duration_s
        time.sleep(duration_s)
        now_s = time.perf_counter()
        if now_s - due_s > _LATE_S:
            self._busy_until_s = now_s + _BUSY_S

    def _read_once(self, link: Link, parts: list[bytes]) -> bool:
        """Read once; returns whether the read waited for its bytes."""
        began_s = time.perf_counter()
        parts.append(link.read())
        has_waited = time.perf_counter() - began_s > _WAITED_S
        if has_waited:
            self._waited_s = time.perf_counter()
        return has_waited


def read_for(read: Callable[[], bytes], duration_s: float) -> bytes:
    """What repeated reads bring in `duration_s`, until one brings nothing (a polled device answers each)."""
    due_s = time.perf_counter() + duration_s
    parts = [read()]
    try:
        while parts[-1] and time.perf_counter() < due_s:
            parts.append(read())
    except DeviceLostError:  # the next call raises it again
        pass
    return b"".join(parts)


class ReaderEndReason(StrEnum):
    """Why a `PortReader` ended."""

    STOPPED = "stopped"
    DEVICE_LOST = "device-lost"
    QUEUE_FULL = "queue-full"
    FAILED = "failed"


@dataclass(frozen=True, slots=True)
class ReaderEnd:
    """How a `PortReader` ended."""

    reason: ReaderEndReason
    message: Message = EMPTY


class PortReader:
    """Thread that reads a device, stamps what came, and hands it on; nothing else.

    `read` is `SampleSource.read` of an open port. `sink` takes the host's time after each read (ns,
    `host_time.host_ns`) and the bytes; it must not wait, and raises `QueueFullError` when it cannot take
    more. `on_end` is called once from the thread, as its last act.
    """

    def __init__(
        self,
        read: Callable[[], bytes],
        sink: Callable[[int, bytes], None],
        on_end: Callable[[ReaderEnd], None],
    ) -> None:
        self._read = read
        self._sink = sink
        self._on_end = on_end
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="port reader", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> None:
        """Wait for the read under way (50 ms, a fraction of a second for a polled device) and end."""
        self._stopping.set()
        if self._thread.is_alive() and self._thread is not threading.current_thread():
            self._thread.join()

    def _run(self) -> None:
        end = ReaderEnd(ReaderEndReason.STOPPED)
        try:
            while not self._stopping.is_set():
                data = self._read()
                arrival_ns = host_ns()
                if data:
                    self._sink(arrival_ns, data)
        except DeviceLostError as error:
            end = ReaderEnd(ReaderEndReason.DEVICE_LOST, error.message)
        except QueueFullError as error:
            end = ReaderEnd(ReaderEndReason.QUEUE_FULL, error.message)
        except Exception as error:  # the application must learn why no samples come
            _log.exception("reader failed")
            what = message("reading {kind}: {fault}", kind=type(error).__name__, fault=message_of(error))
            end = ReaderEnd(ReaderEndReason.FAILED, what)
        _log.info("reader ended: %s %s", end.reason, end.message)
        self._on_end(end)
