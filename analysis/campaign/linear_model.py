"""A linear model of values with known uncertainties, partly shared: fit, F tests, and their power."""

from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.optimize import brentq
from scipy.special import fdtrc, fdtri, ncfdtr, stdtrit

from analysis.arrays import Floats

LEVEL, POWER = 0.05, 0.8
_FARTHEST = 1e6


@dataclass(frozen=True, eq=False, slots=True)
class Observations:
    """Values to be explained.

    Attributes
    ----------
    values : (n,) float64
    variances : (n,) float64
        Of what each value has for itself, as repeats show it.
    shared : (n, n) float64
        Covariance of the errors that values share.
    degrees_of_freedom : int
        Of `variances`; 0 where they come from single runs, whose differences are not known.
    """

    values: Floats
    variances: Floats
    shared: Floats
    degrees_of_freedom: int


@dataclass(frozen=True, eq=False, slots=True)
class LinearFit:
    """A model fitted by generalised least squares.

    Attributes
    ----------
    coefficients : (p,) float64
    covariance : (p, p) float64
    degrees_of_freedom : int
        Of the variance that tests use.
    beyond : float
        Standard deviation of the values about the model beyond their uncertainties.
    """

    coefficients: Floats
    covariance: Floats
    degrees_of_freedom: int
    excess_deviation: float


@dataclass(frozen=True, slots=True)
class FTest:
    """An F test that some combinations of coefficients are zero.

    `size_seen` is the size of the effect of a given pattern that has the chance `POWER` to be found.
    """

    statistic: float
    degrees_of_freedom: tuple[int, int]
    p_value: float
    detectable_size: float


def fit_linear_model(design: Floats, observations: Observations) -> LinearFit | None:
    """Fit `values = design @ coefficients` by generalised least squares.

    Each value has its own uncertainty, and the values scatter about the model beyond it, with a variance
    that makes chi-square equal to its degrees of freedom (Mandel and Paule), 0 at least. Tests have the
    degrees of freedom of that scatter; where there are none, those of the repeats.

    Parameters
    ----------
    design : (n, p) float64
        Of full rank.
    measured : Measured

    Returns
    -------
    Fitted or None
        None where nothing tells how far chance goes: no repeats, and as many coefficients as values.
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
    """Test that `combinations @ coefficients` are all zero.

    Parameters
    ----------
    fitted : Fitted
    combinations : (k, p) float64
        Of rank k.
    patterns : (m, k) float64
        What the combinations are for an effect of size 1, in m ways; the power is that of the worst.
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
    return (
        float(weights @ fitted.coefficients),
        deviation,
        float(stdtrit(fitted.degrees_of_freedom, 0.975)) * deviation,
    )


def _beyond(design: Floats, measured: Observations, left: int) -> float:
    def excess(beyond: float) -> float:
        return _chi_square(design, measured, beyond) - left

    if excess(0.0) <= 0.0:
        return 0.0
    far = float(np.std(measured.values)) or 1.0
    while excess(far) > 0.0:
        far *= 2.0
    return float(brentq(excess, 0.0, far, xtol=1e-12 * far))


def _chi_square(design: Floats, measured: Observations, beyond: float) -> float:
    """Of the residuals of the best fit."""
    weighted, values = _whitened(design, measured, beyond)
    coefficients = np.linalg.lstsq(weighted, values, rcond=None)[0]
    return float(np.sum((values - weighted @ coefficients) ** 2))


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
