"""Quantities of INTERFACE ("results") from fitted parameters, each with its uncertainty by source."""

import math
from collections.abc import Callable
from itertools import pairwise
from typing import Final

import numpy as np

from analysis.arrays import Floats
from analysis.fitting.initial_guess import nonlinearity_slope_error, range_m
from analysis.fitting.problem import FitProblem, project_to_bounds
from analysis.fitting.profile import Profile
from analysis.fitting.search import Fit
from analysis.laws.catalogue import PARAMETER_COUNT
from analysis.laws.parameters import Parameter
from analysis.preparation.free_decay import FreeDecay
from analysis.quantities import BudgetSource, Source
from analysis.record import AnalysisError, Record
from analysis.uncertainty import (
    COVERAGE_FACTOR_95,
    ParameterUncertainty,
    UncertaintyBudget,
    levelling_shift,
    numerical_gradient,
    propagate_with_model_choice,
    white_noise_variance,
)

_TIME_POWERS = {
    Parameter.FRICTION_DYNAMIC: -2.0,
    Parameter.FRICTION_STATIC: -2.0,
    Parameter.TILT: -2.0,
    Parameter.STIFFNESS: -2.0,
    Parameter.DAMPING: -1.0,
}
"""How a parameter scales when all times are stretched."""
_GRAVITY_POWERS = {Parameter.FRICTION_DYNAMIC: -1.0, Parameter.FRICTION_STATIC: -1.0, Parameter.TILT: -1.0}


def joint_fit_uncertainty(
    record: Record, decay: FreeDecay, problem: FitProblem, fit: Fit, candidates: list[Fit]
) -> ParameterUncertainty:
    """Distribution of the joint fit with every source: the fit's own, other laws, time base, gravity."""
    return add_systematic_uncertainty(
        record, problem, fit, propagate_with_model_choice(problem, fit, candidates, decay.period_s / 4.0)
    )


def add_systematic_uncertainty(
    record: Record, problem: FitProblem, fit: Fit, own: ParameterUncertainty
) -> ParameterUncertainty:
    """The fit's `own` distribution with what the fit does not know of: time base, gravity, levelling."""
    columns = dict(own.shifts)
    _split(
        columns,
        BudgetSource.GAUGE_1_GAIN,
        BudgetSource.GAUGE_1_NONLINEARITY,
        nonlinearity_slope_error(record.table_gauge, range_m(problem.table.value_m)),
        record.table_gauge.gain_relative or 0.0,
    )
    if problem.relative is not None:
        _split(
            columns,
            BudgetSource.GAUGE_2_GAIN,
            BudgetSource.GAUGE_2_NONLINEARITY,
            nonlinearity_slope_error(record.relative_gauge, range_m(problem.relative.value_m)),
            record.relative_gauge.gain_relative or 0.0,
        )
    columns[BudgetSource.TIME_BASE] = record.clock_scale_uncertainty * _scaled(fit.parameters, _TIME_POWERS)
    gravity = record.masses.gravity_uncertainty_m_per_s2 / record.masses.gravity_m_per_s2
    columns[BudgetSource.GRAVITY] = gravity * _scaled(fit.parameters, _GRAVITY_POWERS)
    tilt = levelling_shift(problem, fit)
    if tilt is not None:
        columns[BudgetSource.LEVELLING] = tilt
    return ParameterUncertainty(columns, own.noise_covariance)


