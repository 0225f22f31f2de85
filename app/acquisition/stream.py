"""The device's bytes, read by a thread of their own, decoded and calibrated here."""

import contextlib
import queue
from dataclasses import replace
from types import TracebackType
from typing import Self

from app.acquisition.calibration import Rows, calibrated
from app.acquisition.errors import StreamEndedError
from app.acquisition.history import Chunk, difference
from app.acquisition.messages import EndReason, PortSettings
from config.schema import Gauges
from drivers.clock import ClockEstimate, ClockFit
from drivers.errors import DriverError
from drivers.host_time import host_ns
from drivers.port import Port, PortReader, QueueFullError, ReaderEnd, ReaderEnded, open_port
from drivers.registry import find_protocol
from drivers.samples import DeviceIdentity, Losses
from drivers.source import SampleSource

STALLED_S = 3.0
"""A device that says nothing for so long has stalled."""

_SETTLING_S = 0.5
"""What comes first was held while the device was started: it says nothing of the clock."""
_QUEUE_READS = 4096
_JOINED_BYTES = 1 << 16
_END_REASONS = {
    ReaderEnd.DEVICE_LOST: EndReason.DEVICE_LOST,
    ReaderEnd.FAILED: EndReason.DEVICE_LOST,
    ReaderEnd.QUEUE_FULL: EndReason.WRITE_ERROR,
    ReaderEnd.STOPPED: EndReason.STOPPED,
}


class LiveStream:
    """A device that sends; make it with `open_stream`, use it with `with` or `close`."""

    def __init__(self, port: Port, source: SampleSource, gauges: Gauges, first: bytes = b"") -> None:
        self._port = port
        self._source = source
        self._gauges = gauges
        self._reads: queue.Queue[tuple[int, bytes]] = queue.Queue(_QUEUE_READS)
        self._ended: ReaderEnded | None = None
        self._losses = Losses()
        self._clock = ClockFit(source.rate_hz)
        self._started_ns = self._heard_ns = host_ns()
        if first:
            self._reads.put((self._started_ns, first))
        self._reader = PortReader(port, self._take, self._end)
        self._reader.start()

    @property
    def identity(self) -> DeviceIdentity:
        """What the device said of itself."""
        return self._source.identity

    @property
    def port_identity(self) -> str:
        """The port's address and, for USB, vendor, product and serial number."""
        info = self._port.info
        if info.vendor_id is None or info.product_id is None:
            return self._port.url
        return (
            f"{self._port.url} USB {info.vendor_id:04x}:{info.product_id:04x} {info.serial_number}".rstrip()
        )

    @property
    def rate_hz(self) -> float:
        """Nominal samples a second."""
        return self._source.rate_hz

    @property
    def losses(self) -> Losses:
        """The account of the whole stream until now."""
        return self._losses

    def clock(self) -> ClockEstimate | None:
        """How the device's clock goes by the host's; None while that cannot be told."""
        return self._clock.estimate()

    def next_chunk(self, timeout_s: float) -> Chunk | None:
        """What was read since the last call, with its samples; None when nothing came within `timeout_s`.

        Raises
        ------
        StreamEndedError
            When all that came has been handed on and no more will come, or what comes makes no sense.
        """
        try:
            arrival_ns, data = self._join(self._reads.get(timeout=timeout_s))
        except queue.Empty:
            self._check()
            return None
        self._heard_ns = arrival_ns
        rows = self._decoded(data, arrival_ns)
        if rows and arrival_ns - self._started_ns > _SETTLING_S * 1e9:
            self._clock.add(rows[-1].end_index - 1, arrival_ns)
        before, self._losses = self._losses, replace(self._source.losses)
        return Chunk(data, arrival_ns, rows, difference(self._losses, before))

    def close(self) -> None:
        """Stop the device and give the port up."""
        self._reader.stop()
        self._source.stop(self._port)
        self._port.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _decoded(self, data: bytes, arrival_ns: int) -> tuple[Rows, ...]:
        try:
            blocks = list(self._source.decode(data, arrival_ns))
        except DriverError as error:
            raise StreamEndedError(EndReason.DEVICE_LOST, str(error)) from error
        return tuple(calibrated(block, self._gauges) for block in blocks)

    def _join(self, read: tuple[int, bytes]) -> tuple[int, bytes]:
        """A read and those that wait behind it, as one that came with the last of them."""
        arrival_ns, data = read
        with contextlib.suppress(queue.Empty):
            while len(data) < _JOINED_BYTES:
                arrival_ns, more = self._reads.get_nowait()
                data += more
        return arrival_ns, data

    def _take(self, arrival_ns: int, data: bytes) -> None:
        """Reader's thread: hand on, never wait."""
        try:
            self._reads.put_nowait((arrival_ns, data))
        except queue.Full:
            raise QueueFullError(
                f"this computer is too slow: {_QUEUE_READS} reads wait to be decoded. Close other programs"
            ) from None

    def _end(self, ended: ReaderEnded) -> None:
        self._ended = ended

    def _check(self) -> None:
        if self._ended is not None and self._reads.empty():
            raise StreamEndedError(_END_REASONS[self._ended.reason], self._ended.message)
        if host_ns() - self._heard_ns > STALLED_S * 1e9:
            raise StreamEndedError(
                EndReason.STALLED,
                f"port {self._port.url} is open but silent for {STALLED_S:g} s: check the device, "
                "reset it and record again",
            )


def open_stream(settings: PortSettings, gauges: Gauges) -> LiveStream:
    """Open the port, start the device and begin to read.

    Raises
    ------
    DriverError
        Unknown protocol or setting, no such port, busy port, or nothing intelligible within 3 s.
    """
    protocol = find_protocol(settings.protocol)
    source = protocol.make_source(settings.device, settings.rate_hz)
    source.prepare()
    baud = settings.baud or protocol.default_baud
    port = open_port(settings.url, baud, settings.parity)
    try:
        return LiveStream(port, source, gauges, source.start(port))
    except BaseException:
        port.close()
        raise
