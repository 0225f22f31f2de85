"""A campaign summed up: a row a series, and what was left out and why."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from analysis.audit import KILOGRAM_FORCE_N, PublishedRow
from analysis.campaign.contacts import ContactRatio, friction_ratios
from analysis.campaign.effects import Effects, find_effects
from analysis.campaign.rows import TABLE_VELOCITY, SeriesRow, pool_rows
from analysis.campaign.series import RunResult, campaign_warnings, group_into_series, run_names
from analysis.catalogue import table_columns
from analysis.quantities import ResultWarning
from messages.message import Message, message


@dataclass(frozen=True, slots=True)
class Excluded:
    """A run that does not count, and why."""

    run: str
    reason: str


@dataclass(frozen=True, eq=False, slots=True)
class Campaign:
    """All that the runs say together.

    Attributes
    ----------
    rows : tuple of SeriesRow
        In the paper's order.
    effects : Effects
        What f_d depends on.
    ratios : tuple of ContactRatio
        f_s / f_d by contact.
    msk64_degrees : tuple of str
        Degrees that the table reached, each once, the lowest first.
    excluded : tuple of Excluded
        In the order given.
    cautions : tuple of Caution
        Of the campaign; those of a series are in its row.
    """

    rows: tuple[SeriesRow, ...]
    effects: Effects
    ratios: tuple[ContactRatio, ...]
    msk64_degrees: tuple[str, ...]
    excluded: tuple[Excluded, ...]
    warnings: tuple[ResultWarning, ...]


def summarize(runs: Sequence[RunResult], *, known_contacts: Sequence[str] = ()) -> Campaign:
    """Sum up runs: a row a series in the paper's order.

    Parameters
    ----------
    runs : sequence of RunResult
        Of one campaign, in any order. The numbers do not depend on it.
    known_contacts : sequence of str
        Codes of the stand; others are allowed, and named. Empty where none is known.
    """
    counted = sorted(
        (run for run in runs if not run.excluded), key=lambda run: (run.series.sort_key, run.name)
    )
    series = group_into_series(counted)
    rows = pool_rows(series)
    return Campaign(
        rows,
        find_effects(rows),
        friction_ratios(series, rows),
        tuple(dict.fromkeys(row.msk64_degree for row in sorted(rows, key=_velocity) if row.msk64_degree)),
        tuple(Excluded(run.name, run.excluded) for run in runs if run.excluded),
        (*campaign_warnings(counted, known_contacts), *_run_warnings(counted)),
    )


def _velocity(row: SeriesRow) -> float:
    """Largest velocity of the table (m/s)."""
    found = row.quantities.get(TABLE_VELOCITY)
    return 0.0 if found is None else found.quantity.value


def _run_warnings(runs: Sequence[RunResult]) -> list[ResultWarning]:
    """What was said of single runs, once for each code and gauge, with the runs that it was said of."""
    groups: dict[tuple[str, object], list[tuple[RunResult, Message]]] = {}
    for run in runs:
        for warning in run.warnings:
            key = warning.code, warning.message.values.get("gauge")
            groups.setdefault(key, []).append((run, warning.message))
    return [ResultWarning(code, _combined(group)) for (code, _), group in groups.items()]


def _combined(group: Sequence[tuple[RunResult, Message]]) -> Message:
    """Message of the first run of a group, with the names of all runs."""
    runs = {run.name: run for run, _ in group}
    names, first = run_names(list(runs.values())), group[0][1]
    if all(other == first for _, other in group):
        return message("{runs}: {warning}", runs=names, warning=first)
    return message(
        "{runs}: {warning} (of the first; of the others with other figures)", runs=names, warning=first
    )


_UNITS_PRINTED = {"stiffness_n_per_m": KILOGRAM_FORCE_N}
"""Stiffness as printed agrees with T only if it is read as kgf/m (docs/validation.md)."""


@dataclass(frozen=True, slots=True)
class PublishedComparison:
    """A figure as found and as printed, both in the unit of its column; the difference is found - printed.

    `normalised` is the difference over the standard uncertainty as found; that of the print is not known.
    """

    name: str
    measured: float
    published: float
    difference: float
    normalised: float | None


def compare_with_published(row: SeriesRow, printed: PublishedRow) -> tuple[PublishedComparison, ...]:
    """Hold a row against its print, in the order of the columns; what was not found is left out."""
    return tuple(
        _compare(
            row, quantity.name, getattr(printed, column.published) * _UNITS_PRINTED.get(quantity.name, 1.0)
        )
        for quantity, column in table_columns()
        if column.published and quantity.name in row.quantities
    )


def _compare(row: SeriesRow, name: str, printed: float) -> PublishedComparison:
    quantity = row.quantities[name].quantity
    difference, deviation = quantity.value - printed, quantity.standard_uncertainty
    return PublishedComparison(
        name, quantity.value, printed, difference, difference / deviation if deviation else None
    )


def compare_all_with_published(
    rows: Sequence[SeriesRow], published: Mapping[str, PublishedRow]
) -> dict[str, tuple[PublishedComparison, ...]]:
    """Hold all rows that the print has too against it, by their labels."""
    return {
        row.label: compare_with_published(row, published[row.label]) for row in rows if row.label in published
    }
