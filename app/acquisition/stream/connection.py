"""One connection to a device: an open port, read by a thread of its own until it ends."""

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol

from app.acquisition.messages import PortSettings
from app.acquisition.stream.reads import ReadQueue
from drivers.errors import DriverError, SettingsError
from drivers.host_time import host_ns
from drivers.pair.link import PairLink, open_pair
from drivers.pair.source import PairSource, make_pair
from drivers.port import OpenPort, PortConfig, PortInfo
from drivers.port_reader import PortReader, ReaderEnd, read_for
from drivers.registry import find_driver
from drivers.source import CancellableLink, SampleSource
from messages.message import message


class PortOpener(Protocol):
    """How to come to an open port, and to that of the same device again."""

    def open(self) -> OpenPort:
        """Open it. Raises DriverError."""

    def reopen(self) -> OpenPort:
        """Open that of the device that was opened before. Raises DriverError while it is not there."""


def create_source(
    settings: PortSettings, rate_hz: float | None, facts: Mapping[str, str] | None = None
) -> SampleSource:
    """Source of the device, or of both. Raises SettingsError if it cannot be.

    Parameters
    ----------
    rate_hz : float or None
        Rows a second, asked for or of an earlier recording.
    facts : mapping, optional
        What an earlier recording noted of its device's settings; it tells the rates of two devices.
    """
    protocol = find_driver(settings.protocol)
    if settings.relative_url:
        return make_pair(protocol, settings.device, settings.rate_hz, facts)
    source = protocol.make_source(settings.device, rate_hz)
    if source.channels == 1:
        raise SettingsError(
            message(
                "{protocol} is set to one gauge, and two are recorded: give the port of the other device"
                " too, with --relative-port",
                protocol=settings.protocol,
            )
        )
    return source


def create_opener(settings: PortSettings, source: SampleSource) -> PortOpener:
    """How its port, or both, are opened. Raises SettingsError where both gauges are said to be at one."""
    baud = settings.baud or find_driver(settings.protocol).default_baud_for(settings.device)
    choice = PortConfig(settings.url, baud, settings.parity)
    if not isinstance(source, PairSource):
        return _Single(choice)
    if settings.relative_url == settings.url:
        raise SettingsError(
            message("both gauges are said to be at {url}: give the port of each device", url=settings.url)
        )
    return _Pair((choice, PortConfig(settings.relative_url, baud, settings.parity)), source)


@dataclass(slots=True)
class _Single:
    choice: PortConfig
    opened: PortInfo | None = None

    def open(self) -> OpenPort:
        port = self.choice.open()
        self.opened = port.info
        return port

    def reopen(self) -> OpenPort:
        return self.open() if self.opened is None else self.choice.reopen(self.opened)


@dataclass(slots=True)
class _Pair:
    choices: tuple[PortConfig, PortConfig]
    source: PairSource
    opened: tuple[PortInfo, PortInfo] | None = None

    def open(self) -> OpenPort:
        return self._opened(None)

    def reopen(self) -> OpenPort:
        return self._opened(self.opened)

    def _opened(self, lost: tuple[PortInfo, PortInfo] | None) -> PairLink:
        first, second = self.source.channel_sources
        link = open_pair(self.choices, (first.source, second.source), lost)
        self.opened = self.opened or link.infos
        return link


class Connection:
    """A device that is being read.

    Parameters
    ----------
    port : OpenPort
        Open; closed here.
    source : SampleSource
        Of the device, started.
    first : bytes
        What of the stream was read already.
    intake : Intake
        Gets that, and all that is read.
    """

    def __init__(self, port: OpenPort, source: SampleSource, first: bytes, read_queue: ReadQueue) -> None:
        self.port = port
        self.start_ns = host_ns()
        self.last_poll_ns = self.start_ns
        """Host's time when the port was looked at the last time, whether anything came or not."""
        self._source = source
        self._intake = read_queue
        self._ended: ReaderEnd | None = None
        if first:
            read_queue.put(self.start_ns, first)
        self._reader = PortReader(self._read, read_queue.put, self._end)
        self._reader.start()

    @property
    def ended(self) -> ReaderEnd | None:
        """Why no more will come, once all that came has been taken."""
        return self._ended if self._intake.is_empty else None

    def close(self, *, stop_device: bool = False) -> None:
        """Give the port up, with or without a word to the device."""
        self._reader.stop()
        if stop_device:
            self._source.stop(self.port)
        self.port.close()

    def _read(self) -> bytes:
        data = read_for(lambda: self._source.read(self.port), self._source.batch_delay_s)
        self.last_poll_ns = host_ns()
        return data

    def _end(self, ended: ReaderEnd) -> None:
        self._ended = ended


_OFTEN_S = 0.2
_SELDOM_S = 1.0
_OFTEN_UNTIL_S = 30.0
_UNWATCHED_S = 1.0
"""Who has not looked for so long got no processor, and nor did the search."""


class Reconnection:
    """A search that has begun.

    Parameters
    ----------
    reopen : callable
        Opens the port of the device, wherever it is now. Raises DriverError while it is not there.
    source : SampleSource
        Of the device; nobody else uses it meanwhile.
    intake : Intake
        Gets a read of no bytes, which says that the link was broken, and then what the new connection brings.
    """

    def __init__(self, reopen: Callable[[], OpenPort], source: SampleSource, intake: ReadQueue) -> None:
        self._began_ns = self._watched_ns = host_ns()
        self._watched_s = 0.0
        self._reopen = reopen
        self._source = source
        self._intake = intake
        self._failure: Exception | None = None
        self._connection: Connection | None = None
        self._is_done = threading.Event()
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._search, name="reconnection", daemon=True)
        self._thread.start()

    @property
    def failure(self) -> Exception | None:
        """Why the latest attempt failed; None while the first one is under way."""
        return self._failure

    def elapsed_s(self) -> float:
        """How long it has gone on (s), but for what this computer slept or stood still. Ask often."""
        before_ns, self._watched_ns = self._watched_ns, host_ns()
        passed_s = (self._watched_ns - before_ns) * 1e-9
        self._watched_s += passed_s if passed_s < _UNWATCHED_S else 0.0
        return self._watched_s

    def take(self, timeout_s: float) -> Connection | None:
        """The new connection once there is one, which belongs to the caller then."""
        if not self._is_done.wait(timeout_s):
            return None
        connection, self._connection = self._connection, None
        return connection

    def stop(self) -> None:
        """Give the search up, and a connection that nobody took."""
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
                self._failure = error
            except Exception as error:  # a search that dies unseen would be a device lost for ever
                self._failure = DriverError(
                    message(
                        "looking for the device failed ({kind}: {error})",
                        kind=type(error).__name__,
                        error=error,
                    )
                )
            else:
                self._is_done.set()
                return
            self._stopping.wait(_OFTEN_S if host_ns() - self._began_ns < _OFTEN_UNTIL_S * 1e9 else _SELDOM_S)

    def _attempt(self) -> Connection:
        port = self._reopen()
        try:
            first = self._source.resume(CancellableLink(port, self._stopping))
            self._intake.put(host_ns(), b"")
            return Connection(port, self._source, first, self._intake)
        except BaseException:
            port.close()
            raise
