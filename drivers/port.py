"""The serial port: opened, read by a thread of its own, and listed. The only user of pyserial."""

import contextlib
import errno
import os
import select
import sys
import threading
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from types import TracebackType
from typing import Any, Protocol, Self

import serial
from serial.tools import list_ports as serial_list_ports

from drivers.errors import DeviceLostError, DriverError, PortUnavailableError, SettingsError
from drivers.host_time import host_ns
from drivers.port_users import PortUser, other_port_users, port_users
from drivers.source import Link

PARITIES = ("N", "E", "O")
_WAIT_S = 0.05
_WRITE_TIMEOUT_S = 2.0
_DRAIN_BYTES = 1 << 16
_SOCKET_BYTES = _DRAIN_BYTES
_TERMINAL_BYTES = 1024
"""Where a terminal gives so many at once, it may hold more."""
_TERMINAL_READS = 16
_WINDOWS_BUFFER_BYTES = 1 << 18


@dataclass(frozen=True, slots=True)
class PortInfo:
    """A port that is there. The numbers are those of USB, None or empty for others."""

    device: str
    description: str = ""
    vendor_id: int | None = None
    product_id: int | None = None
    serial_number: str = ""
    location: str = ""
    """Where it is plugged in, as the system calls it."""

    @property
    def identity(self) -> str:
        """Its name and, for USB, vendor, product and serial number."""
        if self.vendor_id is None or self.product_id is None:
            return self.device
        return f"{self.device} USB {self.vendor_id:04x}:{self.product_id:04x} {self.serial_number}".rstrip()

    def is_same_device(self, other: "PortInfo") -> bool:
        """Whether both are one USB device, whatever the names of their ports."""
        mine = (self.vendor_id, self.product_id, self.serial_number)
        return self.vendor_id is not None and mine == (
            other.vendor_id,
            other.product_id,
            other.serial_number,
        )


class OpenPort(Link, Protocol):
    """What is needed of an open port; `Port` is one, tests use a fake."""

    @property
    def info(self) -> PortInfo:
        """What is known of it, to find the device again or to name it in a run."""

    @property
    def url(self) -> str:
        """As it was opened."""

    def close(self) -> None:
        """Give it up; may be called twice, and when the device is gone."""


def list_ports() -> list[PortInfo]:
    """Serial ports of this machine, by name; none where it cannot tell, as while one comes or goes."""
    try:
        ports = list(serial_list_ports.comports())
    except PLATFORM_ERRORS:  # Windows refuses to tell of a device that has just been unplugged
        return []
    found = (
        PortInfo(
            port.device,
            port.description or "",
            port.vid,
            port.pid,
            port.serial_number or "",
            port.location or "",
        )
        for port in ports
    )
    return sorted(found, key=lambda port: port.device)


def find_replugged(lost: PortInfo) -> str | None:
    """What to open to have a lost device again; None while it is not there.

    Parameters
    ----------
    lost : PortInfo
        What `Port.info` was. A USB device is known again by its numbers, under whatever name. Of two
        that are alike and have no serial number it is the one in the same socket, then the one of the
        same name. Without these numbers (a network address, a pseudo-terminal) it is the same address.
    """
    if lost.vendor_id is None:
        return lost.device
    alike = [port for port in list_ports() if port.is_same_device(lost)]
    alike.sort(key=lambda port: (port.location != lost.location, port.device != lost.device))
    certain = len(alike) == 1 and bool(lost.serial_number)
    if alike and (certain or alike[0].location == lost.location or alike[0].device == lost.device):
        return alike[0].device
    return None


