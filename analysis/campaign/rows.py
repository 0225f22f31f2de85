"""Rows of the table: quantities of each series, pooled over its runs."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import PurePath

from scipy.special import chdtrc

from analysis.campaign.pooling import PooledQuantity, has_stated_gains, pool, run_value
from analysis.campaign.series import Series, SeriesKey, run_names
from analysis.catalogue import TableColumn, optional_columns, table_columns
from analysis.quantities import Quantity, ResultWarning, result_warning
from analysis.results.fitted_quantities import msk64_degree
from messages.i18n import N_

STATIC_LOWER, STATIC_UPPER = "friction_static_lower", "friction_static_upper"
TABLE_VELOCITY = "table_velocity_max_m_per_s"
_MASS, _FRICTION = "plate_mass_kg", "friction_dynamic"
_CHANCE = 0.01  # chance that runs which agree get the warning that they differ


@dataclass(frozen=True, eq=False, slots=True)
class SeriesRow:
    """A row of the table."""

    label: str  # code of the series, with the difference where it has several rows; unique in a campaign
    series: SeriesKey
    quantities: dict[str, PooledQuantity]  # by name, with both bounds of f_s; absent where undetermined
    msk64_degree: str  # of the pooled v_max; `VI/VII` where its interval crosses a bound; "" without v_max
    runs: tuple[str, ...]
    warnings: tuple[ResultWarning, ...] = ()


def pool_rows(series: Sequence[Series]) -> tuple[SeriesRow, ...]:
    """Pool every quantity of the series, in the order given.

    Series of one contact share their scatter; for properties of the stand, all series do.
    """
    quantities = {each.label: {_MASS: _plate_mass(each)} for each in series}
    columns = table_columns(optional_columns())
    of_runs = [(row.name, column) for row, column in columns if row.name != _MASS]
    for name, column in (*of_runs, (STATIC_LOWER, TableColumn(0)), (STATIC_UPPER, TableColumn(0))):
        values = [[one for run in each.runs if (one := run_value(run, name)) is not None] for each in series]
        found = [(each, some) for each, some in zip(series, values, strict=True) if some]
        kinds = ["" if column.is_of_stand else each.key.contact for each, _ in found]
        pooled = pool([some for _, some in found], proportional=column.is_proportional, kinds=kinds)
        for (each, _), quantity in zip(found, pooled, strict=True):
            quantities[each.label][name] = quantity
    return tuple(_row(each, quantities[each.label]) for each in series)


def _row(series: Series, quantities: dict[str, PooledQuantity]) -> SeriesRow:
    velocity = quantities.get(TABLE_VELOCITY)
    degree = "" if velocity is None else _degree(velocity.quantity)
    runs = tuple(run.name for run in series.runs)
    return SeriesRow(series.label, series.key, quantities, degree, runs, tuple(_warnings(series, quantities)))


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


def _warnings(series: Series, quantities: dict[str, PooledQuantity]) -> Iterator[ResultWarning]:
    """Outliers, runs that differ by more than their own uncertainties explain, and what lacks."""
    label, friction = series.label, quantities.get(_FRICTION)
    by_run: dict[str, list[str]] = {}
    for row, _ in table_columns():
        for run in quantities[row.name].outliers if row.name in quantities else ():
            by_run.setdefault(run, []).append(row.symbol.text)
    if by_run:
        yield result_warning(
            "outlying-run",
            "{label}: far from the other runs: {said}. All runs count; look at these, and leave"
            " out with --exclude what there is a reason for",
            label=label,
            said="; ".join(f"{PurePath(run).name} in {', '.join(those)}" for run, those in by_run.items()),
        )
    differing = [
        f"{row.symbol.text} (Birge ratio {pooled.birge_ratio:.1f})"
        for row, _ in table_columns()
        if (pooled := quantities.get(row.name)) is not None and pooled.birge_ratio is not None
        if chdtrc(pooled.runs - 1, pooled.birge_ratio**2 * (pooled.runs - 1)) < _CHANCE / len(table_columns())
    ]
    if differing:
        yield result_warning(
            "runs-differ",
            "{series}: runs differ by more than their noise explains in {quantities}. The uncertainties"
            " include these differences",
            series=label,
            quantities=differing,
        )
    if holding := [run for run in series.runs if run.friction_holds]:
        template = N_("{label}: no model explains {run_names}, but f_d holds: joint fit and plate agree")
        yield result_warning("friction-holds", template, label=label, run_names=run_names(holding))
    if wrong := [run for run in series.runs if run.adequate is False and not run.friction_holds]:
        template = N_("{label}: no friction law explains {run_names}. Look at it: slipstand analyze")
        yield result_warning("not-adequate", template, label=label, run_names=run_names(wrong))
    if friction is None:
        yield result_warning("no-friction", "{label}: no run determined f_d.", label=label)
    elif friction.runs == 1:
        template = N_("{label}: one run alone determined f_d. Repeat the test twice at least")
        yield result_warning("single-run", template, label=label)
    if not all(has_stated_gains(run, _FRICTION) for run in series.runs):
        yield result_warning(
            "gain-not-stated",
            "{label}: a gain has no stated uncertainty, so that of f_d is too small. Calibrate",
            label=label,
        )
