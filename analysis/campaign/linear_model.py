"""Linear model of values with partly shared uncertainties: design matrix, fit, F tests and their power."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Final

import numpy as np
from scipy.optimize import brentq
from scipy.special import fdtrc, fdtri, ncfdtr, stdtrit

from analysis.arrays import Floats
from analysis.campaign.rows import TABLE_VELOCITY, SeriesRow

LEVEL, POWER = 0.05, 0.8
_FARTHEST = 1e6


@dataclass(frozen=True, eq=False, slots=True)
class Observations:
    """Values of the model, with the covariance of their errors."""

    values: Floats
    variances: Floats  # (n,) float64: of the independent errors, from repeats
    shared: Floats  # (n, n) float64: covariance of the shared errors
    degrees_of_freedom: int  # of `variances`; 0 where they come from single runs


@dataclass(frozen=True, eq=False, slots=True)
class LinearFit:
    """A model fitted by generalised least squares."""

    coefficients: Floats  # (p,) float64
    covariance: Floats  # (p, p) float64
    degrees_of_freedom: int  # of the variance used in tests
    excess_deviation: float  # standard deviation of the values about the model beyond their uncertainties


@dataclass(frozen=True, slots=True)
class FTest:
    """An F test that some combinations of coefficients are zero.

    `detectable_size` is the size of an effect of the given pattern that is found with the chance `POWER`.
    """

    statistic: float
    degrees_of_freedom: tuple[int, int]
    p_value: float
    detectable_size: float


def fit_linear_model(design: Floats, observations: Observations) -> LinearFit | None:
    """Fit `values = design @ coefficients` by generalised least squares.

    The values scatter about the model beyond their uncertainties, with the variance, 0 or above, at which
    chi-square equals its degrees of freedom (Mandel and Paule). Tests have the degrees of freedom of that
    scatter, or those of the repeats where there are none.
    `design` (n, p) has full rank. None without residual degrees of freedom: no repeats, and as many
    coefficients as values.
    """
    left = len(observations.values) - design.shape[1]
    if left + observations.degrees_of_freedom == 0:
        return None
    beyond = _beyond(design, observations, left) if left else 0.0
    weighted, values = _whitened(design, observations, beyond)
    inverse = np.asarray(np.linalg.inv(weighted.T @ weighted), dtype=np.float64)
    coefficients = np.asarray(np.linalg.lstsq(weighted, values, rcond=None)[0], dtype=np.float64)
    return LinearFit(coefficients, inverse, left or observations.degrees_of_freedom, beyond)


def f_test(fitted: LinearFit, combinations: Floats, patterns: Floats) -> FTest:
    """Test that `combinations` (k, p), of rank k, times the coefficients are all zero.

    `patterns` (m, k) are their values for an effect of size 1, in m ways; the least power counts.
    """
    count, degrees = len(combinations), fitted.degrees_of_freedom
    inverse = np.linalg.inv(combinations @ fitted.covariance @ combinations.T)
    estimated = combinations @ fitted.coefficients
    statistic = max(0.0, float(estimated @ inverse @ estimated)) / count
    needed = np.sqrt(_noncentrality(count, degrees) / np.einsum("ij,jk,ik->i", patterns, inverse, patterns))
    return FTest(statistic, (count, degrees), float(fdtrc(count, degrees, statistic)), float(np.max(needed)))


def estimate_linear_form(fitted: LinearFit, weights: Floats) -> tuple[float, float, float]:
    """Linear form of the coefficients: value, standard uncertainty, and half of the 95 % interval."""
    deviation = float(np.sqrt(weights @ fitted.covariance @ weights))
    half = float(stdtrit(fitted.degrees_of_freedom, 0.975)) * deviation
    return float(weights @ fitted.coefficients), deviation, half


def _beyond(design: Floats, measured: Observations, left: int) -> float:
    def excess(beyond: float) -> float:
        weighted, values = _whitened(design, measured, beyond)
        coefficients = np.linalg.lstsq(weighted, values, rcond=None)[0]
        return float(np.sum((values - weighted @ coefficients) ** 2)) - left

    if excess(0.0) <= 0.0:
        return 0.0
    far = float(np.std(measured.values)) or 1.0
    while excess(far) > 0.0:
        far *= 2.0
    return float(brentq(excess, 0.0, far, xtol=1e-12 * far))


def _whitened(design: Floats, measured: Observations, beyond: float) -> tuple[Floats, Floats]:
    """Design and values in units in which the errors are independent and of size 1."""
    covariance = np.diag(measured.variances + beyond**2) + measured.shared
    root = np.linalg.cholesky(covariance)
    both = np.linalg.solve(root, np.column_stack([design, measured.values]))
    return both[:, :-1], both[:, -1]


@cache
def _noncentrality(count: int, degrees: int) -> float:
    """Noncentrality at which an F test at `LEVEL` finds the effect with the chance `POWER`."""
    critical = float(fdtri(count, degrees, 1.0 - LEVEL))

    def short(noncentrality: float) -> float:
        return float(ncfdtr(count, degrees, noncentrality, critical)) - (1.0 - POWER)

    far = 10.0
    while short(far) > 0.0 and far < _FARTHEST:
        far *= 2.0
    return float(brentq(short, 1e-9, far)) if far < _FARTHEST else float("inf")


FRICTION = "friction_dynamic"
_INFLATION_MAX: Final = 10.0  # variance inflation above which velocity and plate mass are confounded
_NOTHING: Final = 1e-9  # relative variation that is rounding
_VAGUE: Final = 1e100  # relative uncertainty whose square overflows


@dataclass(frozen=True, eq=False, slots=True)
class DesignMatrix:
    """Design matrix of ln f_d: combination of contact and pullback, plate mass, velocity."""

    cells: tuple[tuple[str, float], ...]  # contact and pullback (m) of each combination
    matrix: Floats
    """(n, p) float64: one column for each combination, then plate mass (kg) and velocity (m/s) about their
    means, where they are not confounded."""
    mass: int | None  # index of its column; None where confounded
    velocity: int | None
    velocity_follows: bool  # the velocity varies only with contact, pullback and plate mass
    velocities: tuple[float, float]  # least and largest (m/s)

    @property
    def contacts(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys(contact for contact, _ in self.cells))

    @property
    def pullbacks_m(self) -> tuple[float, ...]:
        return tuple(sorted({pullback for _, pullback in self.cells}))

    def form(self, place: int, share: float) -> Floats:
        weights = np.zeros(self.matrix.shape[1])
        weights[place] = share
        return weights

    def difference(self, one: tuple[str, float], other: tuple[str, float]) -> Floats:
        """Weights (p,) of ln f_d in one combination less that in another, at equal mass and velocity."""
        weights = np.zeros(self.matrix.shape[1])
        weights[self.cells.index(one)] = 1.0
        weights[self.cells.index(other)] = -1.0
        return weights


def is_usable(row: SeriesRow) -> bool:
    """Tell whether a row has f_d above 0, v_max and a pullback."""
    friction = row.quantities.get(FRICTION)
    return (
        friction is not None
        and friction.quantity.value > 0.0
        and friction.quantity.standard_uncertainty < _VAGUE * friction.quantity.value
        and TABLE_VELOCITY in row.quantities
        and row.series.pullback_m is not None
    )


def build_design(rows: Sequence[SeriesRow]) -> DesignMatrix:
    """Design matrix of rows that are usable."""
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
    keys = sorted({key for one in pooled for key in one.common}, key=str)
    shared = np.array([[one.common.get(key, 0.0) for key in keys] for one in pooled]) / values[:, None]
    repeats = sum(one.runs - 1 for one in pooled)
    return Observations(np.log(values), own**2, shared @ shared.T, repeats)


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
