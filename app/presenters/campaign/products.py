"""Table, figures and report of a campaign, by the code of the command line. Runs in the worker's process."""

import datetime
from pathlib import Path

from analysis.campaign.campaign import Campaign
from app.presenters.base import Progress
from app.presenters.campaign.state import Product
from app.presenters.worker import ReportProgress
from app.reports.table.content import TableContent
from app.runs.campaign.collect import CollectedRuns
from messages.i18n import gettext

_TABLE_FORMATS = {".csv": "csv", ".json": "json", ".md": "markdown", ".tex": "latex"}
_ENDLESS = 1_000_000
"""Width of a text that is not for a terminal."""


def write_product(
    product: Product, target: Path, gathered: CollectedRuns, campaign: Campaign, report: ReportProgress
) -> tuple[str, ...]:
    """Write a product, over a file of that name as the dialog has asked; returns the files.

    Figures go to a folder, and never over others. Raises RunError.
    """
    report(Progress(gettext("Writing {file}", file=target.name)))
    if product is Product.FIGURES:
        return _figures(target, gathered, campaign, report)
    failures = tuple((failure.run, failure.reason) for failure in gathered.failures)
    content = TableContent(campaign, gathered.warnings, failures)
    if product is Product.TABLE:
        _table(target, content)
    else:
        _report(target, gathered, content)
    return (str(target),)


def _table(target: Path, content: TableContent) -> None:
    """In the format that the name of the file says; text where it says none."""
    from app.reports.table.files import as_text, write_text, write_workbook

    if target.suffix.lower() == ".xlsx":
        write_workbook(content, target, replace=True)
    else:
        name = _TABLE_FORMATS.get(target.suffix.lower(), "text")
        write_text(as_text(content, name, _ENDLESS, with_repeats=True), target, replace=True)


def _report(target: Path, gathered: CollectedRuns, content: TableContent) -> None:
    from app.reports.test_report.build import TITLE, ReportHead, build_report
    from app.reports.test_report.render import write_report

    head = ReportHead(datetime.datetime.now().astimezone().date(), TITLE, "")
    write_report(build_report(gathered, content, head), target, replace=True)


def _figures(
    target: Path, gathered: CollectedRuns, campaign: Campaign, report: ReportProgress
) -> tuple[str, ...]:
    """Fig. 2 of all runs, and Figs. 3a to 5b of the run that stands for them."""
    from app.reports.figures.figure_files import NUMBERS, FigureFolder, representative_runs, write_figures

    def drawing(share: float, run: str) -> None:
        report(Progress(gettext("Drawing {run}", run=run), share))

    chosen = representative_runs(campaign, gathered.runs) if campaign.rows else []
    folder = FigureFolder(str(target))
    folder.check()
    files, _ = write_figures(folder, NUMBERS, chosen, campaign, gathered.stands.values(), drawing)
    return tuple(file.file for file in files)
