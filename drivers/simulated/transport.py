"""How the simulated device's bytes leave its process: the seam between it and its wire."""

import contextlib
import errno
import os
import select
import shutil
import socket
import sys
import tempfile
import time
from pathlib import Path
from typing import Protocol

from drivers.errors import PortUnavailableError


class Transport(Protocol):
    """The device's end of a wire. It never blocks."""

    @property
    def url(self) -> str:
        """What a reader opens; the same after the wire was unplugged and came back."""

    @property
    def resets_device(self) -> bool:
        """True: a reader that leaves the port resets the device, as DTR does. False: it goes on alone."""

    @property
    def burst_s(self) -> float:
        """So much of a stream may be sent at once when it is late, for a reader to follow."""

    def wait(self, timeout_s: float) -> None:
        """Sleep until the reader has sent something or `timeout_s` is over."""

    def receive(self) -> bytes | None:
        """Return what the reader has sent, b"" if nothing; None while no reader has the port open."""

    def send(self, data: bytes) -> int:
        """Offer `data` and return how many bytes were taken; the rest is lost, as on a UART."""

    def unplug(self) -> None:
        """Let the port vanish under whoever reads it."""

    def plug_in(self) -> None:
        """Let the port appear again under its old address."""

    def close(self) -> None:
        """Give the port up."""


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


class PseudoTerminal:
    """The device's end of a POSIX pseudo-terminal (a `Transport`), see `open_pseudo_terminal`.

    Readers open a link to it, since a terminal that comes back has another name. While no reader has the
    other end open, reading here fails or ends; so a reader that comes or goes is noticed, as an Arduino
    notices it by the DTR line that resets it.

    Parameters
    ----------
    descriptor : int
        The device's end.
    link : Path
        Leads to the reader's end; alone in a folder that is removed with it.
    """

    resets_device = True
    burst_s = 0.004
    """A terminal holds 18,048 bytes, 20 ms at 100 kHz."""

    _LOOK_FOR_READER_S = 0.005

    def __init__(self, descriptor: int, link: Path) -> None:
        self._descriptor: int | None = descriptor
        self._link = link
        self._reader_is_there = False

    @property
    def url(self) -> str:
        """Path of the link that a reader opens."""
        return str(self._link)

    def wait(self, timeout_s: float) -> None:
        """Sleep until the reader has sent something or `timeout_s` is over; 5 ms while nobody is there."""
        if self._reader_is_there and self._descriptor is not None:
            select.select([self._descriptor], [], [], max(0.0, timeout_s))
        else:  # the descriptor of a deserted terminal counts as readable all the time
            select.select([], [], [], min(self._LOOK_FOR_READER_S, max(0.0, timeout_s)))

    def receive(self) -> bytes | None:
        """Return what the reader has sent; None while no reader has the port open."""
        if self._descriptor is None:
            return None
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
        if self._descriptor is None:
            return 0
        try:
            return os.write(self._descriptor, data)
        except OSError:  # full, or the reader has just gone
            return 0

    def unplug(self) -> None:
        """Hang the terminal up and take the link away."""
        self._link.unlink(missing_ok=True)
        if self._descriptor is not None:
            os.close(self._descriptor)
        self._descriptor = None
        self._reader_is_there = False

    def plug_in(self) -> None:
        """Let the old link lead to a new terminal."""
        if self._descriptor is None:
            self._descriptor = _open_device_end(self._link)

    def close(self) -> None:
        """Close the device's end, which a reader notices, and remove the link with its folder."""
        self.unplug()
        shutil.rmtree(self._link.parent, ignore_errors=True)


def has_pseudo_terminals() -> bool:
    """Tell whether this system has pseudo-terminals; Windows has none."""
    return sys.platform != "win32"


def open_pseudo_terminal() -> PseudoTerminal:
    """Open a pseudo-terminal in raw mode. Raises PortUnavailableError where there are none."""
    if not has_pseudo_terminals():
        raise PortUnavailableError(
            "there are no pseudo-terminals on Windows: let the simulated stand use TCP, --tcp 0"
        )
    folder = Path(tempfile.mkdtemp(prefix="slipstand-stand-"))
    try:
        return PseudoTerminal(_open_device_end(folder / "port"), folder / "port")
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise


def _open_device_end(link: Path) -> int:
    """Open a terminal, let `link` lead to its reader's end, and return the device's end."""
    if sys.platform == "win32":  # said above; here it tells the type checker
        raise PortUnavailableError("there are no pseudo-terminals on Windows: use TCP")
    import tty

    device_end, reader_end = os.openpty()
    try:
        # Raw before anybody opens it: otherwise the terminal echoes our samples back as commands.
        tty.setraw(reader_end)
        link.symlink_to(os.ttyname(reader_end))
    except BaseException:
        os.close(device_end)
        raise
    finally:
        # Opened and closed once, the port tells apart "nobody there" from "nothing sent".
        os.close(reader_end)
    os.set_blocking(device_end, False)
    return device_end
