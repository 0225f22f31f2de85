"""Sections of the report of one run."""

import math
from collections.abc import Iterator, Sequence
from typing import Final, Literal

from analysis.campaign.rows import STATIC_LOWER, STATIC_UPPER
from analysis.catalogue import (
    CATALOGUE,
    KILOGRAM,
    MICROMETRE,
    MILLIMETRE,
    SECOND,
    Place,
    QuantityDefinition,
    Unit,
    definition,
    reading_units,
)
from analysis.formatting import (
    format_fixed,
    format_interval,
    format_uncertainty,
    format_value,
    typeset,
    typeset_sentence,
    uncertainty_decimals,
)
from analysis.identification import Degree, Identification
from analysis.plate.trends import velocity_statement
from analysis.quantities import BudgetLine, BudgetSource, Quantity
from analysis.verdict_text import EFFECT_TITLES, describe_verdict, model_title
from app.reports.figures.record_figure import record_caption, record_figure
from app.reports.figures.style import print_style
from app.reports.table.text import ORIGIN
from app.reports.test_report import blocks, shared
from app.reports.test_report.blocks import Cell, Section, Text
from app.runs.analyze import Analysis
from app.runs.metadata import Conditions, RunMetadata
from app.runs.origin import SIMULATED_RUN, is_simulated, origin_rows
from app.runs.reader import Fingerprint
from drivers.samples import Losses

_BUDGETED: Final = "friction_dynamic", "friction_static", "period_s", "damping_n1_per_s", "stiffness_n_per_m"
_HEADLINES: Final = ("friction_dynamic", "friction_static_lower", "period_s")
_FIGURES: Final = ("3b", "4b", "5a", "5b", "fd-velocity", "fd-position", "fd-time")
_LOW_IN: Final = 2.0  # height of those figures: a page has room for all
_ENDINGS: Final = {
    "rest": "at rest",
    "enough": "when waiting would not have narrowed the results",
    "duration": "after the set time",
    "stopped": "by the operator",
}


def run_sections(
    analysis: Analysis, print_of_file: Fingerprint, reproduce: str, excluded: str = ""
) -> list[Section]:
    """All sections of the report of one run, which the command `reproduce` gives again.

    `excluded` is why the run does not count.
    """
    found, run = analysis.identification, analysis.run
    of_stand: list[str] = []
    warnings: list[str] = []
    for warning in found.warnings:
        texts = of_stand if warning.code in EFFECT_TITLES else warnings
        texts.append(f"{_capitalized(str(warning.message))} ({warning.code})")
    sums = ", ".join(f"{name} {value}" for name, value in print_of_file.columns.items())
    columns = [("identifier of the run", print_of_file.identifier), ("CRC-32 of its columns", sums)]
    return [
        Section("Result", [*_notices(analysis, excluded), *_result(found, run.metadata.unit)]),
        Section("Test", [_test(analysis)]),
        Section("Conditions", [_conditions(run.metadata)]),
        shared.stand_section([run.metadata.stand]),
        shared.gauges_section([run.metadata.gauges]),
        shared.PROCEDURE,
        Section("Results", list(_results(found))),
        *([Section("About the stand", [blocks.Points(of_stand)])] if of_stand else []),
        Section("Uncertainty budget", list(_budget(found))),
        Section("Figures", _figures(analysis)),
        Section("Warnings", [blocks.Points(warnings) if warnings else Text("None.")]),
        Section("Data", [*shared.fingerprint_columns([print_of_file]), shared.without_empty(columns)]),
        Section(ORIGIN, [_origin(analysis, reproduce)]),
        shared.SIGNATURES,
    ]


def _notices(analysis: Analysis, excluded: str) -> Iterator[blocks.Block]:
    """Notices above the result: that it is simulated, an exclusion, and an expired calibration."""
    if is_simulated(analysis.document["origin"]):
        yield blocks.Notice(f"{SIMULATED_RUN}.")
    if excluded:
        left_out = f"This run is left out of the campaign's results: {excluded}."
        yield blocks.Notice(f"{left_out} What follows is for information only.")
    for warning in analysis.identification.warnings:
        if warning.code == "calibration-expired":
            yield blocks.Notice(str(warning.message), "warn")


