"""Rate of a stream by the device's own times and by the host's clock, and the skew between two gauges."""

import math
from collections import deque
from dataclasses import dataclass

import msgspec
import numpy as np

from drivers.arrays import Floats
from messages.i18n import N_
from messages.message import EMPTY, Message, message

MIN_STEPS = 5
MIN_SPAN_S = 0.5
"""Fewer steps, or a shorter time, do not give a rate: a clock of 1 ms shows it to 0.2 % over 0.5 s."""
_ROUNDING = 1e-6
_FIRST_WINDOW_S = 0.1
_MIN_WINDOWS = 8
_MAX_WINDOWS = 512
"""Windows of arrivals: at first so short that a rate is known after 0.8 s; their number bounds the memory."""
_MAX_REJECTIONS = 10
_REJECT_SIGMAS = 4.0
"""Late arrivals are one-sided outliers: beyond 4 sigma of the others they do not belong to the line."""
_MAX_CORRELATION = 0.995
_SIGMA_PER_MAD = 1.4826
"""Standard deviation over median absolute deviation of a normal distribution."""
_CLOCK_STEP_S = 1e-6
_DELIVERY_STEP_S = 1e-3
"""USB delivers bytes once a millisecond (USB 2.0, 8.4.3: frames of 1 ms) of the host's clock. Interference
between that and the device's clock looks like drift: the delay is anywhere in the step at both ends."""
DELIVERY_UNCERTAINTY_S = _DELIVERY_STEP_S / math.sqrt(6)
"""Standard uncertainty of the difference of two evenly distributed delays (s)."""


def rate_from_steps(steps_s: Floats, resolution_s: float = 0.0) -> float | None:
    """Samples a second from the device-time steps between samples, some of which may be missing.

    Steps of up to 1.5 times the median, or up to the median and the step of the clock (`resolution_s`), are
    one period each; the rate is that of their mean. Longer steps span a gap, negative ones a restart; either
    may be a damaged digit. Returns None while there are fewer than 5 single periods or 0.5 s of them.
    """
    if len(steps_s) < MIN_STEPS:
        return None
    median_s = _median(steps_s)
    longest_s = max(1.5 * median_s, median_s + resolution_s) * (1 + _ROUNDING)
    single_s = steps_s[(steps_s >= 0) & (steps_s <= longest_s)]
    span_s = float(single_s.sum())
    if len(single_s) < MIN_STEPS or span_s < MIN_SPAN_S:
        return None
    return float(f"{len(single_s) / span_s:.9g}")  # further digits are rounding errors


def _median(values: Floats) -> float:
    """Median of numbers without NaN. That of numpy imports numpy.ma, 0.02 s of each process that reads."""
    middle = (len(values) - 1) // 2, len(values) // 2
    return float(np.partition(values, middle)[middle[0] : middle[1] + 1].mean())


@dataclass(frozen=True, slots=True)
class ClockEstimate:
    """The device's clock compared with the host's."""

    rate_hz: float  # samples a second of the host's clock
    scale: float  # true over nominal time: index / nominal rate is to be multiplied by it
    scale_standard_uncertainty: float
    """Of the fit and of delivery in steps of 1 ms: 4e-5 over 10 s. The error of the host's own clock, some
    1e-5 where nothing disciplines it, is not included."""
    span_s: float


