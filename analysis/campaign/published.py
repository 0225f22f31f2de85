"""The campaign's table beside a published one."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from analysis.audit import KILOGRAM_FORCE_N, PublishedRow
from analysis.campaign.columns import COLUMNS
from analysis.campaign.rows import SeriesRow

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
        _compare(row, column.name, getattr(printed, column.published) * _UNITS_PRINTED.get(column.name, 1.0))
        for column in COLUMNS
        if column.name in row.quantities
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
