"""`slipstand report`: a test report to sign, as PDF."""

import datetime
from typing import Final

import msgspec

from app.cli import output as out
from app.cli.campaigns import exit_with_failures, load_campaign
from app.cli.errors import CommandError
from app.cli.result_options import ReportOptions
from app.reports.table.text import TableContent
from app.reports.test_report.build import build_report
from app.reports.test_report.head import ReportHead, read_head
from app.reports.test_report.render import write_report
from app.runs.campaign.origin import campaign_command


def report(options: ReportOptions) -> None:
    head = _head(options)
    target = out.output_file(options.output, options.force, (".pdf",))
    runs = load_campaign(options.paths, options.jobs, exclude=options.exclude)
    runs.require_result()
    content = TableContent.of_runs(runs, _reproduce(options, head))
    made = build_report(runs, content, head)
    write_report(made, target, replace=options.force)
    if options.as_json:
        failures = [{"run": run, "error": error} for run, error in content.failures]
        names = [run.name for run in runs.runs]
        document = {
            "report": str(target),
            "number": made.number,
            "date": made.date,
            "runs": names,
            "failures": failures,
        }
        out.print_json(document | {"origin": content.origin.document()})
    else:
        out.print_line(str(target))
    exit_with_failures(runs)


def _reproduce(options: ReportOptions, head: ReportHead) -> str:
    """Command that gives the same report, of the runs as they are."""
    words = ["--date", head.date.isoformat()]
    for name in _OF_HEAD:
        words += [f"--{name}", text] if (text := getattr(options, name)) else []
    words += [word for run in options.exclude or () for word in ("--exclude", run)]
    return campaign_command("report", options.paths, ["-o", "REPORT.pdf", *words])


def _head(options: ReportOptions) -> ReportHead:
    """Head of the report: what the options say, else the settings.

    Raises CommandError, ConfigError, RunError.
    """
    try:
        today = datetime.datetime.now().astimezone().date()
        day = datetime.date.fromisoformat(options.date) if options.date else today
    except ValueError:
        raise CommandError(f"--date {options.date!r} is no date. Write it as 2026-11-21") from None
    given = {name: text for name in _OF_HEAD if (text := getattr(options, name).strip())}
    return msgspec.structs.replace(read_head(day), **given)


_OF_HEAD: Final = ("title", "number", "laboratory", "customer", "method")
