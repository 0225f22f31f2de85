"""One connection to a device: an open port, the thread that reads it, and the queue of its reads."""

import logging
import threading
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import TypeAlias

from app.acquisition.messages import PortSettings
from drivers.errors import DriverError, QueueFullError, SettingsError
from drivers.host_time import host_ns
from drivers.pair.link import open_pair
from drivers.pair.source import PairSource, make_pair
from drivers.port import OpenPort, Port, PortConfig, PortInfo
from drivers.registry import find_driver
from drivers.source import CancellableLink
from drivers.stream import PortReader, ReaderEnd, SampleSource, read_for

_log = logging.getLogger(__name__)

_WAITING_READS = 4096
"""Reads that may wait to be decoded: 16 s at 250 reads a second, longer than a busy host stands still."""


@dataclass(frozen=True, slots=True)
class RawRead:
    """Bytes of one read, and the host's time after it (ns); no bytes where the link was broken."""

    arrival_ns: int
    data: bytes


Tap: TypeAlias = Callable[[RawRead], None]
"""Takes each read in the thread that reads the port: must neither wait nor raise."""


class ReadQueue:
    """Holds reads until they are decoded, over all connections of a stream. A tap gets each at once."""

    def __init__(self) -> None:
        self._waiting: deque[RawRead] = deque()
        self._changed = threading.Condition(threading.Lock())
        self._tap: Tap | None = None

    @property
    def is_empty(self) -> bool:
        return not self._waiting

    def put(self, arrival_ns: int, data: bytes) -> None:
        """Add a read. Raises QueueFullError when thousands wait; the tap has this one too."""
        read = RawRead(arrival_ns, data)
        with self._changed:
            is_full = len(self._waiting) >= _WAITING_READS
            if not is_full:
                self._waiting.append(read)
                self._changed.notify()
            if self._tap is not None:  # last, as it wakes up a thread that would wait for this one
                self._tap(read)
        if is_full:
            raise QueueFullError(
                "this computer is too slow: {reads} reads wait to be decoded. Close other programs",
                reads=_WAITING_READS,
            )

    def take(self, timeout_s: float) -> RawRead | None:
        with self._changed:
            if not self._waiting:
                self._changed.wait(timeout_s)
            return self._waiting.popleft() if self._waiting else None

    def open_tap(self, tap: Tap, earlier: Iterable[RawRead] = ()) -> None:
        """Give all reads to `tap` from now on, preceded by `earlier` ones and those that wait."""
        with self._changed:
            for read in (*earlier, *self._waiting):
                tap(read)
            self._tap = tap

    def close_tap(self) -> None:
        """Give nothing to the tap any more; no call of it is under way when this returns."""
        with self._changed:
            self._tap = None


def create_source(
    settings: PortSettings, rate_hz: float | None, facts: Mapping[str, str] | None = None
) -> SampleSource:
    """Create the source of one device or two; `facts` are settings noted earlier. Raises SettingsError."""
    protocol = find_driver(settings.protocol)
    if settings.relative_url:
        return make_pair(protocol, settings.device, settings.rate_hz, facts)
    source = protocol.make_source(settings.device, rate_hz)
    if source.channels == 1:
        raise SettingsError(
            "{protocol} is set to one gauge, and two are recorded: give the port of the other device"
            " too, with --relative-port",
            protocol=settings.protocol,
        )
    return source


class PortOpener:
    """Opens the port of a device, or of two; later, of the same ones. Raises SettingsError."""

    def __init__(self, settings: PortSettings, source: SampleSource) -> None:
        baud = settings.baud or find_driver(settings.protocol).default_baud_for(settings.device)
        self._source = source
        line = baud, settings.parity or "N", settings.stop_bits or 1
        self._config = PortConfig(settings.url, *line)
        self._second = PortConfig(settings.relative_url, *line)
        self._opened: tuple[PortInfo, PortInfo] | None = None
        if isinstance(source, PairSource) and settings.relative_url == settings.url:
            raise SettingsError(
                "both gauges are said to be at {url}: give the port of each device", url=settings.url
            )

    def open(self) -> OpenPort:
        """Open it. Raises DriverError while it, or the device that was there before, is not there."""
        if isinstance(self._source, PairSource):
            first, second = self._source.channel_sources
            link = open_pair((self._config, self._second), (first.source, second.source), self._opened)
            self._opened = self._opened or link.infos
            return link
        if self._opened is not None:
            return self._config.reopen(self._opened[0])
        port = self._config.open()
        self._opened = (port.info, port.info)
        return port


