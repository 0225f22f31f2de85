"""Release time and pullback of a record that begins after the release."""

import numpy as np

from analysis.channels import FloatArray
from analysis.models import Model, Place
from analysis.problem import Problem, allowed

_WINDOW_PERIODS = 1.5
_READINGS = 60
_EARLIEST_PERIODS = 6.0
_STEPS_PER_PERIOD = 48
_STATIC_RATIOS = (1.0, 1.3, 1.7)
_KEPT = 6


def guess_releases(
    guided: Problem, start: FloatArray, period_s: float, pullback_m: float | None
) -> list[FloatArray]:
    """Look back over six periods for releases whose motion fits the first readings; the best few, refined.

    Parameters
    ----------
    guided : Problem
        With prior knowledge of friction, tilt, stiffness and damping.
    start : (15,) float64
        Release and pullback in it are ignored.
    pullback_m : float or None
        Nominal pullback; any up to twice the first swing where None.
    """
    first_s = float(guided.table.time_s[0])
    window = guided.until(first_s + _WINDOW_PERIODS * period_s).thinned(_READINGS, np.inf)
    candidates = _candidates(window, start, period_s, pullback_m)
    scored = sorted(((_cost(window, point), index) for index, point in enumerate(candidates)))
    best = [candidates[index] for _, index in scored[: 4 * _KEPT]]
    refined = [window.minimise(_zeroed(window, point), Model.STATIC_TILT, 20) for point in best]
    refined.sort(key=lambda minimum: minimum.cost)
    return [minimum.parameters for minimum in refined[:_KEPT]]


def _candidates(
    window: Problem, start: FloatArray, period_s: float, pullback_m: float | None
) -> list[FloatArray]:
    swing = float(np.abs(window.table.value_m - start[Place.TABLE_OFFSET]).max())
    pullbacks = swing * np.arange(1.0, 2.0, 0.05)
    if pullback_m is not None:
        pullbacks = abs(pullback_m) * np.array([0.96, 0.98, 1.0, 1.02, 1.04])
    first_s = float(window.table.time_s[0])
    releases = first_s - np.arange(0.0, _EARLIEST_PERIODS, 1.0 / _STEPS_PER_PERIOD) * period_s
    found = []
    for ratio in _STATIC_RATIOS:
        for pullback in (*pullbacks, *(-pullbacks)):
            for release in releases:
                point = start.copy()
                point[Place.PULLBACK], point[Place.RELEASE] = pullback, release
                point[Place.FRICTION_STATIC] = ratio * point[Place.FRICTION_DYNAMIC]
                found.append(point)
    return found


def _cost(window: Problem, point: FloatArray) -> float:
    """Sum of squares (m2) with gauge 2's zero left open."""
    first, second = window.residuals(allowed(point, Model.STATIC_TILT))
    second = second - second.mean() if len(second) else second
    return float(first @ first + second @ second)


def _zeroed(window: Problem, point: FloatArray) -> FloatArray:
    """The point with gauge 2's zero at its best."""
    _, second = window.residuals(point)
    if not len(second):
        return point
    moved = point.copy()
    moved[Place.RELATIVE_OFFSET] += second.mean()
    return moved
