"""The seam between a device and everything above it."""

import threading
from collections.abc import Iterator
from typing import Protocol

from drivers.errors import DeviceLostError
from drivers.samples import DeviceIdentity, Losses, SampleBlock


class Link(Protocol):
    """An open byte connection, as `drivers.port.Port` is one; tests use a fake."""

    def read(self) -> bytes:
        """Wait shortly (<= 50 ms) and return what came, b"" if nothing. Raises DeviceLostError."""

    def write(self, data: bytes) -> None:
        """Send all of `data`. Raises DeviceLostError."""


class SampleSource(Protocol):
    """One device: its conversation and its decoder.

    `start` and `stop` talk; `decode` is pure (no port, clock or thread), so that captured bytes
    replay through the very code that decoded them live. The port loop stands between:
    `data = source.start(port)`; then `source.decode(data, arrival_ns)` for that and all that
    `source.read(port)` gives; then `source.stop(port)`. Where the link broke,
    `source.decode(b"", arrival_ns)` says so, also to a replay, and what `source.resume(port)` returns is
    decoded next.
    """

    batch_delay_s: float
    """How long `read` may let bytes gather first (s), set by who reads; one that asks its device need not."""

    @property
    def channels(self) -> int:
        """Gauges that it reads, 1 or 2; the column of another is 0."""

    @property
    def identity(self) -> DeviceIdentity:
        """Known after `start` (a replayed source knows only its protocol)."""

    @property
    def rate_hz(self) -> float:
        """Nominal samples a second; known after `start`, or from settings, or from device times."""

    @property
    def losses(self) -> Losses:
        """The account until now."""

    @property
    def run_note(self) -> str:
        """What every run of this device must say of itself, known after `start`; "" for most."""

    def take_warnings(self) -> list[str]:
        """What is to be said of the stream since the last call, in sentences; ask after each `decode`."""

    def prepare(self) -> None:
        """Do what takes long and needs no port, such as compiling; `start` does it if it was not done."""

    def start(self, link: Link) -> bytes:
        """Bring the device to a known state, set it up and start the stream.

        Returns what was read here of the stream, to be decoded before all else.
        Raises NoDataError within about 3 s when nothing intelligible comes, saying what did come.
        """

    def resume(self, link: Link) -> bytes:
        """Go on with a device that was lost and found again; else as `start`.

        One that sends already is left as it is: its count then tells exactly what is missing.
        """

    def read(self, link: Link) -> bytes:
        """What comes next, b"" if nothing did within a fraction of a second; to be decoded next.

        A device that sends by itself is listened to. One that must be asked is asked once, at its time,
        and its answer awaited. Called again and again by one thread, `decode` meanwhile by another.
        Raises DeviceLostError.
        """

    def stop(self, link: Link) -> None:
        """Ask the device to stop sending; never raises when the device is gone."""

    def decode(self, data: bytes, arrival_ns: int) -> Iterator[SampleBlock]:
        """Samples completed by `data`. Keeps a bounded unfinished rest for the next call.

        No data at all, b"", means that the link was broken here: what comes next may not go on where
        it ended. Rows stand for what is missing, by the device's sequence or time where the time that
        has passed on the host bears it out, else estimated by that time.
        """


class CancellableLink:
    """Reads and writes of `link` until `stopping` is set; then each raises DeviceLostError."""

    def __init__(self, link: Link, cancelled: threading.Event) -> None:
        self._link = link
        self._stopping = cancelled

    def read(self) -> bytes:
        """See `drivers.source.Link`."""
        self._check()
        return self._link.read()

    def write(self, data: bytes) -> None:
        """See `drivers.source.Link`."""
        self._check()
        self._link.write(data)

    def _check(self) -> None:
        if self._stopping.is_set():
            raise DeviceLostError("the device is not wanted any more: connect again")
