"""Least and largest f_s that a record allows, whether or not the chosen law has an f_s of its own."""

import numpy as np

from analysis.arrays import Floats
from analysis.fitting.problem import motion_phases, project_to_bounds
from analysis.fitting.profile import CHI_SQUARE_RISE_95
from analysis.laws.catalogue import PARAMETER_COUNT, compared_law
from analysis.laws.law import FrictionLaw
from analysis.laws.parameters import MOTION_PARAMETER_COUNT, Parameter
from analysis.preparation.free_decay import FreeDecay
from analysis.quantities import BudgetSource
from analysis.record import Record
from analysis.results.decay_constants import DecayConstants
from analysis.results.joint_fit import JointFit
from analysis.uncertainty import (
    COVERAGE_FACTOR_95,
    LEVELLING_UNCERTAINTY_RAD,
    UncertaintyBudget,
    numerical_gradient,
)

LOWER, UPPER = "friction_static_lower", "friction_static_upper"
_READINGS = 3000
_FIRST_STEP = 1e-4
"""Of the way up along f_s, relative to the likeliest; each next step is twice as long."""
_FARTHEST = 3.0
"""f_s over the likeliest where the way ends."""
_STEPS, _HALVINGS = 6, 5
_SLIP_DOUBT = 2.0
"""Later slips take back part of the first one: what gauge 2 shows in the end is as much smaller."""


def add_static_friction_bounds(joint: JointFit, budget: UncertaintyBudget) -> None:
    """Note both bounds of f_s as the chosen law and the record set them.

    Where a law with f_s explains the record, they are those of its motion: the largest demand that the
    joint stood without slip, and the smallest at which slip began. Where the likeliest law ties f_s to f_d,
    f_s may still be somewhat larger: up to where chi-square of the law that frees it has risen.
    """
    chosen, duration_s = joint.chosen, joint.duration_s
    if not chosen.law.has_static_friction:
        _add_tied(joint, budget)
        return

    def bounds(parameters: Floats) -> Floats:
        return _bounds_of_motion(project_to_bounds(parameters, chosen.law), chosen.law, duration_s)

    values, slopes = bounds(chosen.parameters), numerical_gradient(bounds, chosen.parameters)
    for name, value, weights in zip((LOWER, UPPER), values, slopes, strict=True):
        if np.isfinite(value):
            budget.add(name, float(value), "1", joint.uncertainty.contributions(np.nan_to_num(weights)))


def add_no_slip_bound(
    record: Record, constants: DecayConstants, decay: FreeDecay, budget: UncertaintyBudget
) -> None:
    """Note the least f_s that keeps the plate from slipping, in a decay that has a tail from the release on.

    The joint acceleration over g, less what a slip too small to be seen may have begun at: a demand that
    falls short of f_s by d at its peak A makes the plate slip by 1.5 g (1 + m2/m1) d^2 / (A k1^2).
    """
    tail, gravity = decay.tail, record.masses.gravity_m_per_s2
    if tail is None:
        return
    swing, unseen_m = tail.amplitude_m, _unseen_slip_m(record, decay)

    def bound(point: Floats) -> float:
        k1_squared = float((2.0 * np.pi / point[0]) ** 2 + point[1] ** 2)
        demand = k1_squared * swing / gravity
        short = np.sqrt(unseen_m * demand * k1_squared / (1.5 * gravity * (1.0 + point[3] / point[2])))
        return demand - min(float(short), demand)

    shares = constants.uncertainty.contributions(numerical_gradient(bound, constants.point))
    value = bound(constants.point)
    shares[BudgetSource.GAUGE_1_GAIN] = value * (record.table_gauge.gain_relative or 0.0)
    shares[BudgetSource.GRAVITY] = value * record.masses.gravity_uncertainty_m_per_s2 / gravity
    shares[BudgetSource.LEVELLING] = LEVELLING_UNCERTAINTY_RAD
    budget.add(LOWER, value, "1", shares)


