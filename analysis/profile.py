"""Intervals from the shape of chi-square itself, for parameters about which it is not a parabola."""

import numpy as np

from analysis.friction import Fit
from analysis.least_squares import covariance
from analysis.models import Place
from analysis.problem import Problem

_RISE = 3.841458820694124
"""Rise of chi-square at the ends of a 95 % interval."""
_QUADRATIC = 0.15
"""Relative deviation from that rise up to which a parabola is good enough."""
_FARTHEST = 8.0
_LOOKS = 7
_STEPS = 8


def profile_interval(
    problem: Problem, fit: Fit, place: Place, deviation: float
) -> tuple[float, float] | None:
    """Ends of the 95 % interval of one parameter from the noise, as distances below and above its value.

    Parameters
    ----------
    deviation : float
        Its standard uncertainty from the noise; scales the rise where the noise is larger than stated.

    Returns
    -------
    (float, float) or None
        None where chi-square is a parabola: then 1.96 standard uncertainties hold on both sides.
    """
    index = int(np.flatnonzero(fit.free == place)[0])
    scale = deviation**2 / float(covariance(fit.normal)[0][index, index])
    half = float(np.sqrt(_RISE)) * deviation
    rises = [_rise(problem, fit, place, side * half) / scale for side in (-1.0, 1.0)]
    if all(abs(rise / _RISE - 1.0) < _QUADRATIC for rise in rises):
        return None
    below, above = (
        _distance(problem, fit, place, side, half, rise, scale)
        for side, rise in zip((-1.0, 1.0), rises, strict=True)
    )
    return below, above


def _rise(problem: Problem, fit: Fit, place: Place, shift: float) -> float:
    """Rise of chi-square with the parameter held off its value, the others refined."""
    start = fit.parameters.copy()
    start[place] += shift
    there = problem.minimise(start, fit.model, _STEPS, held=place)
    if there.parameters[place] != start[place]:  # the law does not allow that value
        return np.inf
    return there.cost - problem.quadratic(fit.parameters, fit.model, fit.free).cost


def _distance(
    problem: Problem, fit: Fit, place: Place, side: float, half: float, rise: float, scale: float
) -> float:
    """Distance at which chi-square has risen enough, by bisection between known ends."""
    near, far = (0.0, half) if rise > _RISE else (half, _FARTHEST * half)
    for _ in range(_LOOKS):
        middle = 0.5 * (near + far) if rise > _RISE else min(1.6 * near, 0.5 * (near + far))
        if _rise(problem, fit, place, side * middle) / scale > _RISE:
            far = middle
        else:
            near = middle
    return 0.5 * (near + far)
