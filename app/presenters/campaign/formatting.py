"""Rows and texts of a campaign, formatted in the worker process."""

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import chain
from pathlib import Path

from analysis.campaign.campaign import Campaign
from analysis.campaign.contacts import friction_by_contact
from analysis.campaign.effects import Effect
from analysis.campaign.observed import observe_uncertainty
from analysis.campaign.pooling import PooledQuantity
from analysis.campaign.rows import SeriesRow
from analysis.campaign.series import RunResult
from analysis.campaign.stand_effects import EffectScope, EffectSummary
from analysis.catalogue import Place, QuantityDefinition, TableColumn
from analysis.formatting import typeset, with_unit
from analysis.motion.two_mass import TwoMassParameters
from analysis.plan import plan
from analysis.quantities import Quantity
from analysis.record import AnalysisError
from app.presenters import number_text
from app.presenters.base import EMPTY_CHIP, Chip, Tone
from app.presenters.campaign.state import (
    CampaignSummary,
    Cell,
    ContactBars,
    EffectRow,
    NextTest,
    RepeatabilityRow,
    RunRow,
    TableRow,
    all_columns,
    row_without_runs,
)
from app.presenters.results import in_words, sentence
from app.runs.campaign.collect import CollectedRuns
from app.runs.plan_json import build_planned_test, with_effects
from config.files import load_gauges, load_stand, published_row
from config.schema import ConfigError, Stand
from messages.i18n import N_, gettext, ngettext, translate

TARGET_REPEATS = 3  # tests of each series that a campaign should have: the least that shows an outlier
_FRICTION, _STATIC = "friction_dynamic", "friction_static"
_LOWER, _UPPER = "friction_static_lower", "friction_static_upper"
_MARKS = (
    ("not-adequate", Tone.BAD, N_("law does not fit")),
    ("outlying-run", Tone.WARN, N_("outlier")),
    ("friction-holds", Tone.WARN, N_("law does not fit, f_d holds")),
    ("runs-differ", Tone.WARN, N_("runs differ")),
    ("no-friction", Tone.WARN, N_("no f_d")),
    ("gain-not-stated", Tone.WARN, N_("gain not stated")),
    ("single-run", Tone.PLAIN, N_("one run")),
)
"""Warnings of a series in order of importance, and their labels in the table."""
_VERDICTS = {True: N_("found"), False: N_("none found"), None: N_("cannot be told")}


def summarise(runs: CollectedRuns, all_series: Sequence[str]) -> CampaignSummary:
    """Summarise runs: series of the stand `all_series` have a row in any case."""
    campaign = runs.campaign()
    return CampaignSummary(
        _table_rows(runs, campaign, all_series),
        _contact_bars(runs, campaign),
        tuple(map(_effect_row, campaign.effects.effects)),
        tuple(map(_stand_effect, campaign.effects_of_stand)),
        _repeatability_rows(campaign),
        plan_next_test(runs, campaign, all_series),
        _excluded_rows(runs, campaign),
        tuple(f"{Path(failure.run).name}: {sentence(failure.error)}" for failure in runs.failures),
        _warning_texts(runs, campaign),
        sum(details.analysis is None for details in runs.details.values()),
        len(runs.simulated),
        runs.is_mixed,
        bool(runs.simulated) and runs.counts_simulated,
    )


def _table_rows(runs: CollectedRuns, campaign: Campaign, all_series: Sequence[str]) -> tuple[TableRow, ...]:
    by_name = {run.name: run for run in runs.runs}
    of_series: dict[str, list[TableRow]] = {code: [] for code in all_series}
    others: list[TableRow] = []
    for row in campaign.rows:
        of_series.get(row.series.code, others).append(_row(row, by_name))
    of_stand = (of_series[code] or [row_without_runs(code)] for code in all_series)
    return (*chain.from_iterable(of_stand), *others)


def _contact_bars(runs: CollectedRuns, campaign: Campaign) -> tuple[ContactBars, ...]:
    """Fig. 2: friction by contact."""
    names = {code: named.name for stand in runs.stands.values() for code, named in stand.contacts.items()}
    ratios = {ratio.contact: ratio.ratio for ratio in campaign.ratios}
    return tuple(
        ContactBars(
            friction.contact or gettext("unknown"),
            names.get(friction.contact, ""),
            friction.static,
            friction.dynamic,
            tuple(friction.static_of_series.values()),
            tuple(friction.dynamic_of_series.values()),
            tuple(friction.static_at_least.values()),
            "" if (ratio := ratios.get(friction.contact)) is None else _with_uncertainty(ratio),
        )
        for friction in friction_by_contact(campaign.rows)
    )


