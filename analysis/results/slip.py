"""What the slips of the fitted motion tell: release, end of slip, rest, and the bounds of f_s."""

from dataclasses import dataclass

import numpy as np

from analysis.arrays import Floats
from analysis.fitting.least_squares import covariance
from analysis.fitting.problem import motion_phases, project_to_bounds
from analysis.fitting.search import Fit
from analysis.identification import Events
from analysis.laws.catalogue import PARAMETER_COUNT, compared_law
from analysis.laws.law import FrictionLaw
from analysis.laws.parameters import MOTION_PARAMETER_COUNT, Parameter
from analysis.preparation.free_decay import FreeDecay
from analysis.quantities import BudgetSource
from analysis.record import Record
from analysis.results.decay_constants import DecayConstants
from analysis.results.fitted_quantities import CHI_SQUARE_RISE_95
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
    """Add both bounds of f_s to the budget.

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
    """Add the least f_s that prevents slip, for a decay whose tail begins at the release.

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


_DRAWS = 40
"""Of parameters, for the scatter of the end of slip: it is known to a ninth."""
_PLAUSIBLE = 2.0
"""Laws whose BIC is higher by less than so many times the price of a parameter may be the true ones."""


@dataclass(frozen=True, slots=True)
class SlipEnd:
    """End of the last slip (s) and its standard uncertainty (s)."""

    time_s: float
    uncertainty_s: float

    @property
    def upper_limit_s(self) -> float:
        """A time at which slip has ended: two standard uncertainties later."""
        return self.time_s + 2.0 * self.uncertainty_s


def find_slip_end(joint: JointFit) -> SlipEnd | None:
    """End of slip by the fitted motion; the later one of that and gauge 2's where no law explains the record.

    The last slips are often smaller than the noise. Gauge 2 alone gives the end to a quarter period, rather
    too early than too late.

    Returns
    -------
    SlipEnd or None
        None where slip lasts to the end of the record, or comes again after it.
    """
    decay, chosen, adequate = joint.decay, joint.chosen, joint.selection.adequate
    end_s, largest = joint.end_s, np.inf
    if adequate and _slips_on(chosen, end_s, decay.period_s):
        return None
    if not chosen.law.has_static_friction:
        _, largest = largest_static_friction(joint)
    fitted = _fitted_slip_end(chosen, joint.candidates, end_s, largest)
    if fitted is not None and not chosen.law.has_static_friction:
        fitted = _with_static_open(fitted, chosen, largest, end_s)
    if fitted is None or adequate or decay.slip_end_s is None:
        return fitted
    apart_s = decay.slip_end_s - fitted.time_s
    rough_s = 0.25 * decay.period_s / float(np.sqrt(3.0))
    uncertainty_s = float(np.linalg.norm((fitted.uncertainty_s, apart_s, rough_s)))
    return SlipEnd(max(fitted.time_s, decay.slip_end_s), uncertainty_s)


def _fitted_slip_end(chosen: Fit, candidates: list[Fit], end_s: float, largest: float) -> SlipEnd | None:
    """End of the fitted slip, and how far it scatters when the parameters do, over every plausible law.

    A last small slip comes or goes with small changes of f_s, so that its end has no useful derivative:
    parameters are drawn from the fit's distribution. A law with more parameters that fits hardly better
    may be the true one, and gives another end; its f_s, which the fit may leave open, is `largest` at most.
    """
    end = _end_of(chosen.parameters, chosen.law, end_s)
    if end is None:
        return None
    price = _PLAUSIBLE * float(np.log(len(chosen.table_residual_m) + len(chosen.relative_residual_m)))
    scatters = [_scatter(fit, end, end_s, largest) for fit in candidates if fit.bic <= chosen.bic + price]
    return SlipEnd(end, max(scatters))


