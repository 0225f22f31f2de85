"""How good a gauge is: non-linearity, hysteresis, repeatability and zero drift."""

from dataclasses import dataclass

import numpy as np

from analysis.arrays import Floats
from analysis.calibration.points import CalibrationPoints


@dataclass(frozen=True, slots=True)
class GaugeCharacteristics:
    """Figures of a gauge in m; None where the readings cannot tell.

    Attributes
    ----------
    nonlinearity_m : float
        Largest deviation from the curve at any step on the way up or down, averaged over the rounds; with
        the gauge's hysteresis, therefore.
    hysteresis_m : float, optional
        Largest difference between the ways up and down at one step, averaged over the rounds.
    repeatability_m : float, optional
        Standard deviation of readings at one step in one direction from round to round, pooled.
    zero_drift_m : float, optional
        By how much the gauge shows more at the end of its last way back to the lowest step than at its
        first reading there.
    """

    nonlinearity_m: float
    hysteresis_m: float | None
    repeatability_m: float | None
    zero_drift_m: float | None


def gauge_characteristics(readings: CalibrationPoints, residual_m: Floats) -> GaugeCharacteristics:
    """Figures from the residuals (n,), dial reading minus curve (m)."""
    steps = readings.steps()
    cells = [
        (step, way, residual_m[(steps == step) & (readings.direction == way)])
        for step in np.unique(steps)
        for way in (1, -1)
    ]
    means = {(step, way): float(cell.mean()) for step, way, cell in cells if len(cell)}
    loops = [
        abs(mean - means[step, -1]) for (step, way), mean in means.items() if way == 1 and (step, -1) in means
    ]
    return GaugeCharacteristics(
        max(abs(mean) for mean in means.values()),
        max(loops, default=None),
        _repeatability([cell for _, _, cell in cells]),
        _zero_drift(residual_m[steps == 0]),
    )


def step_means(readings: CalibrationPoints) -> tuple[Floats, Floats]:
    """Mean counts and mean displacement (m) of each step; up and down weigh alike."""
    steps = readings.steps()
    means = []
    for step in np.unique(steps):
        ways = [(steps == step) & (readings.direction == way) for way in (1, -1)]
        both = [(readings.counts[at].mean(), readings.dial_m[at].mean()) for at in ways if at.any()]
        means.append(np.mean(both, axis=0))
    counts, dial_m = np.array(means).T
    return counts, dial_m


def _repeatability(cells: list[Floats]) -> float | None:
    repeated = [cell for cell in cells if len(cell) > 1]
    freedom = sum(len(cell) - 1 for cell in repeated)
    if not freedom:
        return None
    squares = sum(float(np.sum((cell - cell.mean()) ** 2)) for cell in repeated)
    return float(np.sqrt(squares / freedom))


def _zero_drift(residual_m: Floats) -> float | None:
    """Of the residuals at the lowest step, in the order in which they were taken."""
    return float(residual_m[0] - residual_m[-1]) if len(residual_m) > 1 else None
