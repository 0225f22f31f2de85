"""Two open ports as one link: each is read by a thread of its own and reconnected by itself."""

import contextlib
import logging
import queue
import threading
from typing import TypeAlias

from drivers.envelope import wrap
from drivers.errors import DeviceLostError, DriverError, QueueFullError
from drivers.host_time import ActiveTimer, host_ns
from drivers.port import OpenPort, PortConfig, PortInfo
from drivers.source import CancellableLink
from drivers.stream import SampleSource
from messages.i18n import N_
from messages.message import message_of

_log = logging.getLogger(__name__)

RECONNECT_TIMEOUT_S = 10.0
"""How long one device is looked for while the other goes on; after it both count as lost."""
_SILENT_S = 3.0  # a device that sends nothing for so long is reconnected
_STALL_S = 2.0  # a read of a polled device takes up to a second: after more, this computer stood still
_SILENT_SAMPLES = 5.0
_RETRY_S = 0.2
_WAIT_S = 0.05
_Half: TypeAlias = tuple[OpenPort, PortConfig, SampleSource]
_QUEUED_READS = 4096
_MAX_READS = 256


class PairLink:
    """Reads of both ports in envelopes, in order of arrival; made by `open_pair`.

    A device that is gone or silent is reconnected while the other one is read; an empty envelope marks where
    its connection broke. The ports are those of gauge 1 and gauge 2; they are closed here. Each source is
    called from the thread of its port. `is_resumed`: the devices were started before.
    """

    def __init__(
        self,
        ports: tuple[OpenPort, OpenPort],
        configs: tuple[PortConfig, PortConfig],
        sources: tuple[SampleSource, SampleSource],
        *,
        is_resumed: bool = False,
    ) -> None:
        self._reads: queue.SimpleQueue[bytes] = queue.SimpleQueue()
        halves = enumerate(zip(ports, configs, sources, strict=True))
        self._readers = [_ChannelReader(gauge, half, self._reads, is_resumed) for gauge, half in halves]
        self._is_ending = False
        for reader in self._readers:
            reader.thread.start()

    @property
    def infos(self) -> tuple[PortInfo, PortInfo]:
        return self._readers[0].info, self._readers[1].info

    @property
    def info(self) -> PortInfo:
        return PortInfo(" + ".join(reader.info.identity for reader in self._readers))

    @property
    def url(self) -> str:
        return " + ".join(reader.info.device for reader in self._readers)

    def read(self) -> bytes:
        """Wait at most 50 ms for the first envelope and return all that wait. Raises DriverError."""
        failure = next(filter(None, (reader.failure for reader in self._readers)), None)
        if failure is not None and self._is_ending:
            raise failure
        self._is_ending = failure is not None  # reads before the failure are returned first
        parts = []
        with contextlib.suppress(queue.Empty):
            parts.append(self._reads.get(timeout=_WAIT_S))
            while len(parts) < _MAX_READS:
                parts.append(self._reads.get_nowait())
        return b"".join(parts)

    def write(self, data: bytes) -> None:
        """Not supported: each device has its own link. Raises DriverError."""
        template = N_("{count} bytes cannot be sent to two devices at once: use their own links")
        raise DriverError(template, count=len(data))

    def close(self) -> None:
        """Stop both devices and close both ports; may be called twice."""
        for reader in self._readers:
            reader.stopping.set()
        for reader in self._readers:
            reader.join()


def open_pair(
    configs: tuple[PortConfig, PortConfig],
    sources: tuple[SampleSource, SampleSource],
    lost: tuple[PortInfo, PortInfo] | None = None,
) -> PairLink:
    """Open both ports, as they were before the link was `lost`, and start both. Raises DriverError."""
    ports: list[OpenPort] = []
    try:
        for config in configs:
            ports.append(config.reopen(lost[len(ports)]) if lost else config.open())
    except BaseException as error:
        for port in ports:
            port.close()
        if isinstance(error, DriverError):
            raise _with_gauge(len(ports), error) from error
        raise
    return PairLink((ports[0], ports[1]), configs, sources, is_resumed=lost is not None)


class _ChannelReader:
    """Thread of one port: starts the device, reads it, stamps what came, reconnects it."""

    def __init__(self, gauge: int, half: _Half, reads: "queue.SimpleQueue[bytes]", is_resumed: bool) -> None:
        self._port: OpenPort | None
        self._port, self._config, self._source = half
        self.info = half[0].info
        self.failure: DriverError | None = None
        self._gauge = gauge
        self._reads = reads
        self._is_resumed = is_resumed
        self.stopping = threading.Event()
        self.thread = threading.Thread(target=self._run, name=f"port of gauge {gauge + 1}", daemon=True)

    def join(self) -> None:
        self.thread.join()
        if self._port is not None:
            self._source.stop(self._port)
            self._port.close()
            self._port = None

    def _run(self) -> None:
        try:
            if self._port is not None:
                self._start_device(self._port, is_resumed=self._is_resumed)
            while not self.stopping.is_set():
                self._read_until_lost()
                self._reconnect()
        except DriverError as error:
            self.failure = _with_gauge(self._gauge, error)
        except Exception as error:  # a dead thread would look like a silent device
            _log.exception("reader of gauge %d failed", self._gauge + 1)
            template, kind = N_("gauge {gauge}: reading {kind}: {fault}"), type(error).__name__
            self.failure = DriverError(template, gauge=self._gauge + 1, kind=kind, fault=message_of(error))

    def _start_device(self, port: OpenPort, *, is_resumed: bool) -> None:
        link = CancellableLink(port, self.stopping)
        first = self._source.resume(link) if is_resumed else self._source.start(link)
        if first:
            self._put(first)

    def _read_until_lost(self) -> None:
        silent = ActiveTimer(_STALL_S)
        limit_s = max(_SILENT_S, _SILENT_SAMPLES / self._source.rate_hz)
        with contextlib.suppress(DeviceLostError):
            while self._port is not None and not self.stopping.is_set():
                data = self._source.read(self._port)
                if data:
                    self._put(data)
                    silent.restart()
                elif silent.elapsed_s() > limit_s:
                    break

    def _reconnect(self) -> None:
        """Look for the device until it is back. Raises DeviceLostError after 10 s."""
        if self.stopping.is_set() or self._port is None:
            return
        _log.warning("device of gauge %d lost, looking for it", self._gauge + 1)
        self._put(b"")
        self._port.close()
        self._port = None
        lost_ns = host_ns()
        while not self.stopping.is_set():
            try:
                port = self._config.reopen(self.info)
                try:
                    self._start_device(port, is_resumed=True)
                except BaseException:
                    port.close()
                    raise
            except DriverError as error:
                if host_ns() - lost_ns > RECONNECT_TIMEOUT_S * 1e9:
                    template = N_("it was not back within {timeout_s:g} s ({fault})")
                    raise DeviceLostError(template, timeout_s=RECONNECT_TIMEOUT_S, fault=error) from error
            else:
                self._port = port
                return
            self.stopping.wait(_RETRY_S)

    def _put(self, data: bytes) -> None:
        if self._reads.qsize() >= _QUEUED_READS:
            template = N_("this computer is too slow: {count} reads wait to be decoded. Close other programs")
            raise QueueFullError(template, count=_QUEUED_READS)
        self._reads.put(wrap(self._gauge, host_ns(), data))


def _with_gauge(gauge: int, error: DriverError) -> DriverError:
    return type(error)("gauge {gauge}: {fault}", gauge=gauge + 1, fault=error)