def build_events(joint: JointFit, slip_end: SlipEnd | None) -> Events:
    """Events in the record's time."""
    decay, chosen = joint.decay, joint.chosen
    to_record, scale = decay.channels.to_record_time, decay.channels.clock_scale
    index = int(np.flatnonzero(chosen.free == Parameter.RELEASE)[0])
    release_uncertainty_s = float(np.sqrt(covariance(chosen.normal_matrix)[0][index, index]))
    rest = find_rest(decay)
    return Events(
        release_s=to_record(chosen.value(Parameter.RELEASE)),
        slip_end_s=None if slip_end is None else to_record(slip_end.time_s),
        rest_s=None if rest is None else to_record(rest[0]),
        release_uncertainty_s=release_uncertainty_s / scale,
        slip_end_uncertainty_s=None if slip_end is None else slip_end.uncertainty_s / scale,
        rest_uncertainty_s=None if rest is None else rest[1] / scale,
    )


def find_rest(decay: FreeDecay) -> tuple[float, float] | None:
    """When the swing of the tail falls below the noise, and its uncertainty (s); None if not recorded."""
    tail, noise = decay.tail, decay.noise_m[0]
    if tail is None or tail.damping_per_s <= 0.0:
        return None
    log = float(np.log(tail.amplitude_m / noise))
    after_s = log / tail.damping_per_s
    if not tail.start_s <= tail.start_s + after_s <= tail.end_s:
        return None
    of_noise = 1.0 / np.sqrt(2.0 * max(1, decay.noise_reading_counts[0]))
    deviation = np.hypot(after_s * tail.damping_uncertainty_per_s, of_noise) / tail.damping_per_s
    return tail.start_s + after_s, float(deviation)


def _end_of(parameters: Floats, model: FrictionLaw, end_s: float) -> float | None:
    release = float(parameters[Parameter.RELEASE])
    phases = motion_phases(parameters, model, end_s - release)
    return None if phases[-1, 1] != 0.0 else float(phases[-1, 0]) + release


def _slips_on(chosen: Fit, end_s: float, period_s: float) -> bool:
    """Whether the fitted motion slips at `end_s` or after it: a period later the widest swing is past."""
    end = _end_of(chosen.parameters, chosen.law, end_s + period_s)
    return end is None or end > end_s


def _with_static_open(fitted: SlipEnd, chosen: Fit, largest: float, end_s: float) -> SlipEnd:
    """Widen by the ends of slip of every f_s that the record allows above f_d, to which the law ties it."""
    law = compared_law(static_friction=True, tilt=chosen.law.has_tilt)
    points = np.tile(chosen.parameters, (_DRAWS, 1))
    points[:, Parameter.FRICTION_STATIC] = np.linspace(
        chosen.value(Parameter.FRICTION_DYNAMIC), largest, _DRAWS
    )
    ends = [_end_of(project_to_bounds(point, law), law, end_s) for point in points]
    away = np.array([(end_s if end is None else end) - fitted.time_s for end in ends])
    return SlipEnd(fitted.time_s, float(np.hypot(fitted.uncertainty_s, np.sqrt(np.mean(away**2)))))


def _scatter(fit: Fit, about_s: float, end_s: float, largest: float) -> float:
    """Root mean square distance from `about_s` of the ends of slip of drawn parameters of `fit`."""
    inverse, _ = covariance(fit.normal_matrix)
    values, vectors = np.linalg.eigh(inverse)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    drawn = np.tile(fit.parameters, (_DRAWS, 1))
    drawn[:, fit.free] += np.random.default_rng(_DRAWS).standard_normal((_DRAWS, len(fit.free))) @ root.T
    drawn[:, Parameter.FRICTION_STATIC] = np.minimum(drawn[:, Parameter.FRICTION_STATIC], largest)
    ends = [_end_of(project_to_bounds(point, fit.law), fit.law, end_s) for point in (fit.parameters, *drawn)]
    away = np.array([(end_s if end is None else end) - about_s for end in ends])
    return float(np.sqrt(np.mean(away**2)))
