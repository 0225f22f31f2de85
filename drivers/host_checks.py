"""Hindrances of the operating system to reading a serial port, and names of USB chips."""

import contextlib
import os
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from drivers.port import PROCESSES, PortInfo, program_name
from messages.i18n import N_
from messages.message import Message, message

USB_SERIAL = Path("/sys/bus/usb-serial/devices")
UDEV_DATA = Path("/run/udev/data")
MAX_LATENCY_MS = 1
"""Shortest latency of FTDI adapters; their default of 16 ms is too long for the release of a stand."""
_MODEM_MANAGER = "ModemManager"


@dataclass(frozen=True, slots=True)
class PortHint:
    """A hindrance and its remedy."""

    message: Message
    remedy: Message
    rule_helps: bool = False
    """Whether the shipped udev rule removes it permanently (`config/udev`)."""


def port_hints(
    port: PortInfo, *, processes: Path = PROCESSES, usb_serial: Path = USB_SERIAL, udev_data: Path = UDEV_DATA
) -> Iterator[PortHint]:
    """Hindrances to reading `port`; the folders are those of Linux and need not exist."""
    hints = (
        _permission_hint(port.device),
        _modem_manager_hint(port, processes, udev_data),
        _latency_hint(port, usb_serial),
    )
    yield from filter(None, hints)


def _permission_hint(device: str) -> PortHint | None:
    if sys.platform == "win32" or "://" in device or not Path(device).exists():
        return None
    if os.access(device, os.R_OK | os.W_OK):
        return None
    group, template = "", N_("{port} may not be opened by this user")
    with contextlib.suppress(OSError, KeyError):
        group = Path(device).group()
        template = N_("{port} may not be opened by this user (group {group} may)")
    remedy = message("Run: sudo usermod -aG {group} $USER, then log in again", group=group or "dialout")
    return PortHint(message(template, port=device, group=group), remedy, rule_helps=True)


def modem_manager_runs(processes: Path = PROCESSES) -> bool:
    """Whether ModemManager runs, which opens new serial ports to look for modems."""
    with contextlib.suppress(OSError):
        numbered = [entry for entry in processes.iterdir() if entry.name.isdigit()]
        return any(program_name(process) == _MODEM_MANAGER for process in numbered)
    return False


def _modem_manager_hint(port: PortInfo, processes: Path, udev_data: Path) -> PortHint | None:
    if port.vendor_id is None or not modem_manager_runs(processes) or _is_ignored(port.device, udev_data):
        return None
    template = N_("ModemManager runs and talks to {port} for some seconds after it is plugged in")
    remedy = message("Run: sudo systemctl disable --now ModemManager, unless a modem is used here")
    return PortHint(message(template, port=port.device), remedy, rule_helps=True)


def latency_ms(port: PortInfo, usb_serial: Path = USB_SERIAL) -> int | None:
    """Latency timer of an FTDI adapter (ms); None for others, or where the system does not report it."""
    if port.vendor_id != FTDI:
        return None
    with contextlib.suppress(OSError, ValueError):
        return int((usb_serial / Path(port.device).name / "latency_timer").read_text("ascii"))
    return None


def _latency_hint(port: PortInfo, usb_serial: Path) -> PortHint | None:
    delay_ms = latency_ms(port, usb_serial)
    if sys.platform == "win32" and port.vendor_id == FTDI:
        what = message("the FTDI adapter of {port} holds bytes back for 16 ms by default", port=port.device)
        remedy = message("Device Manager, the port, Port Settings, Advanced: latency timer 1 ms")
        return PortHint(what, remedy)
    if delay_ms is None or delay_ms <= MAX_LATENCY_MS:
        return None
    template = N_(
        "the FTDI adapter of {port} holds bytes back for {delay_ms} ms until a program asks for less"
    )
    remedy = message("Slipstand asks for 1 ms while it reads, where the adapter's driver takes it")
    return PortHint(message(template, port=port.device, delay_ms=delay_ms), remedy, rule_helps=True)


def _is_ignored(device: str, udev_data: Path) -> bool:
    """Whether a udev rule keeps ModemManager away from a port."""
    if sys.platform == "win32":
        return False
    with contextlib.suppress(OSError):
        number = Path(device).stat().st_rdev
        known = udev_data / f"c{os.major(number)}:{os.minor(number)}"
        return "E:ID_MM_PORT_IGNORE=1" in known.read_text("utf-8", "replace").splitlines()
    return False


FTDI = 0x0403

_MAKERS = {
    FTDI: "FTDI serial adapter",
    0x0683: "DATAQ instrument",
    0x067B: "Prolific serial adapter",
    0x10C4: "Silicon Labs serial adapter",
    0x16C0: "PJRC Teensy or another board",
    0x1A86: "WCH serial adapter",
    0x2341: "Arduino",
    0x2A03: "Arduino",
    0x239A: "Adafruit board",
    0x2E8A: "Raspberry Pi microcontroller",
    0x303A: "Espressif microcontroller",
    0x04D8: "Microchip USB serial",
    0x1B4F: "SparkFun board",
    0x0483: "STMicroelectronics virtual port",
}
_CHIPS = {
    (FTDI, 0x6001): "FTDI FT232R adapter",
    (FTDI, 0x6010): "FTDI FT2232 adapter, two ports",
    (FTDI, 0x6011): "FTDI FT4232 adapter, four ports",
    (FTDI, 0x6014): "FTDI FT232H adapter",
    (FTDI, 0x6015): "FTDI FT-X adapter",
    (0x067B, 0x2303): "Prolific PL2303 adapter",
    (0x10C4, 0xEA60): "Silicon Labs CP210x adapter",
    (0x10C4, 0xEA70): "Silicon Labs CP2105 adapter, two ports",
    (0x1A86, 0x7523): "WCH CH340 adapter, as on many Arduino clones",
    (0x1A86, 0x5523): "WCH CH341 adapter",
    (0x1A86, 0x55D4): "WCH CH9102 adapter",
    (0x16C0, 0x0483): "PJRC Teensy",
    (0x2341, 0x0043): "Arduino Uno",
    (0x2341, 0x0010): "Arduino Mega 2560",
    (0x2341, 0x8036): "Arduino Leonardo",
    (0x2E8A, 0x000A): "Raspberry Pi Pico",
    (0x04D8, 0x00DD): "Microchip MCP2221 adapter",
}
"""From the USB ID Repository, https://usb-ids.gowdy.us; names shortened."""


def usb_chip_name(vendor_id: int | None, product_id: int | None) -> str:
    """Name of a known chip or board, else of its maker, else ""."""
    if vendor_id is None:
        return ""
    return _CHIPS.get((vendor_id, product_id or 0)) or _MAKERS.get(vendor_id, "")
