"""The device's samples, decoded and calibrated, over as many connections as a loose cable makes of it."""

import logging
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Self, TypeAlias

import numpy as np

from app.acquisition.errors import StreamEndedError
from app.acquisition.messages import EndReason, PortSettings, Reconnected, Reconnecting
from app.acquisition.stream.connection import (
    Connection,
    PortOpener,
    RawRead,
    ReadQueue,
    Reconnection,
    create_source,
)
from app.acquisition.stream.monitors import RateMonitor, StallDetector
from app.runs.blocks import CalibratedBlock, calibrate
from config.schema import Gauges
from drivers.clock import ClockEstimate, TimeBase
from drivers.errors import DriverError, NoDataError
from drivers.host_time import HostMonitor, host_ns
from drivers.packets import MAX_BLOCK_ROWS
from drivers.port import OpenPort
from drivers.samples import ChannelFilter, DeviceIdentity, Losses
from drivers.stream import ReaderEndReason, SampleSource
from messages.i18n import N_
from messages.message import EMPTY, Message, as_message, message, message_of

_log = logging.getLogger(__name__)

PATIENCE_S = 10.0  # a run waits so long for a lost device; the search goes on
_BYTES_PER_SAMPLE = 25.0  # a line of text with its time and two readings; assumed before anything has come
_STARTED_ANEW = N_(
    "the device started anew while it sent: what is missing until then is estimated by this computer's clock"
    " and marked. Check its power and its cable"
)


@dataclass(frozen=True, eq=False, slots=True)
class DecodedRead:
    """One read of the port, or several consecutive ones, with the samples that they completed."""

    data: bytes
    arrival_ns: int  # host's monotonic time after the read
    rows: tuple[CalibratedBlock, ...]  # in order, without holes
    losses: Losses


def concatenate(parts: tuple[CalibratedBlock, ...]) -> tuple[CalibratedBlock, ...]:
    """Join consecutive rows; they stay as they are where there is nothing to join, or a long gap between."""
    if len(parts) < 2 or parts[-1].end_index - parts[0].first_index > MAX_BLOCK_ROWS:
        return parts
    columns = (
        np.concatenate([getattr(rows, name) for rows in parts])
        for name in ("counts", "readings", "relative_m", "status")
    )
    return (CalibratedBlock(parts[0].first_index, *columns),)


def merge_reads(reads: Sequence[DecodedRead]) -> DecodedRead:
    """Join one or more consecutive reads; their bytes, which a run has from its journal, are left out."""
    rows = tuple(rows for read in reads for rows in read.rows)
    losses = sum((read.losses for read in reads), Losses())
    return DecodedRead(b"", reads[-1].arrival_ns, concatenate(rows), losses)


class ReadHistory:
    """Reads of the last `span` samples: those before its release belong to a run."""

    def __init__(self, span: int) -> None:
        self.span = span
        self._reads: deque[DecodedRead] = deque()
        self.next_index = 0

    def add(self, read: DecodedRead) -> None:
        self._reads.append(read)
        if read.rows:
            self.next_index = read.rows[-1].end_index
        while len(self._reads) > 1 and _end_index(self._reads[0]) < self.next_index - self.span:
            self._reads.popleft()

    @property
    def bytes_per_sample(self) -> float:
        samples = self.next_index - self.first_index
        return sum(len(read.data) for read in self._reads) / samples if samples else _BYTES_PER_SAMPLE

    @property
    def first_index(self) -> int:
        return next((read.rows[0].first_index for read in self._reads if read.rows), self.next_index)

    def reads(self, first_index: int = -1) -> Iterator[DecodedRead]:
        """Reads that are kept, oldest first; only those with samples from `first_index` on, where given."""
        return (read for read in self._reads if _end_index(read) > first_index or first_index < 0)


def _end_index(read: DecodedRead) -> int:
    """Reads that completed no sample go with the next one that did."""
    return read.rows[-1].end_index if read.rows else -1


