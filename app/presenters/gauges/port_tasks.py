"""Functions of the tab Ports and devices for its worker process, and the text about each port."""

from dataclasses import replace
from functools import partial

from analysis.formatting import with_unit
from app.presenters.base import EMPTY_CHIP, Chip, Progress, ReportProgress, Tone
from app.presenters.gauges.state import PortCard
from app.presenters.navigator import ConnectForm
from drivers.host_checks import usb_chip_name
from drivers.port import PortInfo, list_ports, list_streams
from drivers.port_probe import PortReport, ProbeOutcome, probe_port
from drivers.recognition import Recognition
from drivers.registry import DRIVERS
from messages.i18n import N_, gettext, translate
from messages.message import Message, message, replace_options

_LABELS = {"--write": message("“Ask silent devices, too”"), "--set": message("device settings")}
"""Controls of the window in place of options of the command line."""
_OUTCOMES = {
    ProbeOutcome.UNREADABLE: Chip(N_("something speaks that is not known"), Tone.WARN),
    ProbeOutcome.SILENT: Chip(N_("silent"), Tone.PLAIN),
    ProbeOutcome.IN_USE: Chip(N_("in use by another program"), Tone.WARN),
    ProbeOutcome.UNAVAILABLE: Chip(N_("cannot be opened"), Tone.BAD),
}


def list_port_cards() -> tuple[PortCard, ...]:
    """List the ports of this computer without opening them."""
    return tuple(listed_port(port) for port in list_ports())


def probe_ports(query_silent: bool, connected: str, report: ReportProgress) -> tuple[PortCard, ...]:
    """Probe ports and LSL streams but `connected`; with `query_silent`, send requests to silent devices."""
    present = [*list_ports(), *list_streams()]
    cards = []
    for number, port in enumerate(present):
        if port.device == connected:
            cards.append(listed_port(port, Chip(gettext("connected here"), Tone.OK)))
            continue
        tell = partial(_report_step, report, port.device, number / len(present))
        tell(message("looking"))
        cards.append(probed_port(probe_port(port, query_silent, tell)))
    return tuple(cards)


def _report_step(report: ReportProgress, device: str, fraction: float, step: Message) -> None:
    report(Progress(f"{device}: {translate(step)}", fraction))


def listed_port(port: PortInfo, status: Chip = EMPTY_CHIP) -> PortCard:
    """Card of a port that was not probed."""
    known = usb_chip_name(port.vendor_id, port.product_id) or port.description.replace("n/a", "")
    usb = port.identity.removeprefix(port.device).strip()
    return PortCard(port.device, ", ".join(part for part in (known, usb) if part), status)


def probed_port(report: PortReport) -> PortCard:
    """Card of a port that was probed."""
    card = listed_port(report.port)
    hints = tuple(f"{translate(hint.message)}. {translate(hint.remedy)}" for hint in report.hints)
    found = report.recognition
    if found is None:
        status = _OUTCOMES[report.outcome]
        words = translate(replace_options(report.message, _LABELS))
        return replace(card, status=replace(status, text=gettext(status.text)), description=(words, *hints))
    info = DRIVERS[found.protocol]
    title = gettext(info.title)
    if report.line_settings:
        line = report.line_settings
        frame = f"8{line.parity}{line.stop_bits}"
        title = gettext("{title} at {baud} baud {frame}", title=title, baud=line.baud, frame=frame)
    remark = (translate(replace_options(found.remark, _LABELS)),) if found.remark else ()
    return replace(
        card,
        status=Chip(title, Tone.OK, gettext("Protocol {protocol}", protocol=found.protocol)),
        description=(
            f"{_signal(found)}; {info.say_verified(gettext)}",
            *remark,
            *hints,
        ),
        suggested_form=suggested_form(report, found),
        needs_second=found.channels == 1,
    )


def suggested_form(report: PortReport, found: Recognition) -> ConnectForm:
    """Form of Start that connects to the device; empty fields take the defaults of the protocol."""
    line_settings = report.line_settings
    usual = DRIVERS[found.protocol].default_baud_for(found.settings)
    return ConnectForm(
        port=report.port.device,
        protocol=found.protocol,
        baud="" if line_settings is None or line_settings.baud == usual else str(line_settings.baud),
        rate_hz=found.rate_option,
        parity="N" if line_settings is None else line_settings.parity,
        settings=" ".join(f"{key}={value}" for key, value in found.settings.items()),
    )


def _signal(found: Recognition) -> str:
    one = gettext("1 gauge, so choose the port of gauge 2 too")
    gauges = one if found.channels == 1 else f"{found.channels} gauges"
    return gauges + (f", {with_unit(f'{found.rate_hz:.4g}', 'Hz')}" if found.rate_hz else "")
