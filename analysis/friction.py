"""The joint fit of both gauges: start values that need no guess, then refinement, for each friction law."""

from dataclasses import dataclass

import numpy as np

from analysis.channels import FloatArray
from analysis.least_squares import Minimum
from analysis.models import Model, Place
from analysis.problem import Problem, allowed

_THIN = 400
"""Readings a channel for searching: the shape of chi-square needs no more."""
_STATIC_RATIOS = np.concatenate((np.linspace(1.0, 1.4, 29), np.linspace(1.42, 2.4, 50)))


@dataclass(frozen=True, eq=False, slots=True)
class Fit:
    """A friction law fitted to a record.

    Attributes
    ----------
    parameters : (15,) float64
        By `Place`.
    free : (k,) int
        Places that were free.
    normal : (k, k) float64
        Gauss-Newton curvature of half of chi-square over the free parameters, priors included.
    chi_square : float
        Of the readings alone.
    bic : float
    table_residual_m, relative_residual_m : (n,) float64
        Reading minus curve.
    """

    model: Model
    parameters: FloatArray
    free: FloatArray
    normal: FloatArray
    chi_square: float
    bic: float
    table_residual_m: FloatArray
    relative_residual_m: FloatArray

    def value(self, place: Place) -> float:
        """Fitted value of one parameter."""
        return float(self.parameters[place])

    @property
    def rms_m(self) -> float:
        """Root mean square of both channels' residuals."""
        both = np.concatenate((self.table_residual_m, self.relative_residual_m))
        return float(np.sqrt(np.mean(both**2)))


def early_fit(problem: Problem, start: FloatArray, period_s: float) -> FloatArray:
    """Refine release, pullback, friction and tilt on the first one and a half periods of the motion.

    So early the motion has not branched yet, and chi-square has one minimum near any fair start.
    The problem must know stiffness, damping and zeros from elsewhere (the stick tail).
    """
    point = start
    for periods in (0.6, 1.5):
        early = problem.until(start[Place.RELEASE] + periods * period_s).thinned(_THIN)
        point = early.minimise(point, Model.COULOMB_TILT, 25).parameters
    return point


def fit_model(problem: Problem, model: Model, start: FloatArray, simpler: list[Fit]) -> Fit:
    """Fit `model` from an early fit and from the laws that it holds as special cases.

    A law with f_s looks along f_s first, where chi-square has many minima.
    """
    thin = problem.thinned(_THIN)
    points = _static_starts(thin, model, start) if model.has_static else [allowed(start, model)]
    points += [fit.parameters for fit in simpler if set(fit.model.free) < set(model.free)]
    rough = [thin.minimise(point, model, 25) for point in points]
    best = min(rough, key=lambda minimum: minimum.cost)
    return finished(problem, model, problem.minimise(best.parameters, model))


def finished(problem: Problem, model: Model, minimum: Minimum) -> Fit:
    """Describe a minimum."""
    table, relative = problem.residuals(minimum.parameters)
    chi_square = float(
        table @ table / problem.noise_m[0] ** 2 + relative @ relative / problem.noise_m[1] ** 2
    )
    bic = chi_square + len(model.free) * float(np.log(problem.samples))
    free = problem.free(model)
    return Fit(model, minimum.parameters, free, minimum.quadratic.normal, chi_square, bic, table, relative)


def _static_starts(thin: Problem, model: Model, start: FloatArray, count: int = 4) -> list[FloatArray]:
    """The best few local minima of chi-square along f_s."""
    points = []
    for ratio in _STATIC_RATIOS:
        point = start.copy()
        point[Place.FRICTION_STATIC] = ratio * start[Place.FRICTION_DYNAMIC]
        points.append(allowed(point, model))
    costs = np.array([thin.cost(point) for point in points])
    padded = np.concatenate(([np.inf], costs, [np.inf]))
    lowest = np.flatnonzero((padded[1:-1] <= padded[:-2]) & (padded[1:-1] <= padded[2:]))
    order = lowest[np.argsort(costs[lowest], kind="stable")]
    return [points[index] for index in order[:count]]