def _result(found: Identification, unit: str) -> Iterator[blocks.Block]:
    """The first of the headline quantities that has a value, with its assessment."""
    key = next((key for key in _HEADLINES if key in found.results), None)
    if key is None:
        yield Text("The record gave no result; the warnings say why.")
        return
    row, quantity = definition(key), found.results[key]
    symbol, value = blocks.Symbol(row.symbol.markup), row.format(quantity, Place.REPORT).in_print
    if found.model is None:
        relation, text = row.symbol.relation, "No friction law was fitted."
        if relation:
            text = "The plate did not slip: f_s is at least so large."
        yield blocks.Conclusion(symbol, value, text, "warn", relation or "=")
        return
    _, shown = reading_units(unit)
    residual, noise = (
        f"{shown.scale * size:.3g} {shown.symbol}"
        for size in (found.model.residual_rms_m, found.model.noise_rms_m)
    )
    verdict = str(describe_verdict(found.model, found.kind))
    text = f"{_capitalized(verdict)} (residual {residual}, noise {noise})."
    holds: Literal["warn", "bad"] = "warn" if found.model.degree is Degree.FRICTION else "bad"
    yield blocks.Conclusion(symbol, value, text, "ok" if found.model.adequate else holds)
    if found.model.degree is Degree.NONE:
        yield Text(
            "This value is that of the nearest law, for information only. Its uncertainty does not cover what"
            " the law leaves unexplained, so that no expanded uncertainty is stated for it."
        )
        return
    symbol_of_unit = row.unit_at(Place.REPORT, quantity.unit).symbol
    expanded = f"{_expanded(row, quantity)} {symbol_of_unit}".rstrip()
    yield Text(
        f"± standard uncertainty. Expanded uncertainty U = {expanded} (k = 2, coverage of about 95 %); the"
        f" interval of 95 % coverage is {_interval(row, quantity)}."
    )


def _capitalized(sentence: str) -> str:
    """A sentence with its first letter large, unless it begins with a symbol: `f_d`, `T`."""
    return sentence if sentence[1:2] in ("_", " ") else sentence[:1].upper() + sentence[1:]


def _test(analysis: Analysis) -> blocks.Facts:
    run, metadata = analysis.run, analysis.run.metadata
    ending, events = run.end, analysis.identification.events
    device = metadata.device
    rows = [
        ("run", run.path.name),
        ("title", metadata.title),
        ("series", metadata.series or "none"),
        ("contact", metadata.contact),
        ("begun", metadata.format_start("%Y-%m-%d %H:%M:%S %z") or "not known"),
        ("operator", metadata.operator),
        ("nominal pullback", shared.in_unit(metadata.pullback_m, MILLIMETRE, 2)),
        ("table mass m1", f"{metadata.table_mass_kg:g} {KILOGRAM.symbol}"),
        ("plate mass m2", f"{metadata.plate_mass_kg:g} {KILOGRAM.symbol}"),
        ("device", " ".join(filter(None, (device.name, device.firmware, device.serial_number)))),
        ("protocol", device.protocol),
        ("port", metadata.port),
        ("nominal rate", "" if metadata.rate_hz is None else f"{metadata.rate_hz:g} samples a second"),
        ("source", metadata.origin),
        ("ended", "" if ending is None else _ENDINGS.get(ending.ended, ending.ended)),
        ("hold before release", "" if ending is None else shared.in_unit(ending.dwell_s, SECOND, 2)),
        ("released at", _time(events.release_s, events.release_uncertainty_s)),
        ("slip ended at", _time(events.slip_end_s, events.slip_end_uncertainty_s)),
        ("samples", _samples(run.losses)),
        ("note", metadata.note),
    ]
    return shared.without_empty(rows)


def _time(time_s: float | None, uncertainty_s: float | None) -> str:
    """A time of the record with its standard uncertainty; "" for None."""
    return "" if time_s is None else format_value(time_s, uncertainty_s, SECOND.symbol).in_print


def _samples(losses: Losses) -> str:
    faults = [
        f"{count} {name}" for name in ("missing", "damaged", "overloaded") if (count := getattr(losses, name))
    ]
    return f"{losses.samples}, of which {', '.join(faults) if faults else 'none missing or damaged'}"


def _origin(analysis: Analysis, reproduce: str) -> blocks.Facts:
    """Origin of the results; the same for every report of the run, whenever it is made."""
    rows = dict(origin_rows(analysis.document["origin"]))
    del rows["analysed"]
    kept = analysis.repeats
    if kept is not None:
        rows["kept"] = (
            f"as analysis {kept.number} of the run, {kept.date.isoformat()}, by {kept.program_text}"
        )
    return blocks.Facts([*rows.items(), ("this report", reproduce)])


def _conditions(metadata: RunMetadata) -> blocks.Facts:
    conditions: Conditions = metadata.conditions
    number = conditions.run_in_number
    rows = [
        ("temperature", shared.in_unit(conditions.temperature_c, Unit("°C"), 1)),
        ("humidity", shared.in_unit(conditions.humidity_percent, Unit("%"), 0)),
        ("plate", conditions.plate_id),
        ("surfaces", conditions.contact_id),
        ("surface preparation", conditions.surface_preparation),
        ("pullback number on these surfaces", "" if number is None else str(number)),
        *conditions.other.items(),
    ]
    stated = shared.without_empty(rows)
    return stated if stated.rows else blocks.Facts([("conditions", "none were noted")])


