"""Serial ports: opened, read, listed, and which programs use them. The only user of pyserial."""

import contextlib
import errno
import logging
import os
import re
import select
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, Self

import serial
from serial.tools import list_ports as serial_list_ports

from drivers import lsl_link
from drivers.errors import DeviceLostError, DriverError, PortUnavailableError, SettingsError
from drivers.source import CollectLimit, LineSettings, Link
from messages.i18n import N_

_log = logging.getLogger(__name__)

PARITIES = ("N", "E", "O")
STOP_BITS = (1, 2)
PROCESSES = Path("/proc")
_READ_TIMEOUT_S = 0.05
"""How long a read waits for its first byte: threads that read are stopped within this time."""
_WRITE_TIMEOUT_S = 2.0  # commands are a few bytes: a device that takes none for so long hangs
_MAX_READ_BYTES = 1 << 16
_TERMINAL_BYTES = 1024
"""A terminal that returns so many bytes at once may hold more."""
_MAX_TERMINAL_READS = 16
_PSEUDO_TERMINAL_LIMIT = CollectLimit(3584, 3584)
"""Linux holds 20 kB of a pseudo-terminal, and one read returns 4 kB at most."""
_SOCKET_LIMIT = CollectLimit(1 << 15, 1 << 15)
"""A connection holds at least so much, and then its sender waits."""
_WINDOWS_BUFFER_BYTES = 1 << 18
"""Receive buffer asked for on Windows, whose default of 4 kB lasts 90 ms at 460800 baud."""

if sys.platform == "win32":
    PLATFORM_ERRORS: tuple[type[Exception], ...] = (OSError, ValueError, OverflowError)
else:
    from termios import error as _termios_error

    # pyserial lets these through beside its own exception, which is an OSError.
    PLATFORM_ERRORS: tuple[type[Exception], ...] = (OSError, ValueError, OverflowError, _termios_error)

_WINDOWS_PORT = re.compile(r"(?:[\\/]{2}\.[\\/])?(COM\d+)", re.IGNORECASE)
_LINUX_PSEUDO_TERMINALS = "/dev/pts/"
_PSEUDO_TERMINALS = (_LINUX_PSEUDO_TERMINALS, "/dev/ttys")  # also those of macOS; ports of Linux are ttyS0
_BUSY = (errno.EBUSY, errno.EAGAIN)
_ABSENT = (errno.ENOENT, errno.ENODEV, errno.ENXIO, errno.EIO)
_DENIED = (errno.EACCES, errno.EPERM)


@dataclass(frozen=True, slots=True)
class PortInfo:
    """A port that exists. The numbers are those of USB, None or "" for others."""

    device: str
    description: str = ""
    vendor_id: int | None = None
    product_id: int | None = None
    serial_number: str = ""
    location: str = ""
    """Where it is plugged in, as the system calls it."""

    @property
    def identity(self) -> str:
        if self.vendor_id is None or self.product_id is None:
            return self.device
        return f"{self.device} USB {self.vendor_id:04x}:{self.product_id:04x} {self.serial_number}".rstrip()

    def is_same_device(self, other: "PortInfo") -> bool:
        own = (self.vendor_id, self.product_id, self.serial_number)
        return self.vendor_id is not None and own == (other.vendor_id, other.product_id, other.serial_number)


class OpenPort(Link, Protocol):
    """An open port: a `Port`, or the two ports of a `drivers.pair.link.PairLink`."""

    @property
    def info(self) -> PortInfo: ...

    @property
    def url(self) -> str: ...

    def close(self) -> None:
        """Close it; may be called twice, and when the device is gone."""


@dataclass(frozen=True, slots=True)
class PortConfig:
    """How to open a port."""

    url: str
    baud: int
    parity: str = "N"
    stop_bits: int = 1

    def open(self) -> OpenPort:
        return self._open(self.url)

    def reopen(self, lost: PortInfo) -> OpenPort:
        """Open the port of the same device, wherever it is now. Raises DriverError while it is gone."""
        url = find_replugged(lost)
        if url is None:
            template = N_("the device of {port} is not there: plug it in again, into the same socket")
            raise PortUnavailableError(template, port=lost.device)
        return self._open(url)

    def _open(self, url: str) -> OpenPort:
        return open_port(url, self.baud, self.parity, self.stop_bits)


