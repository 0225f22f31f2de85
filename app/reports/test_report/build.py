"""Building of a report from run files: of one run, or of a campaign."""

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from app.reports.figures.figure_files import representative_runs
from app.reports.table.text import TableContent
from app.reports.test_report import shared
from app.reports.test_report.blocks import Report, Section
from app.reports.test_report.campaign_report import CampaignReportInput, campaign_sections
from app.reports.test_report.head import ReportHead
from app.reports.test_report.run_report import run_sections
from app.runs.analysis_request import quote_command
from app.runs.analyze import repeat_saved_analysis
from app.runs.campaign.collect import CollectedRuns
from app.runs.origin import SIMULATED, is_simulated, program_document, software_text
from app.runs.reader import compute_fingerprint
from app.runs.validator import Validator


def build_report(gathered: CollectedRuns, content: TableContent, head: ReportHead) -> Report:
    """Build the report of the collected runs; of the run itself where there is only one.

    Raises RunError, AnalysisError.
    """
    with Validator() as validator:
        if len(gathered.runs) == 1 and not (gathered.failures or gathered.excluded):
            (run,) = gathered.runs
            return _run_report(Path(run.name), head, validator, content.origin.reproduce, run.excluded)
        content = replace(content, origin=content.origin.dated(head.date.isoformat()))
        chosen = representative_runs(content.campaign, gathered.runs) if content.campaign.rows else []
        material = CampaignReportInput(
            content,
            gathered,
            [compute_fingerprint(Path(run.name)) for run in gathered.runs],
            [repeat_saved_analysis(path, validator) for path in chosen],
            _folder([run.name for run in gathered.runs]),
        )
    subtitle = f"Campaign of {len(gathered.runs)} runs in {len(content.campaign.rows)} series"
    mark = content.origin.mark
    return _report(head.numbered(content.origin.inputs_hash), subtitle, campaign_sections(material), mark)


def build_run_report(path: Path, head: ReportHead) -> Report:
    """Build the report of one run. Raises RunError, AnalysisError."""
    words = ["slipstand", "report", str(path.absolute()), "-o", "REPORT.pdf", "--date", head.date.isoformat()]
    with Validator() as validator:
        return _run_report(path, head, validator, quote_command(words))


def _run_report(
    path: Path, head: ReportHead, validator: Validator, reproduce: str, excluded: str = ""
) -> Report:
    """Build the report of a run; `excluded` is why it does not count, where the run does not say so."""
    analysis = repeat_saved_analysis(path, validator)
    metadata = analysis.run.metadata
    subtitle = f"{metadata.series}, {path.name}" if metadata.series else path.name
    sections = run_sections(analysis, compute_fingerprint(path), reproduce, excluded or metadata.excluded)
    origin = analysis.document["origin"]
    mark = SIMULATED if is_simulated(origin) else ""
    return _report(head.numbered(origin["inputs_hash"]), subtitle, sections, mark)


def _report(head: ReportHead, subtitle: str, sections: list[Section], mark: str) -> Report:
    software = software_text(program_document()).capitalize()
    rows = [
        ("report number", head.number),
        ("date of issue", head.date.isoformat()),
        ("laboratory", "\n".join(filter(None, (head.laboratory, head.address)))),
        ("customer", head.customer),
        ("method", head.method),
    ]
    stated = shared.without_empty(rows).rows
    date = head.date.isoformat()
    return Report(head.title, subtitle, stated, head.logo, head.number, date, software, sections, mark)


def _folder(names: Sequence[str]) -> str:
    """Common folder of all runs; "" where there is none, as on two drives."""
    try:
        return os.path.commonpath([str(Path(name).parent) for name in names])
    except ValueError:
        return ""
