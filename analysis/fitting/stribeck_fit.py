"""The law that is tried when no other explains the record: friction that falls with speed."""

from itertools import product

import numpy as np

from analysis.arrays import Floats
from analysis.fitting.models import FrictionLaw, Parameter
from analysis.fitting.problem import FitProblem
from analysis.fitting.search import Fit, Search, fit_at_minimum

_VELOCITIES_M_PER_S = (0.002, 0.005, 0.012, 0.03, 0.08)
_EXCESSES = (0.03, 0.1, 0.25, 0.6)
"""f_s above f_d, in units of f_d."""
_TYPICAL_M_PER_S = 0.06
"""Mean speed of slips."""
_KEPT = 3
_STEPS = 10
_HOPELESS = 0.1
"""Residual over range of gauge 1 from which on it is not friction that is wrong: Stribeck friction with f_s
up to three times f_d leaves 0.014 at most with the other laws."""


def may_explain(problem: FitProblem, fits: list[Fit]) -> bool:
    """Whether the best of the other laws' `fits` is so near the record that friction may be the reason."""
    rms_m = min(fit.rms_m for fit in fits)
    return rms_m < _HOPELESS * float(np.ptp(problem.table.value_m))


def fit_stribeck(search: Search, static: Fit) -> Fit:
    """Fit f = f_d + (f_s - f_d) exp(-|w| / v_s) with a tilt, from the fit of the law without v_s."""
    some = search.window(np.inf)
    starts = [static.parameters, *_grid(static.parameters)]
    starts.sort(key=lambda point: _cost(some, point))
    rough = [some.minimise(point, FrictionLaw.STRIBECK_TILT, _STEPS) for point in starts[:_KEPT]]
    best = min(rough, key=lambda minimum: minimum.cost)
    refined = search.problem.minimise(best.parameters, FrictionLaw.STRIBECK_TILT, _STEPS)
    return fit_at_minimum(search.problem, FrictionLaw.STRIBECK_TILT, refined)


def _grid(point: Floats) -> list[Floats]:
    """Points with a friction that is about that of `point` at the speeds of most slips."""
    found = []
    for velocity, excess in product(_VELOCITIES_M_PER_S, _EXCESSES):
        moved = point.copy()
        moved[Parameter.STRIBECK_VELOCITY] = velocity
        moved[Parameter.FRICTION_DYNAMIC] *= 1.0 - excess * velocity / (velocity + _TYPICAL_M_PER_S)
        moved[Parameter.FRICTION_STATIC] = (1.0 + excess) * moved[Parameter.FRICTION_DYNAMIC]
        found.append(moved)
    return found


def _cost(problem: FitProblem, point: Floats) -> float:
    table, relative = problem.residuals(point, FrictionLaw.STRIBECK_TILT)
    return float(table @ table / problem.noise_m[0] ** 2 + relative @ relative / problem.noise_m[1] ** 2)
