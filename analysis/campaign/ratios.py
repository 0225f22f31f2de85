"""How much larger the static friction coefficient is than the dynamic one, by contact."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from analysis.campaign.contacts import mean_over_series
from analysis.campaign.pooling import pool
from analysis.campaign.readings import run_ratio
from analysis.campaign.rows import STATIC_LOWER, STATIC_UPPER, SeriesRow
from analysis.campaign.series import Series
from analysis.quantities import Quantity

_STATIC, _DYNAMIC = "friction_static", "friction_dynamic"


@dataclass(frozen=True, slots=True)
class ContactRatio:
    """f_s / f_d of one contact.

    Attributes
    ----------
    contact : str
    ratio : Quantity or None
        Mean over the series that determined f_s, their differences in its uncertainty; None without any.
    series : int
        How many did.
    between_series : float or None
        Standard deviation of the ratio from series to series; None with fewer than two.
    bounds : (float or None, float or None)
        Between which the other series leave it, as the smallest lower and largest upper bound; None where
        there are none.
    """

    contact: str
    ratio: Quantity | None
    series: int
    between_series: float | None
    bounds: tuple[float | None, float | None]


def friction_ratios(series: Sequence[Series], rows: Sequence[SeriesRow]) -> tuple[ContactRatio, ...]:
    """Ratios by contact, in the order of the table; `rows` are those of `series`."""
    contacts = dict.fromkeys(each.key.contact for each in series)
    return tuple(
        _of_contact(
            contact,
            [each for each in series if each.key.contact == contact],
            [row for row in rows if row.series.contact == contact],
        )
        for contact in contacts
    )


def _of_contact(contact: str, series: Sequence[Series], rows: Sequence[SeriesRow]) -> ContactRatio:
    runs = [[run_ratio(run, _STATIC, _DYNAMIC) for run in each.runs] for each in series]
    found = [[one for one in some if one is not None] for some in runs]
    pooled = pool([some for some in found if some], proportional=True) if any(found) else []
    bounds = _bounds([row for row in rows if _STATIC not in row.quantities])
    if not pooled:
        return ContactRatio(contact, None, 0, None, bounds)
    values = [one.quantity.value for one in pooled]
    between = float(np.std(values, ddof=1)) if len(values) > 1 else None
    return ContactRatio(contact, mean_over_series(pooled), len(pooled), between, bounds)


def _bounds(rows: Sequence[SeriesRow]) -> tuple[float | None, float | None]:
    """Smallest lower and largest upper bound of f_s over f_d."""
    ends = [[_over(row, name) for row in rows] for name in (STATIC_LOWER, STATIC_UPPER)]
    lows, highs = ([end for end in some if end is not None] for some in ends)
    return min(lows, default=None), max(highs, default=None)


def _over(row: SeriesRow, name: str) -> float | None:
    bound, friction = row.quantities.get(name), row.quantities.get(_DYNAMIC)
    if bound is None or friction is None or friction.quantity.value <= 0.0:
        return None
    return bound.quantity.value / friction.quantity.value