def list_ports() -> list[PortInfo]:
    """Serial ports of this computer, by name; none where the system cannot list them."""
    try:
        ports = list(serial_list_ports.comports())
    except PLATFORM_ERRORS:  # Windows raises while a device is being unplugged
        return []
    return [
        PortInfo(p.device, p.description or "", p.vid, p.pid, p.serial_number or "", p.location or "")
        for p in sorted(ports, key=lambda port: _natural_order(port.device))
    ]


def _natural_order(name: str) -> list[tuple[str, int]]:
    """Sort key that puts COM2 before COM10."""
    return [(text, int(number or 0)) for text, number in re.findall(r"(\D*)(\d*)", name)]


def list_streams() -> list[PortInfo]:
    """LSL streams in the network, searched for a second; none without pylsl."""
    return [PortInfo(url, description) for url, description in lsl_link.find_streams()]


def port_info(url: str) -> PortInfo:
    """What is known of the port that `url` opens, or leads to as a symbolic link."""
    if "://" in url:
        return PortInfo(url)
    names = (url, device_path(url))
    return next((port for port in list_ports() if port.device in names), PortInfo(url))


def device_path(device: str) -> str:
    """Path of a device where links end, or the name by which the system lists it: `COM12`, `/dev/cu.X`.

    On Windows Python would open the port to learn where its name leads, which resets many a device. macOS has
    two names for a port, of which `/dev/tty.X` is that for incoming calls.
    """
    name = _WINDOWS_PORT.fullmatch(device)
    return name[1].upper() if name else os.path.realpath(device).replace("/dev/tty.", "/dev/cu.")


def find_replugged(lost: PortInfo) -> str | None:
    """Address of a lost device; None while it is gone.

    A USB device is recognised by its numbers, under whatever name. Of two that are alike and have no serial
    number it is the one in the same socket, then the one of the same name. A port without USB numbers (a
    network address, a pseudo-terminal) keeps its address.
    """
    if lost.vendor_id is None:
        return lost.device
    alike = [port for port in list_ports() if port.is_same_device(lost)]
    alike.sort(key=lambda port: (port.location != lost.location, port.device != lost.device))
    certain = len(alike) == 1 and bool(lost.serial_number)
    if alike and (certain or alike[0].location == lost.location or alike[0].device == lost.device):
        return alike[0].device
    return None


def open_port(url: str, baud: int, parity: str = "N", stop_bits: int = 1) -> "Port | StreamPort":
    """Open a port for this program alone, or an LSL stream (`lsl://NAME`), to which the rest does not apply.

    `url` is a device (`/dev/ttyUSB0`, `COM3`, a pseudo-terminal's path) or a URL of pyserial
    (`socket://host:port`, `rfc2217://host:port`, `loop://`, `spy://device`); `parity` N, E or O; `stop_bits`
    1 or 2; bytes have 8 data bits. Raises PortUnavailableError if the port does not exist, is busy, or may
    not be opened, SettingsError if it cannot be set so.
    """
    if url.startswith(lsl_link.SCHEME):
        return StreamPort(*lsl_link.open_inlet(url), url)
    if parity not in PARITIES:
        template = N_("parity {parity!r} is not known: give one of {allowed}")
        raise SettingsError(template, parity=parity, allowed=PARITIES)
    if stop_bits not in STOP_BITS:
        template = N_("stop_bits {stop_bits} are not known: give one of {allowed}")
        raise SettingsError(template, stop_bits=stop_bits, allowed=STOP_BITS)
    if baud <= 0:
        template = N_("baud {baud} is not possible: give the device's baud rate, for example 115200")
        raise SettingsError(template, baud=baud)
    users = other_port_users(url)
    if users:  # many programs take no lock, and two readers get half of the bytes each
        raise port_busy_error(url, users)
    timeouts = {"timeout": _READ_TIMEOUT_S, "write_timeout": _WRITE_TIMEOUT_S}
    try:
        line = {"baudrate": baud, "parity": parity, "stopbits": stop_bits}
        wire = serial.serial_for_url(url, exclusive=True, **line, **timeouts)
    except PLATFORM_ERRORS as error:
        raise port_unavailable_error(url, baud, error, [port.device for port in list_ports()]) from error
    absent = (AttributeError, NotImplementedError, *PLATFORM_ERRORS)  # only some platforms have these
    with contextlib.suppress(*absent):
        wire.set_low_latency_mode(True)
    with contextlib.suppress(*absent):
        wire.set_buffer_size(rx_size=_WINDOWS_BUFFER_BYTES)
    _log.info("opened %s at %s", url, LineSettings(baud, parity, stop_bits))
    return Port(wire, url)


