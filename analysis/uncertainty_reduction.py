"""Measures that halve the standard uncertainty of f_d: rate, repeats, pullback, calibration.

Each measure is tried by planning the test again. The contribution of noise falls with rate and repeats. The
contributions of calibration, masses and gravity do not: they are the floor that no rate and no number of
tests goes below.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from analysis.catalogue import MILLIMETRE
from analysis.formatting import format_number
from analysis.plan import PlannedTest, expected_budget, range_use
from analysis.quantities import BudgetSource
from analysis.record import GaugeUncertainty
from messages.i18n import N_
from messages.message import Message, message

RATE_MAX_HZ = 100_000.0  # the fastest converters of two gauges
_REPEATS_MAX = 100  # more tests than a campaign makes with one contact
_PULLBACK_FACTORS = np.geomspace(1.05, 4.0, 28)
"""Pullbacks tried, over the planned one: steps of 5 %, up to more than any gauge range allows."""
_SMALLEST_SHARE = 1e-3  # smallest share of today's calibration uncertainty that is looked at


class Measure(Enum):
    """What may be changed."""

    RATE = "rate"
    REPEATS = "repeats"
    PULLBACK = "pullback"
    CALIBRATION = "calibration"


@dataclass(frozen=True, slots=True)
class ReductionOption:
    """One measure, and whether it halves the standard uncertainty of f_d."""

    measure: Measure
    value: float | None
    """Rate (Hz), number of tests, pullback (m), or the allowed share of today's calibration uncertainties;
    None where this measure does not suffice."""
    standard_uncertainty: float  # of f_d with that value, or the least that this measure reaches
    message: Message


@dataclass(frozen=True, slots=True)
class UncertaintyParts:
    """Standard uncertainty of f_d: from noise of the readings (type A), and from other sources (type B)."""

    noise: float
    stated: float
    model: float = 0.0  # share of `stated` by what models leave unexplained

    @property
    def total(self) -> float:
        return math.hypot(self.noise, self.stated)

    @property
    def readings_to_halve(self) -> float | None:
        """How many times as many readings halve the total; None where the stated part alone is too large."""
        if 2.0 * self.stated >= self.total:
            return None
        return (self.noise / math.sqrt(0.25 * self.total**2 - self.stated**2)) ** 2

    def with_readings(self, factor: float) -> float:
        return math.hypot(self.noise / math.sqrt(factor), self.stated)


def uncertainty_parts(test: PlannedTest) -> UncertaintyParts | None:
    """Both parts of the expected uncertainty; None where the test does not determine f_d."""
    budget = expected_budget(test)
    if "friction_dynamic" not in budget.results:
        return None
    lines = [line for line in budget.lines if line.contribution_to == "friction_dynamic"]
    noise = [line.standard_uncertainty for line in lines if line.source is BudgetSource.NOISE]
    stated = [line.standard_uncertainty for line in lines if line.source is not BudgetSource.NOISE]
    model = [line.standard_uncertainty for line in lines if line.source is BudgetSource.MODEL]
    return UncertaintyParts(math.hypot(*noise), math.hypot(*stated), math.hypot(*model))


def reduction_options(test: PlannedTest) -> list[ReductionOption]:
    """Return every measure with its value, or why it does not help; empty where f_d is undetermined.

    Raises AnalysisError for an impossible test.
    """
    now = uncertainty_parts(test)
    if now is None:
        return []
    return [_by_rate(test, now), _by_repeats(now), _by_pullback(test, now), _by_calibration(test, now)]


def _by_rate(test: PlannedTest, now: UncertaintyParts) -> ReductionOption:
    factor, value, left = now.readings_to_halve, None, now.stated
    if factor is None:
        text = message("No rate halves it: {floor}", floor=_floor(now))
    elif (rate_hz := test.rate_hz * factor) > RATE_MAX_HZ:
        left = now.with_readings(RATE_MAX_HZ / test.rate_hz)
        text = message(
            "It would take {rate} samples a second, more than converters give.",
            rate=format_number(rate_hz, 2),
        )
    else:
        value, left = rate_hz, 0.5 * now.total
        text = message(
            "{rate_hz:.0f} samples a second instead of {planned} halve it, if each is as noisy as now and"
            " their noise is white.",
            rate_hz=rate_hz,
            planned=format_number(test.rate_hz),
        )
    return ReductionOption(Measure.RATE, value, left, text)


def _by_repeats(now: UncertaintyParts) -> ReductionOption:
    factor, value = now.readings_to_halve, None
    if factor is None:
        text = message("No number of repeats halves it: {floor}", floor=_floor(now))
        return ReductionOption(Measure.REPEATS, None, now.stated, text)
    count = math.ceil(factor)
    if count > _REPEATS_MAX:
        text = message("It would take {count} tests: too many.", count=count)
    else:
        value = float(count)
        template = N_("The mean of {count} tests halves it, if the contact itself scatters less than that.")
        text = message(template, count=count)
    return ReductionOption(Measure.REPEATS, value, now.with_readings(count), text)


def _by_pullback(test: PlannedTest, now: UncertaintyParts) -> ReductionOption:
    planned_m = test.parameters.pullback_m
    best, best_m = now.total, planned_m
    for factor in _PULLBACK_FACTORS:
        longer = test.replace(parameters=replace(test.parameters, pullback_m=float(factor) * planned_m))
        if not all(use.fits() for use in range_use(longer, longer.motion())):
            break
        parts = uncertainty_parts(longer)
        if parts is not None and parts.total < best:
            best, best_m = parts.total, longer.parameters.pullback_m
        if best <= 0.5 * now.total:
            break
    pullback_mm = MILLIMETRE.scale * abs(best_m)
    if best <= 0.5 * now.total:
        text = message("A pullback of {pullback_mm:.1f} mm halves it.", pullback_mm=pullback_mm)
        return ReductionOption(Measure.PULLBACK, best_m, best, text)
    text = message("No longer pullback within the gauges' ranges makes it smaller.")
    if best_m != planned_m:
        text = message(
            "No longer pullback within the gauges' ranges halves it; {pullback_mm:.1f} mm gives {best}.",
            pullback_mm=pullback_mm,
            best=format_number(best, 2),
        )
    return ReductionOption(Measure.PULLBACK, None, best, text)


def _by_calibration(test: PlannedTest, now: UncertaintyParts) -> ReductionOption:
    gauges = (test.table_gauge, test.relative_gauge)

    def total(share: float) -> float:
        table, relative = (_improved(gauge, share) for gauge in gauges)
        parts = uncertainty_parts(test.replace(table_gauge=table, relative_gauge=relative))
        return math.inf if parts is None else parts.total

    stated = [gauge.gain_relative for gauge in gauges if gauge.gain_relative is not None]
    if not stated:
        text = message("What the calibration adds is not known: state the uncertainty of its gains.")
        return ReductionOption(Measure.CALIBRATION, None, now.total, text)
    least = total(0.0)
    if least > 0.5 * now.total:
        template = N_("No calibration alone halves it: with perfect gauges {least} would be left.")
        text = message(template, least=format_number(least, 2))
        return ReductionOption(Measure.CALIBRATION, None, least, text)
    share = _largest(lambda tried: total(tried) <= 0.5 * now.total)
    text = message(
        "Gauges calibrated {factor:.1f} times as well halve it: gains known to {gain} %.",
        factor=1.0 / share,
        gain=format_number(100.0 * share * max(stated), 2),
    )
    return ReductionOption(Measure.CALIBRATION, share, total(share), text)


def _largest(allowed: Callable[[float], bool]) -> float:
    """Largest allowed share, to 2 %, where all smaller ones are allowed too."""
    low, high = _SMALLEST_SHARE, 1.0
    while high / low > 1.02:
        middle = math.sqrt(low * high)
        low, high = (middle, high) if allowed(middle) else (low, middle)
    return low


def _floor(now: UncertaintyParts) -> Message:
    template = N_("without any noise {stated} would be left, of gauges, masses, gravity and levelling.")
    if now.model:
        template = N_(
            "without any noise {stated} would be left, of gauges, masses, gravity, levelling and the model"
            " of the stand."
        )
    return message(template, stated=format_number(now.stated, 2))


def _improved(gauge: GaugeUncertainty, share: float) -> GaugeUncertainty:
    gain = None if gauge.gain_relative is None else share * gauge.gain_relative
    return replace(gauge, gain_relative=gain, nonlinearity_m=share * gauge.nonlinearity_m)
