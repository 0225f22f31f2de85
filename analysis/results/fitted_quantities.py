"""Results from the fitted parameters, each with its uncertainty by source.

Intervals of f_d and f_s come from the profile of chi-square where that is not a parabola.
"""

import math
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final, Self

import numpy as np

from analysis.arrays import Floats
from analysis.fitting.least_squares import covariance
from analysis.fitting.problem import FitProblem, project_to_bounds
from analysis.fitting.search import Fit
from analysis.laws.catalogue import PARAMETER_COUNT
from analysis.laws.law import FrictionLaw
from analysis.laws.parameters import Parameter
from analysis.quantities import BudgetSource, Source
from analysis.record import AnalysisError
from analysis.results.curves import SIGNED_PARAMETERS
from analysis.results.joint_fit import JointFit
from analysis.uncertainty import (
    COVERAGE_FACTOR_95,
    UncertaintyBudget,
    numerical_gradient,
    white_noise_variance,
)


def add_fitted_quantities(
    joint: JointFit, budget: UncertaintyBudget, *, slip_ended: bool
) -> dict[str, str | bool]:
    """Add friction, tilt, pullback, u_s if slip has ended, and peak rates; return the MSK-64 degree.

    Intervals of f_d and f_s follow chi-square itself, except where that takes seconds for a law that does
    not explain the record.
    """
    fit, fitted = joint.chosen, joint.uncertainty
    profiled = joint.selection.adequate or fit.law.solver.is_closed_form
    own = zip(fit.law.own_places.tolist(), fit.law.own, strict=True)
    of_law = [(place, parameter.name, parameter.unit) for place, parameter in own]
    for place, name, unit in (*_FRICTION, *of_law, *_STAND):
        if fit.determines(place):
            sign = joint.decay.sign if place in SIGNED_PARAMETERS else 1
            weights = np.zeros(PARAMETER_COUNT)
            weights[place] = 1.0
            shares, reach = fitted.contributions(weights), None
            if profiled and fit.law.has_static_friction and place in _PROFILED:
                shares, reach = _by_profile(joint.problem, fit, place, shares)
            budget.add(name, sign * fit.value(place), unit, shares, reach)
    if slip_ended:
        _add_residual_displacement(joint, budget)
    _add_peak_rates(joint, budget)
    velocity = budget.results["table_velocity_max_m_per_s"].value
    return {"msk64_degree": msk64_degree(velocity)}


def _by_profile(
    problem: FitProblem, fit: Fit, place: int, shares: dict[Source, float]
) -> tuple[dict[Source, float], tuple[float, float] | None]:
    """Shares of the uncertainty, and the reach of the 95 % interval, by the shape of chi-square itself.

    Where that is no parabola, the part of the noise is taken from its profile.
    """
    profile = Profile.from_fit(
        problem, fit, place, shares[BudgetSource.NOISE] ** 2 / white_noise_variance(problem, fit, place)
    )
    bent = profile.interval()
    if bent is None:
        return shares, None
    others = COVERAGE_FACTOR_95 * np.sqrt(max(0.0, sum(s**2 for s in shares.values()) - profile.deviation**2))
    noise = np.sqrt(max(0.0, shares[BudgetSource.NOISE] ** 2 - profile.deviation**2 + bent.deviation**2))
    reach = float(np.hypot(bent.below, others)), float(np.hypot(bent.above, others))
    return {**shares, BudgetSource.NOISE: float(noise)}, reach


def _add_peak_rates(joint: JointFit, budget: UncertaintyBudget) -> None:
    law, duration_s = joint.chosen.law, joint.duration_s

    def rates(parameters: Floats) -> Floats:
        return law.solver.peak_rates(law.vector(project_to_bounds(parameters, law)), duration_s)

    point = joint.chosen.parameters
    for (name, unit), value, weights in zip(
        _RATES, rates(point), numerical_gradient(rates, point), strict=True
    ):
        if np.isfinite(value):
            budget.add(name, float(value), unit, joint.uncertainty.contributions(np.nan_to_num(weights)))