def open_port(url: str, baud: int, parity: str = "N", stop_bits: int = 1) -> "Port":
    """Open a port for this program alone.

    Parameters
    ----------
    url : str
        A device (`/dev/ttyUSB0`, `COM3`, a pseudo-terminal's path) or a URL of pyserial
        (`socket://host:port`, `rfc2217://host:port`, `loop://`, `spy://device`).
    baud : int
        Bits a second; 8 data bits.
    parity : str
        "N", "E" or "O".
    stop_bits : int
        1 or 2.

    Raises
    ------
    PortUnavailableError
        If it is not there, is busy, or may not be opened.
    SettingsError
        If the port cannot be set so.
    """
    if parity not in PARITIES:
        raise SettingsError(f"parity {parity!r} is not known: give one of {', '.join(PARITIES)}")
    if baud <= 0:
        raise SettingsError(f"baud {baud} is not possible: give the device's baud rate, for example 115200")
    others = other_port_users(url)
    if others:  # many programs take no lock, and two readers get half of the bytes each
        raise port_busy_error(url, others)
    try:
        wire = serial.serial_for_url(
            url,
            baudrate=baud,
            parity=parity,
            stopbits=stop_bits,
            timeout=_WAIT_S,
            write_timeout=_WRITE_TIMEOUT_S,
            exclusive=True,
        )
    except PLATFORM_ERRORS as error:
        raise port_unavailable_error(url, baud, error, [port.device for port in list_ports()]) from error
    _tune(wire)
    return Port(wire, url)


def _tune(wire: Any) -> None:
    """Ask for short latency and a large buffer where the platform has them."""
    with contextlib.suppress(AttributeError, NotImplementedError, *PLATFORM_ERRORS):
        wire.set_low_latency_mode(True)
    with contextlib.suppress(AttributeError, NotImplementedError, *PLATFORM_ERRORS):
        wire.set_buffer_size(rx_size=_WINDOWS_BUFFER_BYTES)


def port_info(url: str) -> PortInfo:
    """What is known of the port that `url` opens, or leads to as a symbolic link."""
    if "://" in url:
        return PortInfo(url)
    names = (url, os.path.realpath(url))
    return next((port for port in list_ports() if port.device in names), PortInfo(url))


