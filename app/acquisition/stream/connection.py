"""One connection to a device: an open port, read by a thread of its own until it ends."""

import queue

from drivers.host_time import host_ns
from drivers.port import Port, PortReader, QueueFullError, ReaderEnded
from drivers.source import SampleSource

_QUEUE_READS = 4096
_JOINED_BYTES = 1 << 16


class Connection:
    """A device that is being read.

    Parameters
    ----------
    port : Port
        Open; closed here.
    source : SampleSource
        Of the device, started.
    first : bytes
        What of the stream was read already.
    """

    def __init__(self, port: Port, source: SampleSource, first: bytes) -> None:
        self.port = port
        self._source = source
        self.began_ns = host_ns()
        self._first = first
        # Bounded by whoever puts: a queue that bounds itself takes five times as long for each read.
        self._reads: queue.SimpleQueue[tuple[int, bytes]] = queue.SimpleQueue()
        self._ended: ReaderEnded | None = None
        self._reader = PortReader(lambda: source.read(port), self._take, self._end)
        self._reader.start()

    @property
    def ended(self) -> ReaderEnded | None:
        """Why no more will come, once all that came has been taken."""
        return self._ended if self._reads.empty() and not self._first else None

    def next_read(self, timeout_s: float) -> tuple[int, bytes] | None:
        """What came since the last call, with the host's time of its end; None without any."""
        if self._first:
            first, self._first = self._first, b""
            return self.began_ns, first
        try:
            return self._join(self._reads.get(timeout=timeout_s))
        except queue.Empty:
            return None

    def close(self, *, stop_device: bool = False) -> None:
        """Give the port up, with or without a word to the device."""
        self._reader.stop()
        if stop_device:
            self._source.stop(self.port)
        self.port.close()

    def _join(self, read: tuple[int, bytes]) -> tuple[int, bytes]:
        """A read and those that wait behind it, as one that came with the last of them."""
        arrival_ns, data = read
        parts, size = [data], len(data)
        while size < _JOINED_BYTES and not self._reads.empty():
            arrival_ns, data = self._reads.get_nowait()
            parts.append(data)
            size += len(data)
        return arrival_ns, b"".join(parts)

    def _take(self, arrival_ns: int, data: bytes) -> None:
        """Reader's thread: hand on, never wait."""
        if self._reads.qsize() >= _QUEUE_READS:
            raise QueueFullError(
                f"this computer is too slow: {_QUEUE_READS} reads wait to be decoded. Close other programs"
            )
        self._reads.put((arrival_ns, data))

    def _end(self, ended: ReaderEnded) -> None:
        self._ended = ended
