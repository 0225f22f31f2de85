"""What the report of a campaign says."""

import math
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import msgspec

from analysis.campaign.contacts import friction_by_contact
from analysis.campaign.pooling import PooledQuantity
from analysis.campaign.series import RunResult
from analysis.catalogue import Place, QuantityDefinition
from analysis.formatting import format_uncertainty, format_value, typeset, typeset_sentence
from app.reports.figures.friction_figure import CAPTION, contact_names, friction_figure
from app.reports.figures.run_figures import RUN_FIGURES, RunFigureData
from app.reports.figures.style import print_style
from app.reports.table.content import TableContent, row_cells, table_quantities
from app.reports.table.text import LEGEND, REPEATS_LEGEND, note_sections, repeats_grid
from app.reports.test_report.blocks import (
    Block,
    Cell,
    Drawing,
    Drawings,
    Facts,
    Grid,
    Points,
    Section,
    Symbol,
    Text,
)
from app.reports.test_report.shared import (
    drawing,
    fingerprint_columns,
    gauges_section,
    procedure,
    signatures,
    stand_section,
    without_empty,
)
from app.runs.analyze import Analysis
from app.runs.campaign.collect import CollectedRuns
from app.runs.campaign.run_result import RunDetails
from app.runs.reader import Fingerprint

_FRICTION = "friction_dynamic"
_DRAWN: Final = ("3a", "3b", "4a", "4b", "5a")
_VERDICTS: Final = {True: "fits", False: "does NOT fit", None: "no law fitted"}
_ALWAYS_SAID: Final = ("Runs that do not count", "Runs without a result")


@dataclass(frozen=True, eq=False, slots=True)
class CampaignReportInput:
    """What a report of a campaign is made of."""

    content: TableContent
    gathered: CollectedRuns
    prints: Sequence[Fingerprint]
    """Of every run that was read, in the order of `gathered.runs`."""
    shown: Sequence[Analysis]
    """Runs whose motion is drawn."""
    folder: str
    """That all runs lie in; paths are told from there."""


def campaign_sections(material: CampaignReportInput) -> list[Section]:
    """All sections of the report of a campaign."""
    gathered, rows = material.gathered, material.content.campaign.rows
    table: list[list[Cell]] = [[typeset_sentence(text) for text in row_cells(row)] for row in rows]
    header, scatter = repeats_grid(material.content)
    heads: list[Cell] = ["series", "n", *_heads(table_quantities())]
    return [
        Section("Campaign", [_summary(material)]),
        *_said(material),
        Section(
            "Table of results",
            [Grid(heads, table, numbers=len(heads) - 1, small=True, note=LEGEND)],
            wide=True,
        ),
        Section("Uncertainty of the dynamic friction coefficient", list(_budget(material)), wide=True),
        Section(
            "Repeatability",
            [
                Grid(
                    ["series", *_heads(table_quantities()[1:], with_units=False)],
                    [list(row) for row in scatter],
                    len(header) - 1,
                    small=True,
                    note=REPEATS_LEGEND,
                )
            ],
            wide=True,
        ),
        Section("Figures", list(_figures(material))),
        stand_section(list(gathered.stands.values())),
        gauges_section(list(gathered.gauges.values())),
        procedure(),
        Section("Runs", [_runs(material)], wide=True),
        Section("Data", fingerprint_columns(_named(material))),
        signatures(),
    ]


def _heads(quantities: Sequence[QuantityDefinition], *, with_units: bool = True) -> list[Cell]:
    return [
        Symbol(row.symbol.markup, row.unit_at(Place.TABLE).symbol if with_units else "") for row in quantities
    ]


def _summary(material: CampaignReportInput) -> Facts:
    gathered, campaign = material.gathered, material.content.campaign
    facts = [gathered.details[run.name] for run in gathered.runs]
    days = sorted(one.start_time.date().isoformat() for one in facts)
    contacts = contact_names(gathered.stands.values())
    codes = dict.fromkeys(row.series.contact for row in campaign.rows)
    counted = sum(len(row.runs) for row in campaign.rows)
    rows = [
        (
            "runs",
            f"{counted} counted, {len(campaign.excluded)} left out, {len(material.content.failures)} failed",
        ),
        ("series", str(len(campaign.rows))),
        (
            "contacts",
            "\n".join(
                f"{code or 'not named'}: {contacts.get(code, 'not one of the stand')}" for code in codes
            ),
        ),
        ("recorded", "" if not days else days[0] if days[0] == days[-1] else f"{days[0]} to {days[-1]}"),
        ("operators", ", ".join(sorted({one.operator for one in facts if one.operator}))),
        ("stand", ", ".join(stand.name for stand in gathered.stands.values())),
        ("source", ", ".join(sorted({one.source for one in facts if one.source}))),
    ]
    return without_empty(rows)


