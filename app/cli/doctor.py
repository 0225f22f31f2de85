"""`slipstand doctor`: looks the installation over, and says what to do."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

import typer

from app.cli.options import Json

if TYPE_CHECKING:
    from app.cli.checkup.finding import Finding


def doctor(as_json: Json = False) -> None:
    """Check installation, settings, gauges, ports and clocks.

    Recordings are checked too. Ends with 1 if something fails.
    """
    from dataclasses import asdict

    from app.cli import output as out
    from app.cli.checkup.finding import State

    findings = []
    for finding in _findings():
        findings.append(finding)
        if not as_json:
            out.say(f"{finding.state:4}  {finding.subject}: {finding.message}")
            if finding.remedy:
                out.say(f"      {finding.remedy}")
    failed = sum(finding.state is State.FAIL for finding in findings)
    if as_json:
        out.emit_json({"ok": not failed, "checks": [asdict(finding) for finding in findings]})
    if failed:
        raise typer.Exit(1)


_CHECKS = (
    ("installation", "check_installation"),
    ("folders", "check_folders"),
    ("gauges", "check_gauges"),
    ("ports", "check_ports"),
    ("clocks", "check_clocks"),
)


def _findings() -> "Iterator[Finding]":
    """What all checks find; one that breaks down, as for want of a library, does not hide the others."""
    from importlib import import_module

    from app.cli.checkup.finding import fail

    for module, check in _CHECKS:
        try:
            yield from getattr(import_module(f"app.cli.checkup.{module}"), check)()
        except Exception as error:
            fault = " ".join(f"{type(error).__name__}: {error}".split())
            yield fail(module, f"cannot be checked ({fault})", "Install again, or report this")
