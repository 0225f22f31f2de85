"""`slipstand device list`, `ports` and `probe`: which devices are supported, plugged in, and recognised."""

import shlex
from collections.abc import Iterator
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

import config
from app.cli import output as out
from app.cli.device_options import ListDevicesOptions, ListPortsOptions, ProbeOptions
from app.runs.analysis_request import quote_command
from drivers.driver import DeviceDriver, DeviceVariant
from drivers.host_checks import usb_chip_name
from drivers.port import PortInfo, list_streams, other_port_users, port_info
from drivers.port import list_ports as present_ports
from drivers.port_probe import PortReport, probe_port
from drivers.registry import DRIVERS

UDEV_RULE = Path(config.__file__).parent / "udev" / "60-slipstand.rules"


_NO_PORT = "No serial port found. Plug the amplifier in, or try: slipstand device simulate"


def _ports_and_streams() -> list[PortInfo]:
    return [*present_ports(), *list_streams()]


def list_devices(options: ListDevicesOptions) -> None:
    documents = [document for info in DRIVERS.values() for document in device_documents(info)]
    if options.as_json:
        out.print_json(documents)
        return
    rows = []
    for one in documents:
        settings = [f"--set {key}={value}" for key, value in one["settings"].items()]
        baud = str(one["default_baud"] or "")
        rows.append((" ".join([one["protocol"], *settings]), one["title"], baud, one["verified"]))
    out.print_table(("protocol", "device", "baud", "verified"), rows)


def device_documents(info: DeviceDriver) -> Iterator[dict[str, Any]]:
    """JSON objects of a protocol, and of the devices that its settings choose."""
    itself = DeviceVariant(info.name, info.title, {}, info.verified)
    for one in (itself, *info.list_variants()):
        yield {
            "protocol": info.name,
            "name": one.name,
            "settings": one.settings,
            "title": one.title,
            "default_baud": info.default_baud_for(one.settings),
            "available": info.available,
            "verified": one.verified,
        }


def list_ports(options: ListPortsOptions) -> None:
    ports = _ports_and_streams()
    if options.as_json:
        out.print_json([asdict(port) for port in ports])
    elif not ports:
        out.print_line(_NO_PORT)
    else:
        rows = []
        for port in ports:
            what = usb_chip_name(port.vendor_id, port.product_id) or port.description
            users = ", ".join(map(str, other_port_users(port.device)))
            rows.append((port.device, what, usb_identity(port), users))
        out.print_table(("port", "what it is", "identity", "in use by"), rows)


def probe(options: ProbeOptions) -> None:
    ports = [port_info(url) for url in options.ports] if options.ports else _ports_and_streams()
    reports = []
    for port in ports:
        report = probe_port(port, options.write, partial(_print_progress, port))
        reports.append(report)
        if not options.as_json:
            for line in report_lines(report):
                out.print_line(line)
    if options.as_json:
        out.print_json([port_document(report) for report in reports])
    elif not ports:
        out.print_line(_NO_PORT)


def _print_progress(port: PortInfo, doing: object) -> None:
    out.print_status(f"{port.device}: {doing}")


def report_lines(report: PortReport) -> Iterator[str]:
    """What is said of a port, one thing a line."""
    what = (report.chip or _description(report.port), usb_identity(report.port))
    yield f"{report.port.device} {', '.join(filter(None, what))}".rstrip()
    found = report.recognition
    if found is not None:
        info = DRIVERS[found.protocol]
        gauges = "1 gauge" if found.channels == 1 else f"{found.channels} gauges"
        rate = f", {found.rate_hz:.4g} Hz" if found.rate_hz else ""
        tuning = f" at {report.line_settings}" if report.line_settings else ""
        yield f"  speaks {found.protocol}{tuning}: {info.title}; {gauges}{rate}; {info.verified}"
        if found.remark:
            yield f"  {found.remark}"
        yield f"  record with: {record_command(report)}"
    else:
        yield f"  {report.message}"
    for hint in report.hints:
        yield f"  {hint.message}"
        yield f"    {hint.remedy}"
    if any(hint.rule_helps for hint in report.hints):
        yield f"    for good: {install_rule()}"


def install_rule() -> str:
    """Commands that install the udev rule that is shipped."""
    copy = f"sudo cp {shlex.quote(str(UDEV_RULE))} /etc/udev/rules.d/"
    return f"{copy} && sudo udevadm control --reload && sudo udevadm trigger"


def record_command(report: PortReport) -> str:
    """The command line that records from a port on which something was recognised; "" for others."""
    found = report.recognition
    if found is None:
        return ""
    words = ["slipstand", "record", "--port", report.port.device, "--protocol", found.protocol]
    usual = DRIVERS[found.protocol].default_baud_for(found.settings)
    if line := report.line_settings:
        words += ["--baud", str(line.baud)] if line.baud != usual else []
        words += ["--parity", line.parity] if line.parity != "N" else []
        words += ["--stop-bits", str(line.stop_bits)] if line.stop_bits != 1 else []
    for key, value in found.settings.items():
        words += ["--set", f"{key}={value}"]
    if found.rate_option:
        words += ["--rate", found.rate_option]
    if found.channels == 1:
        words += ["--relative-port", "PORT-OF-GAUGE-2"]
    return quote_command(words)


def port_document(report: PortReport) -> dict[str, Any]:
    """JSON object of a port."""
    found, line, speaks = report.recognition, report.line_settings, None
    if found is not None:
        speaks = {
            "protocol": found.protocol,
            "verified": DRIVERS[found.protocol].verified,
            "baud": line and line.baud,
            "parity": line and line.parity,
            "rate_hz": found.rate_hz,
            "channels": found.channels,
            "settings": found.settings,
            "share": found.share,
            "remark": str(found.remark),
            "command": record_command(report),
        }
    return {
        "port": report.port.device,
        "chip": report.chip,
        "description": _description(report.port),
        "vendor_id": report.port.vendor_id,
        "product_id": report.port.product_id,
        "serial_number": report.port.serial_number,
        "outcome": report.outcome,
        "message": str(report.message),
        "holders": [{"process": one.process, "program": one.program} for one in report.users],
        "speaks": speaks,
        "hints": [{"message": str(hint.message), "remedy": str(hint.remedy)} for hint in report.hints],
    }


def usb_identity(port: PortInfo) -> str:
    """USB numbers of a port as text; "" for others."""
    if port.vendor_id is None or port.product_id is None:
        return ""
    return f"USB {port.vendor_id:04x}:{port.product_id:04x} {port.serial_number}".rstrip()


def _description(port: PortInfo) -> str:
    return "" if port.description == "n/a" else port.description