def _add_residual_displacement(joint: JointFit, budget: UncertaintyBudget) -> None:
    """Add u_s: gauge 2 after slip minus gauge 2 in the hold, or the fitted one without a hold or gauge."""
    law, decay, duration_s = joint.chosen.law, joint.decay, joint.duration_s

    def end(parameters: Floats) -> float:
        return law.solver.final_relative(law.vector(project_to_bounds(parameters, law)), duration_s)

    point = joint.chosen.parameters
    value, shares = end(point), joint.uncertainty.contributions(numerical_gradient(end, point))
    if (
        decay.relative is not None
        and decay.plateau is not None
        and decay.slip_end_s is not None
        and not decay.gauge_2_absolute
    ):
        held = decay.relative.between(*decay.plateau).value_m
        rest = decay.relative.between(decay.slip_end_s, np.inf).value_m
        value, gauge = float(rest.mean() - held.mean()), joint.record.relative_gauge
        shares = {
            BudgetSource.NOISE: decay.noise_m[1] * float(np.sqrt(1.0 / len(held) + 1.0 / len(rest))),
            BudgetSource.GAUGE_2_GAIN: value * (gauge.gain_relative or 0.0),
            BudgetSource.GAUGE_2_NONLINEARITY: gauge.nonlinearity_m * float(np.sqrt(2.0 / 3.0)),
        }
    budget.add("residual_displacement_m", decay.relative_sign * value, "m", shares)


_FRICTION = (
    (Parameter.FRICTION_DYNAMIC, "friction_dynamic", "1"),
    (Parameter.FRICTION_STATIC, "friction_static", "1"),
)
_STAND = ((Parameter.TILT, "tilt_rad", "rad"), (Parameter.PULLBACK, "pullback_m", "m"))
_PROFILED = (Parameter.FRICTION_DYNAMIC, Parameter.FRICTION_STATIC)
"""Parameters about which chi-square may have kinks."""
_RATES = (
    ("table_velocity_max_m_per_s", "m/s"),
    ("plate_velocity_max_m_per_s", "m/s"),
    ("table_acceleration_max_m_per_s2", "m/s2"),
    ("plate_acceleration_max_m_per_s2", "m/s2"),
)


_DEGREES: Final = ("V", "VI", "VII", "VIII", "IX", "X")
_BOUNDS_M_PER_S: Final = (0.01, 0.02, 0.04, 0.08, 0.16, 0.32, 0.64)


def msk64_degree(velocity_max_m_per_s: float) -> str:
    """MSK-64 degree of a largest velocity (m/s, 0 or above).

    Degrees are intervals of velocity, each closed above: V (1, 2] cm/s, VI (2, 4], VII (4, 8],
    VIII (8, 16], IX (16, 32], X (32, 64] (PHYSICS.md; Medvedev, Sponheuer and Karnik 1964). Outside them
    "below V" or "above X". Raises AnalysisError for a velocity that is negative or not finite.
    """
    if not (math.isfinite(velocity_max_m_per_s) and velocity_max_m_per_s >= 0.0):
        raise AnalysisError(
            "velocity {velocity!r} m/s has no MSK-64 degree: give a finite number, 0 or above",
            velocity=velocity_max_m_per_s,
        )
    if velocity_max_m_per_s <= _BOUNDS_M_PER_S[0]:
        return "below V"
    for degree, (_, upper) in zip(_DEGREES, pairwise(_BOUNDS_M_PER_S), strict=True):
        if velocity_max_m_per_s <= upper:
            return degree
    return "above X"


CHI_SQUARE_RISE_95 = 3.841458820694124
"""Rise of chi-square at the ends of a 95 % interval."""
_QUADRATIC = 0.15
"""Relative deviation from that rise up to which a parabola is good enough."""
_DISTANCES = (0.1, 0.25, 0.5, 0.8, 1.2, 1.7, 2.4, 3.2)
"""Distances at which chi-square is evaluated, in units of the half interval of a parabola."""
_HOPELESS = 14.0
"""Rise from which on a density of exp(-rise / 2) adds nothing to the interval."""
_FINE = 2001
_PROFILE_STEPS = 8


@dataclass(frozen=True, slots=True)
class ProfileInterval:
    """Distribution of a parameter about which chi-square is no parabola."""

    below: float
    """From the fitted value to the ends of the shortest 95 % interval."""
    above: float
    deviation: float
    """Standard deviation."""


