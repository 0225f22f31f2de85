"""What a table says: the campaign, the print beside it, and what could not be taken."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

from analysis.campaign.campaign import Campaign, PublishedComparison
from analysis.campaign.columns import COLUMNS, Column
from analysis.campaign.pooling import PooledQuantity
from analysis.campaign.rows import STATIC_LOWER, STATIC_UPPER, SeriesRow
from analysis.quantities import Quantity, ResultWarning


@dataclass(frozen=True, slots=True)
class PublishedRowComparison:
    """A row of the published table: its figures beside those found, and what the audit says of it."""

    figures: tuple[PublishedComparison, ...]
    flags: tuple[str, ...]


@dataclass(frozen=True, eq=False, slots=True)
class TableContent:
    """All that goes into a table.

    Attributes
    ----------
    campaign : Campaign
    cautions : tuple of Caution
        What must be known beside what the campaign and its rows say themselves.
    failures : tuple of (str, str)
        Runs that gave no result, and why.
    published : dict of Printed or None
        By the labels of the rows; None where it was not asked for.
    """

    campaign: Campaign
    warnings: tuple[ResultWarning, ...] = ()
    failures: tuple[tuple[str, str], ...] = ()
    published: Mapping[str, PublishedRowComparison] | None = field(default=None)

    def all_warnings(self) -> list[ResultWarning]:
        """Those of the runs together, then of the campaign, then row by row."""
        of_rows = [caution for row in self.campaign.rows for caution in row.warnings]
        return [*self.warnings, *self.campaign.warnings, *of_rows]


def has_inadequate_run(row: SeriesRow) -> bool:
    """Tell whether no friction law explains one of the row's runs."""
    return any(caution.code == "not-adequate" for caution in row.warnings)


OUTLIER, INADEQUATE = "*", "!"
_SCALES: Final = {"residual_displacement_m": (1e3, "mm")}
_FINEST = 1e-9
"""Relative uncertainty that is not worth digits."""


def header(column: Column) -> str:
    """Symbol and unit, as `u_s mm`."""
    unit = _SCALES.get(column.name, (1.0, column.unit))[1]
    return column.symbol if unit == "1" else f"{column.symbol} {unit}"


HEADERS: Final = ("series", "n", *map(header, COLUMNS))


def row_cells(row: SeriesRow) -> tuple[str, ...]:
    """A row of the table; `*` marks a quantity with an outlier, `!` a series with a run that no law fits."""
    doubt = INADEQUATE if has_inadequate_run(row) else ""
    values = (row_cell(row, column) for column in COLUMNS)
    return (row.label + doubt, str(len(row.runs)), *values)


def row_cell(row: SeriesRow, column: Column) -> str:
    """One quantity; f_s without a value of its own by its bounds; "" for what no run determined."""
    pooled = row.quantities.get(column.name)
    if pooled is None:
        return _bounds(row) if column.name == "friction_static" else ""
    shown = of_column(pooled.quantity, column.name)
    return shown + (OUTLIER if pooled.outliers else "")


def of_column(quantity: Quantity, name: str) -> str:
    """A quantity in the unit of its column."""
    scale = _SCALES.get(name, (1.0, ""))[0]
    return format_concise(scale * quantity.value, scale * quantity.standard_uncertainty)


def difference(found: Quantity, less: float, name: str) -> str:
    """By how much a quantity differs from a number, to its own digits, in the unit of its column."""
    scale = _SCALES.get(name, (1.0, ""))[0]
    decimals = _decimals(scale * found.standard_uncertainty)
    return f"{round(scale * (found.value - less), decimals):+.{max(0, decimals)}f}"


def format_concise(value: float, uncertainty: float) -> str:
    """Write `0.10030(64)`: the standard uncertainty in units of the last digits (JCGM 100, 7.2.2)."""
    if not math.isfinite(uncertainty) or uncertainty <= _FINEST * abs(value):
        return f"{value:.6g}"
    decimals = _decimals(uncertainty)
    digits = round(uncertainty * 10.0**decimals)
    if decimals < 1:
        return f"{round(value, decimals):.0f}({digits * 10**-decimals})"
    return f"{value:.{decimals}f}({digits if decimals > 1 else digits / 10.0})"


def repeats(pooled: PooledQuantity) -> str:
    """How runs differ: relative standard deviation and Birge ratio, as `0.12 % 1.1`."""
    value = abs(pooled.quantity.value)
    if pooled.scatter is None or pooled.birge_ratio is None or not value:
        return ""
    share = 100.0 * pooled.scatter / value
    mark = OUTLIER if pooled.outliers else ""
    return f"{share:.{max(0, _decimals(share))}f} % {pooled.birge_ratio:.1f}{mark}"


def _decimals(uncertainty: float) -> int:
    """Decimals that show two digits of an uncertainty; negative ones are tens."""
    if not 0.0 < uncertainty < math.inf:
        return 6
    decimals = 1 - math.floor(math.log10(uncertainty))
    return decimals - (round(uncertainty * 10.0**decimals) >= 100)


def _bounds(row: SeriesRow) -> str:
    """`0.130..0.132`; one number where the bounds meet."""
    ends = [row.quantities.get(name) for name in (STATIC_LOWER, STATIC_UPPER)]
    low, high = (None if one is None else _value(one.quantity) for one in ends)
    if low and high:
        return low if float(high) <= float(low) else f"{low}..{high}"
    return f">={low}" if low else f"<={high}" if high else ""


def _value(quantity: Quantity) -> str:
    return format_concise(quantity.value, quantity.standard_uncertainty).partition("(")[0]
