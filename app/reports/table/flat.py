"""The table as plain columns of numbers in SI, for CSV and workbooks."""

from collections.abc import Iterator
from typing import Any, Final

from analysis.campaign.columns import COLUMNS
from analysis.campaign.pooling import PooledQuantity
from analysis.campaign.rows import STATIC_LOWER, STATIC_UPPER, SeriesRow
from app.reports.table.content import PublishedRowComparison, TableContent

_QUANTITIES: Final = (*(column.name for column in COLUMNS), STATIC_LOWER, STATIC_UPPER)
_FACTS: Final = (
    "",
    "_standard_uncertainty",
    "_low_95",
    "_high_95",
    "_runs",
    "_between_runs",
    "_scatter",
    "_birge_ratio",
    "_outliers",
)
_PUBLISHED: Final = ("_printed", "_difference")
_LEADING: Final = ("series", "contact", "pullback_m", "table_mass_kg", "runs")


def flat_table(content: TableContent) -> tuple[list[str], list[list[Any]]]:
    """Header and rows; None where there is nothing."""
    names = [f"{name}{fact}" for name in _QUANTITIES for fact in _FACTS]
    header = [*_LEADING, *names, "msk64_degree", "warnings"]
    if content.published is not None:
        header += [f"{column.name}{fact}" for column in COLUMNS for fact in _PUBLISHED] + ["flags"]
    return header, [list(_row(row, content)) for row in content.campaign.rows]


def _row(row: SeriesRow, content: TableContent) -> Iterator[Any]:
    key = row.series
    yield from (row.label, key.contact, key.pullback_m, key.table_mass_kg, len(row.runs))
    for name in _QUANTITIES:
        yield from _facts(row.quantities.get(name))
    yield from (row.msk64_degree, " | ".join(caution.message for caution in row.warnings))
    if content.published is not None:
        yield from _printed(content.published.get(row.label))


def _facts(pooled: PooledQuantity | None) -> Iterator[Any]:
    if pooled is None:
        yield from [None] * len(_FACTS)
        return
    quantity = pooled.quantity
    yield from (quantity.value, quantity.standard_uncertainty, *quantity.interval_95, pooled.runs)
    yield from (pooled.between_runs, pooled.scatter, pooled.birge_ratio, " | ".join(pooled.outliers))


def _printed(printed: PublishedRowComparison | None) -> Iterator[Any]:
    figures = {one.name: one for one in printed.figures} if printed else {}
    for column in COLUMNS:
        one = figures.get(column.name)
        yield from (None, None) if one is None else (one.published, one.difference)
    yield ", ".join(printed.flags) if printed else None