def largest_static_friction(joint: JointFit) -> tuple[float, float]:
    """Likeliest f_s, and the one above it at which chi-square is higher by 3.84, all else refined.

    The chosen law ties f_s to f_d; one of the candidates may have found a lower minimum with a free f_s.
    """
    chosen = joint.chosen
    law = compared_law(static_friction=True, tilt=chosen.law.has_tilt)
    some = joint.problem.decimated(_READINGS, joint.decay.dense_until_s)
    starts = [chosen.parameters, *(fit.parameters for fit in joint.candidates if fit.law is law)]
    best = min((some.minimise(start, law, 2 * _STEPS) for start in starts), key=lambda found: found.cost)
    likeliest = float(best.parameters[Parameter.FRICTION_STATIC])
    limit = CHI_SQUARE_RISE_95 * max(1.0, best.cost / some.sample_count)

    def allows(static: float) -> bool:
        start = best.parameters.copy()
        start[Parameter.FRICTION_STATIC] = static
        return some.minimise(start, law, _STEPS, fixed=Parameter.FRICTION_STATIC).cost < best.cost + limit

    near, step = likeliest, _FIRST_STEP * likeliest
    while allows(near + step) and near < _FARTHEST * likeliest:
        near, step = near + step, 2.0 * step
    far = near + step
    for _ in range(_HALVINGS):
        middle = 0.5 * (near + far)
        near, far = (middle, far) if allows(middle) else (near, middle)
    return likeliest, far


def _add_tied(joint: JointFit, budget: UncertaintyBudget) -> None:
    chosen = joint.chosen
    friction = chosen.value(Parameter.FRICTION_DYNAMIC)
    if not chosen.determines(Parameter.FRICTION_DYNAMIC):
        return
    weights = np.zeros(PARAMETER_COUNT)
    weights[Parameter.FRICTION_DYNAMIC] = 1.0
    shares = joint.uncertainty.contributions(weights)
    budget.add(LOWER, friction, "1", shares)
    likeliest, end = largest_static_friction(joint)
    likeliest, end = max(likeliest, friction), max(end, friction)
    noise = float(np.hypot((end - likeliest) / COVERAGE_FACTOR_95, shares[BudgetSource.NOISE]))
    budget.add(UPPER, likeliest, "1", {**shares, BudgetSource.NOISE: noise})


def _unseen_slip_m(record: Record, decay: FreeDecay) -> float:
    """Largest slip that gauge 2 (or without it, gauge 1) may have missed."""
    if decay.relative is None or decay.plateau is None or decay.gauge_2_absolute:
        share = record.masses.plate_mass_kg / (record.masses.table_mass_kg + record.masses.plate_mass_kg)
        count = max(1.0, 0.25 * decay.period_s / decay.channels.interval_s)
        return _SLIP_DOUBT * 2.0 * decay.noise_m[0] / float(np.sqrt(count)) / share
    held = decay.relative.between(*decay.plateau).value_m
    rest = decay.relative.between(decay.release.time_s + 0.5 * decay.period_s, np.inf).value_m
    uncertainty = decay.noise_m[1] * float(np.sqrt(1.0 / len(held) + 1.0 / len(rest)))
    return _SLIP_DOUBT * (abs(float(rest.mean() - held.mean())) + 2.0 * uncertainty)


def _bounds_of_motion(parameters: Floats, law: FrictionLaw, duration_s: float) -> Floats:
    """Least and largest f_s that leave the motion as it is, (2,); both f_s where a stick ends in slip."""
    phases = motion_phases(parameters, law, duration_s)
    stick = phases[:, 1] == 0.0
    if (stick[:-1] & ~stick[1:]).any():
        return np.array([parameters[Parameter.FRICTION_STATIC], parameters[Parameter.FRICTION_STATIC]])
    demands = _demand(parameters, phases[:, 2], phases[:, 3])
    upper = float(demands[~stick].min()) if (~stick).any() else np.inf
    lower = _largest_demand(parameters, phases[-1]) if stick[-1] else np.nan
    return np.array([lower, upper])


def _demand(parameters: Floats, position: Floats, velocity: Floats) -> Floats:
    """|u1'' - g alpha| / g of the joint motion: the f_s that it takes to stick."""
    _, _, stiffness, damping, _, tilt, _, table_mass, plate_mass, gravity = parameters[
        :MOTION_PARAMETER_COUNT
    ]
    acceleration = -(damping * velocity + stiffness * position) / (table_mass + plate_mass)
    return np.asarray(np.abs(acceleration / gravity - tilt))


def _largest_demand(parameters: Floats, phase: Floats) -> float:
    """Largest demand during a last stick."""
    mass = float(parameters[Parameter.TABLE_MASS] + parameters[Parameter.PLATE_MASS])
    n = float(parameters[Parameter.DAMPING]) / (2.0 * mass)
    w = float(np.sqrt(parameters[Parameter.STIFFNESS] / mass - n * n))
    tau = np.linspace(0.0, 2.0 * np.pi / w, 2000)
    a, b = phase[2], (phase[3] + n * phase[2]) / w
    decay, cosine, sine = np.exp(-n * tau), np.cos(w * tau), np.sin(w * tau)
    position = decay * (a * cosine + b * sine)
    velocity = decay * ((w * b - n * a) * cosine - (w * a + n * b) * sine)
    return float(_demand(parameters, position, velocity).max())
