"""A link that is lost as soon as nobody wants it any more, so that no conversation holds up an end."""

import threading

from drivers.errors import DeviceLostError
from drivers.source import Link


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
