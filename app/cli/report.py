"""`slipstand report`: a test report to sign, as PDF."""

import datetime

from app.cli import output as out
from app.cli.campaigns import excluded_runs, exit_with_failures, load_campaign
from app.cli.errors import CommandError
from app.cli.option_values import executor_options
from app.cli.result_options import ReportOptions
from app.cli.table import table_content
from app.reports.test_report.build import TITLE, ReportHead, build_report
from app.reports.test_report.render import write_report


def report(options: ReportOptions) -> None:
    head = _head(options.date, options.title, options.laboratory)
    target = out.output_file(options.output, options.force, (".pdf",))
    executor, excluded = executor_options(options.jobs), excluded_runs(options.paths, options.exclude or [])
    gathered, campaign = load_campaign(options.paths, executor, excluded=excluded)
    if not gathered.runs:
        fault = gathered.failures[0].error if gathered.failures else "all are left out"
        raise CommandError(f"none of the runs gives a result: {fault}")
    content = table_content(gathered, campaign)
    made = build_report(gathered, content, head)
    write_report(made, target, replace=options.force)
    if options.as_json:
        runs = [run.name for run in gathered.runs]
        failures = [{"run": run, "error": error} for run, error in content.failures]
        out.print_json({"report": str(target), "date": made.date, "runs": runs, "failures": failures})
    else:
        out.print_line(str(target))
    exit_with_failures(content.failures)


def _head(date: str, title: str, laboratory: str) -> ReportHead:
    try:
        day = datetime.date.fromisoformat(date) if date else datetime.datetime.now().astimezone().date()
    except ValueError:
        raise CommandError(f"--date {date!r} is no date. Write it as 2026-11-21") from None
    return ReportHead(day, title.strip() or TITLE, laboratory.strip())
