"""Serial ports: which are there, who may open them, and what disturbs them."""

import contextlib
import os
import sys
from collections.abc import Iterator
from pathlib import Path

from app.cli.checkup.finding import Finding, ok, warn
from drivers.port import PortInfo, list_ports

_FTDI = 0x0403
_MODEM_MANAGER = "ModemManager"


def check_ports() -> Iterator[Finding]:
    """Look at each port, and at programs known to seize them."""
    ports = list_ports()
    if not ports:
        yield ok("ports", "no serial port is there; an amplifier shows when it is plugged in")
    for port in ports:
        yield access(port)
        if port.vendor_id == _FTDI:
            yield latency(port)
    yield modem_manager(Path("/proc"))


def access(port: PortInfo) -> Finding:
    """Tell whether this user may open a port."""
    subject = f"port {port.device}"
    what = port.description if port.description not in ("", "n/a") else "no description"
    if sys.platform == "win32" or os.access(port.device, os.R_OK | os.W_OK):
        return ok(subject, f"{what}, may be opened")
    group = _group_of(Path(port.device))
    return warn(
        subject,
        f"{what}, may not be opened by this user{f' (group {group} may)' if group else ''}",
        f"Run: sudo usermod -aG {group or 'dialout'} $USER, then log in again",
    )


def latency(port: PortInfo, devices: Path = Path("/sys/bus/usb-serial/devices")) -> Finding:
    """Tell for how long an FTDI adapter holds back bytes."""
    subject = f"latency of {port.device}"
    if sys.platform == "win32":
        return warn(
            subject,
            "FTDI adapters hold bytes back for 16 ms by default",
            "Device Manager, the port, Port Settings, Advanced: latency timer 1 ms",
        )
    with contextlib.suppress(OSError, ValueError):
        timer_ms = int((devices / Path(port.device).name / "latency_timer").read_text())
        return ok(subject, f"FTDI, {timer_ms} ms; Slipstand asks for the shortest while it reads")
    return ok(subject, "FTDI; Slipstand asks for the shortest while it reads")


def modem_manager(processes: Path) -> Finding:
    """Tell whether ModemManager runs, which opens new serial ports to look for modems."""
    for name in processes.glob("[0-9]*/comm"):
        with contextlib.suppress(OSError):
            if name.read_text().strip() == _MODEM_MANAGER:
                return warn(
                    "other programs",
                    "ModemManager runs and talks to serial ports when they are plugged in",
                    "Run: sudo systemctl disable --now ModemManager, unless a modem is used here",
                )
    return ok("other programs", "none that is known to seize serial ports")


def _group_of(path: Path) -> str:
    with contextlib.suppress(OSError, KeyError, NotImplementedError):
        return path.group()
    return ""