class Port:
    """An open port (a `Link`), made by `open_port`.

    Reading and writing may happen in two threads; closing must wait until both are done.
    """

    def __init__(self, wire: Any, url: str) -> None:
        self._wire = wire
        self._is_socket = url.lower().startswith("socket://")
        self._terminal = _terminal_of(wire)
        self.url = url
        self.info = port_info(url)
        """What is known of the port, to find the device again or to name it in a run."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def read(self) -> bytes:
        """Wait at most 50 ms for the first byte and return all that is there.

        Raises
        ------
        DeviceLostError
            If the port is gone. What came before it is returned by the call before.
        """
        try:
            if self._terminal is not None:
                return _read_terminal(self._terminal)
            first = bytes(self._wire.read(max(1, 0 if self._is_socket else self._wire.in_waiting)))
        except PLATFORM_ERRORS as error:
            raise self._lost(error) from error
        if not first:
            return b""
        return first + (self._socket_rest() if self._is_socket else self._rest())

    @property
    def has_baud(self) -> bool:
        """Whether the baud rate means anything here, as it does not on a network or pseudo-terminal."""
        return "://" not in self.url and not os.path.realpath(self.url).startswith("/dev/pts/")

    def configure(self, baud: int, parity: str) -> None:
        """Go on with another baud rate and parity; what waited to be read is thrown away.

        Raises
        ------
        SettingsError
            If the port cannot be set so.
        DeviceLostError
            If the port is gone.
        """
        try:
            self._wire.baudrate, self._wire.parity = baud, parity
        except PLATFORM_ERRORS as error:
            raise SettingsError(
                f"port {self.url} cannot be set to {baud} baud, parity {parity} ({error}): give others"
            ) from error
        try:
            self._wire.reset_input_buffer()
        except PLATFORM_ERRORS as error:
            raise self._lost(error) from error

    def write(self, data: bytes) -> None:
        """Send all of `data`.

        Raises
        ------
        DeviceLostError
            If the port is gone, or takes nothing for 2 s.
        """
        try:
            self._wire.write(data)
        except PLATFORM_ERRORS as error:
            raise self._lost(error) from error

    def close(self) -> None:
        """Give the port up; may be called twice, and when the device is gone."""
        if self._is_socket and self._wire.is_open:
            self._wire._socket.close()  # pyserial leaves it open when the other end is gone
        with contextlib.suppress(*PLATFORM_ERRORS):
            self._wire.close()

    def _rest(self) -> bytes:
        parts: list[bytes] = []
        size = 0
        # An error after the first bytes shows again at the next call; these are not to be lost.
        with contextlib.suppress(*PLATFORM_ERRORS):
            while size < _DRAIN_BYTES and (waiting := self._wire.in_waiting):
                parts.append(bytes(self._wire.read(min(waiting, _DRAIN_BYTES))))
                size += len(parts[-1])
        return b"".join(parts)

    def _socket_rest(self) -> bytes:
        # `in_waiting` of a socket is only 0 or 1. Without time to wait, pyserial receives once.
        self._wire.timeout = 0
        try:
            return bytes(self._wire.read(_SOCKET_BYTES))
        except PLATFORM_ERRORS:  # as in `_rest`
            return b""
        finally:
            self._wire.timeout = _WAIT_S

    def _lost(self, error: Exception) -> DeviceLostError:
        return device_lost_error(self.url, error)


def _terminal_of(wire: Any) -> int | None:
    """Descriptor of a POSIX terminal: reading it without the detours of pyserial costs a third."""
    is_terminal = sys.platform != "win32" and type(wire) is serial.Serial
    return int(wire.fileno()) if is_terminal else None


def _read_terminal(descriptor: int) -> bytes:
    """All that is there, or comes first within 50 ms. Raises an error of `PLATFORM_ERRORS`."""
    parts = [_taken(descriptor)]
    if not parts[0] and select.select([descriptor], [], [], _WAIT_S)[0]:
        parts = [os.read(descriptor, _DRAIN_BYTES)]
        if not parts[0]:
            raise serial.SerialException("it is ready and gives nothing, as when it is unplugged")
    # An error after the first bytes shows again at the next call; these are not to be lost.
    with contextlib.suppress(*PLATFORM_ERRORS):
        while len(parts[-1]) >= _TERMINAL_BYTES and len(parts) < _TERMINAL_READS:
            parts.append(_taken(descriptor))
    return b"".join(parts)


def _taken(descriptor: int) -> bytes:
    """What a terminal holds, b"" if nothing; which of two ways tells that depends on the system."""
    try:
        return os.read(descriptor, _DRAIN_BYTES)
    except BlockingIOError:
        return b""


class ReaderEndReason(StrEnum):
    """Why a `PortReader` ended."""

    STOPPED = "stopped"
    DEVICE_LOST = "device-lost"
    QUEUE_FULL = "queue-full"
    FAILED = "failed"


@dataclass(frozen=True, slots=True)
class ReaderEnd:
    """Last word of a `PortReader`."""

    reason: ReaderEndReason
    message: str = ""


class QueueFullError(DriverError):
    """Raised by a sink that cannot take more: the reader ends, since it may not skip."""


class PortReader:
    """Thread that reads a device, stamps what came, and hands it on; nothing else.

    Parameters
    ----------
    read : callable
        Waits shortly and returns what came, b"" if nothing, as `Port.read` or `SampleSource.read` of an
        open port does. Raises DeviceLostError.
    sink : callable (arrival_ns, data)
        Takes each read with the host's time (ns, `host_time.host_ns`) after it; must not wait. Raises
        `QueueFullError` when it cannot take more.
    ended : callable (ReaderEnded)
        Called once from the thread, as its last act.
    """

    def __init__(
        self,
        read: Callable[[], bytes],
        sink: Callable[[int, bytes], None],
        ended: Callable[[ReaderEnd], None],
    ) -> None:
        self._read = read
        self._sink = sink
        self._ended = ended
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="port reader", daemon=True)

    def start(self) -> None:
        """Begin to read."""
        self._thread.start()

    def stop(self) -> None:
        """Wait for the read under way (50 ms, a fraction of a second where a device is asked) and end."""
        self._stopping.set()
        if self._thread.is_alive() and self._thread is not threading.current_thread():
            self._thread.join()

    def _run(self) -> None:
        ended = ReaderEnd(ReaderEndReason.STOPPED)
        try:
            self._read_on()
        except DeviceLostError as error:
            ended = ReaderEnd(ReaderEndReason.DEVICE_LOST, str(error))
        except QueueFullError as error:
            ended = ReaderEnd(ReaderEndReason.QUEUE_FULL, str(error))
        except Exception as error:  # whatever it was, those who wait for samples must hear of it
            ended = ReaderEnd(ReaderEndReason.FAILED, f"reading {type(error).__name__}: {error}")
        self._ended(ended)

    def _read_on(self) -> None:
        while not self._stopping.is_set():
            data = self._read()
            arrival_ns = host_ns()
            if data:
                self._sink(arrival_ns, data)


if sys.platform == "win32":
    PLATFORM_ERRORS: tuple[type[Exception], ...] = (OSError, ValueError, OverflowError)
else:
    from termios import error as _termios_error

    # pyserial lets these through beside its own exception, which is an OSError.
    PLATFORM_ERRORS: tuple[type[Exception], ...] = (OSError, ValueError, OverflowError, _termios_error)

_BUSY = (errno.EBUSY, errno.EAGAIN)
_ABSENT = (errno.ENOENT, errno.ENODEV, errno.ENXIO, errno.EIO)
_DENIED = (errno.EACCES, errno.EPERM)


def device_lost_error(url: str, error: Exception) -> DeviceLostError:
    """Error to raise for `error`, which an open port gave."""
    if "://" in url:
        return DeviceLostError(
            f"the connection to {url} was closed by the other end: check its power and the network"
        )
    if "timeout" in str(error).lower():
        return DeviceLostError(
            f"port {url} takes nothing of what is sent: check the device, and reset it if it hangs"
        )
    return DeviceLostError(f"port {url} is gone: plug its cable in again, and check the power of the device")


def port_unavailable_error(url: str, baud: int, error: Exception, present: list[str]) -> DriverError:
    """Error to raise for `error`, which opening `url` gave, while the ports `present` are there."""
    if "://" in url:
        return _unreachable(url, error)
    number = getattr(error, "errno", None)
    text = str(error)
    if number in _DENIED:
        return PortUnavailableError(
            f"port {url} may not be opened by this user: add the user to the group that owns it "
            "(Debian, Ubuntu: `sudo usermod -aG dialout $USER`), then log in again"
        )
    # Windows says "permission" of a port that is in use, and pyserial keeps the text alone.
    if number in _BUSY or "PermissionError" in text:
        return port_busy_error(url, port_users(url))
    if number in _ABSENT or "FileNotFoundError" in text:
        there = f"ports here: {', '.join(present)}" if present else "there is no serial port here"
        return PortUnavailableError(f"there is no port {url}: plug the device in or give its name; {there}")
    if isinstance(error, (ValueError, OverflowError)):
        return SettingsError(f"port {url} cannot be set to {baud} baud ({error}): give another --baud")
    return PortUnavailableError(f"{url} cannot be used as a serial port ({error}): give the name of a port")


def port_busy_error(url: str, users: list[PortUser]) -> PortUnavailableError:
    """Error to raise for a port that other programs have open, those that are known."""
    held = f", held by {', '.join(map(str, users))}" if users else ""
    return PortUnavailableError(f"port {url} is busy{held}: close the program that has it open")


def _unreachable(url: str, error: Exception) -> DriverError:
    if "not known" in str(error):
        return PortUnavailableError(
            f"{url} is no kind of port that is known: give a device, socket://host:port or rfc2217://host:port"
        )
    text = str(error).lower()
    if "refused" in text:
        return PortUnavailableError(
            f"{url} refuses: nothing listens there, start the device's server or check the port number"
        )
    if "name or service" in text or "getaddrinfo" in text or "nodename" in text:
        return PortUnavailableError(f"{url} is not known in this network: check how the address is written")
    return PortUnavailableError(
        f"{url} does not answer: check address, port number, network and power of the device"
    )
