"""One connection to a device: an open port, read by a thread of its own until it ends."""

from app.acquisition.stream.intake import ReadQueue
from drivers.gathering import read_for
from drivers.host_time import host_ns
from drivers.port import OpenPort, PortReader, ReaderEnded
from drivers.source import SampleSource


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

    def __init__(self, port: OpenPort, source: SampleSource, first: bytes, intake: ReadQueue) -> None:
        self.port = port
        self.start_ns = host_ns()
        self.last_poll_ns = self.start_ns
        """Host's time when the port was looked at the last time, whether anything came or not."""
        self._source = source
        self._intake = intake
        self._ended: ReaderEnded | None = None
        if first:
            intake.put(self.start_ns, first)
        self._reader = PortReader(self._read, intake.put, self._end)
        self._reader.start()

    @property
    def ended(self) -> ReaderEnded | None:
        """Why no more will come, once all that came has been taken."""
        return self._ended if self._intake.is_empty else None

    def close(self, *, stop_device: bool = False) -> None:
        """Give the port up, with or without a word to the device."""
        self._reader.stop()
        if stop_device:
            self._source.stop(self.port)
        self.port.close()

    def _read(self) -> bytes:
        data = read_for(lambda: self._source.read(self.port), self._source.pause_s)
        self.last_poll_ns = host_ns()
        return data

    def _end(self, ended: ReaderEnded) -> None:
        self._ended = ended
