"""`slipstand device probe`: which ports are there, what speaks on them, and how to record from it."""

from typing import TYPE_CHECKING, Annotated

import typer

from app.cli.options import Json

if TYPE_CHECKING:
    from collections.abc import Callable

    from drivers.port import PortInfo


def probe(
    ports: Annotated[
        list[str] | None, typer.Argument(help="Ports or URLs to look at; all serial ports if absent.")
    ] = None,
    write: Annotated[
        bool,
        typer.Option("--write", help="Ask silent devices who they are. Without it nothing is sent to any."),
    ] = False,
    as_json: Json = False,
) -> None:
    """Look at ports: what speaks on them, how to record it.

    Also what is plugged in, and which program has it open.
    """
    from app.cli import output as out
    from app.cli.probe_text import document, lines
    from drivers.probe.report import probe_port

    present = _ports(ports)
    reports = []
    for port in present:
        report = probe_port(port, write, _teller(port))
        reports.append(report)
        if not as_json:
            for line in lines(report):
                out.say(line)
    if as_json:
        out.emit_json([document(report) for report in reports])
    elif not present:
        out.say("No serial port found. Plug the amplifier in, or try: slipstand device simulate")


def _teller(port: "PortInfo") -> "Callable[[str], None]":
    """Tells on stderr what is done on a port."""
    from app.cli import output as out

    return lambda doing: out.tell(f"{port.device}: {doing}")


def _ports(given: list[str] | None) -> "list[PortInfo]":
    """Ports to look at; of one that is given by another name or as a URL, what is known of it."""
    from drivers.port import info_of, list_ports

    return [info_of(url) for url in given] if given else list_ports()
