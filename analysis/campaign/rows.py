"""Rows of the table: quantities of each series, pooled over its runs."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import PurePath

from scipy.special import chdtrc

from analysis.campaign.pooling import PooledQuantity, is_fully_stated, pool, run_value
from analysis.campaign.series import Series, SeriesKey, run_names
from analysis.catalogue import QuantityDefinition, TableColumn, definition, table_columns
from analysis.quantities import Quantity, ResultWarning
from analysis.results.fitted_quantities import msk64_degree
from messages.message import message

STATIC_LOWER, STATIC_UPPER = "friction_static_lower", "friction_static_upper"
TABLE_VELOCITY = "table_velocity_max_m_per_s"
_MASS, _FRICTION = "plate_mass_kg", "friction_dynamic"
_CHANCE = 0.01
"""Chance that runs which agree get the warning that they differ."""


@dataclass(frozen=True, eq=False, slots=True)
class SeriesRow:
    """A row of the table."""

    label: str
    """Code of the series, with the difference where it has several rows; unique in a campaign."""
    series: SeriesKey
    quantities: dict[str, PooledQuantity]
    """By name, for every column of the table and both bounds of f_s; absent where no run determined it."""
    msk64_degree: str
    """Of the pooled v_max; two with a slash where its interval crosses a bound; "" without v_max."""
    runs: tuple[str, ...]
    warnings: tuple[ResultWarning, ...] = ()


def pool_rows(series: Sequence[Series]) -> tuple[SeriesRow, ...]:
    """Pool every quantity of the series, in the order given.

    Series of one contact share their scatter; for properties of the stand, all series do.
    """
    quantities: dict[str, dict[str, PooledQuantity]] = {each.label: {} for each in series}
    for row, column in _pooled_columns():
        for label, pooled in _pooled(series, row, column).items():
            quantities[label][row.name] = pooled
    return tuple(_row(each, quantities[each.label]) for each in series)


def _pooled_columns() -> Iterator[tuple[QuantityDefinition, TableColumn]]:
    """Quantities that runs determine, with the rules of their columns; bounds of f_s pool as f_s does."""
    for row, column in table_columns():
        if row.name != _MASS:
            yield row, column
    for name in (STATIC_LOWER, STATIC_UPPER):
        yield definition(name), TableColumn(position=0)


def _pooled(
    series: Sequence[Series], row: QuantityDefinition, column: TableColumn
) -> dict[str, PooledQuantity]:
    found = []
    for each in series:
        some = [one for run in each.runs if (one := run_value(run, row.name)) is not None]
        if some:
            found.append((each, some))
    kinds = ["" if column.is_of_stand else each.key.contact for each, _ in found]
    pooled = pool([some for _, some in found], proportional=column.is_proportional, kinds=kinds)
    return {each.label: one for (each, _), one in zip(found, pooled, strict=True)}


def _row(series: Series, quantities: dict[str, PooledQuantity]) -> SeriesRow:
    quantities = {_MASS: _plate_mass(series), **quantities}
    velocity = quantities.get(TABLE_VELOCITY)
    return SeriesRow(
        series.label,
        series.key,
        quantities,
        "" if velocity is None else _degree(velocity.quantity),
        tuple(run.name for run in series.runs),
        tuple(_warnings(series, quantities)),
    )


def _plate_mass(series: Series) -> PooledQuantity:
    """Plate mass: weighed before the runs, so repeats do not reduce its uncertainty."""
    known = run_value(series.runs[0], _MASS)
    mass = Quantity.normal(series.key.plate_mass_kg, 0.0, "kg")
    common = {} if known is None else known.common
    weighed = series.runs[0].results.get(_MASS, mass)
    return PooledQuantity(weighed, len(series.runs), 0.0, common, None, None, None, 0)


def _degree(velocity: Quantity) -> str:
    ends = dict.fromkeys(msk64_degree(max(0.0, end)) for end in velocity.interval_95 if math.isfinite(end))
    return "/".join(ends)


def _warnings(series: Series, quantities: dict[str, PooledQuantity]) -> list[ResultWarning]:
    friction = quantities.get(_FRICTION)
    found = [_outliers(series, quantities), _disagreeing(series, quantities), _inadequate(series)]
    if friction is None:
        text = message("{label}: no run determined f_d.", label=series.label)
        found.append(ResultWarning("no-friction", text))
    elif friction.runs == 1:
        text = message(
            "{label}: one run alone determined f_d. Repeat the test twice at least", label=series.label
        )
        found.append(ResultWarning("single-run", text))
    if not all(is_fully_stated(run, _FRICTION) for run in series.runs):
        text = message(
            "{label}: a gain has no stated uncertainty, so that of f_d is too small. Calibrate",
            label=series.label,
        )
        found.append(ResultWarning("gain-not-stated", text))
    return [caution for caution in found if caution is not None]


def _outliers(series: Series, quantities: dict[str, PooledQuantity]) -> ResultWarning | None:
    by_run: dict[str, list[str]] = {}
    for row, _ in table_columns():
        for run in quantities[row.name].outliers if row.name in quantities else ():
            by_run.setdefault(run, []).append(row.symbol.text)
    if not by_run:
        return None
    said = "; ".join(f"{PurePath(run).name} in {', '.join(symbols)}" for run, symbols in by_run.items())
    text = message(
        "{label}: far from the other runs: {said}. All runs count; look at these, and leave"
        " out with --exclude what there is a reason for",
        label=series.label,
        said=said,
    )
    return ResultWarning("outlying-run", text)


def _disagreeing(series: Series, quantities: dict[str, PooledQuantity]) -> ResultWarning | None:
    """Warn of quantities in which runs differ by more than their own uncertainties explain."""
    found = [
        f"{row.symbol.text} (Birge ratio {pooled.birge_ratio:.1f})"
        for row, _ in table_columns()
        if (pooled := quantities.get(row.name)) is not None and pooled.birge_ratio is not None
        if chdtrc(pooled.runs - 1, pooled.birge_ratio**2 * (pooled.runs - 1)) < _CHANCE / len(table_columns())
    ]
    if not found:
        return None
    text = message(
        "{series}: runs differ by more than their noise explains in {quantities}. The uncertainties"
        " include these differences",
        series=series.label,
        quantities=found,
    )
    return ResultWarning("runs-differ", text)


def _inadequate(series: Series) -> ResultWarning | None:
    wrong = [run for run in series.runs if run.adequate is False]
    if not wrong:
        return None
    text = message(
        "{label}: no friction law explains {run_names}. Look at it: slipstand analyze",
        label=series.label,
        run_names=run_names(wrong),
    )
    return ResultWarning("not-adequate", text)
