"""`slipstand table`: the paper's Table 1 from runs, with uncertainties and repeats."""

import shutil
import sys
from dataclasses import replace
from pathlib import Path

import msgspec

from analysis.audit import PublishedRow, audit
from analysis.campaign.campaign import Campaign, compare_with_published
from app.cli import output as out
from app.cli.campaigns import excluded_runs, exit_with_failures, load_campaign
from app.cli.errors import CommandError
from app.cli.option_values import executor_options
from app.cli.result_options import TableOptions
from app.reports.table.content import PublishedRowComparison, TableContent
from app.reports.table.files import as_text, write_text, write_workbook
from app.reports.table.text import note_sections
from app.runs.campaign.collect import CollectedRuns
from config.files import load_stand, published_table

_WIDTH_MIN, _ENDLESS = 40, 1_000_000


def table(options: TableOptions) -> None:
    name = _format(options.format_name, options.output, as_json=options.as_json)
    target = out.output_file(options.output, options.force) if options.output else None
    executor, excluded = executor_options(options.jobs), excluded_runs(options.paths, options.exclude or [])
    gathered, campaign = load_campaign(options.paths, executor, save=options.save, excluded=excluded)
    content = table_content(gathered, campaign, published=options.published)
    _write_table(content, name, target, with_repeats=options.repeats, replace=options.force)
    if target or name in ("csv", "latex"):
        _print_remarks(content)
    exit_with_failures(content.failures)


def _format(name: str, output: Path | None, *, as_json: bool) -> str:
    if as_json and name not in ("text", "json"):
        raise CommandError(f"--json and --format {name} contradict each other. Give one of them")
    name = "json" if as_json else name
    if name == "xlsx" and output is None:
        raise CommandError("--format xlsx is a file. Say where it goes: -o TABLE.xlsx")
    return name


def table_content(gathered: CollectedRuns, campaign: Campaign, *, published: bool = False) -> TableContent:
    """Put together all that goes into a table, or into a report; beside the paper's where `published`."""
    return TableContent(
        campaign,
        gathered.warnings,
        tuple((failure.run, str(failure.reason)) for failure in gathered.failures),
        _published(campaign) if published else None,
    )


def _published(campaign: Campaign) -> dict[str, PublishedRowComparison]:
    """The paper's rows of the series that were found, with what the audit says of them."""
    stand = load_stand()
    printed = msgspec.convert(published_table(), dict[str, PublishedRow], from_attributes=True)
    beside = compare_with_published(campaign.rows, printed)
    audited = audit(
        [printed[label] for label in beside],
        table_mass_kg=stand.table_mass_kg,
        pullbacks_m={label: stand.series(label).pullback_m for label in beside},
        gravity_m_per_s2=stand.gravity_m_per_s2,
    )
    flags = {row.series: tuple(row.flags) for row in audited}
    return {label: PublishedRowComparison(figures, flags[label]) for label, figures in beside.items()}


def _write_table(
    content: TableContent, name: str, target: Path | None, *, with_repeats: bool, replace: bool
) -> None:
    if name == "xlsx" and target is not None:
        write_workbook(content, target, replace=replace)
    else:
        text = as_text(content, name, _width(target), with_repeats=with_repeats)
        if target is None:
            sys.stdout.write(text)
            return
        write_text(text, target, replace=replace)
    out.print_line(str(target))


def _width(target: Path | None) -> int:
    """Columns of the terminal, or of COLUMNS; a file or a pipe has no end."""
    if target is not None:
        return _ENDLESS
    return max(shutil.get_terminal_size((_ENDLESS, 0)).columns, _WIDTH_MIN)


def _print_remarks(content: TableContent) -> None:
    """Say on stderr what the format itself does not show; runs without a result are told at the end."""
    for title, sentences in note_sections(replace(content, failures=())):
        for sentence in sentences:
            out.print_status(f"{title}: {sentence}")
