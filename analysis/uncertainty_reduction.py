"""What would halve the standard uncertainty of f_d: a higher rate, repeats, a longer pull, better gauges.

Each is tried by planning the test anew. What the noise of the readings adds falls with rate and repeats;
what calibration, masses and gravity add does not, and is the floor below which no rate leads.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from analysis.formatting import format_number
from analysis.plan import PlannedTest, expected_budget, range_use
from analysis.quantities import BudgetSource
from analysis.record import GaugeUncertainty

RATE_MAX_HZ = 100_000.0
"""The fastest converters of two gauges."""
_REPEATS_MAX = 100
_PULLBACKS = np.geomspace(1.05, 4.0, 28)
"""Over the planned one."""
_FINEST = 1e-3
"""Of what a calibration leaves open, over what it leaves open now."""


class Measure(Enum):
    """What may be changed."""

    RATE = "rate"
    REPEATS = "repeats"
    PULLBACK = "pullback"
    CALIBRATION = "calibration"


@dataclass(frozen=True, slots=True)
class ReductionOption:
    """One means, and whether it halves the standard uncertainty of f_d.

    Attributes
    ----------
    means : Means
    value : float or None
        Samples a second, number of tests, pullback (m), or the share of today's uncertainties of both
        gauges' calibration that is allowed; None where this means does not get so far.
    standard_uncertainty : float
        Of f_d there, or the least that this means reaches.
    message : str
        The same as a sentence.
    """

    measure: Measure
    value: float | None
    standard_uncertainty: float
    message: str


@dataclass(frozen=True, slots=True)
class UncertaintyParts:
    """Standard uncertainty of f_d by kind: type A from the readings' noise, type B from what is stated."""

    noise: float
    stated: float

    @property
    def total(self) -> float:
        """Both together."""
        return math.hypot(self.noise, self.stated)


def uncertainty_parts(test: PlannedTest) -> UncertaintyParts | None:
    """Both parts of what is expected; None where the test does not tell f_d."""
    ledger = expected_budget(test)
    if "friction_dynamic" not in ledger.results:
        return None
    shares = [line for line in ledger.lines if line.contribution_to == "friction_dynamic"]
    noise = math.hypot(*(line.standard_uncertainty for line in shares if line.source is BudgetSource.NOISE))
    stated = math.hypot(
        *(line.standard_uncertainty for line in shares if line.source is not BudgetSource.NOISE)
    )
    return UncertaintyParts(noise, stated)


def reduction_options(test: PlannedTest) -> list[ReductionOption]:
    """Every means with what it takes, or with the reason why it does not help; none where f_d is not told.

    Raises AnalysisError for a test that cannot be.
    """
    now = uncertainty_parts(test)
    if now is None:
        return []
    return [
        _by_rate(test, now),
        _by_repeats(now),
        _by_pullback(test, now),
        _by_calibration(test, now),
    ]


def _by_rate(test: PlannedTest, now: UncertaintyParts) -> ReductionOption:
    """Readings k times as many of the same white noise are worth readings of noise / sqrt(k)."""
    if 2.0 * now.stated >= now.total:
        return ReductionOption(Measure.RATE, None, now.stated, f"No rate halves it: {_floor(now)}")
    rate_hz = test.rate_hz * (now.noise / math.sqrt(0.25 * now.total**2 - now.stated**2)) ** 2
    if rate_hz > RATE_MAX_HZ:
        message = f"It would take {format_number(rate_hz, 2)} samples a second, more than converters give."
        reached = math.hypot(_thinned(now.noise, RATE_MAX_HZ / test.rate_hz), now.stated)
        return ReductionOption(Measure.RATE, None, reached, message)
    message = (
        f"{rate_hz:.0f} samples a second instead of {format_number(test.rate_hz)} halve it, if each is as"
        f" noisy"
        " as now and their noise is white."
    )
    return ReductionOption(Measure.RATE, rate_hz, 0.5 * now.total, message)


