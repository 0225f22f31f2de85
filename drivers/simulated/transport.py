"""How the simulated device's bytes leave its process: a pseudo-terminal here, others by the same protocol."""

import os
import select
import sys
from typing import Protocol

from drivers.errors import PortUnavailableError


class Transport(Protocol):
    """The device's end of a wire. It never blocks."""

    @property
    def url(self) -> str:
        """What a reader opens."""

    def wait(self, timeout_s: float) -> None:
        """Sleep until the reader has sent something or `timeout_s` is over."""

    def receive(self) -> bytes | None:
        """Return what the reader has sent, b"" if nothing; None while no reader has the port open."""

    def send(self, data: bytes) -> int:
        """Offer `data` and return how many bytes were taken; the rest is lost, as on a UART."""

    def close(self) -> None:
        """Give the port up."""


class PseudoTerminal:
    """The device's end of a POSIX pseudo-terminal, see `open_pseudo_terminal`.

    While no reader has the other end open, reading here fails or ends; so a reader that comes or goes
    is noticed, as an Arduino notices it by the DTR line that resets it.
    """

    _LOOK_FOR_READER_S = 0.005

    def __init__(self, descriptor: int, url: str) -> None:
        self._descriptor = descriptor
        self._url = url
        self._reader_is_there = False

    @property
    def url(self) -> str:
        """Path of the reader's end, for example `/dev/pts/3`."""
        return self._url

    def wait(self, timeout_s: float) -> None:
        """Sleep until the reader has sent something or `timeout_s` is over; 5 ms while nobody is there."""
        if self._reader_is_there:
            select.select([self._descriptor], [], [], max(0.0, timeout_s))
        else:  # the descriptor of a deserted terminal counts as readable all the time
            select.select([], [], [], self._LOOK_FOR_READER_S)

    def receive(self) -> bytes | None:
        """Return what the reader has sent; None while no reader has the port open."""
        try:
            data = os.read(self._descriptor, 4096)
        except BlockingIOError:
            self._reader_is_there = True
            return b""
        except OSError:  # EIO on Linux; BSD and macOS report the end of the file instead
            data = b""
        self._reader_is_there = bool(data)
        return data or None

    def send(self, data: bytes) -> int:
        """Offer `data` and return how many bytes the terminal had room for."""
        try:
            return os.write(self._descriptor, data)
        except OSError:  # full, or the reader has just gone
            return 0

    def close(self) -> None:
        """Close the device's end; a reader sees the device vanish."""
        os.close(self._descriptor)


def open_pseudo_terminal() -> PseudoTerminal:
    """Open a pseudo-terminal in raw mode. Raises PortUnavailableError where there are none."""
    if sys.platform == "win32":
        raise PortUnavailableError(
            "a simulated stand needs a pseudo-terminal, which Windows does not have. Use Linux or macOS"
        )
    import tty

    device_end, reader_end = os.openpty()
    try:
        # Raw before anybody opens it: otherwise the terminal echoes our samples back as commands.
        tty.setraw(reader_end)
        url = os.ttyname(reader_end)
    finally:
        # Opened and closed once, the port tells apart "nobody there" from "nothing sent".
        os.close(reader_end)
    os.set_blocking(device_end, False)
    return PseudoTerminal(device_end, url)
