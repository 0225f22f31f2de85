"""What goes wrong when a port is opened, in words with a remedy."""

import errno
import sys

from drivers.errors import DeviceLostError, DriverError, PortUnavailableError, SettingsError
from drivers.holders import PortUser, port_users

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
