"""Whether waiting improves a result: what later readings would add, by the fitted motion."""

from dataclasses import replace

import numpy as np

from analysis.arrays import Floats
from analysis.fitting.problem import FitProblem, covariance
from analysis.fitting.search import Fit
from analysis.laws.parameters import Parameter
from analysis.preparation.channels import Channel
from analysis.preparation.oscillation import DampedCosine, damped_cosine

RELATIVE_REDUCTION_MIN = 0.05
"""Waiting that takes away a smaller part of a standard uncertainty is not worth it."""
LATEST_END_S = 20.0  # after the release no record goes on for longer
_LATER_READINGS = 400  # later readings a channel that stand for all of them, with the noise of their mean


def is_worth_waiting(deviation: float, removed_variance: float) -> bool:
    """Whether taking `removed_variance` away narrows a standard uncertainty by more than a twentieth."""
    return removed_variance > (1.0 - (1.0 - RELATIVE_REDUCTION_MIN) ** 2) * deviation**2


def friction_variance_reduction(problem: FitProblem, fit: Fit, noise_variance: float, end_s: float) -> float:
    """Variance of f_d that readings until `end_s` would take away.

    `noise_variance` is the part of the variance of f_d that comes from noise, as the residuals show it.
    """
    now, _ = covariance(fit.normal_matrix)
    later = _later(problem, end_s)
    if later is None:
        return 0.0
    then, _ = covariance(fit.normal_matrix + _information(later, fit))
    place = int(np.flatnonzero(fit.free == Parameter.FRICTION_DYNAMIC)[0])
    white = float((now @ _information(problem, fit) @ now)[place, place])
    factor = noise_variance / white if white > 0.0 else 1.0
    return float(now[place, place] - then[place, place]) * factor


def tail_variance_reduction(tail: DampedCosine, end_s: float) -> Floats:
    """Shares (2,) of the noise variance of T and of n1 that a tail until `end_s` would take away."""
    if end_s <= tail.end_s:
        return np.zeros(2)
    density_hz = len(tail.residual_m) / (tail.end_s - tail.start_s)
    times_s = np.linspace(tail.end_s, end_s, _LATER_READINGS)
    _, columns = damped_cosine(tail.parameters, times_s - tail.start_s)
    weight = density_hz * (end_s - tail.end_s) / _LATER_READINGS
    variance = float(np.mean(tail.residual_m**2))
    now = tail.covariance
    then = np.linalg.inv(np.linalg.inv(now) + weight * columns @ columns.T / variance)
    shares = 1.0 - np.diag(then)[:2] / np.diag(now)[:2]
    return np.asarray(shares[::-1])


def _later(problem: FitProblem, end_s: float) -> FitProblem | None:
    """The same gauges after their last reading, with the noise of the mean of as many as one stands for."""
    start_s = float(problem.table.time_s[-1])
    if end_s <= start_s:
        return None
    times_s = np.linspace(start_s, end_s, _LATER_READINGS)
    empty = Channel(times_s, np.zeros(_LATER_READINGS))
    table = problem.table
    density_hz = len(table) / float(table.time_s[-1] - table.time_s[0])
    stands_for = max(density_hz * (end_s - start_s) / _LATER_READINGS, 1e-9)
    noise = problem.noise_m[0] / stands_for**0.5, problem.noise_m[1] / stands_for**0.5
    relative = None if problem.relative is None else empty
    return replace(problem, table=empty, relative=relative, noise_m=noise)


def _information(problem: FitProblem, fit: Fit) -> Floats:
    """Curvature (k, k) of half of chi-square that the readings of `problem` bring, without priors."""
    systems = problem.normal_equations(fit.parameters, fit.law, fit.free)
    return np.asarray(np.sum(systems, axis=0)[:-1, :-1])
