"""What screens and figures draw of a fit: curves at any time, and chi-square against f_d."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from analysis.arrays import Floats
from analysis.fitting.models import Place
from analysis.fitting.problem import Problem, allowed, gauge_1, gauge_2
from analysis.friction import Fit
from analysis.identification import Curves
from analysis.readings.preparation import FreeDecay

NAMES = {
    Place.FRICTION_DYNAMIC: "friction_dynamic",
    Place.FRICTION_STATIC: "friction_static",
    Place.STIFFNESS: "stiffness_n_per_m",
    Place.DAMPING: "damping_coefficient_kg_per_s",
    Place.PULLBACK: "pullback_m",
    Place.TILT: "tilt_rad",
    Place.TABLE_MASS: "table_mass_kg",
    Place.PLATE_MASS: "plate_mass_kg",
    Place.GRAVITY: "gravity_m_per_s2",
}
SIGNED = (Place.PULLBACK, Place.TILT)


def named_parameters(parameters: Floats, decay: FreeDecay) -> dict[str, float]:
    """Parameters of the motion by name, in the frame of the record; `release_s` in the record's time."""
    named = {
        name: float(parameters[place]) * (decay.sign if place in SIGNED else 1)
        for place, name in NAMES.items()
    }
    return {**named, "release_s": decay.channels.to_record_time(float(parameters[Place.RELEASE]))}


def curves_of(fit: Fit, decay: FreeDecay, delays_s: tuple[float, float]) -> Callable[[Floats], Curves]:
    """What both gauges should read at record times; `delays_s` are the gauges' known delays."""

    def curves(time_s: Floats) -> Curves:
        true_s = decay.channels.from_record_time(np.array(time_s, dtype=np.float64))
        since_s = true_s - decay.release.time_s
        first = gauge_1(fit.parameters, true_s - delays_s[0], fit.model)
        table = decay.sign * (first + decay.table_drift_m_per_s * (since_s - delays_s[0]))
        if decay.relative is None:
            return Curves(table, None)
        second = gauge_2(fit.parameters, true_s - delays_s[1], fit.model, decay.absolute)
        drifted = second + decay.drift_m_per_s * (since_s - delays_s[1])
        return Curves(table, decay.relative_sign * drifted)

    return curves


def objective_of(problem: Problem, fit: Fit) -> Callable[[Floats], Floats]:
    """Chi-square at values of f_d, f_s in the fitted ratio to it and all else as fitted."""

    def objective(friction_dynamic: Floats) -> Floats:
        costs = []
        for friction in np.asarray(friction_dynamic, dtype=np.float64):
            first, second = problem.residuals(_with_friction(fit, float(friction)), fit.model)
            costs.append(first @ first / problem.noise_m[0] ** 2 + second @ second / problem.noise_m[1] ** 2)
        return np.array(costs)

    return objective


def curves_by_friction_of(
    fit: Fit, decay: FreeDecay, delays_s: tuple[float, float]
) -> Callable[[float, Floats], Curves]:
    """What both gauges would read with another f_d, f_s in the fitted ratio to it and all else as fitted."""

    def curves(friction_dynamic: float, time_s: Floats) -> Curves:
        moved = replace(fit, parameters=_with_friction(fit, friction_dynamic))
        return curves_of(moved, decay, delays_s)(time_s)

    return curves


def _with_friction(fit: Fit, friction_dynamic: float) -> Floats:
    ratio = fit.value(Place.FRICTION_STATIC) / fit.value(Place.FRICTION_DYNAMIC)
    point = fit.parameters.copy()
    point[Place.FRICTION_DYNAMIC], point[Place.FRICTION_STATIC] = friction_dynamic, ratio * friction_dynamic
    return allowed(point, fit.model)
