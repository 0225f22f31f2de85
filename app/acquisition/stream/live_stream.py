"""The device's bytes, decoded and calibrated, over as many connections as a loose cable makes of it."""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from types import TracebackType
from typing import Self, TypeAlias

from app.acquisition.errors import StreamEndedError
from app.acquisition.messages import EndReason, Event, PortSettings, Reconnected, Reconnecting
from app.acquisition.stream.calibration import CalibratedBlock, calibrate
from app.acquisition.stream.connection import Connection, Reconnection, create_opener, create_source
from app.acquisition.stream.monitors import RateMonitor, StallDetector
from app.acquisition.stream.reads import DecodedRead, RawRead, ReadQueue, losses_between
from config.schema import Gauges
from drivers.clock import ClockEstimate, TimeBase
from drivers.errors import DriverError, NoDataError
from drivers.host_time import HostMonitor
from drivers.port import OpenPort
from drivers.port_reader import ReaderEndReason
from drivers.samples import DeviceIdentity, Losses
from drivers.source import SampleSource
from messages.message import EMPTY, Message, as_message, message, message_of

PATIENCE_S = 10.0
"""A run waits so long for a lost device; the search goes on."""


@dataclass(frozen=True, slots=True)
class DeviceLost:
    """The device is gone, or says nothing intelligible: it is looked for from now on."""

    reason: EndReason
    message: Message
    tried: Message = EMPTY
    """Why the latest attempt to find it failed."""


@dataclass(frozen=True, slots=True)
class SearchFailed:
    """It is not found, for another reason than before."""

    message: Message


@dataclass(frozen=True, slots=True)
class DeviceFound:
    """It is back at `url`, and samples of `gap_s` are missing."""

    url: str
    gap_s: float

    @property
    def message(self) -> Message:
        """In a sentence."""
        return message(
            "the device was away and is back at {port}: {gap_s:.2f} s are missing and marked",
            port=self.url,
            gap_s=self.gap_s,
        )


@dataclass(frozen=True, slots=True)
class StreamNotice:
    """Samples come, but something is to be said of them, or of this computer."""

    message: Message


StreamEvent: TypeAlias = DeviceLost | SearchFailed | DeviceFound | StreamNotice


@dataclass(frozen=True, slots=True)
class StreamFault:
    """Why a run must end that waits for samples."""

    reason: EndReason
    message: Message


def engine_events(news: StreamEvent) -> tuple[Event, ...]:
    """What to tell the owner of the engine."""
    match news:
        case DeviceLost() | SearchFailed():
            return (Reconnecting(news.message),)
        case DeviceFound():
            return (Reconnected(news.gap_s, news.message),)
        case StreamNotice():
            return ()


