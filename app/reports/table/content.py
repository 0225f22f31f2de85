"""Content of the campaign's table, and its cells for people."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from analysis.campaign.campaign import Campaign, PublishedComparison
from analysis.campaign.pooling import PooledQuantity
from analysis.campaign.rows import STATIC_LOWER, STATIC_UPPER, SeriesRow
from analysis.catalogue import Place, QuantityDefinition, table_columns
from analysis.formatting import (
    format_concise,
    format_fixed,
    format_signed,
    format_value,
    uncertainty_decimals,
)
from analysis.quantities import Quantity, ResultWarning
from app.runs.campaign.collect import CollectedRuns


@dataclass(frozen=True, slots=True)
class PublishedRowComparison:
    """Comparison of a row with the published one, and the flags of the audit."""

    figures: tuple[PublishedComparison, ...]
    flags: tuple[str, ...]


@dataclass(frozen=True, eq=False, slots=True)
class TableContent:
    """Content of a table."""

    campaign: Campaign
    warnings: tuple[ResultWarning, ...] = ()
    failures: tuple[tuple[str, str], ...] = ()
    published: Mapping[str, PublishedRowComparison] | None = field(default=None)
    """By the labels of the rows; None where not asked for."""

    @classmethod
    def of_runs(
        cls, runs: CollectedRuns, published: Mapping[str, PublishedRowComparison] | None = None
    ) -> "TableContent":
        failures = tuple((failure.run, str(failure.reason)) for failure in runs.failures)
        return cls(runs.campaign(), runs.warnings, failures, published)

    def all_warnings(self) -> list[ResultWarning]:
        """Warnings of the runs, of the campaign, and of its rows."""
        of_rows = [caution for row in self.campaign.rows for caution in row.warnings]
        return [*self.warnings, *self.campaign.warnings, *of_rows]


def has_inadequate_run(row: SeriesRow) -> bool:
    """Tell whether no friction law explains one of the row's runs."""
    return any(caution.code == "not-adequate" for caution in row.warnings)


OUTLIER, INADEQUATE = "*", "!"


def table_quantities() -> tuple[QuantityDefinition, ...]:
    """Quantities of the table, in the paper's order."""
    return tuple(row for row, _ in table_columns())


def table_headers() -> tuple[str, ...]:
    """Heads of the columns: symbols with units."""
    return ("series", "n", *(row.heading(Place.TABLE) for row in table_quantities()))


def row_cells(row: SeriesRow) -> tuple[str, ...]:
    """Cells of a row, `0.10030(64)`, bounds for f_s without a value, "" where undetermined.

    `*` marks a quantity with an outlier, `!` a series with a run that no law fits.
    """
    doubt = INADEQUATE if has_inadequate_run(row) else ""
    values = (_cell(row, column) for column in table_quantities())
    return (row.label + doubt, str(len(row.runs)), *values)


def _cell(row: SeriesRow, column: QuantityDefinition) -> str:
    pooled = row.quantities.get(column.name)
    if pooled is None:
        return _bounds(row) if column.name == "friction_static" else ""
    scale, quantity = column.unit_at(Place.TABLE).scale, pooled.quantity
    shown = format_concise(scale * quantity.value, scale * quantity.standard_uncertainty)
    return shown + (OUTLIER if pooled.outliers else "")


def format_difference(found: Quantity, reference: float, column: QuantityDefinition) -> str:
    """Difference of a quantity from a number, to the digits of its uncertainty: `+0.0012`."""
    scale = column.unit_at(Place.TABLE).scale
    return format_signed(scale * (found.value - reference), _decimals(scale * found.standard_uncertainty))


def repeats(pooled: PooledQuantity) -> str:
    """Scatter of the runs: relative standard deviation and Birge ratio, `0.12 % 1.1`."""
    value = abs(pooled.quantity.value)
    if pooled.scatter is None or pooled.birge_ratio is None or not value:
        return ""
    share = 100.0 * pooled.scatter / value
    mark = OUTLIER if pooled.outliers else ""
    return f"{format_fixed(share, max(0, _decimals(share)))} % {pooled.birge_ratio:.1f}{mark}"


def _decimals(uncertainty: float) -> int:
    return uncertainty_decimals(uncertainty) if 0.0 < uncertainty < math.inf else 6


def _bounds(row: SeriesRow) -> str:
    """`0.130..0.132`; one number where the bounds meet."""
    bounds = [row.quantities.get(name) for name in (STATIC_LOWER, STATIC_UPPER)]
    low, high = (
        one and format_value(one.quantity.value, one.quantity.standard_uncertainty).value for one in bounds
    )
    if low and high:
        return low if float(high) <= float(low) else f"{low}..{high}"
    return f">={low}" if low else f"<={high}" if high else ""
