"""What the rate of a stream is: by the device's own times, and by the host's clock."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

MIN_STEPS = 5
MIN_SPAN_S = 0.5
"""Fewer steps, or less time, do not tell a rate."""
_ROUNDING = 1e-6
_FIRST_STRETCH_S = 0.1
_MIN_STRETCHES = 8
_MAX_STRETCHES = 512
_REJECTIONS = 10
_REJECT_BEYOND = 4.0
_ALIKE_MAX = 0.995
_SIGMA_PER_MAD = 1.4826
_CLOCK_STEP_S = 1e-6
_DELIVERY_STEP_S = 1e-3
"""USB brings bytes once a millisecond of the host's clock. A beat of the device's clock against that
can pass for drift: a delay anywhere in the step at both ends, sqrt(1/6) of it as standard uncertainty."""
DELIVERY_UNCERTAINTY_S = _DELIVERY_STEP_S / math.sqrt(6)
"""Standard uncertainty of the difference of two arrivals by it (s)."""


def rate_from_steps(steps_s: NDArray[np.float64], resolution_s: float = 0.0) -> float | None:
    """Samples a second from the device-time steps between samples, some of which may be missing.

    Steps up to half as long again as the median, or to the median and the step of the clock, are
    one period each; the rate is that of their mean. Longer ones span a gap, negative ones a new
    start of the device, either may be a wrong digit: they are left out.

    Parameters
    ----------
    steps_s : (n,) float64
        Differences of consecutive device times (s).
    resolution_s : float
        Step of the device's clock (s).

    Returns
    -------
    float or None
        None while there are fewer than 5 such steps or 0.5 s of them.
    """
    if len(steps_s) < MIN_STEPS:
        return None
    median_s = float(np.median(steps_s))
    longest_s = max(1.5 * median_s, median_s + resolution_s) * (1 + _ROUNDING)
    single_s = steps_s[(steps_s >= 0) & (steps_s <= longest_s)]
    span_s = float(single_s.sum())
    if len(single_s) < MIN_STEPS or span_s < MIN_SPAN_S:
        return None
    return float(f"{len(single_s) / span_s:.9g}")  # what is beyond is rounding


@dataclass(frozen=True, slots=True)
class ClockEstimate:
    """How the device's clock goes by the host's.

    Attributes
    ----------
    rate_hz : float
        Samples a second of the host's clock.
    scale : float
        True over nominal time: multiply index / nominal rate by it.
    scale_standard_uncertainty : float
        Of the fit and of delivery in steps of 1 ms: 4e-5 over 10 s. The host's own clock, some 1e-5
        where nothing disciplines it, is not in it.
    span_s : float
        Time that the fit rests on.
    """

    rate_hz: float
    scale: float
    scale_standard_uncertainty: float
    span_s: float


class ClockFit:
    """Rate of a stream against the host's arrival times.

    A block arrives late by what system and wire add, never early. So of each stretch of time only
    the most punctual block counts, and a line is fitted through these by least squares, leaving
    out stretches that were late as a whole. On a busy host lateness comes and goes slowly, so that
    stretches tell less than they are many: the uncertainty allows for how alike neighbours are.
    Stretches grow as the stream does: memory is bounded.

    Parameters
    ----------
    nominal_rate_hz : float
        Rate that index and time are compared by, > 0; good to 1 % or so.
    """

    def __init__(self, nominal_rate_hz: float) -> None:
        self._period_s = 1 / nominal_rate_hz
        self._stretch_s = _FIRST_STRETCH_S
        self._start_ns: int | None = None
        self._punctual: dict[int, tuple[float, float]] = {}

    @property
    def windows(self) -> int:
        """Stretches of time that are remembered, at most 512."""
        return len(self._punctual)

    def add(self, index: int, arrival_ns: int) -> None:
        """A sample that arrived: the last of its block.

        Parameters
        ----------
        index : int
            From the first sample of the stream, gaps included.
        arrival_ns : int
            Host's monotonic time (ns) after the read that brought it.
        """
        if self._start_ns is None:
            self._start_ns = arrival_ns
        nominal_s = index * self._period_s
        self._keep(nominal_s, (arrival_ns - self._start_ns) * 1e-9 - nominal_s)
        if len(self._punctual) > _MAX_STRETCHES:
            self._grow()

    def estimate(self) -> ClockEstimate | None:
        """Rate until now; None before there are 8 stretches of 0.1 s."""
        if len(self._punctual) < _MIN_STRETCHES:
            return None
        line = fit_robust_line(*np.array(list(self._punctual.values())).T)
        uncertainty = math.hypot(line.slope_uncertainty, DELIVERY_UNCERTAINTY_S / line.span)
        return ClockEstimate(
            rate_hz=1 / (self._period_s * (1 + line.slope)),
            scale=1 + line.slope,
            scale_standard_uncertainty=uncertainty,
            span_s=line.span,
        )

    def _keep(self, nominal_s: float, late_s: float) -> None:
        stretch = int(nominal_s / self._stretch_s)
        before = self._punctual.get(stretch)
        if before is None or late_s < before[1]:
            self._punctual[stretch] = (nominal_s, late_s)

    def _grow(self) -> None:
        """Join neighbouring stretches."""
        kept = list(self._punctual.values())
        self._stretch_s *= 2
        self._punctual = {}
        for nominal_s, late_s in kept:
            self._keep(nominal_s, late_s)


@dataclass(frozen=True, slots=True)
class RobustLine:
    """A straight line through the punctual ones of some points.

    Attributes
    ----------
    centre, level : float
        A point of the line.
    slope, slope_uncertainty : float
    scatter : float
        Root mean square distance of these points from it.
    span : float
        From the first of them to the last.
    """

    centre: float
    level: float
    slope: float
    slope_uncertainty: float
    scatter: float
    span: float

    def at(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values of the line, (n,)."""
        return self.level + self.slope * (x - self.centre)


