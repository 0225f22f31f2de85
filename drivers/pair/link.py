"""Two open ports read as one link: each by a thread of its own, each found again by itself."""

import contextlib
import queue
import threading
from dataclasses import dataclass

from drivers.envelope import wrap
from drivers.errors import DeviceLostError, DriverError, PortUnavailableError
from drivers.host_time import ActiveTimer, host_ns
from drivers.port import OpenPort, PortInfo, QueueFullError, find_replugged, open_port
from drivers.source import CancellableLink, SampleSource

RECONNECT_TIMEOUT_S = 10.0
"""A device is looked for so long while the other one goes on; then both count as lost."""
_SILENT_S = 3.0
_STOOD_S = 2.0
"""One read of a device that is asked may take a second: whoever comes back later stood still."""
_SILENT_SAMPLES = 5.0
_AGAIN_S = 0.2
_WAIT_S = 0.05
_QUEUED_READS = 4096
_JOINED_READS = 256


@dataclass(frozen=True, slots=True)
class PairPortSettings:
    """How to open one of the ports."""

    url: str
    baud: int
    parity: str = "N"

    def open(self) -> OpenPort:
        """Open it. Raises DriverError."""
        return open_port(self.url, self.baud, self.parity)

    def reopen(self, lost: PortInfo) -> OpenPort:
        """Open the same device again, wherever it is now. Raises DriverError while it is not there."""
        url = find_replugged(lost)
        if url is None:
            raise PortUnavailableError(
                f"the device of {lost.device} is not there: plug it in again, into the same socket"
            )
        return open_port(url, self.baud, self.parity)


class PairLink:
    """Reads of both ports in envelopes, in the order in which they came; make it with `open_pair`.

    A device that is gone, or silent, is looked for while the other one is read on; an empty envelope stands
    where its link was broken.

    Parameters
    ----------
    ports : pair of OpenPort
        Open, of gauge 1 and gauge 2; closed here.
    choices : pair of PortChoice
    sources : pair of SampleSource
        Their `start`, `read`, `resume` and `stop` are called from the thread of their port.
    is_resumed : bool
        The devices were started before.
    """

    def __init__(
        self,
        ports: tuple[OpenPort, OpenPort],
        choices: tuple[PairPortSettings, PairPortSettings],
        sources: tuple[SampleSource, SampleSource],
        *,
        is_resumed: bool = False,
    ) -> None:
        self._reads: queue.SimpleQueue[bytes] = queue.SimpleQueue()
        self._readers = [
            _ChannelReader(gauge, *half, self._reads, is_resumed=is_resumed)
            for gauge, half in enumerate(zip(ports, choices, sources, strict=True))
        ]
        self._is_ending = False
        for reader in self._readers:
            reader.start()

    @property
    def infos(self) -> tuple[PortInfo, PortInfo]:
        """What is known of each port, to open both again."""
        return self._readers[0].info, self._readers[1].info

    @property
    def info(self) -> PortInfo:
        """Both ports by their addresses, with what is known of their USB devices."""
        return PortInfo(" + ".join(reader.info.identity for reader in self._readers))

    @property
    def url(self) -> str:
        """Both addresses."""
        return " + ".join(reader.info.device for reader in self._readers)

    def read(self) -> bytes:
        """Wait at most 50 ms for the first envelope and return all that are there.

        Raises
        ------
        DeviceLostError
            If one of the devices is gone and was not back in 10 s.
        QueueFullError
            If thousands of reads wait.
        DriverError
            If one of them could not be started.
        """
        failure = next(filter(None, (reader.failure for reader in self._readers)), None)
        if failure is not None and self._is_ending:
            raise failure
        self._is_ending = failure is not None  # what came before it is handed on first
        return b"".join(self._waiting())

    def write(self, data: bytes) -> None:
        """Refuse: each device is spoken to through its own port."""
        raise DriverError(f"{len(data)} bytes cannot be sent to two devices at once: use their own links")

    def close(self) -> None:
        """Stop both devices and give both ports up; may be called twice."""
        for reader in self._readers:
            reader.ask_to_stop()
        for reader in self._readers:
            reader.join()

    def _waiting(self) -> list[bytes]:
        try:
            parts = [self._reads.get(timeout=_WAIT_S)]
        except queue.Empty:
            return []
        while len(parts) < _JOINED_READS and not self._reads.empty():
            parts.append(self._reads.get_nowait())
        return parts