def _by_repeats(now: UncertaintyParts) -> ReductionOption:
    if 2.0 * now.stated >= now.total:
        return ReductionOption(
            Measure.REPEATS, None, now.stated, f"No number of repeats halves it: {_floor(now)}"
        )
    count = math.ceil((now.noise / math.sqrt(0.25 * now.total**2 - now.stated**2)) ** 2)
    reached = math.hypot(_thinned(now.noise, count), now.stated)
    if count > _REPEATS_MAX:
        return ReductionOption(Measure.REPEATS, None, reached, f"It would take {count} tests: too many.")
    message = f"The mean of {count} tests halves it, if the contact itself scatters less than that."
    return ReductionOption(Measure.REPEATS, float(count), reached, message)


def _by_pullback(test: PlannedTest, now: UncertaintyParts) -> ReductionOption:
    """Try longer pulls, as far as both gauges go."""
    best, best_m = now.total, test.parameters.pullback_m
    for factor in _PULLBACKS:
        longer = _pulled(test, float(factor))
        if not all(use.fits() for use in range_use(longer, longer.motion())):
            break
        parts = uncertainty_parts(longer)
        if parts is not None and parts.total < best:
            best, best_m = parts.total, longer.parameters.pullback_m
        if best <= 0.5 * now.total:
            message = f"A pullback of {abs(best_m) * 1e3:.1f} mm halves it."
            return ReductionOption(Measure.PULLBACK, best_m, best, message)
    if best_m == test.parameters.pullback_m:
        message = "No longer pullback within the gauges' ranges makes it smaller."
    else:
        reached = f"{abs(best_m) * 1e3:.1f} mm gives {format_number(best, 2)}"
        message = f"No longer pullback within the gauges' ranges halves it; {reached}."
    return ReductionOption(Measure.PULLBACK, None, best, message)


def _by_calibration(test: PlannedTest, now: UncertaintyParts) -> ReductionOption:
    """Look for the share of today's uncertainties of both calibrations that is allowed."""

    def total(share: float) -> float:
        parts = uncertainty_parts(_calibrated(test, share))
        return math.inf if parts is None else parts.total

    if test.table_gauge.gain_relative is None and test.relative_gauge.gain_relative is None:
        message = "What the calibration adds is not known: state the uncertainty of its gains."
        return ReductionOption(Measure.CALIBRATION, None, now.total, message)
    least = total(0.0)
    if least > 0.5 * now.total:
        message = (
            f"No calibration alone halves it: with perfect gauges {format_number(least, 2)} would be left."
        )
        return ReductionOption(Measure.CALIBRATION, None, least, message)
    share = _largest(lambda tried: total(tried) <= 0.5 * now.total)
    gain = share * max(test.table_gauge.gain_relative or 0.0, test.relative_gauge.gain_relative or 0.0)
    message = (
        f"Gauges calibrated {1.0 / share:.1f} times as well halve it: gains known to"
        f" {format_number(100.0 * gain, 2)} %."
    )
    return ReductionOption(Measure.CALIBRATION, share, total(share), message)


def _largest(good: Callable[[float], bool]) -> float:
    """Largest share that is still good, where smaller ones are, to two digits."""
    low, high = _FINEST, 1.0
    while high / low > 1.02:
        middle = math.sqrt(low * high)
        low, high = (middle, high) if good(middle) else (low, middle)
    return low


def _floor(now: UncertaintyParts) -> str:
    return (
        f"without any noise {format_number(now.stated, 2)} would be left, of gauges, masses, gravity"
        f" and levelling."
    )


def _thinned(noise: float, count: float) -> float:
    return noise / math.sqrt(count)


def _pulled(test: PlannedTest, factor: float) -> PlannedTest:
    parameters = test.parameters
    return test.replace(parameters=replace(parameters, pullback_m=factor * parameters.pullback_m))


def _calibrated(test: PlannedTest, share: float) -> PlannedTest:
    return test.replace(
        table_gauge=_better(test.table_gauge, share), relative_gauge=_better(test.relative_gauge, share)
    )


def _better(gauge: GaugeUncertainty, share: float) -> GaugeUncertainty:
    """The same gauge with gain and non-linearity known as much better."""
    gain = None if gauge.gain_relative is None else share * gauge.gain_relative
    return replace(gauge, gain_relative=gain, nonlinearity_m=share * gauge.nonlinearity_m)
