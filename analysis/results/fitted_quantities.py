"""Quantities of INTERFACE ("results") from fitted parameters, each with its uncertainty by source."""

import math
from itertools import pairwise
from typing import Final

import numpy as np

from analysis.arrays import Floats
from analysis.fitting.problem import FitProblem, project_to_bounds
from analysis.fitting.profile import Profile
from analysis.fitting.search import Fit
from analysis.laws.catalogue import PARAMETER_COUNT
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