def add_fitted_quantities(
    record: Record,
    decay: FreeDecay,
    problem: FitProblem,
    fit: Fit,
    fitted: ParameterUncertainty,
    budget: UncertaintyBudget,
    *,
    ended: bool,
    profiled: bool,
) -> dict[str, str | bool]:
    """Note friction, tilt, pullback, u_s if slip `ended` and largest rates; returns the MSK-64 degree.

    Intervals of f_d and f_s follow chi-square itself where `profiled`.
    """
    own = zip(fit.law.own_places.tolist(), fit.law.own, strict=True)
    of_law = [(place, parameter.name, parameter.unit) for place, parameter in own]
    for place, name, unit in (*_FRICTION, *of_law, *_STAND):
        if fit.determines(place):
            sign = decay.sign if place in (Parameter.TILT, Parameter.PULLBACK) else 1
            weights = np.zeros(PARAMETER_COUNT)
            weights[place] = 1.0
            shares, reach = fitted.contributions(weights), None
            if profiled and fit.law.has_static_friction and place in _PROFILED:
                shares, reach = _by_profile(problem, fit, place, shares)
            budget.add(name, sign * fit.value(place), unit, shares, reach)
    if ended:
        _add_residual_displacement(record, decay, fit, fitted, budget)
    duration = float(decay.table.time_s[-1]) - fit.value(Parameter.RELEASE)
    _add_functions(
        budget, fit, fitted, _RATES, lambda p: fit.law.solver.peak_rates(fit.law.vector(p), duration)
    )
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


def _add_functions(
    budget: UncertaintyBudget,
    fit: Fit,
    fitted: ParameterUncertainty,
    names: tuple[tuple[str, str], ...],
    functions: Callable[[Floats], Floats],
) -> None:
    """Note several functions of the parameters at once; those that are not finite are left out."""

    def within(parameters: Floats) -> Floats:
        return functions(project_to_bounds(parameters, fit.law))

    values, slopes = within(fit.parameters), numerical_gradient(within, fit.parameters)
    for (name, unit), value, weights in zip(names, values, slopes, strict=True):
        if np.isfinite(value):
            budget.add(name, float(value), unit, fitted.contributions(np.nan_to_num(weights)))


def _add_residual_displacement(
    record: Record, decay: FreeDecay, fit: Fit, fitted: ParameterUncertainty, budget: UncertaintyBudget
) -> None:
    """Note u_s: gauge 2 after slip minus gauge 2 in the hold, or the fitted one without a hold or gauge."""
    duration = float(decay.table.time_s[-1]) - fit.value(Parameter.RELEASE)

    def end(parameters: Floats) -> float:
        vector = fit.law.vector(project_to_bounds(parameters, fit.law))
        return fit.law.solver.final_relative(vector, duration)

    value, shares = end(fit.parameters), fitted.contributions(numerical_gradient(end, fit.parameters))
    if (
        decay.relative is not None
        and decay.plateau is not None
        and decay.slip_end_s is not None
        and not decay.gauge_2_absolute
    ):
        held = decay.relative.between(*decay.plateau).value_m
        rest = decay.relative.between(decay.slip_end_s, np.inf).value_m
        value, gauge = float(rest.mean() - held.mean()), record.relative_gauge
        shares = {
            BudgetSource.NOISE: decay.noise_m[1] * float(np.sqrt(1.0 / len(held) + 1.0 / len(rest))),
            BudgetSource.GAUGE_2_GAIN: value * (gauge.gain_relative or 0.0),
            BudgetSource.GAUGE_2_NONLINEARITY: gauge.nonlinearity_m * float(np.sqrt(2.0 / 3.0)),
        }
    budget.add("residual_displacement_m", decay.relative_sign * value, "m", shares)


def _split(
    columns: dict[Source, Floats],
    gain_source: BudgetSource,
    nonlinearity_source: BudgetSource,
    nonlinearity: float,
    gain: float,
) -> None:
    """Divide the column of a gauge's slope between its gain and its non-linearity."""
    column = columns.pop(gain_source, None)
    total = float(np.hypot(nonlinearity, gain))
    if column is not None and total > 0.0:
        columns[gain_source] = column * gain / total
        columns[nonlinearity_source] = column * nonlinearity / total


def _scaled(parameters: Floats, powers: dict[Parameter, float]) -> Floats:
    column = np.zeros(PARAMETER_COUNT)
    for place, power in powers.items():
        column[place] = power * parameters[place]
    return column


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
            f"velocity {velocity_max_m_per_s!r} m/s has no MSK-64 degree: give a finite number, 0 or above"
        )
    if velocity_max_m_per_s <= _BOUNDS_M_PER_S[0]:
        return "below V"
    for degree, (_, upper) in zip(_DEGREES, pairwise(_BOUNDS_M_PER_S), strict=True):
        if velocity_max_m_per_s <= upper:
            return degree
    return "above X"
