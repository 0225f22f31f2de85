"""`slipstand report`: a test report to sign, as PDF."""

import datetime

from app.cli import output as out
from app.cli.campaigns import exit_with_failures, load_campaign
from app.cli.errors import CommandError
from app.cli.result_options import ReportOptions
from app.reports.table.text import TableContent
from app.reports.test_report.build import TITLE, ReportHead, build_report
from app.reports.test_report.render import write_report


def report(options: ReportOptions) -> None:
    head = _head(options.date, options.title, options.laboratory)
    target = out.output_file(options.output, options.force, (".pdf",))
    runs = load_campaign(options.paths, options.jobs, exclude=options.exclude)
    if not runs.runs:
        fault = runs.failures[0].error if runs.failures else "all are left out"
        raise CommandError(f"none of the runs gives a result: {fault}")
    content = TableContent.of_runs(runs)
    made = build_report(runs, content, head)
    write_report(made, target, replace=options.force)
    if options.as_json:
        failures = [{"run": run, "error": error} for run, error in content.failures]
        names = [run.name for run in runs.runs]
        out.print_json({"report": str(target), "date": made.date, "runs": names, "failures": failures})
    else:
        out.print_line(str(target))
    exit_with_failures(runs)


def _head(date: str, title: str, laboratory: str) -> ReportHead:
    try:
        day = datetime.date.fromisoformat(date) if date else datetime.datetime.now().astimezone().date()
    except ValueError:
        raise CommandError(f"--date {date!r} is no date. Write it as 2026-11-21") from None
    return ReportHead(day, title.strip() or TITLE, laboratory.strip())
