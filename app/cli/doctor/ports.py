"""Serial ports: which are there, what stands in the way of reading them, and what is known of devices."""

from collections.abc import Iterator

from app.cli.device import install_rule
from app.cli.doctor import Finding, ok, warn
from drivers.driver import UNVERIFIED
from drivers.host_checks import PortHint, modem_manager_runs, port_hints, usb_chip_name
from drivers.port import PortInfo, list_ports, other_port_users
from drivers.registry import AVAILABLE


def check_ports() -> Iterator[Finding]:
    """Look at each port, at programs known to seize them, and at the protocols."""
    ports = list_ports()
    if not ports:
        yield ok("ports", "no serial port is there; an amplifier shows when it is plugged in")
    for port in ports:
        yield from check_port(port, list(port_hints(port)))
    if not modem_manager_runs():
        yield ok("other programs", "none that is known to seize serial ports")
    elif all(port.vendor_id is None for port in ports):  # else told for each port
        yield warn(
            "other programs",
            "ModemManager runs and talks to serial ports when they are plugged in",
            f"Run: {install_rule()}",
        )
    yield check_protocols()


def check_port(port: PortInfo, hints: list[PortHint]) -> Iterator[Finding]:
    """What stands in the way of a port, or that nothing does."""
    subject = f"port {port.device}"
    description = "" if port.description == "n/a" else port.description
    what = usb_chip_name(port.vendor_id, port.product_id) or description or "no description"
    held = ", ".join(map(str, other_port_users(port.device)))
    if held:
        yield warn(subject, f"{what}, in use by {held}", "Close that program to record from this port")
    elif not hints:
        yield ok(subject, f"{what}, may be opened; see: slipstand device probe")
    for hint in hints:
        rule = f"; for good: {install_rule()}" if hint.rule_helps else ""
        yield warn(subject, f"{what}: {hint.message}", f"{hint.remedy}{rule}")


def check_protocols() -> Finding:
    """Say which protocols were never tried on the device itself."""
    untried = [driver.name for driver in AVAILABLE if not driver.on_hardware]
    if not untried:
        return ok("devices", f"{len(AVAILABLE)} protocols, all verified on hardware")
    return ok("devices", f"{UNVERIFIED}: {', '.join(untried)}; see: slipstand device list")
