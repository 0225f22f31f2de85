"""What screens and figures draw of a fit: curves at any time, and chi-square against f_d."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from analysis.arrays import Floats
from analysis.fitting.problem import FitProblem, predict_gauge_1, predict_gauge_2, project_to_bounds
from analysis.fitting.search import Fit
from analysis.identification import Curves
from analysis.laws.parameters import Parameter
from analysis.preparation.free_decay import FreeDecay

PARAMETER_NAMES = {
    Parameter.FRICTION_DYNAMIC: "friction_dynamic",
    Parameter.FRICTION_STATIC: "friction_static",
    Parameter.STIFFNESS: "stiffness_n_per_m",
    Parameter.DAMPING: "damping_coefficient_kg_per_s",
    Parameter.PULLBACK: "pullback_m",
    Parameter.TILT: "tilt_rad",
    Parameter.TABLE_MASS: "table_mass_kg",
    Parameter.PLATE_MASS: "plate_mass_kg",
    Parameter.GRAVITY: "gravity_m_per_s2",
}
SIGNED_PARAMETERS = (Parameter.PULLBACK, Parameter.TILT)


def named_parameters(parameters: Floats, decay: FreeDecay) -> dict[str, float]:
    """Parameters of the motion by name, in the frame of the record; `release_s` in the record's time."""
    named = {
        name: float(parameters[place]) * (decay.sign if place in SIGNED_PARAMETERS else 1)
        for place, name in PARAMETER_NAMES.items()
    }
    return {**named, "release_s": decay.channels.to_record_time(float(parameters[Parameter.RELEASE]))}


def fitted_curves(fit: Fit, decay: FreeDecay, delays_s: tuple[float, float]) -> Callable[[Floats], Curves]:
    """What both gauges should read at record times; `delays_s` are the gauges' known delays."""

    def curves(time_s: Floats) -> Curves:
        true_s = decay.channels.from_record_time(np.array(time_s, dtype=np.float64))
        since_s = true_s - decay.release.time_s
        first = predict_gauge_1(fit.parameters, true_s - delays_s[0], fit.law)
        table = decay.sign * (first + decay.table_drift_m_per_s * (since_s - delays_s[0]))
        if decay.relative is None:
            return Curves(table, None)
        second = predict_gauge_2(fit.parameters, true_s - delays_s[1], fit.law, decay.gauge_2_absolute)
        drifted = second + decay.drift_m_per_s * (since_s - delays_s[1])
        return Curves(table, decay.relative_sign * drifted)

    return curves


def friction_objective(problem: FitProblem, fit: Fit) -> Callable[[Floats], Floats]:
    """Chi-square at values of f_d, f_s in the fitted ratio to it and all else as fitted."""

    def objective(friction_dynamic: Floats) -> Floats:
        costs = []
        for friction in np.asarray(friction_dynamic, dtype=np.float64):
            first, second = problem.residuals(_with_friction(fit, float(friction)), fit.law)
            costs.append(first @ first / problem.noise_m[0] ** 2 + second @ second / problem.noise_m[1] ** 2)
        return np.array(costs)

    return objective


def friction_curves(
    fit: Fit, decay: FreeDecay, delays_s: tuple[float, float]
) -> Callable[[float, Floats], Curves]:
    """What both gauges would read with another f_d, f_s in the fitted ratio to it and all else as fitted."""

    def curves(friction_dynamic: float, time_s: Floats) -> Curves:
        moved = replace(fit, parameters=_with_friction(fit, friction_dynamic))
        return fitted_curves(moved, decay, delays_s)(time_s)

    return curves


def _with_friction(fit: Fit, friction_dynamic: float) -> Floats:
    ratio = fit.value(Parameter.FRICTION_STATIC) / fit.value(Parameter.FRICTION_DYNAMIC)
    point = fit.parameters.copy()
    point[Parameter.FRICTION_DYNAMIC], point[Parameter.FRICTION_STATIC] = (
        friction_dynamic,
        ratio * friction_dynamic,
    )
    return project_to_bounds(point, fit.law)
