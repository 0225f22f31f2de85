"""Rows and texts of a campaign."""

import math
from pathlib import Path
from typing import TYPE_CHECKING

from analysis.catalogue import MILLIMETRE, Place, QuantityDefinition, TableColumn, table_columns
from analysis.formatting import typeset, with_unit
from app.presenters import number_text
from app.presenters.base import EMPTY_CHIP, Chip, Tone
from app.presenters.campaign.state import (
    Bar,
    Cell,
    ContactBars,
    EffectRow,
    NextTest,
    RepeatabilityRow,
    RunRow,
    TableRow,
)
from app.presenters.campaign.tasks import TARGET_REPEATS, CampaignData, CampaignRun, PlannedTest
from app.presenters.results import in_words, sentence
from messages.i18n import N_, gettext, ngettext, translate

if TYPE_CHECKING:
    from analysis.campaign.pooling import PooledQuantity
    from analysis.campaign.rows import SeriesRow
    from analysis.quantities import Quantity

_FRICTION, _STATIC = "friction_dynamic", "friction_static"
_LOWER, _UPPER = "friction_static_lower", "friction_static_upper"
_MARKS = (
    ("not-adequate", Tone.BAD, N_("law does not fit")),
    ("outlying-run", Tone.WARN, N_("outlier")),
    ("runs-differ", Tone.WARN, N_("runs differ")),
    ("no-friction", Tone.WARN, N_("no f_d")),
    ("gain-not-stated", Tone.WARN, N_("gain not stated")),
    ("single-run", Tone.PLAIN, N_("one run")),
)
"""Warnings of a series in order of importance, and their labels in the table."""
_VERDICTS = {True: N_("found"), False: N_("none found"), None: N_("cannot be told")}


def column_titles() -> tuple[tuple[str, str], ...]:
    """Symbol and unit of each column, in the paper's order."""
    return tuple((row.symbol.plain, row.unit_at(Place.WINDOW).symbol) for row, _ in table_columns())


def table_rows(found: CampaignData | None, all_series: tuple[str, ...]) -> tuple[TableRow, ...]:
    """Every series of the stand in the paper's order, then other series of the runs."""
    rows = () if found is None else found.campaign.rows
    by_code: dict[str, list[SeriesRow]] = {}
    for row in rows:
        by_code.setdefault(row.series.code if row.series.code in all_series else "", []).append(row)
    made = []
    for code in all_series:
        made += [_row(row) for row in by_code.get(code, ())] or [_without_runs(code)]
    return (*made, *(_row(row) for row in by_code.get("", ())))


def contact_bars(found: CampaignData) -> tuple[ContactBars, ...]:
    """Fig. 2: friction by contact."""
    ratios = {one.contact: one for one in found.campaign.ratios}
    made = []
    for one in found.contacts:
        ratio = ratios.get(one.contact)
        made.append(
            ContactBars(
                one.contact or gettext("unknown"),
                found.contact_names.get(one.contact, ""),
                None if one.static is None else _bar(one.static),
                None if one.dynamic is None else _bar(one.dynamic),
                tuple(map(_bar, one.static_of_series.values())),
                tuple(map(_bar, one.dynamic_of_series.values())),
                tuple(one.static_at_least.values()),
                "" if ratio is None or ratio.ratio is None else _with_spread(ratio.ratio),
            )
        )
    return tuple(made)


def effect_rows(found: CampaignData) -> tuple[EffectRow, ...]:
    """Effects on f_d."""
    return tuple(
        EffectRow(
            sentence(effect.cause.value),
            gettext(_VERDICTS[effect.found]),
            typeset(translate(effect.sentence)),
            is_found=effect.found is True,
        )
        for effect in found.campaign.effects.effects
    )


def repeatability_rows(found: CampaignData) -> tuple[RepeatabilityRow, ...]:
    """Repeatability of f_d in each series with several runs, the worst first."""
    with_repeats = [
        (row, pooled)
        for row in found.campaign.rows
        if (pooled := row.quantities.get(_FRICTION)) is not None and pooled.birge_ratio is not None
    ]
    with_repeats.sort(key=lambda pair: -(pair[1].birge_ratio or 0.0))
    return tuple(
        RepeatabilityRow(row.label, pooled.runs, _scatter(pooled), _birge(pooled), _spread_mark(row))
        for row, pooled in with_repeats
    )


def next_test(found: CampaignData) -> NextTest:
    """The recommended next test."""
    expected = found.next_test
    if expected is None:
        return NextTest("", gettext("Every series has {count} runs or more.", count=TARGET_REPEATS), ())
    if expected.runs == 0:
        why = gettext("No run yet: the first series in the paper's order without one.")
    else:
        why = ngettext(
            "It has {count} run of {wanted}, the fewest.",
            "It has {count} runs of {wanted}, the fewest.",
            expected.runs,
            wanted=TARGET_REPEATS,
        )
    return NextTest(expected.series, why, _expectations(expected))


def run_rows(found: CampaignData, label: str) -> tuple[RunRow, ...]:
    """Runs of a row; outliers are marked."""
    row = next((row for row in found.campaign.rows if row.label == label), None)
    if row is None:
        return ()
    pooled = row.quantities.get(_FRICTION)
    outliers = () if pooled is None else pooled.outliers
    return tuple(_line(found.runs[path], is_outlier=path in outliers) for path in row.runs)