def _results(found: Identification) -> Iterator[blocks.Block]:
    rows: list[list[Cell]] = []
    redundant = (STATIC_LOWER, STATIC_UPPER) if "friction_static" in found.results else ()
    for row in CATALOGUE:
        quantity = None if row.name in redundant else found.results.get(row.name)
        if quantity is not None and math.isfinite(quantity.value):
            shown = row.format(quantity, Place.REPORT)
            uncertainty, unit = shown.uncertainty or "–", shown.unit or "1"
            symbol, interval = blocks.Symbol(row.symbol.markup), _interval(row, quantity)
            expanded = _expanded(row, quantity) if shown.uncertainty else "–"
            rows.append(
                [row.description, symbol, typeset(shown.value), uncertainty, expanded, interval, unit]
            )
    if degree := found.labels.get("msk64_degree"):
        rows.append(["seismic degree by the table's velocity", "MSK-64", str(degree), "", "", "", ""])
    header: list[Cell] = ["quantity", "symbol", "value", "u", "U (k = 2)", "95 % interval", "unit"]
    note = "u: standard uncertainty. U: expanded uncertainty, 2 u, a coverage of about 95 %."
    yield blocks.Grid(header, rows, numbers=5, note=note)
    if found.plate is not None:
        yield Text(typeset_sentence(str(velocity_statement(found.plate))))
    if found.model is not None and found.model.tried:
        laws: list[list[Cell]] = []
        decimals = _decimals(found.results.get("friction_dynamic"))
        for law in found.model.tried:
            friction, bic = format_fixed(law.friction_dynamic, decimals), typeset(f"{law.bic:.1f}")
            title = str(model_title(law.name, law.parts))
            laws.append([title, friction, bic, MICROMETRE.number(law.residual_rms_m, 2)])
        heads: list[Cell] = ["friction law", blocks.Symbol("f_d"), "BIC", f"residual, {MICROMETRE.symbol}"]
        yield blocks.Grid(heads, laws, numbers=3, note=_LAWS_NOTE)


_LAWS_NOTE: Final = (
    "The law with the lowest BIC is taken; its f_d and u stand above. f_d of the others is for comparison"
    " and has no uncertainty."
)


def _decimals(found: Quantity | None) -> int:
    """Decimals of f_d: those of its uncertainty, else six."""
    stated = found is not None and 0.0 < found.standard_uncertainty < math.inf
    return uncertainty_decimals(found.standard_uncertainty) if found is not None and stated else 6


def _interval(row: QuantityDefinition, quantity: Quantity) -> str:
    scale = row.unit_at(Place.REPORT, quantity.unit).scale
    low, high = quantity.interval_95
    return typeset(format_interval(low * scale, high * scale))


def _expanded(row: QuantityDefinition, quantity: Quantity) -> str:
    """Expanded uncertainty, k = 2, in the unit of the report."""
    scale = row.unit_at(Place.REPORT, quantity.unit).scale
    return typeset(format_uncertainty(quantity.expanded_uncertainty * scale))


def _budget(found: Identification) -> Iterator[blocks.Block]:
    """One row for each source, one column for each result; the largest source of the first result first."""
    rows = [definition(name) for name in _BUDGETED if name in found.results]
    shown = [row.name for row in rows]
    shares = {(str(line.source), line.contribution_to): line.standard_uncertainty for line in found.budget}
    sources = _by_size(found.budget, shown)
    if not sources:
        yield Text("No result has an uncertainty budget.")
        return
    heads = [blocks.Symbol(row.symbol.markup, row.unit_at(Place.REPORT).symbol) for row in rows]
    body: list[list[Cell]] = []
    for source in sources:
        kind = "A" if source == str(BudgetSource.NOISE) else "B"
        body.append([source, kind, *(_share(shares.get((source, row.name)), row) for row in rows)])
    total = [_share(found.results[row.name].standard_uncertainty, row) for row in rows]
    body.append(["together", "", *total])
    note = "Standard uncertainty by source; A: from statistics, B: from stated values. Empty: none."
    yield blocks.Grid(["source", "type", *heads], body, numbers=len(shown), note=note)


def _by_size(budget: Sequence[BudgetLine], shown: Sequence[str]) -> list[str]:
    """Sources of the results shown, by share of the first result, then of the others; unstated last."""
    sources: dict[str, None] = {}
    for name in shown:
        lines = [line for line in budget if line.contribution_to == name]
        lines.sort(key=lambda line: (math.isnan(line.standard_uncertainty), -line.standard_uncertainty))
        sources |= dict.fromkeys(str(line.source) for line in lines)
    unstated = {str(line.source) for line in budget if math.isnan(line.standard_uncertainty)}
    return sorted(sources, key=lambda source: source in unstated)


def _share(deviation: float | None, row: QuantityDefinition) -> str:
    if deviation is None:
        return ""
    if math.isnan(deviation):
        return "not stated"
    return typeset(format_uncertainty(deviation * row.unit_at(Place.REPORT).scale))


def _figures(analysis: Analysis) -> list[blocks.Block]:
    record, found, unit = analysis.record, analysis.identification, analysis.run.metadata.unit
    with print_style():
        whole = shared.drawing(record_figure(record, found, unit), record_caption(record, found))
        items = shared.run_drawings(analysis, _FIGURES, height_in=_LOW_IN)
    return [whole, blocks.Drawings(items)] if items else [whole]
