"""`slipstand report`: a test report to sign, as PDF."""

import datetime
from pathlib import Path
from typing import Annotated

import typer

from app.cli import output as out
from app.cli.campaigns import excluded_runs, exit_with_failures, load_campaign
from app.cli.errors import CommandError
from app.cli.options import Exclude, Force, JobOptions, Json, RunsOrFolders, with_options
from app.cli.table import table_content
from app.reports.test_report.build import TITLE, ReportHead, build_report
from app.reports.test_report.render import write_report


@with_options
def report(
    *,
    paths: RunsOrFolders,
    output: Annotated[Path, typer.Option("-o", "--output", help="PDF file to write.")],
    date: Annotated[
        str, typer.Option(metavar="YYYY-MM-DD", help="Date of the report; today if absent.")
    ] = "",
    title: Annotated[str, typer.Option(help="Title of the report.")] = "",
    laboratory: Annotated[str, typer.Option(help="Who issues it.")] = "",
    exclude: Exclude = None,
    jobs: JobOptions,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Write a test report of one run or a campaign, as PDF.

    It holds results, budgets, figures, warnings and fingerprints.
    The same runs give the same file to the byte, apart from its date.
    """
    if output.suffix.lower() != ".pdf":
        raise CommandError(f"-o {output.name} has no known ending. Use .pdf")
    head = _head(date, title, laboratory)
    target = out.output_file(output, force)
    executor, excluded = jobs.executor(), excluded_runs(paths, exclude or [])
    gathered, campaign = load_campaign(paths, executor, excluded=excluded)
    if not gathered.runs:
        fault = gathered.failures[0].error if gathered.failures else "all are left out"
        raise CommandError(f"none of the runs gives a result: {fault}")
    content = table_content(gathered, campaign)
    made = build_report(gathered, content, head)
    write_report(made, target, replace=force)
    if as_json:
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