def _effect_row(effect: Effect) -> EffectRow:
    return EffectRow(
        sentence(effect.cause.value),
        gettext(_VERDICTS[effect.found]),
        typeset(translate(effect.sentence)),
        is_found=effect.found is True,
    )


def _stand_effect(effect: EffectSummary) -> Chip:
    is_common = effect.scope in (EffectScope.STAND, EffectScope.CONTACT)
    return Chip(in_words(effect.message), Tone.WARN if is_common else Tone.PLAIN)


def _repeatability_rows(campaign: Campaign) -> tuple[RepeatabilityRow, ...]:
    """Repeatability of f_d in each series with several runs, the worst first."""
    with_repeats = [
        (row, pooled)
        for row in campaign.rows
        if (pooled := row.quantities.get(_FRICTION)) is not None and pooled.birge_ratio is not None
    ]
    with_repeats.sort(key=lambda pair: -(pair[1].birge_ratio or 0.0))
    return tuple(
        RepeatabilityRow(row.label, pooled.runs, _scatter(pooled), _birge(pooled), _spread_mark(row))
        for row, pooled in with_repeats
    )


def _excluded_rows(runs: CollectedRuns, campaign: Campaign) -> tuple[RunRow, ...]:
    """Excluded runs, and why; those that an operator excluded can be included again."""
    by_name = {run.name: run for run in runs.runs}
    by_operator = {name for name, details in runs.details.items() if details.metadata.excluded}
    by_operator |= {excluded.run for excluded in runs.excluded}
    return tuple(
        RunRow(
            excluded.run,
            Path(excluded.run).name,
            _run_row(by_name[excluded.run]).friction if excluded.run in by_name else "–",
            reason=sentence(excluded.reason),
            can_return=excluded.run in by_operator,
        )
        for excluded in campaign.excluded
    )


def _warning_texts(runs: CollectedRuns, campaign: Campaign) -> tuple[str, ...]:
    """Warnings about the runs together and about series, with file names for paths."""
    of_series = chain.from_iterable(row.warnings for row in campaign.rows)
    told = {effect.name for effect in campaign.effects_of_stand}
    of_all = (*runs.warnings, *campaign.warnings, *of_series)
    texts = []
    for warning in (warning for warning in of_all if warning.code not in told):
        text = in_words(warning.message)
        for run in runs.runs:
            text = text.replace(run.name, Path(run.name).name)
        texts.append(text)
    return tuple(dict.fromkeys(texts))


def _row(row: SeriesRow, runs: Mapping[str, RunResult]) -> TableRow:
    pooled = row.quantities.get(_FRICTION)
    outliers = () if pooled is None else pooled.outliers
    return TableRow(
        row.label,
        row.series.code,
        tuple(_run_row(runs[name], is_outlier=name in outliers) for name in row.runs),
        tuple(_cell(row, *column) for column in all_columns()),
        _mark(row),
    )


def _cell(row: SeriesRow, quantity: QuantityDefinition, column: TableColumn) -> Cell:
    pooled = row.quantities.get(quantity.name)
    if pooled is not None:
        shown = quantity.format(pooled.quantity, Place.WINDOW)
        uncertainty = f"± {shown.uncertainty}" if shown.uncertainty else ""
        return Cell(typeset(shown.value), uncertainty, _of_runs(row, pooled))
    if quantity.name == _STATIC and any(_bounds(row)):
        return Cell(*_bounds(row), gettext(column.missing))
    return Cell("–", "", gettext(column.missing or N_("No run of this series determined it.")))


def _bounds(row: SeriesRow) -> tuple[str, str]:
    """Lower and upper bound of f_s."""
    low, high = row.quantities.get(_LOWER), row.quantities.get(_UPPER)
    least = "" if low is None else f"≥ {number_text.format_fixed(low.quantity.value, 4)}"
    most = "" if high is None else f"≤ {number_text.format_fixed(high.quantity.value, 4)}"
    return least, most


def _of_runs(row: SeriesRow, pooled: PooledQuantity) -> str:
    words = ngettext("From {count} run", "From {count} runs", pooled.runs)
    if pooled.runs < len(row.runs):
        words += gettext(" of {all}", all=len(row.runs))
    if pooled.outliers:
        words += gettext(
            "; far from the others: {runs}", runs=", ".join(Path(run).name for run in pooled.outliers)
        )
    return words


