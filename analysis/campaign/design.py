"""The rows of a campaign as a linear model of ln f_d: contact and pullback, plate mass, velocity."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from analysis.arrays import Floats
from analysis.campaign.linear_model import Observations
from analysis.campaign.rows import TABLE_VELOCITY, SeriesRow

FRICTION = "friction_dynamic"
_INFLATION_MAX: Final = 10.0
"""Of the variance of the velocity's coefficient by the plate mass, above which they are not told apart."""
_NOTHING: Final = 1e-9
"""Relative variation of a cause that is none."""
_VAGUE: Final = 1e100
"""Relative uncertainty of an f_d that tells nothing, and whose square is no number."""


@dataclass(frozen=True, eq=False, slots=True)
class DesignMatrix:
    """Which combination of contact and pullback each row has, and its plate mass and velocity.

    Attributes
    ----------
    cells : tuple of (str, float)
        Contact and pullback (m) of each combination that occurs.
    matrix : (n, p) float64
        A column a combination, then plate mass (kg) and velocity (m/s) about their means, if they are told
        apart.
    mass, velocity : int or None
        Their columns; None where the rows cannot tell what they do.
    velocity_follows : bool
        The velocity differs, but only as contact, pullback and plate mass do.
    velocities : (float, float)
        Least and largest (m/s).
    """

    cells: tuple[tuple[str, float], ...]
    matrix: Floats
    mass: int | None
    velocity: int | None
    velocity_follows: bool
    velocities: tuple[float, float]

    @property
    def contacts(self) -> tuple[str, ...]:
        """Contacts in the order of the table."""
        return tuple(dict.fromkeys(contact for contact, _ in self.cells))

    @property
    def pullbacks_m(self) -> tuple[float, ...]:
        """Pullbacks, the smallest first."""
        return tuple(sorted({pullback for _, pullback in self.cells}))

    def form(self, **shares: float) -> Floats:
        """Weights (p,) of one coefficient: `mass=10.0` or `velocity=0.1`."""
        weights = np.zeros(self.matrix.shape[1])
        for name, share in shares.items():
            weights[getattr(self, name)] = share
        return weights

    def difference(self, one: tuple[str, float], other: tuple[str, float]) -> Floats:
        """Weights (p,) of ln f_d in one combination less that in another, at equal mass and velocity."""
        weights = np.zeros(self.matrix.shape[1])
        weights[self.cells.index(one)] = 1.0
        weights[self.cells.index(other)] = -1.0
        return weights


def is_usable(row: SeriesRow) -> bool:
    """Tell whether the effects can take a row: it has f_d above 0, v_max and a pullback."""
    friction = row.quantities.get(FRICTION)
    return (
        friction is not None
        and friction.quantity.value > 0.0
        and friction.quantity.standard_uncertainty < _VAGUE * friction.quantity.value
        and TABLE_VELOCITY in row.quantities
        and row.series.pullback_m is not None
    )


def build_design(rows: Sequence[SeriesRow]) -> DesignMatrix:
    """Lay out the model of rows that are `usable`."""
    places = [(row.series.contact, row.series.pullback_m or 0.0) for row in rows]
    cells = tuple(dict.fromkeys(places))
    columns = [np.array([float(place == cell) for place in places]) for cell in cells]
    masses = np.array([row.series.plate_mass_kg for row in rows])
    velocities = np.array([row.quantities[TABLE_VELOCITY].quantity.value for row in rows])
    mass = _column(columns, masses)
    within = _unexplained(columns[: len(cells)], velocities)
    differs = within > _NOTHING * float(np.linalg.norm(velocities)) or len(cells) > 1
    velocity = None
    if _unexplained(columns, velocities) ** 2 * _INFLATION_MAX > max(within, _NOTHING) ** 2:
        velocity = _column(columns, velocities)
    ends = float(velocities.min()), float(velocities.max())
    return DesignMatrix(cells, np.column_stack(columns), mass, velocity, velocity is None and differs, ends)


def observations(rows: Sequence[SeriesRow]) -> Observations:
    """Ln f_d of each row with the covariance of its errors."""
    pooled = [row.quantities[FRICTION] for row in rows]
    values = np.array([one.quantity.value for one in pooled])
    own = np.array([one.repeatable for one in pooled]) / values
    keys = sorted({key for one in pooled for key in one.common})
    shared = np.array([[one.common.get(key, 0.0) for key in keys] for one in pooled]) / values[:, None]
    return Observations(np.log(values), own**2, shared @ shared.T, _degrees(rows))


def _degrees(rows: Sequence[SeriesRow]) -> int:
    """Of the repeats of all rows, each scatter counted once."""
    return sum(row.quantities[FRICTION].runs - 1 for row in rows)


def _column(columns: list[Floats], values: Floats) -> int | None:
    """Append a cause about its mean, if the columns so far do not explain it; returns its place."""
    if _unexplained(columns, values) <= _NOTHING * float(np.linalg.norm(values)):
        return None
    columns.append(values - values.mean())
    return len(columns) - 1


def _unexplained(columns: list[Floats], values: Floats) -> float:
    """Length of what is left of `values` when the columns are fitted to them."""
    matrix = np.column_stack(columns)
    return float(np.linalg.norm(values - matrix @ np.linalg.lstsq(matrix, values, rcond=None)[0]))