class ClockFit:
    """Rate of a stream against the host's arrival times.

    A block arrives late by what system and wire add, never early. So only the earliest arrival of each
    window of time counts, and a line is fitted through these by least squares without windows that were late
    as a whole. Neighbouring windows of a busy host are late alike, so the uncertainty allows for their
    correlation. Windows grow with the stream, which bounds the memory.

    `nominal_rate_hz` is the rate that index and time are compared by, > 0; good to 1 % or so.
    """

    def __init__(self, nominal_rate_hz: float) -> None:
        self._period_s = 1 / nominal_rate_hz
        self._window_s = _FIRST_WINDOW_S
        self._start_ns: int | None = None
        self._earliest: dict[int, tuple[float, float]] = {}

    @property
    def windows(self) -> int:
        return len(self._earliest)

    def add(self, index: int, arrival_ns: int) -> None:
        """Add the last sample of a block: its index in the stream, gaps included, and when it came (ns)."""
        if self._start_ns is None:
            self._start_ns = arrival_ns
        nominal_s = index * self._period_s
        self._keep(nominal_s, (arrival_ns - self._start_ns) * 1e-9 - nominal_s)
        if len(self._earliest) > _MAX_WINDOWS:
            self._window_s *= 2
            kept, self._earliest = self._earliest, {}
            for point in kept.values():
                self._keep(*point)

    def estimate(self) -> ClockEstimate | None:
        """Rate until now; None before there are 8 windows of 0.1 s."""
        if len(self._earliest) < _MIN_WINDOWS:
            return None
        return self._estimate(np.array(list(self._earliest.values())))

    def halves(self) -> tuple[ClockEstimate, ClockEstimate] | None:
        """Rate in the first and in the second half of the windows; None as for `estimate`."""
        if len(self._earliest) < _MIN_WINDOWS:
            return None
        points = np.array(list(self._earliest.values()))
        middle = len(points) // 2
        return self._estimate(points[:middle]), self._estimate(points[middle:])

    def _estimate(self, points: Floats) -> ClockEstimate:
        line = fit_robust_line(*points.T)
        scale = 1 + line.slope
        uncertainty = math.hypot(line.slope_uncertainty, DELIVERY_UNCERTAINTY_S / line.span)
        return ClockEstimate(1 / (self._period_s * scale), scale, uncertainty, line.span)

    def _keep(self, nominal_s: float, late_s: float) -> None:
        window = int(nominal_s / self._window_s)
        before = self._earliest.get(window)
        if before is None or late_s < before[1]:
            self._earliest[window] = (nominal_s, late_s)


@dataclass(frozen=True, slots=True)
class RobustLine:
    """A straight line through points, outliers left out."""

    centre: float
    level: float
    """Value of the line at `centre`."""
    slope: float
    slope_uncertainty: float
    """Standard uncertainty; it allows for correlated residuals."""
    scatter: float  # root mean square of the residuals
    span: float  # from the first to the last point

    def at(self, x: Floats) -> Floats:
        return self.level + self.slope * (x - self.centre)


def fit_robust_line(x: Floats, y: Floats) -> RobustLine:
    """Line by least squares through points (n,), n >= 3, repeated without outliers until none is left."""
    for _ in range(_MAX_REJECTIONS):
        dx = x - x.mean()
        sxx = float(dx @ dx)
        slope = float(dx @ y) / sxx
        residual = y - y.mean() - slope * dx
        spread = _median(np.abs(residual)) * _SIGMA_PER_MAD
        kept = np.abs(residual) <= max(_REJECT_SIGMAS * spread, _CLOCK_STEP_S)
        if kept.all():
            break
        x, y = x[kept], y[kept]
    variance = float(residual @ residual) / (len(residual) - 2)
    uncertainty = math.sqrt(variance / sxx * _variance_inflation(residual))
    scatter = math.sqrt(float(residual @ residual) / len(residual))
    return RobustLine(float(x.mean()), float(y.mean()), slope, uncertainty, scatter, float(x[-1] - x[0]))


def _variance_inflation(residual: Floats) -> float:
    """Variance of the slope relative to independent residuals, for first-order autoregressive ones."""
    power = float(residual @ residual)
    if power <= len(residual) * _DELIVERY_STEP_S**2 / 4:
        return 1.0  # steps of delivery count as independent: their effect is added separately
    correlation = float(residual[1:] @ residual[:-1]) / power
    correlation += (1.0 + 4.0 * correlation) / len(residual)  # bias after a fit (Kendall 1954)
    correlation = min(max(correlation, 0.0), _MAX_CORRELATION)
    return (1.0 + correlation) / (1.0 - correlation)


_SKEW_WINDOW_S = 0.25
"""Lags that change within it average out over a period of the stand; slower changes do not."""
_MAX_SKEW_WINDOWS = 4 * 3600 * 4  # four hours, the longest run


@dataclass(frozen=True, slots=True)
class Skew:
    """Time between the readings of both gauges, over the rows of a run."""

    mean_s: float  # gauge 2 was read so much later than gauge 1 on average (s)
    standard_uncertainty_s: float
    """For each period of the stand (s): drift of the lag, scatter of arrivals of both devices, and delays by
    ports that cannot be seen (1 ms each, evenly distributed)."""