class StreamPort(lsl_link.LslLink):
    """An LSL stream that is read as a port."""

    @property
    def info(self) -> PortInfo:
        return PortInfo(self.url)


class Port:
    """An open port. Reading and writing may happen in two threads; closing must wait until both are done."""

    def __init__(self, wire: Any, url: str) -> None:
        self._wire = wire
        self._is_socket = url.lower().startswith("socket://")
        # Direct reads of a POSIX terminal cost half of those of pyserial, or less.
        is_terminal = sys.platform != "win32" and type(wire) is serial.Serial
        self._terminal: int | None = wire.fileno() if is_terminal else None
        self.url = url
        self.info = port_info(url)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def read(self) -> bytes:
        """Wait at most 50 ms for the first byte and return all that is there. Raises DeviceLostError."""
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
    def is_network(self) -> bool:
        """Whether it leads to a TCP port."""
        return self._is_socket

    @property
    def collect_limit(self) -> CollectLimit:
        if self._is_socket:
            return _SOCKET_LIMIT
        is_pseudo_terminal = device_path(self.url).startswith(_LINUX_PSEUDO_TERMINALS)
        return _PSEUDO_TERMINAL_LIMIT if is_pseudo_terminal else CollectLimit()

    @property
    def has_baud(self) -> bool:
        """Whether the baud rate has an effect; it has none on a network or a pseudo-terminal."""
        return "://" not in self.url and not device_path(self.url).startswith(_PSEUDO_TERMINALS)

    def configure(self, line_settings: LineSettings) -> None:
        """Change the settings and discard unread bytes. Raises SettingsError, DeviceLostError."""
        try:
            self._wire.baudrate, self._wire.parity = line_settings.baud, line_settings.parity
            self._wire.stopbits = line_settings.stop_bits
        except PLATFORM_ERRORS as error:
            template = N_("port {port} cannot be set to {baud} baud, parity {parity} ({fault}): give others")
            baud, parity = line_settings.baud, line_settings.parity
            raise SettingsError(template, port=self.url, baud=baud, parity=parity, fault=error) from error
        try:
            self._wire.reset_input_buffer()
        except PLATFORM_ERRORS as error:
            raise self._lost(error) from error

    def write(self, data: bytes) -> None:
        """Send all of `data`. Raises DeviceLostError if the port is gone, or takes nothing for 2 s."""
        try:
            self._wire.write(data)
        except PLATFORM_ERRORS as error:
            raise self._lost(error) from error

    def close(self) -> None:
        if self._is_socket and self._wire.is_open:
            self._wire._socket.close()  # pyserial leaves it open when the other end is gone
        with contextlib.suppress(*PLATFORM_ERRORS):
            self._wire.close()
        _log.info("closed %s", self.url)

    def _rest(self) -> bytes:
        rest = b""
        # An error after the first bytes is raised by the next call; the bytes must not be lost.
        with contextlib.suppress(*PLATFORM_ERRORS):
            while len(rest) < _MAX_READ_BYTES and (waiting := self._wire.in_waiting):
                rest += self._wire.read(min(waiting, _MAX_READ_BYTES))
        return rest

    def _socket_rest(self) -> bytes:
        # `in_waiting` of a socket is only 0 or 1. With a timeout of 0, pyserial receives once.
        self._wire.timeout = 0
        try:
            return bytes(self._wire.read(_MAX_READ_BYTES))
        except PLATFORM_ERRORS:  # as in `_rest`
            return b""
        finally:
            self._wire.timeout = _READ_TIMEOUT_S

    def _lost(self, error: Exception) -> DeviceLostError:
        lost = device_lost_error(self.url, error)
        _log.warning("%s (%s: %s)", lost, type(error).__name__, error)
        return lost


def _read_terminal(descriptor: int) -> bytes:
    """All that is there, or comes first within 50 ms. Raises an error of `PLATFORM_ERRORS`."""
    parts = [_read_available(descriptor)]
    if not parts[0] and select.select([descriptor], [], [], _READ_TIMEOUT_S)[0]:
        parts = [os.read(descriptor, _MAX_READ_BYTES)]
        if not parts[0]:
            raise serial.SerialException("the port is ready and gives nothing, as when it is unplugged")
    # An error after the first bytes is raised by the next call; the bytes must not be lost.
    with contextlib.suppress(*PLATFORM_ERRORS):
        while len(parts[-1]) >= _TERMINAL_BYTES and len(parts) < _MAX_TERMINAL_READS:
            parts.append(_read_available(descriptor))
    return b"".join(parts)


