"""`slipstand table`: the paper's Table 1 from runs, with uncertainties and repeats."""

import shutil
from dataclasses import replace
from pathlib import Path

import msgspec

from analysis.audit import PublishedRow, audit
from analysis.campaign.campaign import Campaign, compare_with_published
from analysis.catalogue import optional_columns
from app.cli import output as out
from app.cli.campaigns import exit_with_failures, load_campaign
from app.cli.errors import CommandError, alternatives
from app.cli.result_options import TableOptions
from app.reports.table.files import as_text, write_table
from app.reports.table.formats import FORMAT_OF_ENDING
from app.reports.table.text import PublishedRowComparison, TableContent, note_sections
from app.runs.campaign.origin import campaign_command
from config.files import load_stand, published_table

_WIDTH_MIN, _UNLIMITED = 40, 1_000_000  # columns of a narrow terminal, and of a pipe


def table(options: TableOptions) -> None:
    name = _format(options.format_name, options.output, as_json=options.as_json)
    target = out.output_file(options.output, options.force) if options.output else None
    columns = _columns(options.column)
    runs = load_campaign(options.paths, options.jobs, exclude=options.exclude, save=options.save)
    published = _published(runs.campaign()) if options.published else None
    content = TableContent.of_runs(runs, _reproduce(options), published)
    content = replace(content, columns=columns)
    if target is not None:
        write_table(content, target, name, with_repeats=options.repeats, replace=options.force)
        out.print_line(str(target))
    else:
        width = max(shutil.get_terminal_size((_UNLIMITED, 0)).columns, _WIDTH_MIN)
        text = as_text(content, name, width, with_repeats=options.repeats)
        out.print_document(text, is_json=name == "json")
    if target or name in ("csv", "latex"):  # which do not show the notes; failures are printed at the end
        for title, sentences in note_sections(replace(content, failures=())):
            for sentence in sentences:
                out.print_status(f"{title}: {sentence}")
    exit_with_failures(runs)


def _reproduce(options: TableOptions) -> str:
    """Command that gives the same table, of the runs as they are."""
    chosen = {"--column": options.column, "--exclude": options.exclude}
    words = [word for name, values in chosen.items() for value in values or () for word in (name, value)]
    words += ["--published"] if options.published else []
    return campaign_command("table", options.paths, words)


def _format(name: str | None, output: Path | None, *, as_json: bool) -> str:
    if as_json and name not in (None, "text", "json"):
        raise CommandError(f"--json and --format {name} contradict each other. Give one of them")
    if as_json:
        return "json"
    if name is None:
        name = FORMAT_OF_ENDING.get(output.suffix.lower()) if output and output.suffix else "text"
    if name is None:
        endings = alternatives(list(FORMAT_OF_ENDING))
        raise CommandError(f"-o {output} has no known ending. Use {endings}, or give --format")
    if name == "xlsx" and output is None:
        raise CommandError("--format xlsx is a file. Say where it goes: -o TABLE.xlsx")
    return name


def _columns(wanted: list[str] | None) -> tuple[str, ...]:
    for name in wanted or []:
        if name not in optional_columns():
            raise CommandError(f"--column {name!r} is not known. Use {', '.join(optional_columns())}")
    return tuple(wanted or ())


def _published(campaign: Campaign) -> dict[str, PublishedRowComparison]:
    """The paper's rows of the series that were found, with the flags of the audit."""
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
