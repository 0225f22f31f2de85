"""Sections of the report of a campaign."""

import math
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import msgspec

from analysis.campaign.contacts import friction_by_contact
from analysis.campaign.pooling import PooledQuantity
from analysis.catalogue import Place
from analysis.formatting import format_uncertainty, format_value, typeset, typeset_sentence
from app.reports.figures.run_figures import CAPTION, contact_names, friction_figure
from app.reports.figures.style import print_style
from app.reports.table.text import (
    LEGEND,
    ORIGIN,
    REPEATS_LEGEND,
    TableContent,
    note_sections,
    repeats_grid,
    row_cells,
    table_quantities,
)
from app.reports.test_report import blocks, shared
from app.reports.test_report.blocks import Cell, Section, Text
from app.runs.analyze import Analysis
from app.runs.campaign.collect import CollectedRuns
from app.runs.reader import Fingerprint

_FRICTION = "friction_dynamic"
_DRAWN: Final = ("3a", "3b", "4a", "4b", "5a")
_VERDICTS: Final = {True: "fits", False: "does NOT fit", None: "no law fitted"}
_ALWAYS_SHOWN: Final = ("Runs that do not count", "Runs without a result")


@dataclass(frozen=True, eq=False, slots=True)
class CampaignReportInput:
    content: TableContent
    gathered: CollectedRuns
    prints: Sequence[Fingerprint]
    shown: Sequence[Analysis]
    folder: str  # common folder of all runs; paths are relative to it


def campaign_sections(material: CampaignReportInput) -> list[Section]:
    gathered, rows = material.gathered, material.content.campaign.rows
    prints = [
        msgspec.structs.replace(one, name=_local(run.name, material))
        for run, one in zip(gathered.runs, material.prints, strict=True)
    ]
    table: list[list[Cell]] = [[typeset_sentence(text) for text in row_cells(row)] for row in rows]
    columns = table_quantities()
    symbols = [blocks.Symbol(row.symbol.markup, row.unit_at(Place.TABLE).symbol) for row in columns]
    results = blocks.Grid(["series", "n", *symbols], table, len(symbols) + 1, small=True, note=LEGEND)
    no_units = [blocks.Symbol(row.symbol.markup) for row in columns[1:]]
    scatter: list[list[Cell]] = [list(row) for row in repeats_grid(material.content)[1]]
    repeats = blocks.Grid(
        ["series", *no_units], scatter, len(no_units), small=True, note=f"{REPEATS_LEGEND}."
    )
    return [
        Section("Campaign", [*_simulated(material), _summary(material)]),
        *_notes(material),
        Section("Table of results", [results], wide=True),
        Section("Uncertainty of the dynamic friction coefficient", list(_budget(material)), wide=True),
        Section("Repeatability", [repeats], wide=True),
        Section("Runs", [_runs(material)], wide=True),
        Section("Figures", list(_figures(material))),
        shared.stand_section(list(gathered.stands.values())),
        shared.gauges_section(list(gathered.gauges.values())),
        shared.PROCEDURE,
        Section("Data", shared.fingerprint_columns(prints)),
        Section(ORIGIN, [blocks.Points(list(material.content.origin.sentences()))]),
        shared.SIGNATURES,
    ]


def _summary(material: CampaignReportInput) -> blocks.Facts:
    gathered, campaign = material.gathered, material.content.campaign
    facts = [gathered.details[run.name].metadata for run in gathered.runs]
    days = sorted(one.format_start("%Y-%m-%d") for one in facts if one.start_time is not None)
    contacts = contact_names(gathered.stands.values())
    codes = dict.fromkeys(row.series.contact for row in campaign.rows)
    counted = sum(len(row.runs) for row in campaign.rows)
    excluded, failed = len(campaign.excluded), len(material.content.failures)
    named = [f"{code or 'not named'}: {contacts.get(code, 'not one of the stand')}" for code in codes]
    rows = [
        ("runs", f"{counted} counted, {excluded} left out, {failed} failed"),
        ("series", str(len(campaign.rows))),
        ("contacts", "\n".join(named)),
        ("recorded", "" if not days else days[0] if days[0] == days[-1] else f"{days[0]} to {days[-1]}"),
        ("operators", ", ".join(sorted({one.operator for one in facts if one.operator}))),
        ("stand", ", ".join(stand.name for stand in gathered.stands.values())),
        ("source", ", ".join(sorted({one.origin for one in facts if one.origin}))),
    ]
    return shared.without_empty(rows)


