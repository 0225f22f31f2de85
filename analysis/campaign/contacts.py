"""Static and dynamic friction and their ratio by contact, with uncertainties (the paper's Fig. 2)."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import stdtrit

from analysis.campaign.pooling import PooledQuantity, pool, run_ratio
from analysis.campaign.rows import STATIC_LOWER, STATIC_UPPER, SeriesRow
from analysis.campaign.series import Series
from analysis.quantities import COVERAGE_FACTOR_95, Quantity

_RECTANGLE = 2.0 * math.sqrt(3.0)  # width of a rectangular distribution over its standard deviation
_DYNAMIC, _STATIC = "friction_dynamic", "friction_static"


@dataclass(frozen=True, slots=True)
class ContactFriction:
    """Friction of one contact over its series."""

    contact: str  # code, "" where it is not known
    dynamic: Quantity | None  # mean over the series; None where undetermined
    static: Quantity | None
    dynamic_of_series: dict[str, Quantity]  # by label; f_s from its bounds where no law determined it
    static_of_series: dict[str, Quantity]
    static_at_least: dict[str, float]  # lower bounds, by the labels of series without an upper one


def friction_by_contact(rows: Sequence[SeriesRow]) -> tuple[ContactFriction, ...]:
    """Friction of each contact, in the order of the rows."""
    return tuple(
        _friction(contact, [row for row in rows if row.series.contact == contact])
        for contact in dict.fromkeys(row.series.contact for row in rows)
    )


def _friction(contact: str, rows: Sequence[SeriesRow]) -> ContactFriction:
    dynamic = {row.label: row.quantities[_DYNAMIC] for row in rows if _DYNAMIC in row.quantities}
    static = {row.label: found for row in rows if (found := _static(row)) is not None}
    return ContactFriction(
        contact,
        mean_over_series(list(dynamic.values())),
        mean_over_series(list(static.values())),
        {label: pooled.quantity for label, pooled in dynamic.items()},
        {label: pooled.quantity for label, pooled in static.items()},
        {
            row.label: row.quantities[STATIC_LOWER].quantity.value
            for row in rows
            if row.label not in static and STATIC_LOWER in row.quantities
        },
    )


def mean_over_series(series: Sequence[PooledQuantity]) -> Quantity | None:
    """Unweighted mean of a quantity over series that may truly differ; None without series.

    Type A is the scatter between series over the root of their number, with Student's factor. Errors that
    series share enter at full size.
    """
    if len(series) < 2:
        return series[0].quantity if series else None
    values = np.array([one.quantity.value for one in series])
    mean = float(values.mean())
    own = float(values.std(ddof=1)) / math.sqrt(len(values))
    keys = {key for one in series for key in one.common}
    shared = math.hypot(*(sum(one.common.get(key, 0.0) for one in series) / len(series) for key in keys))
    half = math.hypot(float(stdtrit(len(values) - 1, 0.975)) * own, COVERAGE_FACTOR_95 * shared)
    return Quantity(mean, math.hypot(own, shared), (mean - half, mean + half), series[0].quantity.unit)


def _static(row: SeriesRow) -> PooledQuantity | None:
    """f_s of a law, or the middle of its bounds (rectangular distribution)."""
    if _STATIC in row.quantities:
        return row.quantities[_STATIC]
    if not row.quantities.keys() >= {STATIC_LOWER, STATIC_UPPER}:
        return None
    lower, upper = row.quantities[STATIC_LOWER], row.quantities[STATIC_UPPER]
    low, high = lower.quantity, upper.quantity
    deviation = math.hypot((high.value - low.value) / _RECTANGLE, low.standard_uncertainty)
    ends = low.interval_95[0], high.interval_95[1]
    return replace(lower, quantity=Quantity(0.5 * (low.value + high.value), deviation, ends, low.unit))


@dataclass(frozen=True, slots=True)
class ContactRatio:
    """f_s / f_d of one contact."""

    contact: str
    ratio: Quantity | None  # mean over the series that determined f_s, with their scatter; None without any
    series: int
    between_series: float | None  # standard deviation of the ratio between series; None with fewer than two
    bounds: tuple[float | None, float | None]  # smallest lower, largest upper of the other series


def friction_ratios(series: Sequence[Series], rows: Sequence[SeriesRow]) -> tuple[ContactRatio, ...]:
    """Ratios by contact, in the order of the table; `rows` are those of `series`."""
    contacts = dict.fromkeys(each.key.contact for each in series)
    return tuple(_of_contact(contact, series, rows) for contact in contacts)


def _of_contact(contact: str, series: Sequence[Series], rows: Sequence[SeriesRow]) -> ContactRatio:
    own = [each for each in series if each.key.contact == contact]
    runs = [[run_ratio(run, _STATIC, _DYNAMIC) for run in each.runs] for each in own]
    found = [[one for one in some if one is not None] for some in runs]
    pooled = pool([some for some in found if some], proportional=True) if any(found) else []
    values = [one.quantity.value for one in pooled]
    between = float(np.std(values, ddof=1)) if len(values) > 1 else None
    bounded = [row for row in rows if row.series.contact == contact and _STATIC not in row.quantities]
    bounds = (
        min(_ratios(bounded, STATIC_LOWER), default=None),
        max(_ratios(bounded, STATIC_UPPER), default=None),
    )
    return ContactRatio(contact, mean_over_series(pooled), len(pooled), between, bounds)


def _ratios(rows: Sequence[SeriesRow], name: str) -> Iterator[float]:
    for quantities in (row.quantities for row in rows):
        if name in quantities and _DYNAMIC in quantities and quantities[_DYNAMIC].quantity.value > 0.0:
            yield quantities[name].quantity.value / quantities[_DYNAMIC].quantity.value
