"""First estimate of friction and tilt: while it slips, the plate's own path is a parabola.

In a slip the plate obeys u2'' = -g (s f_d - tilt), whatever the table does. So the sum of both gauges,
fitted piece by piece with parabolas of two common curvatures, gives f_d and tilt without a simulation.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from analysis.arrays import Floats
from analysis.preparation.channels import Channel
from analysis.preparation.release import local_slopes, white_noise


@dataclass(frozen=True, eq=False, slots=True)
class PlatePathEstimate:
    """Friction and tilt from the plate's path.

    Attributes
    ----------
    friction, tilt_rad : float
        Estimates; the tilt is zero where all slips go one way.
    covariance : (2, 2) float64
        Of (friction, tilt), from the noise.
    slips : int
        Number of slip phases used.
    misfit : float
        Chi-square per degree of freedom of the phases' curvatures about the common two.
    """

    friction: float
    tilt_rad: float
    covariance: Floats
    slips: int
    misfit: float


def estimate_from_plate_path(
    table: Channel, relative: Channel, period_s: float, gravity_m_per_s2: float
) -> PlatePathEstimate | None:
    """Fit parabolas to table + relative in every clear slip phase; None where there is none.

    Parameters
    ----------
    table, relative : Channel
        From release to the end of slip.
    """
    phases = _phases(relative, period_s)
    if not phases:
        return None
    u2 = relative.value_m + np.interp(relative.time_s, table.time_s, table.value_m)
    noise = float(np.hypot(white_noise(table), white_noise(relative))) + 1e-9
    signs, curvatures, weights = (
        np.array(column)
        for column in zip(*(_curvature(relative.time_s, u2, phase) for phase in phases), strict=True)
    )
    return _common(signs, curvatures / gravity_m_per_s2, weights * (gravity_m_per_s2 / noise) ** 2)


def _phases(relative: Channel, period_s: float) -> list[tuple[int, int, int]]:
    """(sign, first, last) of the samples well inside each slip phase."""
    if len(relative) < 12:
        return []
    half_window = period_s / 24.0
    w = local_slopes(relative, half_window)
    interval = float(np.median(np.diff(relative.time_s)))
    count = max(5.0, 2.0 * half_window / interval)
    noise = white_noise(relative) * float(np.sqrt(12.0 / count**3)) / interval
    threshold = max(5.0 * noise, 0.05 * float(np.abs(w).max()), 1e-6)
    side = np.where(w > threshold, 1, np.where(w < -threshold, -1, 0))
    edges = np.concatenate(([0], np.flatnonzero(np.diff(side)) + 1, [len(side)]))
    return [
        (int(side[first]), int(first), int(last))
        for first, last in pairwise(edges)
        if side[first] != 0
        and last - first >= 6
        and relative.time_s[last - 1] - relative.time_s[first] > period_s / 8.0
    ]


def _curvature(time_s: Floats, u2: Floats, phase: tuple[int, int, int]) -> tuple[float, float, float]:
    """Sign, second derivative of u2 (m/s2) and its weight for noise of one metre."""
    sign, first, last = phase
    tau = time_s[first:last] - time_s[first:last].mean()
    columns = np.stack((np.ones_like(tau), tau))
    parabola = 0.5 * tau**2
    parabola = parabola - columns.T @ np.linalg.lstsq(columns.T, parabola, rcond=None)[0]
    weight = float(parabola @ parabola)
    return float(sign), float(parabola @ u2[first:last]) / weight, weight


def _common(signs: Floats, curvatures: Floats, weights: Floats) -> PlatePathEstimate:
    """Weighted least squares of curvature/g = -s f + tilt."""
    both_ways = len(np.unique(signs)) > 1
    columns = np.stack((-signs, np.ones_like(signs) if both_ways else np.zeros_like(signs)))
    covariance = np.asarray(np.linalg.pinv(columns * weights @ columns.T), dtype=np.float64)
    friction, tilt = covariance @ (columns * weights @ curvatures)
    residual = curvatures + signs * friction - tilt
    freedom = max(1, len(signs) - 1 - int(both_ways))
    misfit = float(residual**2 @ weights) / freedom
    return PlatePathEstimate(float(friction), float(tilt), covariance, len(signs), misfit)