def _mark(row: SeriesRow) -> Chip:
    said = {caution.code: caution.message for caution in row.warnings}
    for code, tone, words in _MARKS:
        if code in said:
            return Chip(gettext(words), tone, "\n".join(sentence(message) for message in said.values()))
    return EMPTY_CHIP


def _scatter(pooled: PooledQuantity) -> str:
    if pooled.scatter is None or not pooled.quantity.value:
        return "–"
    return with_unit(f"{100.0 * pooled.scatter / abs(pooled.quantity.value):.2g}", "%")


def _birge(pooled: PooledQuantity) -> str:
    ratio = pooled.birge_ratio
    return "–" if ratio is None or not math.isfinite(ratio) else number_text.format_fixed(ratio, 1)


def _spread_mark(row: SeriesRow) -> Chip:
    pooled = row.quantities[_FRICTION]
    if pooled.outliers:
        named = ", ".join(Path(run).stem for run in pooled.outliers)
        return Chip(gettext("outlier: {runs}", runs=named), Tone.WARN)
    if any(caution.code == "runs-differ" for caution in row.warnings):
        return Chip(gettext("runs differ"), Tone.WARN)
    return Chip(gettext("repeats well"), Tone.OK)


def _run_row(run: RunResult, *, is_outlier: bool = False) -> RunRow:
    friction, status = run.results.get(_FRICTION), EMPTY_CHIP
    value, uncertainty = ("–", "") if friction is None else number_text.format_uncertain(friction)
    if run.friction_holds:
        status = Chip(gettext("law does not fit, f_d holds"), Tone.WARN)
    elif run.adequate is False:
        status = Chip(gettext("law does not fit"), Tone.BAD)
    elif is_outlier:
        status = Chip(gettext("outlier"), Tone.WARN)
    return RunRow(run.name, Path(run.name).name, value, f"± {uncertainty}" if uncertainty else "", status)


def _with_uncertainty(quantity: Quantity) -> str:
    value, uncertainty = number_text.format_uncertain(quantity)
    return f"{value} ± {uncertainty}" if uncertainty else value


def plan_next_test(runs: CollectedRuns, campaign: Campaign, all_series: Sequence[str]) -> NextTest:
    """Plan a test of the series with the fewest runs, with the effects that the stand shows in all runs."""
    counts = dict.fromkeys(all_series, 0)
    for row in campaign.rows:
        if row.series.code in counts:
            counts[row.series.code] += len(row.runs)
    code = min(counts, key=lambda code: counts[code], default=None)
    if code is None or counts[code] >= TARGET_REPEATS:
        return NextTest("", gettext("Every series has {count} runs or more.", count=TARGET_REPEATS), ())
    reason = gettext("No run yet: the first series in the paper's order without one.")
    if counts[code]:
        reason = ngettext(
            "It has {count} run of {wanted}, the fewest.",
            "It has {count} runs of {wanted}, the fewest.",
            counts[code],
            wanted=TARGET_REPEATS,
        )
    try:
        return NextTest(code, reason, tuple(_expectations(code, runs, campaign, load_stand())))
    except (AnalysisError, ConfigError):  # the stand of the series is not configured here
        return NextTest(code, reason)


def _expectations(code: str, runs: CollectedRuns, campaign: Campaign, stand: Stand) -> Iterator[str]:
    """What a test will show by T, n1 and f_d of its series, else of the published table."""
    series, published = stand.series(code), published_row(code)
    found = next((row.quantities for row in campaign.rows if row.series.code == code), {})
    values = {
        name: found[name].quantity.value if name in found else getattr(published, name)
        for name in ("period_s", "damping_n1_per_s", _FRICTION)
    }
    parameters = TwoMassParameters.from_free_decay(
        table_mass_kg=stand.table_mass_kg,
        plate_mass_kg=series.plate_mass_kg,
        pullback_m=series.pullback_m,
        **values,
    )
    effects = campaign.effects_of_stand
    observed = observe_uncertainty([run for run in runs.runs if not run.excluded])
    planned = plan(with_effects(build_planned_test(parameters, stand, load_gauges()), effects, observed))
    if _FRICTION in found:
        so_far = _with_uncertainty(found[_FRICTION].quantity)
        yield gettext("f<sub>d</sub> so far: {value}", value=so_far)
    if (friction := planned.results.get(_FRICTION)) is not None:
        yield gettext("f<sub>d</sub> by one test: {value}", value=_with_uncertainty(friction))
    length = number_text.format_displacement(abs(planned.motion.residual_displacement_m))
    yield gettext("the plate ends {length} off: re-centre it afterwards", length=length)
    yield from (sentence(warning.message) for warning in planned.warnings)