def _said(material: CampaignReportInput) -> Iterator[Section]:
    """What the campaign says in sentences; that nothing was left out is said too."""
    said = dict(note_sections(material.content))
    for title in dict.fromkeys((*said, *_ALWAYS_SAID)):
        texts = [typeset_sentence(_local(text, material)) for text in said.get(title, ())]
        yield Section(title, [Points(texts) if texts else Text("None.")])


def _local(text: str, material: CampaignReportInput) -> str:
    """Text with the paths of runs from the folder on that all lie in."""
    return text.replace(material.folder + os.sep, "") if material.folder else text


def _budget(material: CampaignReportInput) -> Iterator[Block]:
    """A row a series, a column a source of uncertainty of its f_d."""
    pooled = {
        row.label: row.quantities[_FRICTION]
        for row in material.content.campaign.rows
        if _FRICTION in row.quantities
    }
    shared = {label: _by_source(one) for label, one in pooled.items()}
    sources = list(dict.fromkeys(source for of_it in shared.values() for source in of_it))
    rows: list[list[Cell]] = [
        [
            label,
            format_value(one.quantity.value, one.quantity.standard_uncertainty).in_print,
            typeset(format_uncertainty(one.repeatable)),
            *(
                typeset(format_uncertainty(shared[label][source])) if source in shared[label] else ""
                for source in sources
            ),
        ]
        for label, one in pooled.items()
    ]
    if not rows:
        yield Text("No run tells the dynamic friction coefficient.")
        return
    note = "Standard uncertainties. Repeats make the noise and what runs differ by smaller, and nothing else."
    header: list[Cell] = ["series", "value", "noise and repeats", *sources]
    yield Grid(header, rows, numbers=len(header) - 1, small=True, note=note)


def _by_source(pooled: PooledQuantity) -> dict[str, float]:
    """Shared parts by source, whoever shares them."""
    found: dict[str, float] = {}
    for error, deviation in pooled.common.items():
        source = str(error.source)
        found[source] = math.hypot(found.get(source, 0.0), deviation)
    return found


def _figures(material: CampaignReportInput) -> Iterator[Block]:
    names = contact_names(material.gathered.stands.values())
    with print_style():
        figure = friction_figure(friction_by_contact(material.content.campaign.rows), names)
        items = [] if figure is None else [drawing(figure, CAPTION)]
        for analysis in material.shown:
            items += _of_run(analysis)
    yield Drawings(items) if items else Text("No run tells friction.")


def _of_run(analysis: Analysis) -> list[Drawing]:
    drawn = RunFigureData.from_identification(analysis.record, analysis.identification)
    run = f"{analysis.run.metadata.series or 'Run'} ({analysis.run.path.name})"
    made = [(one.render(drawn), f"{run}. {one.caption}") for one in RUN_FIGURES if one.number in _DRAWN]
    return [drawing(figure, said) for figure, said in made if figure is not None]


def _runs(material: CampaignReportInput) -> Grid:
    header: list[Cell] = [
        "run",
        "series",
        "begun",
        "operator",
        "conditions",
        "note",
        "law",
        "dynamic friction",
    ]
    facts = material.gathered.details
    rows = [_run(run, facts[run.name], material) for run in material.gathered.runs]
    return Grid(header, rows, numbers=1, small=True)


def _run(run: RunResult, facts: RunDetails, material: CampaignReportInput) -> list[Cell]:
    friction = run.results.get(_FRICTION)
    return [
        _local(run.name, material),
        run.series.label,
        facts.start_time.strftime("%Y-%m-%d %H:%M"),
        facts.operator,
        facts.conditions.as_text(),
        facts.note,
        "left out" if run.excluded else _VERDICTS[run.adequate],
        "–" if friction is None else format_value(friction.value, friction.standard_uncertainty).in_print,
    ]


def _named(material: CampaignReportInput) -> list[Fingerprint]:
    """Fingerprints by the paths of their runs, which are told apart in several folders too."""
    runs = zip(material.gathered.runs, material.prints, strict=True)
    return [msgspec.structs.replace(one, name=_local(run.name, material)) for run, one in runs]
