"""`slipstand doctor`: looks the installation over, and says what to do."""

from collections.abc import Iterator
from dataclasses import asdict
from importlib import import_module

import typer

from app.cli import output as out
from app.cli.doctor import Finding, FindingState, fail
from app.cli.run_file_options import DoctorOptions


def doctor(options: DoctorOptions) -> None:
    """Check installation, settings, gauges, ports and clocks."""
    target = out.output_file(options.bundle, options.force) if options.bundle else None
    findings = []
    for finding in _findings():
        findings.append(finding)
        if not options.as_json:
            out.print_line(f"{finding.state:4}  {finding.subject}: {finding.message}")
            if finding.remedy:
                out.print_line(f"      {finding.remedy}")
    failed = sum(finding.state is FindingState.FAIL for finding in findings)
    if options.as_json:
        out.print_json({"ok": not failed, "checks": [asdict(finding) for finding in findings]})
    if target is not None:
        out.print_status(f"wrote {target}. It holds no recording, but:")
        for line in import_module("app.cli.doctor.bundle").write_bundle(target, findings):
            out.print_status(f"  {line}")
    if failed:
        raise typer.Exit(1)


_CHECKS = (
    ("installation", "installation", "check_installation"),
    ("folders", "folders", "check_folders"),
    ("gauges", "folders", "check_gauges"),
    ("ports", "ports", "check_ports"),
    ("clocks", "installation", "check_clocks"),
)
"""Subject, module and function of each check."""


def _findings() -> Iterator[Finding]:
    """Findings of all checks. A check that raises, as for a missing library, does not hide the others."""
    for subject, module, check in _CHECKS:
        try:
            yield from getattr(import_module(f"app.cli.doctor.{module}"), check)()
        except Exception as error:
            fault = " ".join(f"{type(error).__name__}: {error}".split())
            yield fail(subject, f"cannot be checked ({fault})", "Install again, or report this")