def excluded_rows(found: CampaignData) -> tuple[RunRow, ...]:
    """Excluded runs, and why; those that an operator excluded can be included again."""
    return tuple(
        RunRow(
            one.run,
            Path(one.run).name,
            _line(found.runs[one.run]).friction if one.run in found.runs else "–",
            reason=sentence(one.reason),
            can_return=one.run in found.excluded_by_operator,
        )
        for one in found.campaign.excluded
    )


def failure_texts(found: CampaignData) -> tuple[str, ...]:
    """A line for each run without a result."""
    return tuple(f"{Path(path).name}: {sentence(error)}" for path, error in found.failures)


def warning_texts(found: CampaignData) -> tuple[str, ...]:
    """Warnings about the runs together and about series."""
    of_series = [caution.message for row in found.campaign.rows for caution in row.warnings]
    said = [*found.warnings, *(caution.message for caution in found.campaign.warnings), *of_series]
    return tuple(dict.fromkeys(_short(in_words(message), found) for message in said))


def _row(row: "SeriesRow") -> TableRow:
    return TableRow(
        row.label,
        row.series.code,
        len(row.runs),
        tuple(_cell(row, *column) for column in table_columns()),
        _mark(row),
    )


def _without_runs(code: str) -> TableRow:
    empty = Cell(hint=gettext("No run of {series} yet.", series=code))
    return TableRow(code, code, 0, (empty,) * len(table_columns()))


def _cell(row: "SeriesRow", quantity: QuantityDefinition, column: TableColumn) -> Cell:
    pooled = row.quantities.get(quantity.name)
    if pooled is not None:
        shown = quantity.format(pooled.quantity, Place.WINDOW)
        uncertainty = f"± {shown.uncertainty}" if shown.uncertainty else ""
        return Cell(typeset(shown.value), uncertainty, _of_runs(row, pooled))
    if quantity.name == _STATIC and any(_bounds(row)):
        return Cell(*_bounds(row), gettext(column.missing))
    return Cell("–", "", gettext(column.missing or N_("No run of this series determined it.")))


def _bounds(row: "SeriesRow") -> tuple[str, str]:
    """Lower and upper bound of f_s."""
    low, high = row.quantities.get(_LOWER), row.quantities.get(_UPPER)
    least = "" if low is None else f"≥ {number_text.format_fixed(low.quantity.value, 4)}"
    most = "" if high is None else f"≤ {number_text.format_fixed(high.quantity.value, 4)}"
    return least, most


def _of_runs(row: "SeriesRow", pooled: "PooledQuantity") -> str:
    words = ngettext("From {count} run", "From {count} runs", pooled.runs)
    if pooled.runs < len(row.runs):
        words += gettext(" of {all}", all=len(row.runs))
    if pooled.outliers:
        words += gettext(
            "; far from the others: {runs}", runs=", ".join(Path(run).name for run in pooled.outliers)
        )
    return words


def _mark(row: "SeriesRow") -> Chip:
    said = {caution.code: caution.message for caution in row.warnings}
    for code, tone, words in _MARKS:
        if code in said:
            return Chip(gettext(words), tone, "\n".join(sentence(message) for message in said.values()))
    return EMPTY_CHIP


def _bar(quantity: "Quantity") -> Bar:
    low, high = quantity.interval_95
    return Bar(quantity.value, low, high)


def _with_spread(quantity: "Quantity") -> str:
    value, uncertainty = number_text.format_uncertain(quantity)
    return f"{value} ± {uncertainty}" if uncertainty else value


def _scatter(pooled: "PooledQuantity") -> str:
    if pooled.scatter is None or not pooled.quantity.value:
        return "–"
    return with_unit(f"{100.0 * pooled.scatter / abs(pooled.quantity.value):.2g}", "%")


def _birge(pooled: "PooledQuantity") -> str:
    ratio = pooled.birge_ratio
    return "–" if ratio is None or not math.isfinite(ratio) else number_text.format_fixed(ratio, 1)


def _spread_mark(row: "SeriesRow") -> Chip:
    pooled = row.quantities[_FRICTION]
    if pooled.outliers:
        named = ", ".join(Path(run).stem for run in pooled.outliers)
        return Chip(gettext("outlier: {runs}", runs=named), Tone.WARN)
    if any(caution.code == "runs-differ" for caution in row.warnings):
        return Chip(gettext("runs differ"), Tone.WARN)
    return Chip(gettext("repeats well"), Tone.OK)


def _expectations(expected: PlannedTest) -> tuple[str, ...]:
    said = []
    if expected.pooled_friction is not None:
        said.append(gettext("f<sub>d</sub> so far: {value}", value=_with_spread(expected.pooled_friction)))
    if expected.friction is not None:
        said.append(gettext("f<sub>d</sub> by one test: {value}", value=_with_spread(expected.friction)))
    if math.isfinite(expected.residual_displacement_m):
        length = number_text.format_in(MILLIMETRE, abs(expected.residual_displacement_m))
        said.append(gettext("the plate ends {length} off: re-centre it afterwards", length=length))
    return (*said, *expected.warnings)


def _line(run: CampaignRun, *, is_outlier: bool = False) -> RunRow:
    value, uncertainty = ("–", "") if run.friction is None else number_text.format_uncertain(run.friction)
    said = EMPTY_CHIP
    if run.adequate is False:
        said = Chip(gettext("law does not fit"), Tone.BAD)
    elif is_outlier:
        said = Chip(gettext("outlier"), Tone.WARN)
    return RunRow(run.path, Path(run.path).name, value, f"± {uncertainty}" if uncertainty else "", said)


def _short(message: str, found: CampaignData) -> str:
    """Replace paths by file names."""
    for path in found.runs:
        if path in message:
            message = message.replace(path, Path(path).name)
    return message
