"""The simulated device behind TCP, as behind a serial-to-network converter; on every system."""

import contextlib
import errno
import os
import select
import socket
import time

from drivers.errors import PortUnavailableError

HOST = "127.0.0.1"
"""Nobody but this computer may come in."""

_SEND_BUFFER_BYTES = 1 << 16
"""A reader that stands still for longer loses samples, as with any port."""


class TcpPort:
    """A TCP port for one reader at a time (a `Transport`), see `open_tcp_port`.

    While a reader is there the port does not listen, so that a second one is refused by the system.

    Parameters
    ----------
    listener : socket
        Listening, not blocking.
    """

    resets_device = False
    burst_s = 0.05

    def __init__(self, listener: socket.socket) -> None:
        self._number: int = listener.getsockname()[1]
        self._listener: socket.socket | None = listener
        self._reader: socket.socket | None = None
        self._is_plugged_in = True

    @property
    def url(self) -> str:
        """What a reader opens: `socket://127.0.0.1:PORT`."""
        return f"socket://{HOST}:{self._number}"

    def wait(self, timeout_s: float) -> None:
        """Sleep until a reader came or has sent something, or `timeout_s` is over."""
        watched = self._reader or self._listener
        if watched is None:  # where there is nothing to watch, select fails on Windows
            time.sleep(max(0.0, timeout_s))
        else:
            select.select([watched], [], [], max(0.0, timeout_s))

    def receive(self) -> bytes | None:
        """Return what the reader has sent; None while there is no reader."""
        if self._reader is None and not self._accept():
            return None
        try:
            data = self._reader.recv(4096) if self._reader else b""
        except BlockingIOError:
            return b""
        except OSError:  # gone without a word
            data = b""
        if not data:
            self._drop_reader()
            self._listen()
        return data or None

    def send(self, data: bytes) -> int:
        """Offer `data` and return how many bytes the connection had room for."""
        if self._reader is None:
            return 0
        try:
            return self._reader.send(data)
        except OSError:  # full, or the reader has just gone
            return 0

    def unplug(self) -> None:
        """End the connection and refuse others."""
        self._is_plugged_in = False
        self._drop_reader()
        self._deafen()

    def plug_in(self) -> None:
        """Listen again on the same port."""
        self._is_plugged_in = True
        self._listen()

    def close(self) -> None:
        """End the connection and give the port up."""
        self.unplug()

    def _accept(self) -> bool:
        self._listen()
        if self._listener is None:
            return False
        try:
            self._reader, _ = self._listener.accept()
        except OSError:  # nobody there, or gone again
            return False
        self._reader.setblocking(False)
        self._reader.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._deafen()
        return True

    def _listen(self) -> None:
        """Listen if it is time to. A port that another program took meanwhile is tried again later."""
        if self._is_plugged_in and self._listener is None:
            with contextlib.suppress(OSError):
                self._listener = _listener(self._number)

    def _deafen(self) -> None:
        if self._listener is not None:
            self._listener.close()
            self._listener = None

    def _drop_reader(self) -> None:
        if self._reader is not None:
            self._reader.close()
            self._reader = None


def open_tcp_port(number: int = 0) -> TcpPort:
    """Listen on a TCP port of this computer, 0 being any free one. Raises PortUnavailableError."""
    try:
        return TcpPort(_listener(number))
    except OSError as error:
        busy = error.errno == errno.EADDRINUSE
        fault = "is used by another program" if busy else f"cannot be used ({error.strerror})"
        raise PortUnavailableError(f"TCP port {number} {fault}: give another one, or 0 for any") from None


def _listener(number: int) -> socket.socket:
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    try:
        if os.name == "posix":  # elsewhere it would let another program take the port away
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER_BYTES)
        listener.bind((HOST, number))
        listener.listen(1)
        listener.setblocking(False)
    except BaseException:
        listener.close()
        raise
    return listener
