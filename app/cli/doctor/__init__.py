"""`slipstand doctor`: looks the installation over, and says what to do."""

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from enum import StrEnum
from importlib import import_module

import typer

from app.cli import output as out
from app.cli.run_file_options import DoctorOptions


class FindingState(StrEnum):
    """How well it stands."""

    OK = "ok"
    WARN = "warn"
    FAIL = "fail"


@dataclass(frozen=True, slots=True)
class Finding:
    """One line of `slipstand doctor`; what is not ok has a remedy."""

    subject: str
    state: FindingState
    message: str
    remedy: str = ""


def ok(subject: str, message: str) -> Finding:
    """All is well."""
    return Finding(subject, FindingState.OK, message)


def warn(subject: str, message: str, remedy: str) -> Finding:
    """Work is possible, but something is lost or uncertain."""
    return Finding(subject, FindingState.WARN, message, remedy)


def fail(subject: str, message: str, remedy: str) -> Finding:
    """Something does not work."""
    return Finding(subject, FindingState.FAIL, message, remedy)


def doctor(options: DoctorOptions) -> None:
    target = out.output_file(options.bundle, options.force) if options.bundle else None
    if options.compile_code:
        out.print_status("compiling, up to a minute and a half")
        import_module("app.cli.doctor.compilation").compile_all()
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
    ("effects of the stand", "stand", "check_effects"),
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
