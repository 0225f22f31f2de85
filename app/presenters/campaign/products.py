"""Products of a campaign: table, figures and report. It loads matplotlib and typst."""

import datetime
from pathlib import Path

from analysis.campaign.campaign import Campaign
from app.presenters.base import Progress, ReportProgress
from app.presenters.campaign.state import Product
from app.presenters.campaign.tasks import collected_runs
from app.reports.figures.figure_files import NUMBERS, FigureFolder, representative_runs, write_figures
from app.reports.table.content import TableContent
from app.reports.table.files import as_text, write_text, write_workbook
from app.reports.test_report.build import TITLE, ReportHead, build_report
from app.reports.test_report.render import write_report
from app.runs.campaign.collect import CollectedRuns
from messages.i18n import gettext

_TABLE_FORMATS = {".csv": "csv", ".json": "json", ".md": "markdown", ".tex": "latex"}
_UNLIMITED_WIDTH = 1_000_000
"""Width of a text that is not printed on a terminal."""


def write_product(folder: str, product: Product, path: str, report: ReportProgress) -> tuple[str, ...]:
    """Write a product of a folder; return the files. Raises RunError.

    Tables and reports replace a file: the dialog has asked. Figures go to a folder and replace nothing.
    """
    target, runs = Path(path), collected_runs(folder, report)
    campaign = runs.campaign()
    report(Progress(gettext("Writing {file}", file=target.name)))
    if product is Product.FIGURES:
        return _write_figures(target, runs, campaign, report)
    failures = tuple((failure.run, str(failure.reason)) for failure in runs.failures)
    content = TableContent(campaign, runs.warnings, failures)
    if product is Product.TABLE:
        _write_table(target, content)
    else:
        head = ReportHead(datetime.datetime.now().astimezone().date(), TITLE, "")
        write_report(build_report(runs, content, head), target, replace=True)
    return (str(target),)


def _write_table(target: Path, content: TableContent) -> None:
    """Write a table in the format of the suffix; text for an unknown one."""
    if target.suffix.lower() == ".xlsx":
        write_workbook(content, target, replace=True)
    else:
        name = _TABLE_FORMATS.get(target.suffix.lower(), "text")
        write_text(as_text(content, name, _UNLIMITED_WIDTH, with_repeats=True), target, replace=True)


def _write_figures(
    target: Path, runs: CollectedRuns, campaign: Campaign, report: ReportProgress
) -> tuple[str, ...]:
    """Write Fig. 2 of all runs, and Figs. 3a to 5b of a representative run."""

    def drawing(share: float, run: str) -> None:
        report(Progress(gettext("Drawing {run}", run=run), share))

    chosen = representative_runs(campaign, runs.runs) if campaign.rows else []
    folder = FigureFolder(str(target))
    folder.check()
    files, _ = write_figures(folder, NUMBERS, chosen, campaign, runs.stands.values(), drawing)
    return tuple(file.file for file in files)
