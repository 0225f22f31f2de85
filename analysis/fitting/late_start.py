"""Release time and pullback of a record that begins after the release."""

import numpy as np

from analysis.arrays import Floats
from analysis.fitting.models import FrictionLaw, Parameter
from analysis.fitting.problem import FitProblem

EARLIEST_PERIODS = 6.0
"""A record that begins later after its release tells too little of it."""
_WINDOW_PERIODS = 1.5
_READINGS = 60
_STEPS_PER_PERIOD = 48
"""Of the times of release that are tried; chi-square of the first readings is smooth over one."""
_STATIC_RATIOS = (1.0, 1.3, 1.7)
_KEPT = 6


def guess_release(
    guided: FitProblem, start: Floats, period_s: float, pullback_m: float | None
) -> list[Floats]:
    """Look back over six periods for releases whose motion fits the first readings; the best few, refined.

    Parameters
    ----------
    guided : Problem
        With prior knowledge of friction, tilt, stiffness and damping.
    start : (16,) float64
        Release and pullback in it are ignored.
    pullback_m : float or None
        Nominal pullback; any up to twice the first swing where None.
    """
    first_s = float(guided.table.time_s[0])
    window = guided.before(first_s + _WINDOW_PERIODS * period_s).decimated(_READINGS, np.inf)
    candidates = _candidates(window, start, period_s, pullback_m)
    best = candidates[np.argsort(window.chi_squares(candidates, fit_zero=True))[: 4 * _KEPT]]
    refined = [
        window.minimise(_with_fitted_zero(window, point), FrictionLaw.STATIC_TILT, 20) for point in best
    ]
    refined.sort(key=lambda minimum: minimum.cost)
    return [minimum.parameters for minimum in refined[:_KEPT]]


def _candidates(window: FitProblem, start: Floats, period_s: float, pullback_m: float | None) -> Floats:
    """Every combination of release time, pullback of either sign, and f_s, (m, 16)."""
    swing = float(np.abs(window.table.value_m - start[Parameter.TABLE_OFFSET]).max())
    pullbacks = swing * np.arange(1.0, 2.0, 0.05)
    if pullback_m is not None:
        pullbacks = abs(pullback_m) * np.array([0.96, 0.98, 1.0, 1.02, 1.04])
    first_s = float(window.table.time_s[0])
    releases = first_s - np.arange(0.0, EARLIEST_PERIODS, 1.0 / _STEPS_PER_PERIOD) * period_s
    statics = np.array(_STATIC_RATIOS) * start[Parameter.FRICTION_DYNAMIC]
    grid = np.meshgrid(statics, np.concatenate((pullbacks, -pullbacks)), releases, indexing="ij")
    found = np.tile(start, (grid[0].size, 1))
    for place, values in zip(
        (Parameter.FRICTION_STATIC, Parameter.PULLBACK, Parameter.RELEASE), grid, strict=True
    ):
        found[:, place] = values.ravel()
    return found


def _with_fitted_zero(window: FitProblem, point: Floats) -> Floats:
    """The point with gauge 2's zero at its best."""
    _, second = window.residuals(point, FrictionLaw.STATIC_TILT)
    if not len(second):
        return point
    moved = point.copy()
    moved[Parameter.RELATIVE_OFFSET] += second.mean()
    return moved
