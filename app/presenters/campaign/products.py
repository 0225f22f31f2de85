"""Products of a campaign: table, figures and report. It loads matplotlib and typst."""

import datetime
from pathlib import Path

from app.presenters.base import Progress, ReportProgress
from app.presenters.campaign.state import CampaignScope, Product
from app.presenters.campaign.tasks import collected_runs
from app.reports.figures.figure_files import NUMBERS, FigureFolder, representative_runs, write_figures
from app.reports.table.files import write_table
from app.reports.table.formats import FORMAT_OF_ENDING
from app.reports.table.text import TableContent
from app.reports.test_report.build import build_report
from app.reports.test_report.head import read_head
from app.reports.test_report.render import write_report
from app.runs.campaign.collect import CollectedRuns
from app.runs.campaign.origin import campaign_command
from messages.i18n import gettext, translate
from messages.message import Message


def write_product(
    scope: CampaignScope, product: Product, path: str, report: ReportProgress
) -> tuple[str, ...]:
    """Write a product of a folder; return the files. Raises RunError.

    Tables and reports replace a file: the dialog has asked. Figures go to a folder and replace nothing.
    """
    target, runs = Path(path), collected_runs(scope, report)
    report(Progress(gettext("Writing {file}", file=target.name)))
    if product is Product.FIGURES:
        return _write_figures(target, runs, report)
    command = "table" if product is Product.TABLE else "report"
    content = TableContent.of_runs(runs, _reproduce(command, scope, runs))
    if product is Product.TABLE:
        name = FORMAT_OF_ENDING.get(target.suffix.lower(), "text")
        write_table(content, target, name, with_repeats=True, replace=True)
    else:
        head = read_head(datetime.datetime.now().astimezone().date())
        write_report(build_report(runs, content, head), target, replace=True)
    return (str(target),)


def _reproduce(command: str, scope: CampaignScope, runs: CollectedRuns) -> str:
    """Command line that gives the same: it counts simulated runs unless they are excluded."""
    left_out = () if runs.counts_simulated else runs.simulated
    words = [word for path in left_out for word in ("--exclude", f"{path}=simulated")]
    return campaign_command(command, [Path(scope.folder)], words)


def _write_figures(target: Path, runs: CollectedRuns, report: ReportProgress) -> tuple[str, ...]:
    """Write Fig. 2 of all runs, and the figures of a representative run."""

    def drawing(share: float, run: str | Message) -> None:
        report(Progress(gettext("Drawing {run}", run=translate(run)), share))

    campaign = runs.campaign()
    chosen = representative_runs(campaign, runs.runs) if campaign.rows else []
    folder = FigureFolder(str(target))
    folder.check()
    files, _ = write_figures(folder, NUMBERS, chosen, campaign, runs.stands.values(), drawing)
    return tuple(file.file for file in files)