class Connection:
    """A device that is being read, of a port opened at `opened_ns`.

    `first` is the part of its stream that was read before.
    """

    def __init__(
        self, port: OpenPort, source: SampleSource, first: bytes, read_queue: ReadQueue, opened_ns: int
    ) -> None:
        self.port = port
        self.opened_ns = opened_ns
        self.start_ns = host_ns()
        self.last_poll_ns = self.start_ns
        """Host's time when the port was looked at the last time, whether anything came or not."""
        self._source = source
        if isinstance(port, Port):
            source.collect_limit = port.collect_limit
        self._queue = read_queue
        self._ended: ReaderEnd | None = None
        if first:
            read_queue.put(self.start_ns, first)
        _log.info("%s opened", port.info.identity)
        self._reader = PortReader(self._read, read_queue.put, self._on_end)
        self._reader.start()

    @property
    def ended(self) -> ReaderEnd | None:
        return self._ended if self._queue.is_empty else None

    def close(self, *, stop_device: bool = False) -> None:
        self._reader.stop()
        if stop_device:
            self._source.stop(self.port)
        self.port.close()
        _log.info("%s closed", self.port.info.identity)

    def _read(self) -> bytes:
        data = read_for(lambda: self._source.read(self.port), self._source.batch_delay_s)
        self.last_poll_ns = host_ns()
        return data

    def _on_end(self, ended: ReaderEnd) -> None:
        self._ended = ended


_OFTEN_S = 0.2  # between two attempts at first: a cable that was loose is back soon
_SELDOM_S = 1.0
_OFTEN_UNTIL_S = 30.0
_UNWATCHED_S = 1.0  # a caller that has not looked for so long got no processor time, and nor did the search


class Reconnection:
    """Searches for a lost device in a thread; in the queue, a read of no bytes marks the broken link."""

    def __init__(
        self, open_port: Callable[[], OpenPort], source: SampleSource, read_queue: ReadQueue
    ) -> None:
        self.failure: Exception | None = None
        """Why the latest attempt failed; None while the first one is under way."""
        self._began_ns = self._watched_ns = host_ns()
        self._watched_s = 0.0
        self._open_port = open_port
        self._source = source
        self._queue = read_queue
        self._connection: Connection | None = None
        self._is_done = threading.Event()
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._search, name="reconnection", daemon=True)
        self._thread.start()

    def elapsed_s(self) -> float:
        """Duration (s), without the time that this computer slept or stood still. Ask often."""
        before_ns, self._watched_ns = self._watched_ns, host_ns()
        passed_s = (self._watched_ns - before_ns) * 1e-9
        self._watched_s += passed_s if passed_s < _UNWATCHED_S else 0.0
        return self._watched_s

    def take(self, timeout_s: float) -> Connection | None:
        """Return the new connection once there is one; it belongs to the caller then."""
        if not self._is_done.wait(timeout_s):
            return None
        connection, self._connection = self._connection, None
        return connection

    def stop(self) -> None:
        self._stopping.set()
        self._thread.join()
        if self._connection is not None:
            self._connection.close(stop_device=True)
            self._connection = None

    def _search(self) -> None:
        while not self._stopping.is_set():
            try:
                self._connection = self._attempt()
            except DriverError as error:
                self.failure = error
            except Exception as error:  # a search that dies unseen would lose the device for ever
                _log.exception("looking for the device failed")
                self.failure = DriverError(
                    "looking for the device failed ({kind}: {error})", kind=type(error).__name__, error=error
                )
            else:
                self._is_done.set()
                return
            self._stopping.wait(_OFTEN_S if host_ns() - self._began_ns < _OFTEN_UNTIL_S * 1e9 else _SELDOM_S)

    def _attempt(self) -> Connection:
        opened_ns = host_ns()
        port = self._open_port()
        try:
            first = self._source.resume(CancellableLink(port, self._stopping))
            self._queue.put(host_ns(), b"")
            return Connection(port, self._source, first, self._queue, opened_ns)
        except BaseException:
            port.close()
            raise