@dataclass(frozen=True, slots=True)
class StreamNotice:
    """A remark on the samples that come, or on this computer."""

    message: Message


StreamEvent: TypeAlias = Reconnecting | Reconnected | StreamNotice


@dataclass(frozen=True, slots=True)
class StreamFault:
    """Why the device is lost, or why a run that waits for it must end."""

    reason: EndReason
    message: Message


class LiveStream:
    """A device that sends, looked for whenever it is lost. Make it with `open_stream`; use it with `with`."""

    def __init__(
        self,
        connection: Connection,
        source: SampleSource,
        read_queue: ReadQueue,
        gauges: Gauges,
        reopen: Callable[[], OpenPort],
    ) -> None:
        self.read_queue = read_queue  # where reads wait to be decoded; a journal may take them before that
        self.losses = Losses()
        self.rate_hz = source.rate_hz
        self._connection: Connection | None = connection
        self._source = source
        self._gauges = gauges
        self._reopen = reopen
        self._port = connection.port.info
        self._search: Reconnection | None = None
        self._is_returning = False
        self._lost = StreamFault(EndReason.DEVICE_LOST, EMPTY)
        self._search_failure = EMPTY
        self._stall_detector = StallDetector(self._port.device, source, connection.start_ns)
        self._rate_monitor = RateMonitor(source.rate_hz, connection.opened_ns)
        self._host = HostMonitor()
        self._events: deque[StreamEvent] = deque()

    @property
    def identity(self) -> DeviceIdentity:
        return self._source.identity

    @property
    def filters(self) -> tuple[ChannelFilter | None, ChannelFilter | None]:
        """Filter of each gauge's channel, where the device is known to have one."""
        return self._source.filters

    @property
    def port_identity(self) -> str:
        return self._port.identity

    @property
    def note(self) -> str:
        return str(self._source.run_note)

    @property
    def is_disconnected(self) -> bool:
        return self._search is not None

    @property
    def fault(self) -> StreamFault | None:
        """Why a run should not wait any longer for a device that is away; None while it should."""
        if self._search is None:
            return None
        lost, missing_s = self._lost, self._stall_detector.silent_s()
        if lost.reason is EndReason.STALLED and isinstance(self._search.failure, NoDataError):
            end = message(
                "{cause}; beginning anew did not help, and the last {missing_s:.1f} s of the run are missing",
                cause=lost.message,
                missing_s=missing_s,
            )
        elif self._search.elapsed_s() >= PATIENCE_S:
            end = message(
                "{cause}; it was not back within {waited_s:g} s, and the last {missing_s:.1f} s of the"
                " run are missing",
                cause=lost.message,
                waited_s=PATIENCE_S,
                missing_s=missing_s,
            )
        else:
            return None
        return StreamFault(lost.reason, end)

    def recent_clock(self) -> ClockEstimate | None:
        """Rate of the device's clock by the host's, up to a second old; None while it is not known."""
        return self._rate_monitor.recent()

    def time_base(self, first_index: int, end_index: int, *, recent: bool = False) -> TimeBase:
        """Time base of the samples first_index <= index < end_index; `recent` as in `recent_clock`."""
        clock = self._rate_monitor.recent() if recent else self._rate_monitor.estimate()
        return TimeBase.from_estimates(clock, self._source.skew(first_index, end_index))

    def take_events(self) -> list[StreamEvent]:
        events = list(self._events)
        self._events.clear()
        return events

    def next_read(self, timeout_s: float) -> DecodedRead | None:
        """Decode the next read; one without data marks a broken connection. Raises StreamEndedError."""
        self._events.extend(StreamNotice(as_message(note)) for note in self._host.check())
        if self._connection is None:
            self._look_for_device(timeout_s)
        if self._connection is None:
            return None
        read = self.read_queue.take(timeout_s)
        decoded = None if read is None else self._decode(read)
        self._check(self._connection, is_all_taken=read is None)
        return decoded

    def set_read_pause(self, pause_s: float) -> None:
        self._source.batch_delay_s = pause_s

    def close(self) -> None:
        if self._search is not None:
            self._search.stop()
        if self._connection is not None:
            self._connection.close(stop_device=True)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _decode(self, read: RawRead) -> DecodedRead:
        try:
            blocks = list(self._source.decode(read.data, read.arrival_ns))
        except DriverError as error:
            _log.error("the stream cannot be decoded: %s", error)
            raise StreamEndedError(EndReason.DEVICE_LOST, message_of(error)) from error
        rows = tuple(calibrate(block, self._gauges) for block in blocks)
        self._events.extend(StreamNotice(as_message(note)) for note in self._source.take_warnings())
        before, self.losses = self.losses, self._source.losses
        added = self.losses - before
        if added.restarts:
            self._rate_monitor.restart()
            if not self._is_returning:
                self._events.append(StreamNotice(message(_STARTED_ANEW)))
        if rows:
            self._on_rows(rows[-1].end_index - 1, read.arrival_ns, added)
        self._stall_detector.add_read(read.arrival_ns, read.data, has_samples=bool(rows))
        return DecodedRead(read.data, read.arrival_ns, rows, added)

    def _on_rows(self, last_index: int, arrival_ns: int, added: Losses) -> None:
        if self._is_returning and self._connection is not None:
            self._is_returning = False
            absent = added.missing + added.missing_estimated + added.damaged
            gap_s = absent / self.rate_hz
            found = message(
                "the device was away and is back at {port}: {gap_s:.2f} s are missing and marked",
                port=self._connection.port.url,
                gap_s=gap_s,
            )
            _log.info("%s", found)
            self._events.append(Reconnected(gap_s, found))
        note = self._rate_monitor.add(last_index, arrival_ns)
        if note:
            self._events.append(StreamNotice(note))

    def _check(self, connection: Connection, *, is_all_taken: bool) -> None:
        ended = connection.ended
        if ended is not None and ended.reason is ReaderEndReason.QUEUE_FULL:
            if is_all_taken:
                raise StreamEndedError(EndReason.WRITE_ERROR, as_message(ended.message))
        elif ended is not None:
            self._lose(connection, StreamFault(EndReason.DEVICE_LOST, as_message(ended.message)))
        elif self._stall_detector.is_stalled(connection.last_poll_ns) and self.read_queue.is_empty:
            self._lose(connection, StreamFault(EndReason.STALLED, self._stall_detector.message()))

    def _lose(self, connection: Connection, lost: StreamFault) -> None:
        _log.warning("device lost (%s): %s", lost.reason, lost.message)
        connection.close()
        self._connection, self._lost, self._search_failure = None, lost, EMPTY
        self._events.append(Reconnecting(lost.message))
        self._search = Reconnection(self._reopen, self._source, self.read_queue)

    def _look_for_device(self, timeout_s: float) -> None:
        if self._search is None:
            return
        connection = self._search.take(timeout_s)
        if connection is not None:
            self._search, self._connection, self._is_returning = None, connection, True
            self._stall_detector.restart(connection.start_ns)
        elif (error := self._search.failure) is not None and message_of(error) != self._search_failure:
            self._search_failure = message_of(error)
            _log.warning("not found: %s", error)
            self._events.append(Reconnecting(self._search_failure))


def open_stream(settings: PortSettings, gauges: Gauges) -> LiveStream:
    """Open the port or both ports, start the device and begin to read. Raises DriverError."""
    source = create_source(settings, settings.rate_hz)
    opener = PortOpener(settings, source)
    source.prepare()
    opened_ns = host_ns()
    port, read_queue = opener.open(), ReadQueue()
    try:
        connection = Connection(port, source, source.start(port), read_queue, opened_ns)
    except BaseException:
        port.close()
        raise
    return LiveStream(connection, source, read_queue, gauges, opener.open)
