"""What was found on a port, in words, and how to record from it. Loaded in the worker's process only."""

from dataclasses import replace

from app.presenters.base import EMPTY_CHIP, Chip, Tone
from app.presenters.gauges.state import PortCard
from app.presenters.number_text import with_unit
from app.presenters.start.state import ConnectForm
from drivers.port import PortInfo
from drivers.probe.host_checks import usb_chip_name
from drivers.probe.recognition import Recognition
from drivers.probe.report import PortReport, ProbeOutcome
from drivers.registry import PROTOCOLS
from messages.i18n import N_, gettext, translate

_SAID = {
    ProbeOutcome.UNREADABLE: Chip(N_("something speaks that is not known"), Tone.WARN),
    ProbeOutcome.SILENT: Chip(N_("silent"), Tone.PLAIN),
    ProbeOutcome.IN_USE: Chip(N_("in use by another program"), Tone.WARN),
    ProbeOutcome.UNAVAILABLE: Chip(N_("cannot be opened"), Tone.BAD),
}


def listed_port(port: PortInfo, finding: Chip = EMPTY_CHIP) -> PortCard:
    """A port as the system knows it."""
    known = usb_chip_name(port.vendor_id, port.product_id) or port.description.replace("n/a", "")
    usb = port.identity.removeprefix(port.device).strip()
    return PortCard(port.device, ", ".join(part for part in (known, usb) if part), finding)


def probed_port(report: PortReport) -> PortCard:
    """A port that was looked at."""
    card = listed_port(report.port)
    hints = tuple(translate(f"{hint.message}. {hint.remedy}") for hint in report.hints)
    found = report.recognition
    if found is None:
        return PortCard(
            card.url,
            card.identity,
            replace(_SAID[report.outcome], text=gettext(_SAID[report.outcome].text)),
            (_in_window(report.message), *hints),
        )
    info = PROTOCOLS[found.protocol]
    tuning = f" at {report.line_settings}" if report.line_settings else ""
    remark = (_in_window(found.remark),) if found.remark else ()
    return PortCard(
        card.url,
        card.identity,
        Chip(f"{info.title}{tuning}", Tone.OK, gettext("Protocol {protocol}", protocol=found.protocol)),
        (f"{_signal(found)}; {translate(info.verified)}", *remark, *hints),
        suggested_form(report, found),
    )


def suggested_form(report: PortReport, found: Recognition) -> ConnectForm:
    """How the start page is filled in for it; what is usual is left to the protocol."""
    tuning = report.line_settings
    usual = PROTOCOLS[found.protocol].default_baud_for(found.settings)
    return ConnectForm(
        port=report.port.device,
        protocol=found.protocol,
        baud="" if tuning is None or tuning.baud == usual else str(tuning.baud),
        rate_hz=found.rate_option,
        parity="N" if tuning is None else tuning.parity,
        settings=" ".join(f"{key}={value}" for key, value in found.settings.items()),
    )


def _signal(found: Recognition) -> str:
    one = gettext("1 gauge, so choose the port of gauge 2 too")
    gauges = one if found.channels == 1 else f"{found.channels} gauges"
    return gauges + (f", {with_unit(f'{found.rate_hz:.4g}', 'Hz')}" if found.rate_hz else "")


def _in_window(words: str) -> str:
    """What is said of options of the command line, for the window."""
    asked = translate(words).replace(
        "try --write, which asks the device who it is", "tick 'Ask silent devices, too', and look again"
    )
    return asked.replace("--set ", "device settings ")