def _read_available(descriptor: int) -> bytes:
    try:
        return os.read(descriptor, _MAX_READ_BYTES)
    except BlockingIOError:
        return b""


@dataclass(frozen=True, slots=True)
class PortUser:
    """A program that has a port open."""

    process: int
    program: str

    def __str__(self) -> str:
        return f"{self.program} (process {self.process})" if self.program else f"process {self.process}"


def port_users(device: str, processes: Path = PROCESSES) -> list[PortUser]:
    """Programs that have `device` open, as far as Linux shows it to the same user; none elsewhere."""
    if "://" in device:
        return []
    target = device_path(device)
    return [
        PortUser(int(process.name), program_name(process))
        for process in _entries(processes)
        if process.name.isdigit() and any(_leads_to(target, file) for file in _entries(process / "fd"))
    ]


def other_port_users(device: str, processes: Path = PROCESSES) -> list[PortUser]:
    """Programs beside this one that have a serial port open; a pseudo-terminal is open in its maker."""
    target = device_path(device)
    if not target.startswith("/dev/") or target.startswith(_PSEUDO_TERMINALS):
        return []
    return [user for user in port_users(device, processes) if user.process != os.getpid()]


def program_name(process: Path) -> str:
    """Name of a program by its folder in `/proc`; "" where it cannot be read."""
    with contextlib.suppress(OSError):
        return (process / "comm").read_text("utf-8", "replace").strip()
    return ""


def _entries(folder: Path) -> Iterator[Path]:
    with contextlib.suppress(OSError):
        yield from folder.iterdir()


def _leads_to(target: str, file: Path) -> bool:
    with contextlib.suppress(OSError):  # closed meanwhile, or of another user
        return os.path.realpath(file) == target
    return False


def device_lost_error(url: str, error: Exception) -> DeviceLostError:
    """Error to raise for `error` of an open port."""
    template = N_("port {port} is gone: plug its cable in again, and check the power of the device")
    if "://" in url:
        template = N_("the connection to {port} was closed by the other end: check its power and the network")
    elif "timeout" in str(error).lower():
        template = N_("port {port} takes nothing of what is sent: check the device, and reset it if it hangs")
    return DeviceLostError(template, port=url)


def port_unavailable_error(url: str, baud: int, error: Exception, present: list[str]) -> DriverError:
    """Error to raise for `error` of opening `url`, while the ports `present` exist."""
    number, fault = getattr(error, "errno", None), str(error)
    if "://" in url:
        templates = (text for words, text in _UNREACHABLE.items() if re.search(words, fault, re.IGNORECASE))
        return PortUnavailableError(next(templates), port=url)
    if number in _DENIED:
        template = N_(
            "port {port} may not be opened by this user: add the user to the group that owns it "
            "(Debian, Ubuntu: `sudo usermod -aG dialout $USER`), then log in again"
        )
        return PortUnavailableError(template, port=url)
    # Windows reports "permission" for a port in use, of which pyserial keeps only the text.
    if number in _BUSY or "PermissionError" in fault:
        return port_busy_error(url, port_users(url))
    if number in _ABSENT or "FileNotFoundError" in fault:
        template = N_(
            "there is no port {port}: plug the device in or give its name; there is no serial port here"
        )
        if present:
            template = N_(
                "there is no port {port}: plug the device in or give its name; ports here: {present}"
            )
        return PortUnavailableError(template, port=url, present=present)
    if isinstance(error, (ValueError, OverflowError)):
        template = N_("port {port} cannot be set to {baud} baud ({fault}): give another --baud")
        return SettingsError(template, port=url, baud=baud, fault=error)
    template = N_("{port} cannot be used as a serial port ({fault}): give the name of a port")
    return PortUnavailableError(template, port=url, fault=error)


def port_busy_error(url: str, users: list[PortUser]) -> PortUnavailableError:
    """Error to raise for a port that other programs have open."""
    template = N_("port {port} is busy: close the program that has it open")
    if users:
        template = N_("port {port} is busy, held by {users}: close the program that has it open")
    return PortUnavailableError(template, port=url, users=users)


_UNREACHABLE = {
    "name or service|getaddrinfo|nodename": N_(
        "{port} is not known in this network: check how the address is written"
    ),
    "not known": N_(
        "{port} is no kind of port that is known: give a device, socket://host:port or rfc2217://host:port"
    ),
    "refused": N_(
        "{port} refuses: nothing listens there, start the device's server or check the port number"
    ),
    "": N_("{port} does not answer: check address, port number, network and power of the device"),
}  # by what pyserial and the systems write
