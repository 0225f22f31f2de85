"""The joint fit of both gauges: start values that need no guess, then refinement, for each friction law."""

from dataclasses import dataclass

import numpy as np

from analysis.channels import FloatArray
from analysis.least_squares import Minimum
from analysis.models import Model, Place
from analysis.problem import Problem, allowed

_THIN = 400
"""Readings a channel for searching: the shape of chi-square needs no more."""
_STATIC_RATIOS = np.concatenate((np.linspace(1.0, 1.4, 29), np.linspace(1.42, 2.6, 60)))
_FIRST_WINDOW_PERIODS = 0.6
"""So early f_s plays no part, and chi-square has one minimum near any fair start."""
_WINDOWS_PERIODS = (1.5, 3.0, 6.0, np.inf)
_KEPT = 4


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


def search(problem: Problem, guided: Problem, start: FloatArray, period_s: float) -> FloatArray:
    """Find the lowest minimum of the widest law (f_s and tilt free) by following the motion in time.

    Later slips depend on f_s through every breakaway before them, so that chi-square of a whole record
    has a great many minima; that of the first slips has few. The best few are kept as the window grows.

    Parameters
    ----------
    guided : Problem
        The same with prior knowledge from tail, hold and parabolas; used until the window is the record.
    start : (15,) float64
    """
    release = float(start[Place.RELEASE])
    first = guided.until(release + _FIRST_WINDOW_PERIODS * period_s).thinned(_THIN)
    points = [first.minimise(start, Model.COULOMB_TILT, 25).parameters]
    for periods in _WINDOWS_PERIODS:
        known = guided if np.isfinite(periods) else problem
        window = known.until(release + periods * period_s).thinned(_THIN)
        minima = [window.minimise(point, Model.STATIC_TILT, 12) for point in _along_static(window, points)]
        minima.sort(key=lambda minimum: minimum.cost)
        points = [minimum.parameters for minimum in minima]
    return points[0]


def fit_model(problem: Problem, model: Model, starts: list[FloatArray]) -> Fit:
    """Fit `model` from the best of several starts."""
    thin = problem.thinned(_THIN)
    rough = [thin.minimise(allowed(start, model), model, 25) for start in starts]
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


def _along_static(window: Problem, points: list[FloatArray]) -> list[FloatArray]:
    """Local minima of chi-square along f_s from each point, and the points themselves: the lowest few."""
    found: list[tuple[float, FloatArray]] = []
    for point in points:
        line = [_with_static(point, ratio) for ratio in _STATIC_RATIOS]
        costs = np.array([window.cost(candidate) for candidate in line])
        padded = np.concatenate(([np.inf], costs, [np.inf]))
        lowest = np.flatnonzero((padded[1:-1] <= padded[:-2]) & (padded[1:-1] <= padded[2:]))
        found += [(float(costs[index]), line[index]) for index in lowest]
        found.append((window.cost(point), point))
    found.sort(key=lambda pair: pair[0])
    return [point for _, point in found[:_KEPT]]


def _with_static(point: FloatArray, ratio: float) -> FloatArray:
    moved = point.copy()
    moved[Place.FRICTION_STATIC] = ratio * point[Place.FRICTION_DYNAMIC]
    return moved