class LiveStream:
    """A device that sends; make it with `open_stream`, use it with `with` or `close`.

    When the device is lost, or sends nothing intelligible for a while, it is looked for until it is back.
    `take_news` tells of it, and `fault` whether a run should still wait.

    Parameters
    ----------
    connection : Connection
        Brings its reads to `intake`.
    source : SampleSource
        Started.
    reopen : callable
        Opens the port of the same device again. Raises DriverError while it is not there.
    """

    def __init__(
        self,
        connection: Connection,
        source: SampleSource,
        read_queue: ReadQueue,
        gauges: Gauges,
        reopen: Callable[[], OpenPort],
    ) -> None:
        self.read_queue = read_queue
        """Where reads wait to be decoded; a journal may have them before that."""
        self._connection: Connection | None = connection
        self._source = source
        self._gauges = gauges
        self._reopen = reopen
        self._port = connection.port.info
        self._search: Reconnection | None = None
        self._is_returning = False
        self._lost = DeviceLost(EndReason.DEVICE_LOST, EMPTY)
        self._silence = StallDetector(self._port.device, source, connection.start_ns)
        self._losses = Losses()
        self._pace = RateMonitor(source.rate_hz)
        self._host = HostMonitor()
        self._news: deque[StreamEvent] = deque()

    @property
    def identity(self) -> DeviceIdentity:
        """What the device said of itself."""
        return self._source.identity

    @property
    def port_identity(self) -> str:
        """Address of each port and, for USB, vendor, product and serial number."""
        return self._port.identity

    @property
    def rate_hz(self) -> float:
        """Nominal samples a second."""
        return self._source.rate_hz

    @property
    def note(self) -> str:
        """What every run of the device must say of itself; "" for most."""
        return str(self._source.run_note)

    @property
    def losses(self) -> Losses:
        """The account of the whole stream until now."""
        return self._losses

    @property
    def is_disconnected(self) -> bool:
        """Tell whether the device is being looked for."""
        return self._search is not None

    @property
    def fault(self) -> StreamFault | None:
        """Why a run should not wait any longer for a device that is away; None while it should."""
        if self._search is None:
            return None
        failure, lost = self._search.failure, self._lost
        is_hopeless = lost.reason is EndReason.STALLED and isinstance(failure, NoDataError)
        if not is_hopeless and self._search.elapsed_s() < PATIENCE_S:
            return None
        if is_hopeless:
            end = message(
                "{cause}; beginning anew did not help, and the last {missing_s:.1f} s of the run are missing",
                cause=lost.message,
                missing_s=self._silence.silent_s(),
            )
        else:
            end = message(
                "{cause}; it was not back within {waited_s:g} s, and the last {missing_s:.1f} s of the"
                " run are missing",
                cause=lost.message,
                waited_s=PATIENCE_S,
                missing_s=self._silence.silent_s(),
            )
        return StreamFault(lost.reason, end)

    def clock(self) -> ClockEstimate | None:
        """How the device's clock goes by the host's; None while that cannot be told."""
        return self._pace.estimate()

    def recent_clock(self) -> ClockEstimate | None:
        """As `clock`, or as that was up to a second ago."""
        return self._pace.recent()

    def time_base(self, first_index: int, end_index: int, *, recent: bool = False) -> TimeBase:
        """Time base of the samples first_index <= index < end_index; `recent` as in `recent_clock`."""
        clock = self.recent_clock() if recent else self.clock()
        return TimeBase.from_estimates(clock, self._source.skew(first_index, end_index))

    def take_events(self) -> list[StreamEvent]:
        """What has happened to the stream since the last call."""
        news = list(self._news)
        self._news.clear()
        return news

    def next_read(self, timeout_s: float) -> DecodedRead | None:
        """What was read since the last call, with its samples; None when nothing came within `timeout_s`.

        A chunk without data says that the connection was broken before what comes next. Raises
        StreamEndedError when this computer is too slow to take what comes, or what comes makes no sense.
        """
        self._news.extend(StreamNotice(as_message(note)) for note in self._host.check())
        if self._connection is None:
            self._look_for_device(timeout_s)
        if self._connection is None:
            return None
        read = self.read_queue.take(timeout_s)
        chunk = None if read is None else self._chunk(read)
        self._check(self._connection, is_all_taken=read is None)
        return chunk

    def set_read_pause(self, pause_s: float) -> None:
        """Let bytes gather in the port for so long before each read (s): cheaper, and so much later."""
        self._source.batch_delay_s = pause_s

    def close(self) -> None:
        """Stop the device and give the port up."""
        if self._search is not None:
            self._search.stop()
        if self._connection is not None:
            self._connection.close(stop_device=True)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _chunk(self, read: RawRead) -> DecodedRead:
        arrival_ns, data = read.arrival_ns, read.data
        rows = self._decoded(data, arrival_ns)
        self._news.extend(StreamNotice(as_message(note)) for note in self._source.take_warnings())
        before, self._losses = self._losses, replace(self._source.losses)
        added = losses_between(self._losses, before)
        if added.restarts:
            self._pace.restart()
        if rows:
            self._tell_of_rows(rows[-1].end_index - 1, arrival_ns, added)
        self._silence.add_read(arrival_ns, data, is_sense=bool(rows))
        return DecodedRead(data, arrival_ns, rows, added)

    def _tell_of_rows(self, last_index: int, arrival_ns: int, added: Losses) -> None:
        if self._is_returning and self._connection is not None:
            self._is_returning = False
            absent = added.missing + added.missing_estimated + added.damaged
            self._news.append(DeviceFound(self._connection.port.url, absent / self.rate_hz))
        note = self._pace.add(last_index, arrival_ns)
        if note:
            self._news.append(StreamNotice(note))

    def _decoded(self, data: bytes, arrival_ns: int) -> tuple[CalibratedBlock, ...]:
        try:
            blocks = list(self._source.decode(data, arrival_ns))
        except DriverError as error:
            raise StreamEndedError(EndReason.DEVICE_LOST, message_of(error)) from error
        return tuple(calibrate(block, self._gauges) for block in blocks)

    def _check(self, connection: Connection, *, is_all_taken: bool) -> None:
        ended = connection.ended
        if ended is not None and ended.reason is ReaderEndReason.QUEUE_FULL:
            if is_all_taken:
                raise StreamEndedError(EndReason.WRITE_ERROR, as_message(ended.message))
        elif ended is not None:
            self._lose(connection, DeviceLost(EndReason.DEVICE_LOST, as_message(ended.message)))
        elif self._silence.is_stalled(connection.last_poll_ns) and self.read_queue.is_empty:
            self._lose(connection, DeviceLost(EndReason.STALLED, self._silence.message()))

    def _lose(self, connection: Connection, lost: DeviceLost) -> None:
        connection.close()
        self._connection, self._lost = None, lost
        self._news.append(lost)
        self._search = Reconnection(self._reopen, self._source, self.read_queue)

    def _look_for_device(self, timeout_s: float) -> None:
        search = self._search
        connection = search.take(timeout_s) if search is not None else None
        if search is None or connection is None:
            self._tell_of(search)
            return
        self._search, self._connection, self._is_returning = None, connection, True
        self._silence.restart(connection.start_ns)

    def _tell_of(self, search: Reconnection | None) -> None:
        failure = search.failure if search is not None else None
        if failure is not None and message_of(failure) != self._lost.tried:
            self._lost = replace(self._lost, tried=message_of(failure))
            self._news.append(SearchFailed(message_of(failure)))


def open_stream(settings: PortSettings, gauges: Gauges) -> LiveStream:
    """Open the port, start the device and begin to read; both, where there are two.

    Raises
    ------
    DriverError
        Unknown protocol or setting, no such port, busy port, or nothing intelligible within 3 s.
    """
    source = create_source(settings, settings.rate_hz)
    opening = create_opener(settings, source)
    source.prepare()
    port, intake = opening.open(), ReadQueue()
    try:
        connection = Connection(port, source, source.start(port), intake)
    except BaseException:
        port.close()
        raise
    return LiveStream(connection, source, intake, gauges, opening.reopen)
