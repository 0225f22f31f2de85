"""The simulated device on a pseudo-terminal of Linux or macOS."""

import os
import select
import shutil
import sys
import tempfile
from pathlib import Path

from drivers.errors import PortUnavailableError


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