@dataclass(frozen=True, eq=False, slots=True)
class Profile:
    """Chi-square along one parameter, the others refined; those with prior knowledge stay as fitted."""

    problem: FitProblem
    law: FrictionLaw
    parameter: int
    parameters: Floats
    """(16,) float64: the fit."""
    follow: Floats
    """(16,) float64: how the others follow a step of one in the parameter, by a parabola."""
    deviation: float
    """Standard uncertainty of the parameter by the noise, the known parameters being as fitted."""
    white: float
    """Its variance over that by white noise as stated."""

    @classmethod
    def from_fit(cls, problem: FitProblem, fit: Fit, parameter: int, white: float) -> Self:
        """Profile about a fit, the noise's variance being `white` times that stated."""
        still = np.where(np.isinf(problem.prior_deviation), np.inf, 0.0)
        fixed = replace(problem, prior_mean=fit.parameters, prior_deviation=still)
        unknown = np.isinf(problem.prior_deviation[fit.free])
        columns, _ = covariance(fit.normal_matrix[np.ix_(unknown, unknown)])
        own = int(np.flatnonzero(fit.free[unknown] == parameter)[0])
        follow = np.zeros(len(fit.parameters))
        follow[fit.free[unknown]] = columns[own] / columns[own, own]
        deviation = float(np.sqrt(white * columns[own, own]))
        return cls(fixed, fit.law, parameter, fit.parameters, follow, deviation, white)

    def interval(self) -> ProfileInterval | None:
        """Distribution by the profile; None where a parabola will do."""
        if all(
            abs(self._rise(side, follow=True) / CHI_SQUARE_RISE_95 - 1.0) < _QUADRATIC for side in (-1.0, 1.0)
        ):
            return None
        below, above = self._side(-1.0), self._side(1.0)
        shares, rises = zip(*below[::-1], (0.0, 0.0), *above, strict=True)
        reach = float(np.sqrt(CHI_SQUARE_RISE_95)) * self.deviation
        return distribution(reach * np.array(shares), np.array(rises))

    def _side(self, side: float) -> list[tuple[float, float]]:
        """Rises on one side of the fit, until there is no hope of less."""
        found = []
        for distance in _DISTANCES:
            rise = self._lowest_rise(side * distance)
            found.append((side * distance, rise))
            if rise > _HOPELESS and distance > 1.0:
                break
        return found

    def _lowest_rise(self, share: float) -> float:
        rise = self._rise(share, follow=True)
        return rise if rise <= CHI_SQUARE_RISE_95 else min(rise, self._rise(share, follow=False))

    def _rise(self, share: float, *, follow: bool) -> float:
        """Rise of chi-square with the parameter held off its value, in units of the true noise.

        `share` is the distance in units of that at which a parabola rises enough.
        """
        shift = share * float(np.sqrt(CHI_SQUARE_RISE_95)) * self.deviation
        start = self.parameters.copy()
        start += shift * self.follow if follow else 0.0
        start[self.parameter] = self.parameters[self.parameter] + shift
        there = self.problem.minimise(start, self.law, _PROFILE_STEPS, fixed=self.parameter)
        if there.parameters[self.parameter] != start[self.parameter]:  # the law does not allow that value
            return np.inf
        free = self.problem.free_parameters(self.law)
        return (there.cost - self.problem.quadratic_model(self.parameters, self.law, free).cost) / self.white


def distribution(shifts: Floats, rises: Floats) -> ProfileInterval:
    """Distribution of a parameter whose chi-square rises by `rises` (n,) at `shifts` (n,), both sides of 0.

    Its density is exp(-rise / 2), the root of the rise a polygon.
    """
    grid = np.linspace(shifts[0], shifts[-1], _FINE)
    rise = np.interp(grid, shifts, np.sqrt(np.maximum(np.minimum(rises, 1e4) - rises.min(), 0.0))) ** 2
    density = np.exp(-0.5 * rise) / np.exp(-0.5 * rise).sum()
    likeliest = np.argsort(rise, kind="stable")
    kept = likeliest[: int(np.searchsorted(np.cumsum(density[likeliest]), 0.95)) + 1]
    mean = float(grid @ density)
    deviation = float(np.sqrt((grid - mean) ** 2 @ density))
    return ProfileInterval(max(0.0, -float(grid[kept].min())), max(0.0, float(grid[kept].max())), deviation)