UNTIMED_CLOCK_UNCERTAINTY = 1e-4
"""Relative standard uncertainty of a device's clock that could not be compared with the host's: twice the
50 ppm that common crystals are specified to."""
_LATER = N_(
    "gauge 2 was read {skew_ms:.2f} ms later than gauge 1, \u00b1{uncertainty_ms:.2f} ms;"
    " the analysis allows for it"
)
_EARLIER = N_(
    "gauge 2 was read {skew_ms:.2f} ms earlier than gauge 1, \u00b1{uncertainty_ms:.2f} ms;"
    " the analysis allows for it"
)


class TimeBase(msgspec.Struct, frozen=True):
    """How the times of a run's rows relate to true time; applied once, in analysis."""

    scale: float = 1.0  # true seconds for one second of the rows' time
    scale_standard_uncertainty: float = 0.0  # 0 where the times are exact, as in a simulated run
    skew_s: float | None = None
    """Gauge 2 was read so much later than gauge 1 on average (s); None where one device reads both."""
    skew_standard_uncertainty_s: float | None = None  # see `Skew`

    @classmethod
    def from_estimates(cls, clock: ClockEstimate | None, skew: Skew | None) -> "TimeBase":
        """Time base of a device whose clock was timed, or could not be (None)."""
        untimed = cls(scale_standard_uncertainty=UNTIMED_CLOCK_UNCERTAINTY)
        timed = cls(clock.scale, clock.scale_standard_uncertainty) if clock else untimed
        return timed.with_skew(skew)

    def with_skew(self, skew: Skew | None) -> "TimeBase":
        lags = (skew.mean_s, skew.standard_uncertainty_s) if skew else (None, None)
        return TimeBase(self.scale, self.scale_standard_uncertainty, *lags)

    @property
    def skew_message(self) -> Message:
        """Sentence that is stored with the run; empty without a skew."""
        if self.skew_s is None:
            return EMPTY
        uncertainty_ms = 1e3 * (self.skew_standard_uncertainty_s or 0.0)
        template = _LATER if self.skew_s >= 0 else _EARLIER
        return message(template, skew_ms=1e3 * abs(self.skew_s), uncertainty_ms=uncertainty_ms)


class SkewStatistics:
    """Lags of rows, averaged over windows of 0.25 s; the latest 4 hours are kept."""

    def __init__(self, rate_hz: float) -> None:
        self._rows = max(1, round(_SKEW_WINDOW_S * rate_hz))
        self._windows: deque[_Window] = deque(maxlen=_MAX_SKEW_WINDOWS)

    def add(self, first_index: int, lag_s: Floats, scatter_s: float) -> None:
        """Add lags of consecutive rows (n,), NaN for a missing reading, and the scatter of arrivals (s)."""
        numbers = (first_index + np.arange(len(lag_s))) // self._rows
        is_known = np.isfinite(lag_s)
        for number in np.unique(numbers[is_known]).tolist():
            inside = lag_s[is_known & (numbers == number)]
            if not self._windows or self._windows[-1].number != number:
                self._windows.append(_Window(number))
            window = self._windows[-1]
            window.sum_s += float(inside.sum())
            window.rows += len(inside)
            window.scatter_s = max(window.scatter_s, scatter_s)

    def skew(self, first_index: int, end_index: int) -> Skew | None:
        """Skew of rows first_index <= row < end_index, to a window; None where none has both readings."""
        first, last = first_index // self._rows, (end_index - 1) // self._rows
        windows = [window for window in self._windows if first <= window.number <= last]
        if not windows:
            return None
        weights = np.array([window.rows for window in windows], dtype=np.float64)
        means_s = np.array([window.sum_s for window in windows]) / weights
        mean_s = float(np.average(means_s, weights=weights))
        drift_s = math.sqrt(float(np.average((means_s - mean_s) ** 2, weights=weights)))
        scatter_s = float(np.average([window.scatter_s for window in windows], weights=weights))
        return Skew(mean_s, math.hypot(drift_s, scatter_s, DELIVERY_UNCERTAINTY_S))


@dataclass(slots=True)
class _Window:
    number: int
    sum_s: float = 0.0
    rows: int = 0
    scatter_s: float = 0.0