def _simulated(material: CampaignReportInput) -> Iterator[blocks.Block]:
    if warning := material.content.origin.warning:
        yield blocks.Notice(warning)


def _notes(material: CampaignReportInput) -> Iterator[Section]:
    """The notes of the table but for its origin; two of them appear even if they are empty."""
    notes = {title: texts for title, texts in note_sections(material.content) if title != ORIGIN}
    for title in dict.fromkeys((*notes, *_ALWAYS_SHOWN)):
        texts = [typeset_sentence(_local(text, material)) for text in notes.get(title, ())]
        yield Section(title, [blocks.Points(texts) if texts else Text("None.")])


def _local(text: str, material: CampaignReportInput) -> str:
    """Replace paths of runs by those relative to their common folder."""
    return text.replace(material.folder + os.sep, "") if material.folder else text


def _budget(material: CampaignReportInput) -> Iterator[blocks.Block]:
    """One row for each series, one column for each source of the uncertainty of f_d."""
    found = [row for row in material.content.campaign.rows if _FRICTION in row.quantities]
    if not found:
        yield Text("No run determined the dynamic friction coefficient.")
        return
    by_source = {row.label: _by_source(row.quantities[_FRICTION]) for row in found}
    sources = list(dict.fromkeys(source for shares in by_source.values() for source in shares))
    rows: list[list[Cell]] = []
    for row in found:
        pooled = row.quantities[_FRICTION]
        value = format_value(pooled.quantity.value, pooled.quantity.standard_uncertainty).in_print
        shares = [by_source[row.label].get(source) for source in sources]
        parts = [
            "" if one is None else typeset(format_uncertainty(one)) for one in (pooled.repeatable, *shares)
        ]
        expanded = format_uncertainty(pooled.quantity.expanded_uncertainty)
        rows.append([row.label, value, typeset(expanded), *parts])
    note = (
        "Standard uncertainties, and U: expanded uncertainty, a coverage of about 95 %. Repeats reduce the"
        " noise and the scatter between runs, and nothing else."
    )
    header: list[Cell] = ["series", "value", "U (k = 2)", "noise and repeats", *sources]
    yield blocks.Grid(header, rows, numbers=len(header) - 1, small=True, note=note)


def _by_source(pooled: PooledQuantity) -> dict[str, float]:
    shares: dict[str, float] = {}
    for error, deviation in pooled.common.items():
        source = str(error.source)
        shares[source] = math.hypot(shares.get(source, 0.0), deviation)
    return shares


def _figures(material: CampaignReportInput) -> Iterator[blocks.Block]:
    names = contact_names(material.gathered.stands.values())
    with print_style():
        figure = friction_figure(friction_by_contact(material.content.campaign.rows), names)
        items = [] if figure is None else [shared.drawing(figure, CAPTION)]
        for analysis in material.shown:
            run = f"{analysis.run.metadata.series or 'Run'} ({analysis.run.path.name})"
            items += shared.run_drawings(analysis, _DRAWN, f"{run}. ")
    yield blocks.Drawings(items) if items else Text("No run determined friction.")


def _runs(material: CampaignReportInput) -> blocks.Grid:
    columns = "run", "series", "begun", "operator", "conditions", "note", "law", "dynamic friction"
    rows: list[list[Cell]] = []
    for run in material.gathered.runs:
        metadata, found = material.gathered.details[run.name].metadata, run.results.get(_FRICTION)
        name, begun = _local(run.name, material), metadata.format_start("%Y-%m-%d %H:%M") or "not known"
        law = "left out" if run.excluded else _VERDICTS[run.adequate]
        law = "does not fit, f_d holds" if run.friction_holds and not run.excluded else law
        value = "–" if found is None else format_value(found.value, found.standard_uncertainty).in_print
        texts = metadata.operator, metadata.conditions.as_text(), metadata.note
        rows.append([name, run.series.label, begun, *texts, law, value])
    return blocks.Grid(list(columns), rows, numbers=1, small=True)