def fit_robust_line(x: NDArray[np.float64], late: NDArray[np.float64]) -> RobustLine:
    """Line by least squares through points (n,), n >= 3, without those that are far off, as late ones are."""
    for _ in range(_REJECTIONS):
        slope, uncertainty, residual = _fit_line(x, late)
        spread = float(np.median(np.abs(residual))) * _SIGMA_PER_MAD
        kept = np.abs(residual) <= max(_REJECT_BEYOND * spread, _CLOCK_STEP_S)
        if kept.all():
            break
        x, late = x[kept], late[kept]
    scatter = math.sqrt(float(residual @ residual) / len(residual))
    return RobustLine(float(x.mean()), float(late.mean()), slope, uncertainty, scatter, float(x[-1] - x[0]))


def _fit_line(x: NDArray[np.float64], y: NDArray[np.float64]) -> tuple[float, float, NDArray[np.float64]]:
    """Slope by least squares, its standard uncertainty, and the residuals."""
    dx = x - x.mean()
    sxx = float(dx @ dx)
    slope = float(dx @ y) / sxx
    residual = y - y.mean() - slope * dx
    variance = float(residual @ residual) / (len(x) - 2)
    return slope, math.sqrt(variance / sxx * _variance_inflation(residual)), residual


def _variance_inflation(residual: NDArray[np.float64]) -> float:
    """How many neighbours tell as much as one, if each follows the one before (AR(1)).

    What delivery in steps explains counts by itself: its beat is stated apart.
    """
    power = float(residual @ residual)
    if power <= len(residual) * _DELIVERY_STEP_S**2 / 4:
        return 1.0
    alike = float(residual[1:] @ residual[:-1]) / power
    alike += (1.0 + 4.0 * alike) / len(residual)  # Kendall: a fitted line hides some of it
    alike = min(max(alike, 0.0), _ALIKE_MAX)
    return (1.0 + alike) / (1.0 - alike)
