"""Friction of slips against sliding velocity, position and time: slope, its 95 % band, and what it says."""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from analysis.arrays import Floats
from analysis.formatting import format_value
from analysis.quantities import COVERAGE_FACTOR_95, BudgetSource
from messages.i18n import N_
from messages.message import Message, message

if TYPE_CHECKING:
    from analysis.plate.friction import PlateFriction, Variation

_PER_M_PER_S = 0.1  # slopes are told per 100 mm/s, about the velocities of the paper's stand
_POINTS, _MARGIN = 50, 0.05  # of a drawn line, and how far it goes on at both sides
_DWARFING = 8.0  # times the median interval
_OF_SLIPS = BudgetSource.NOISE, BudgetSource.GAUGE_2_LAG  # gain and gravity change all slips alike


@dataclass(frozen=True, eq=False, slots=True)
class FrictionTrend:
    """Friction (k,) of slips at values (k,) of a covariate, and a line through them."""

    at: Floats  # m/s, m or s
    friction: Floats
    half_width_95: Floats  # of each slip: noise, and scatter between slips
    slope: float
    slope_standard_uncertainty: float
    centre: float
    level: float  # of the line at `centre`
    level_standard_uncertainty: float

    @property
    def includes_zero(self) -> bool:
        """Whether zero lies in the 95 % interval of the slope."""
        return abs(self.slope) <= COVERAGE_FACTOR_95 * self.slope_standard_uncertainty

    def grid(self) -> Floats:
        """Values of the covariate (n,) from before the first slip to behind the last, to draw the line at."""
        low, high = float(self.at.min()), float(self.at.max())
        margin = _MARGIN * (high - low)
        return np.linspace(low - margin, high + margin, _POINTS)

    def value_range(self) -> tuple[float, float]:
        """Friction to draw: line, band and slips, but for intervals that would dwarf the others."""
        is_drawn = self.half_width_95 <= _DWARFING * np.median(self.half_width_95)
        line, band = self.line(self.grid())
        values = np.concatenate((line, self.friction[is_drawn]))
        reach = np.concatenate((band, self.half_width_95[is_drawn]))
        low, high = float((values - reach).min()), float((values + reach).max())
        margin = _MARGIN * (high - low)
        return low - margin, high + margin

    def line(self, at: Floats) -> tuple[Floats, Floats]:
        """The line, and half the width of its 95 % band, at values (n,) of the covariate."""
        away = at - self.centre
        deviation = np.hypot(self.level_standard_uncertainty, self.slope_standard_uncertainty * away)
        return self.level + self.slope * away, COVERAGE_FACTOR_95 * deviation


@dataclass(frozen=True, eq=False, slots=True)
class FrictionBySlip:
    """Trends of one run, for drawing without the analysis."""

    with_velocity: FrictionTrend
    with_position: FrictionTrend
    with_time: FrictionTrend
    statement: Message  # of `velocity_statement`


def friction_by_slip(plate: "PlateFriction", release_s: float) -> FrictionBySlip:
    """Trends of a run that was released at `release_s` of the record's time."""
    return FrictionBySlip(
        trend_with_velocity(plate),
        trend_with_position(plate),
        trend_with_time(plate, release_s),
        velocity_statement(plate),
    )


def trend_with_velocity(plate: "PlateFriction") -> FrictionTrend:
    """The slope counts changes within slips too (`PlateFriction.variation`)."""
    return _trend(plate, plate.speed_m_per_s, plate.variation["sliding velocity"])


def trend_with_position(plate: "PlateFriction") -> FrictionTrend:
    """The slope counts changes within slips too (`PlateFriction.variation`)."""
    return _trend(plate, plate.position_m, plate.variation["position"])


def trend_with_time(plate: "PlateFriction", origin_s: float) -> FrictionTrend:
    """Times count from `origin_s`. The slope is that between slips."""
    return _trend(plate, plate.time_s - origin_s, plate.change_per_s)


def _trend(plate: "PlateFriction", at: Floats, variation: "Variation") -> FrictionTrend:
    deviation = np.hypot(plate.friction_standard_uncertainty, plate.scatter)
    weight = deviation**-2.0
    centre, level = (float(weight @ value / weight.sum()) for value in (at, plate.friction))
    level_uncertainty = math.hypot(*(plate.contributions.get(source, 0.0) for source in _OF_SLIPS))
    reach = COVERAGE_FACTOR_95 * deviation
    slope, uncertainty = variation.per_unit, variation.standard_uncertainty
    return FrictionTrend(at, plate.friction, reach, slope, uncertainty, centre, level, level_uncertainty)


def velocity_statement(plate: "PlateFriction") -> Message:
    """Whether the run agrees with the paper, by which f_d does not depend on the sliding velocity."""
    trend = trend_with_velocity(plate)
    shown = format_value(_PER_M_PER_S * trend.slope, _PER_M_PER_S * trend.slope_standard_uncertainty)
    value = shown.value if shown.value.startswith("-") else f"+{shown.value}"
    template = (
        N_(
            "Friction changes by {slope} ± {uncertainty} per 100 mm/s of sliding velocity: zero lies within"
            " 95 %, so this run agrees with the paper that f_d does not depend on velocity."
        )
        if trend.includes_zero
        else N_(
            "Friction changes by {slope} ± {uncertainty} per 100 mm/s of sliding velocity: zero lies outside"
            " 95 %, so in this run f_d depends on velocity, against the paper."
        )
    )
    return message(template, slope=value, uncertainty=shown.uncertainty)