def open_pair(
    choices: tuple[PairPortSettings, PairPortSettings],
    sources: tuple[SampleSource, SampleSource],
    lost: tuple[PortInfo, PortInfo] | None = None,
) -> PairLink:
    """Open both ports and let both devices be started.

    Parameters
    ----------
    choices : pair of PortChoice
    sources : pair of SampleSource
    lost : pair of PortInfo, optional
        What the ports were before the link was lost.

    Raises
    ------
    DriverError
        If one of them cannot be opened.
    """
    ports: list[OpenPort] = []
    try:
        for gauge, choice in enumerate(choices):
            ports.append(_opened(gauge, choice, lost[gauge] if lost else None))
    except BaseException:
        for port in ports:
            port.close()
        raise
    return PairLink((ports[0], ports[1]), choices, sources, is_resumed=lost is not None)


class _ChannelReader:
    """One port with its thread: starts the device, reads it, stamps what came, finds it again."""

    def __init__(
        self,
        gauge: int,
        port: OpenPort,
        choice: PairPortSettings,
        source: SampleSource,
        reads: "queue.SimpleQueue[bytes]",
        *,
        is_resumed: bool,
    ) -> None:
        self.info = port.info
        self.failure: DriverError | None = None
        self._gauge = gauge
        self._port: OpenPort | None = port
        self._choice = choice
        self._source = source
        self._reads = reads
        self._is_resumed = is_resumed
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"port of gauge {gauge + 1}", daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def ask_to_stop(self) -> None:
        """Let the thread end after the read under way."""
        self._stopping.set()

    def join(self) -> None:
        """Wait for the end of the thread, stop the device, and give the port up."""
        self._thread.join()
        if self._port is not None:
            self._source.stop(self._port)
            self._port.close()
            self._port = None

    def _run(self) -> None:
        try:
            if self._port is not None:
                self._start_device(self._port, is_resumed=self._is_resumed)
            while not self._stopping.is_set():
                self._read_until_lost()
                self._reconnect()
        except DriverError as error:
            self.failure = _with_gauge(self._gauge, error)
        except Exception as error:  # a thread that dies unseen would be a device silent for ever
            self.failure = DriverError(f"gauge {self._gauge + 1}: reading {type(error).__name__}: {error}")

    def _start_device(self, port: OpenPort, *, is_resumed: bool) -> None:
        link = CancellableLink(port, self._stopping)
        first = self._source.resume(link) if is_resumed else self._source.start(link)
        if first:
            self._put(first)

    def _read_until_lost(self) -> None:
        port = self._port
        if port is None:
            return
        silent = ActiveTimer(_STOOD_S)
        limit_s = max(_SILENT_S, _SILENT_SAMPLES / self._source.rate_hz)
        with contextlib.suppress(DeviceLostError):
            while not self._stopping.is_set():
                data = self._source.read(port)
                if data:
                    self._put(data)
                    silent.restart()
                elif silent.elapsed_s() > limit_s:
                    break

    def _reconnect(self) -> None:
        """Look for the device until it is back. Raises DeviceLostError when it stays away."""
        if self._stopping.is_set() or self._port is None:
            return
        self._put(b"")
        self._port.close()
        self._port = None
        lost_ns = host_ns()
        while not self._stopping.is_set():
            try:
                self._reopen()
            except DriverError as error:
                if host_ns() - lost_ns > RECONNECT_TIMEOUT_S * 1e9:
                    raise DeviceLostError(
                        f"it was not back within {RECONNECT_TIMEOUT_S:g} s ({error})"
                    ) from error
            else:
                return
            self._stopping.wait(_AGAIN_S)

    def _reopen(self) -> None:
        port = self._choice.reopen(self.info)
        try:
            self._start_device(port, is_resumed=True)
        except BaseException:
            port.close()
            raise
        self._port = port

    def _put(self, data: bytes) -> None:
        if self._reads.qsize() >= _QUEUED_READS:
            raise QueueFullError(
                f"this computer is too slow: {_QUEUED_READS} reads wait to be decoded. Close other programs"
            )
        self._reads.put(wrap(self._gauge, host_ns(), data))


def _opened(gauge: int, choice: PairPortSettings, lost: PortInfo | None) -> OpenPort:
    try:
        return choice.open() if lost is None else choice.reopen(lost)
    except DriverError as error:
        raise _with_gauge(gauge, error) from error


def _with_gauge(gauge: int, error: DriverError) -> DriverError:
    """The same error, which says of which gauge's device it is."""
    return type(error)(f"gauge {gauge + 1}: {error}")
