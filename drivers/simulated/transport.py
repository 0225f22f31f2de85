"""Ports of the simulated device: a pseudo-terminal (POSIX) or TCP (every system)."""

import contextlib
import errno
import os
import select
import shutil
import socket
import sys
import tempfile
import time
from abc import ABC, abstractmethod
from pathlib import Path

from drivers.errors import PortUnavailableError
from drivers.simulated.identity import PORT_FOLDER_PREFIX
from messages.i18n import N_


class Transport(ABC):
    """The device's end of a wire. It never blocks."""

    @property
    @abstractmethod
    def url(self) -> str:
        """Address that a reader opens; it does not change when the port is unplugged and comes back."""

    resets_device: bool
    """Whether a reader that closes the port resets the device, as the DTR line of an Arduino does."""
    burst_s: float  # how much of a late stream may be sent at once (s), so that a reader keeps up

    @abstractmethod
    def wait(self, timeout_s: float) -> None:
        """Sleep until the reader has sent something or `timeout_s` is over."""

    @abstractmethod
    def receive(self) -> bytes | None:
        """What the reader has sent, b"" if nothing; None while no reader has the port open."""

    @abstractmethod
    def send(self, data: bytes) -> int:
        """Send what there is room for; returns the number of bytes. The rest is lost, as on a UART."""

    @abstractmethod
    def unplug(self) -> None:
        """Remove the port, even while it is open."""

    @abstractmethod
    def plug_in(self) -> None:
        """Open the port again under its old address."""

    def close(self) -> None:
        self.unplug()


HOST = "127.0.0.1"  # only this computer may connect

_SEND_BUFFER_BYTES = 1 << 16
"""64 KiB hold 80 ms at 100 kHz: a reader that stands still for longer loses samples, as on a UART."""


class _TcpPort(Transport):
    """A TCP port; while a reader is connected it does not listen, so the system refuses a second one."""

    resets_device = False
    burst_s = 0.05

    def __init__(self, listener: socket.socket) -> None:
        self._number: int = listener.getsockname()[1]
        self._listener: socket.socket | None = listener
        self._reader: socket.socket | None = None
        self._is_plugged_in = True

    @property
    def url(self) -> str:
        return f"socket://{HOST}:{self._number}"

    def wait(self, timeout_s: float) -> None:
        watched = self._reader or self._listener
        if watched is None:  # select without sockets fails on Windows
            time.sleep(max(0.0, timeout_s))
        else:
            select.select([watched], [], [], max(0.0, timeout_s))

    def receive(self) -> bytes | None:
        if self._reader is None and not self._accept():
            return None
        try:
            data = self._reader.recv(4096) if self._reader else b""
        except BlockingIOError:
            return b""
        except OSError:  # the reader is gone
            data = b""
        if not data:
            self._drop_reader()
            self._listen()
        return data or None

    def send(self, data: bytes) -> int:
        if self._reader is None:
            return 0
        try:
            return self._reader.send(data)
        except OSError:  # full, or the reader has just gone
            return 0

    def unplug(self) -> None:
        self._is_plugged_in = False
        self._drop_reader()
        self._deafen()

    def plug_in(self) -> None:
        self._is_plugged_in = True
        self._listen()

    def _accept(self) -> bool:
        self._listen()
        if self._listener is None:
            return False
        try:
            self._reader, _ = self._listener.accept()
        except OSError:  # no reader, or gone again
            return False
        self._reader.setblocking(False)
        self._reader.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._deafen()
        return True

    def _listen(self) -> None:
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


def open_tcp_port(number: int = 0) -> Transport:
    """Listen on a TCP port of this computer, 0 being any free one. Raises PortUnavailableError."""
    try:
        return _TcpPort(_listener(number))
    except OSError as error:
        if error.errno == errno.EADDRINUSE:
            template = N_("TCP port {number} is used by another program: give another one, or 0 for any")
            raise PortUnavailableError(template, number=number) from None
        template = N_("TCP port {number} cannot be used ({fault}): give another one, or 0 for any")
        raise PortUnavailableError(template, number=number, fault=error.strerror) from None


def _listener(number: int) -> socket.socket:
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    try:
        if os.name == "posix":  # on Windows this lets another program take the port
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER_BYTES)
        listener.bind((HOST, number))
        listener.listen(1)
        listener.setblocking(False)
    except BaseException:
        listener.close()
        raise
    return listener


class _PseudoTerminal(Transport):
    """The device's end of a POSIX pseudo-terminal.

    Readers open a link to it, because a terminal that is opened again has another name. While no reader has
    the other end open, reading here fails or ends: this shows when a reader comes or leaves. `link` leads to
    the reader's end, alone in a folder that is removed with it.
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
        return str(self._link)

    def wait(self, timeout_s: float) -> None:
        if self._reader_is_there and self._descriptor is not None:
            select.select([self._descriptor], [], [], max(0.0, timeout_s))
        else:  # a terminal without a reader is readable all the time
            select.select([], [], [], min(self._LOOK_FOR_READER_S, max(0.0, timeout_s)))

    def receive(self) -> bytes | None:
        if self._descriptor is None:
            return None
        try:
            data = os.read(self._descriptor, 4096)
        except BlockingIOError:
            self._reader_is_there = True
            return b""
        except OSError:  # EIO on Linux; BSD and macOS report the end of the file
            data = b""
        self._reader_is_there = bool(data)
        return data or None

    def send(self, data: bytes) -> int:
        if self._descriptor is None:
            return 0
        try:
            return os.write(self._descriptor, data)
        except OSError:  # full, or the reader has just gone
            return 0

    def unplug(self) -> None:
        self._link.unlink(missing_ok=True)
        if self._descriptor is not None:
            os.close(self._descriptor)
        self._descriptor = None
        self._reader_is_there = False

    def plug_in(self) -> None:
        if self._descriptor is None:
            self._descriptor = _open_device_end(self._link)

    def close(self) -> None:
        self.unplug()
        shutil.rmtree(self._link.parent, ignore_errors=True)


def has_pseudo_terminals() -> bool:
    """Whether this system has pseudo-terminals; Windows has none."""
    return sys.platform != "win32"


def open_pseudo_terminal() -> Transport:
    """Open a pseudo-terminal in raw mode. Raises PortUnavailableError where there are none."""
    if not has_pseudo_terminals():
        template = N_("there are no pseudo-terminals on Windows: let the simulated stand use TCP, --tcp 0")
        raise PortUnavailableError(template)
    folder = Path(tempfile.mkdtemp(prefix=PORT_FOLDER_PREFIX))
    try:
        return _PseudoTerminal(_open_device_end(folder / "port"), folder / "port")
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise


def _open_device_end(link: Path) -> int:
    if sys.platform == "win32":  # checked before; for the type checker
        raise PortUnavailableError("there are no pseudo-terminals on Windows: use TCP")
    import tty

    device_end, reader_end = os.openpty()
    try:
        # Raw mode before a reader opens it: otherwise the terminal echoes samples back as commands.
        tty.setraw(reader_end)
        link.symlink_to(os.ttyname(reader_end))
    except BaseException:
        os.close(device_end)
        raise
    finally:
        # Once it was open and closed, "no reader" and "nothing sent" differ.
        os.close(reader_end)
    os.set_blocking(device_end, False)
    return device_end
