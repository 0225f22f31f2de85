"""Summary of a campaign: series, causes, ratios, excluded runs, effects of the stand, the published table."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from analysis.audit import KILOGRAM_FORCE_N, PublishedRow
from analysis.campaign.contacts import ContactRatio, friction_ratios
from analysis.campaign.effects import Effects, find_effects
from analysis.campaign.rows import TABLE_VELOCITY, SeriesRow, pool_rows
from analysis.campaign.series import RunResult, campaign_warnings, group_into_series, run_names
from analysis.campaign.stand_effects import EffectSummary, summarize_effects
from analysis.catalogue import table_columns
from analysis.quantities import ResultWarning
from messages.i18n import N_
from messages.message import Message, message


@dataclass(frozen=True, slots=True)
class Excluded:
    """A run that does not count, with the reason."""

    run: str
    reason: str


@dataclass(frozen=True, eq=False, slots=True)
class Campaign:
    """Summary of all runs."""

    rows: tuple[SeriesRow, ...]  # in the paper's order
    effects: Effects
    ratios: tuple[ContactRatio, ...]
    msk64_degrees: tuple[str, ...]  # degrees that the table reached, each once, lowest first
    excluded: tuple[Excluded, ...]
    warnings: tuple[ResultWarning, ...]
    effects_of_stand: tuple[EffectSummary, ...] = ()


def summarize(runs: Sequence[RunResult], *, known_contacts: Sequence[str] = ()) -> Campaign:
    """Summarize runs: one row for each series, in the paper's order.

    The order of `runs` does not change the numbers. Runs with a contact that is not in `known_contacts`
    (codes of the stand) get a warning; an empty sequence allows all.
    """
    counted = sorted(
        (run for run in runs if not run.excluded), key=lambda run: (run.series.sort_key, run.name)
    )
    series = group_into_series(counted)
    rows = pool_rows(series)
    shaken = [row for row in rows if TABLE_VELOCITY in row.quantities]
    shaken.sort(key=lambda row: row.quantities[TABLE_VELOCITY].quantity.value)
    return Campaign(
        rows,
        find_effects(rows),
        friction_ratios(series, rows),
        tuple(dict.fromkeys(row.msk64_degree for row in shaken if row.msk64_degree)),
        tuple(Excluded(run.name, run.excluded) for run in runs if run.excluded),
        (*campaign_warnings(counted, known_contacts), *_run_warnings(counted)),
        summarize_effects(counted),
    )


def _run_warnings(runs: Sequence[RunResult]) -> list[ResultWarning]:
    groups: dict[tuple[str, object], list[tuple[RunResult, Message]]] = {}
    for run in runs:
        for warning in run.warnings:
            key = warning.code, warning.message.values.get("gauge")
            groups.setdefault(key, []).append((run, warning.message))
    return [ResultWarning(code, _combined(group)) for (code, _), group in groups.items()]


def _combined(group: Sequence[tuple[RunResult, Message]]) -> Message:
    """Message of the first run of a group, with the names of all runs."""
    names, first = run_names(list({run.name: run for run, _ in group}.values())), group[0][1]
    template = N_("{runs}: {warning}")
    if any(other != first for _, other in group):
        template = N_("{runs}: {warning} (of the first; of the others with other figures)")
    return message(template, runs=names, warning=first)


_UNITS_PRINTED = {"stiffness_n_per_m": KILOGRAM_FORCE_N}
"""Stiffness as printed agrees with T only if it is read as kgf/m (docs/validation.md)."""


@dataclass(frozen=True, slots=True)
class PublishedComparison:
    """A measured and a published value in the unit of the column; the difference is measured - published.

    `normalised` is the difference over the standard uncertainty of the measured value.
    """

    name: str
    measured: float
    published: float
    difference: float
    normalised: float | None


def compare_with_published(
    rows: Sequence[SeriesRow], published: Mapping[str, PublishedRow]
) -> dict[str, tuple[PublishedComparison, ...]]:
    """Compare all rows that the published table has too, by their labels, in the order of the columns."""
    return {
        row.label: tuple(_comparisons(row, published[row.label])) for row in rows if row.label in published
    }


def _comparisons(row: SeriesRow, printed: PublishedRow) -> Iterator[PublishedComparison]:
    for name, attribute in ((each.name, column.published) for each, column in table_columns()):
        if attribute and name in row.quantities:
            quantity = row.quantities[name].quantity
            published = getattr(printed, attribute) * _UNITS_PRINTED.get(name, 1.0)
            difference, deviation = quantity.value - published, quantity.standard_uncertainty
            normalised = difference / deviation if deviation else None
            yield PublishedComparison(name, quantity.value, published, difference, normalised)
