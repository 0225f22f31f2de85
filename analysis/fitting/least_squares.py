"""Levenberg-Marquardt on normal equations, for objectives with exact derivatives and kinks."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.arrays import Floats
from analysis.compiled import compiled, compiled_part

_FIRST_DAMPING = 1e-4
"""Over the diagonal of the normal matrix, scaled to ones: a step of Gauss and Newton at first."""
_DAMPING_MAX = 1e8
"""With more, steps are lost in rounding."""
_UNDETERMINED = 1e-11
"""Eigenvalue of the scaled normal matrix below which rounding decides."""
_PIVOT_MIN = 1e-14
_TINY = 1e-300
_ACCURACY = 1e-4
"""A step that promises a smaller fall of chi-square is not taken: a hundredth of a standard deviation."""


@dataclass(frozen=True, eq=False, slots=True)
class QuadraticModel:
    """Chi-square at a point, its descent direction and curvature: cost - 2 b.d + d.A.d nearby."""

    cost: float
    descent: Floats
    normal: Floats


@dataclass(frozen=True, eq=False, slots=True)
class Minimum:
    """Where the search ended.

    Attributes
    ----------
    steps : int
        Evaluations.
    settled : bool
        No step promised to win anything. Otherwise the steps ran out, or every one went up: at a jump.
    """

    parameters: Floats
    quadratic: QuadraticModel
    steps: int
    converged: bool

    @property
    def cost(self) -> float:
        """Chi-square, priors included."""
        return self.quadratic.cost


def minimise(
    evaluate: Callable[[Floats], QuadraticModel],
    project: Callable[[Floats], Floats],
    start: Floats,
    free: NDArray[np.int64],
    steps_max: int = 30,
) -> Minimum:
    """Go downhill from `start` in the `free` parameters.

    Parameters
    ----------
    evaluate : callable
        Chi-square with its quadratic form over the free parameters.
    project : callable
        Moves a parameter vector into the allowed region.
    start : (p,) float64
    free : (k,) int
        Places of the free parameters in the vector.
    """
    point = project(start)
    here = evaluate(point)
    damping, steps, settled = _FIRST_DAMPING, 1, False
    while steps < steps_max and damping < _DAMPING_MAX:
        move, promise = levenberg_marquardt_step(here.normal, here.descent, damping)
        if not promise >= _ACCURACY:  # nor when it is not a number
            settled = True
            break
        trial = point.copy()
        trial[free] += move
        trial = project(trial)
        there = evaluate(trial)
        steps += 1
        if there.cost < here.cost:
            point, here, damping = trial, there, max(1e-9, 0.1 * damping)
        else:
            damping *= 10.0 if damping > 1e-3 else 100.0
    return Minimum(point, here, steps, settled)


def covariance(normal: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    """Invert a normal matrix, leaving out combinations of parameters that it does not determine.

    Returns
    -------
    (k, k) float64
        Covariance within the determined combinations.
    (k,) bool
        True for a parameter that takes part in an undetermined combination.
    """
    curvature = np.diag(normal)
    scale = np.sqrt(np.where(curvature > 0.0, curvature, 1.0))  # a parameter without any is loose
    values, vectors = np.linalg.eigh(normal / np.outer(scale, scale))
    loose = values < _UNDETERMINED
    kept = vectors[:, ~loose]
    result = (kept / values[~loose]) @ kept.T / np.outer(scale, scale)
    return np.asarray(result), (np.abs(vectors[:, loose]) > 0.01).any(axis=1)


@compiled
def levenberg_marquardt_step(normal: Floats, descent: Floats, damping: float) -> tuple[Floats, float]:
    """Solve for the step of Levenberg and Marquardt.

    Parameters
    ----------
    normal, descent : (k, k) and (k,) float64
        See `Quadratic`.
    damping : float
        Added to the diagonal of the normal matrix, scaled to ones.

    Returns
    -------
    (k,) float64
        The step.
    float
        The fall of chi-square that it promises.
    """
    scale, scaled, move = np.empty(len(descent)), np.empty(normal.shape), np.empty(len(descent))
    for k in range(len(descent)):
        scale[k] = math.sqrt(max(normal[k, k], _TINY))
    for k in range(len(descent)):
        move[k] = descent[k] / scale[k]
        for j in range(len(descent)):
            scaled[k, j] = normal[k, j] / (scale[k] * scale[j])
        scaled[k, k] += damping + _PIVOT_MIN
    _solve_cholesky(scaled, move)
    promise = 0.0
    for k in range(len(descent)):
        move[k] /= scale[k]
    for k in range(len(descent)):
        promise += 2.0 * descent[k] * move[k]
        for j in range(len(descent)):
            promise -= move[k] * normal[k, j] * move[j]
    return move, promise


@compiled_part
def _solve_cholesky(matrix: Floats, right: Floats) -> None:
    """Solve a symmetric, positive system in place (Cholesky); no pivot is taken for less than rounding."""
    for i in range(len(matrix)):
        for j in range(i + 1):
            total = matrix[i, j]
            for k in range(j):
                total -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = math.sqrt(max(total, _PIVOT_MIN)) if i == j else total / matrix[j, j]
    for i in range(len(matrix)):
        for k in range(i):
            right[i] -= matrix[i, k] * right[k]
        right[i] /= matrix[i, i]
    for i in range(len(matrix) - 1, -1, -1):
        for k in range(i + 1, len(matrix)):
            right[i] -= matrix[k, i] * right[k]
        right[i] /= matrix[i, i]
