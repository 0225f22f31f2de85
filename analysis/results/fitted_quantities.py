"""Results from the fitted parameters and slips, each with its uncertainty by source."""

import math
from bisect import bisect_left
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Final, Self

import numpy as np

from analysis.arrays import Floats
from analysis.fitting.problem import FitProblem, covariance, motion_phases, project_to_bounds
from analysis.fitting.search import Fit
from analysis.identification import Events
from analysis.laws.catalogue import compared_law
from analysis.laws.law import FrictionLaw, IntegratedSolver
from analysis.laws.parameters import MOTION_PARAMETER_COUNT, Parameter
from analysis.laws.stand_parts import CORNER_NAMES, SHARED_NAMES, StandModel, corner_frequency_hz
from analysis.motion.two_mass import PEAK_RATES
from analysis.preparation.channels import Channel
from analysis.preparation.free_decay import FreeDecay
from analysis.quantities import COVERAGE_FACTOR_95, BudgetSource, Source
from analysis.record import AnalysisError, Record
from analysis.results.joint_fit import FRICTION_PARAMETERS, SIGNED_PARAMETERS, DecayConstants, JointFit
from analysis.uncertainty import (
    LEVELLING_UNCERTAINTY_RAD,
    NEGLIGIBLE,
    LinearForm,
    UncertaintyBudget,
    numerical_gradient,
    white_noise_variance,
)


def add_fitted_quantities(
    joint: JointFit, tied: tuple[float, float] | None, budget: UncertaintyBudget, *, slip_ended: bool
) -> dict[str, str | bool]:
    """Add friction, tilt, pullback, u_s if slip has ended, and peak rates; return the MSK-64 degree.

    `tied` is what `range_of_tied_static_friction` gives. Intervals of f_d and f_s follow chi-square itself,
    except where that takes seconds for a law that does not explain the record.
    """
    fit = joint.chosen
    own = zip(fit.law.own_places.tolist(), fit.law.own, strict=True)
    of_law = [(place, parameter.name, parameter.unit) for place, parameter in own]
    if isinstance(fit.law, StandModel):
        of_law += [(int(place), *SHARED_NAMES[place]) for place in fit.law.extra if place in SHARED_NAMES]
    friction = [(place, name, "1") for place, name in FRICTION_PARAMETERS.items()]
    of_stand = (Parameter.TILT, "tilt_rad", "rad"), (Parameter.PULLBACK, "pullback_m", "m")
    for place, name, unit in (*friction, *of_law, *of_stand):
        if fit.determines(place):
            sign = joint.decay.sign if place in SIGNED_PARAMETERS else 1
            form = LinearForm.of_parameter(joint.uncertainty, place, sign)
            shares, reach = parameter_contributions(joint, place)
            if name in CORNER_NAMES:
                _add_corner(CORNER_NAMES[name], fit.value(place), shares, budget)
                continue
            budget.add(name, sign * fit.value(place), shares, unit=unit, half_widths=reach, form=form)
    if isinstance(fit.law, StandModel) and any(effect.varies_friction for effect in fit.law.effects):
        _add_mean_friction(joint, fit.law, budget)
    if isinstance(fit.law.solver, IntegratedSolver):
        _add_path_mean(joint, fit.law.solver, budget)
    if slip_ended:
        _add_residual_displacement(joint, budget)
    _add_peak_rates(joint, budget)
    if tied is not None:
        _open_breakaway(joint, tied[1], budget)
    velocity = budget.results["table_velocity_max_m_per_s"].value
    return {"msk64_degree": msk64_degree(velocity)}


def parameter_contributions(
    joint: JointFit, place: int
) -> tuple[dict[Source, float], tuple[float, float] | None]:
    """Standard uncertainty of a fitted parameter by source, and the reach of its 95 % interval.

    The reach below and above the value is None where it is that of a normal distribution.
    """
    fit, shares = joint.chosen, LinearForm.of_parameter(joint.uncertainty, place).contributions()
    of_stand_model = isinstance(fit.law, StandModel)
    profiled = fit.law.solver.is_closed_form or (joint.selection.adequate and not of_stand_model)
    if profiled and fit.law.has_static_friction and place in FRICTION_PARAMETERS:
        return _by_profile(joint.problem, fit, place, shares)
    return shares, None


def _add_corner(
    name: str, squared_constant_s2: float, shares: dict[Source, float], budget: UncertaintyBudget
) -> None:
    """Add the corner frequency of an RC filter that rounds the readings as much as the fitted one."""
    corner_hz = corner_frequency_hz(squared_constant_s2)
    slope = 0.5 * corner_hz / max(squared_constant_s2, 1e-12)
    budget.add(name, corner_hz, {source: slope * share for source, share in shares.items()})


def _add_mean_friction(joint: JointFit, model: StandModel, budget: UncertaintyBudget) -> None:
    """Replace f_d, which varies with velocity or place, by its mean over the slid path."""
    fit, duration_s = joint.chosen, joint.duration_s

    def mean(parameters: Floats) -> float:
        return model.mean_friction(project_to_bounds(parameters, model), duration_s)

    point = fit.parameters
    gradient = numerical_gradient(mean, point, fit.free)
    budget.remove("friction_dynamic")
    _add_finite(joint, budget, [("friction_dynamic", mean(point), gradient)])


def _add_path_mean(joint: JointFit, solver: IntegratedSolver, budget: UncertaintyBudget) -> None:
    """Add the mean friction over the slid path of a law whose f_d is that at infinite velocity."""
    fit, duration_s = joint.chosen, joint.duration_s

    def mean(parameters: Floats) -> float:
        return solver.mean_friction(fit.law.vector(project_to_bounds(parameters, fit.law)), duration_s)

    gradient = numerical_gradient(mean, fit.parameters, fit.free)
    _add_finite(joint, budget, [("friction_path_mean", mean(fit.parameters), gradient)])


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
    _add_finite(
        joint,
        budget,
        zip(PEAK_RATES, rates(point), numerical_gradient(rates, point, joint.chosen.free), strict=True),
    )


_PLATE_ACCELERATION = PEAK_RATES.index("plate_acceleration_max_m_per_s2")
_BREAKAWAYS = 16  # values of f_s that are tried: a last slip may come with one and not with the next


def _open_breakaway(joint: JointFit, largest: float, budget: UncertaintyBudget) -> None:
    """Widen the plate's largest acceleration by every f_s up to the `largest` that the record allows.

    A stick ends where the acceleration is g f_s, however little that exceeds f_d, to which the law ties it.
    """
    name, chosen = PEAK_RATES[_PLATE_ACCELERATION], joint.chosen
    law = compared_law(static_friction=True, tilt=chosen.law.has_tilt)
    found, reached = budget.results[name], 0.0
    for static in np.linspace(chosen.value(Parameter.FRICTION_DYNAMIC), largest, _BREAKAWAYS):
        point = chosen.parameters.copy()
        point[Parameter.FRICTION_STATIC] = static
        rates = law.solver.peak_rates(law.vector(project_to_bounds(point, law)), joint.duration_s)
        reached = max(reached, float(rates[_PLATE_ACCELERATION]))
    rise = (reached - found.value) / COVERAGE_FACTOR_95
    if rise > NEGLIGIBLE * found.standard_uncertainty:
        budget.widen(name, BudgetSource.NOISE, rise)


def _add_finite(
    joint: JointFit, budget: UncertaintyBudget, quantities: Iterable[tuple[str, float, Floats]]
) -> None:
    """Add quantities (name, value, derivatives by the parameters) that have a value."""
    for name, value, slopes in quantities:
        if np.isfinite(value):
            form = LinearForm(joint.uncertainty, np.nan_to_num(slopes))
            budget.add(name, float(value), form.contributions(), form=form)


def _add_residual_displacement(joint: JointFit, budget: UncertaintyBudget) -> None:
    """Add u_s: gauge 2 after slip minus gauge 2 in the hold, or the fitted one without a hold or gauge."""
    law, decay, duration_s = joint.chosen.law, joint.decay, joint.duration_s

    def end(parameters: Floats) -> float:
        return law.solver.final_relative(law.vector(project_to_bounds(parameters, law)), duration_s)

    if (
        decay.relative is not None
        and decay.plateau is not None
        and decay.slip_end_s is not None
        and not decay.gauge_2_absolute
    ):
        gauge = joint.record.relative_gauge
        value, noise_m = _shift_of_gauge_2(decay.relative, decay.plateau, decay.slip_end_s, decay.noise_m[1])
        shares: dict[Source, float] = {
            BudgetSource.NOISE: noise_m,
            BudgetSource.GAUGE_2_GAIN: value * (gauge.gain_relative or 0.0),
            BudgetSource.GAUGE_2_NONLINEARITY: gauge.nonlinearity_m * float(np.sqrt(2.0 / 3.0)),
        }
    else:
        point = joint.chosen.parameters
        slopes = numerical_gradient(end, point, joint.chosen.free)
        value, shares = end(point), joint.uncertainty.contributions(slopes)
    budget.add("residual_displacement_m", decay.relative_sign * value, shares)


_DEGREES: Final = ("below V", "V", "VI", "VII", "VIII", "IX", "X", "above X")
_BOUNDS_M_PER_S: Final = (0.01, 0.02, 0.04, 0.08, 0.16, 0.32, 0.64)


def msk64_degree(velocity_max_m_per_s: float) -> str:
    """MSK-64 degree of a largest velocity (m/s, 0 or above).

    Degrees are intervals of velocity, each closed above: V (1, 2] cm/s, VI (2, 4], VII (4, 8],
    VIII (8, 16], IX (16, 32], X (32, 64] (Medvedev, Sponheuer and Karnik 1964). Outside them
    "below V" or "above X". Raises AnalysisError for a velocity that is negative or not finite.
    """
    if not (math.isfinite(velocity_max_m_per_s) and velocity_max_m_per_s >= 0.0):
        raise AnalysisError(
            "velocity {velocity!r} m/s has no MSK-64 degree: give a finite number, 0 or above",
            velocity=velocity_max_m_per_s,
        )
    return _DEGREES[bisect_left(_BOUNDS_M_PER_S, velocity_max_m_per_s)]


CHI_SQUARE_RISE_95 = 3.841458820694124  # rise of chi-square at the ends of a 95 % interval
_QUADRATIC = 0.15  # relative deviation from that rise up to which a parabola is good enough
_DISTANCES = (0.1, 0.25, 0.5, 0.8, 1.2, 1.7, 2.4, 3.2)  # in half intervals of a parabola
_HOPELESS = 14.0  # rise from which on a density of exp(-rise / 2) adds nothing to the interval
_FINE = 2001
_PROFILE_STEPS = 8


@dataclass(frozen=True, slots=True)
class ProfileInterval:
    """Distribution of a parameter about which chi-square is no parabola."""

    below: float  # from the fitted value to the ends of the shortest 95 % interval
    above: float
    deviation: float


@dataclass(frozen=True, eq=False, slots=True)
class Profile:
    """Chi-square along one parameter, the others refined; those with prior knowledge stay as fitted."""

    problem: FitProblem
    law: FrictionLaw
    parameter: int
    parameters: Floats  # (p,) float64: the fit
    follow: Floats  # (p,) float64: how the others follow a step of one in the parameter, by a parabola
    deviation: float  # standard uncertainty by the noise, the known parameters being as fitted
    white: float  # its variance over that by white noise as stated
    lowest: float  # chi-square of the fit

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
        lowest = fixed.cost(fit.parameters, fit.law)
        return cls(fixed, fit.law, parameter, fit.parameters, follow, deviation, white, lowest)

    def interval(self) -> ProfileInterval | None:
        if all(
            abs(self._rise(side, follow=True) / CHI_SQUARE_RISE_95 - 1.0) < _QUADRATIC for side in (-1.0, 1.0)
        ):
            return None
        below, above = self._side(-1.0), self._side(1.0)
        shares, rises = zip(*below[::-1], (0.0, 0.0), *above, strict=True)
        reach = float(np.sqrt(CHI_SQUARE_RISE_95)) * self.deviation
        return distribution(reach * np.array(shares), np.array(rises))

    def _side(self, side: float) -> list[tuple[float, float]]:
        """Lowest rises on one side of the fit, until there is no hope of less."""
        found = []
        for distance in _DISTANCES:
            rise = self._rise(side * distance, follow=True)
            if rise > CHI_SQUARE_RISE_95 and self.law.solver.is_closed_form:
                rise = min(rise, self._rise(side * distance, follow=False))
            found.append((side * distance, rise))
            if rise > _HOPELESS and distance > 1.0:
                break
        return found

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
        return (there.cost - self.lowest) / self.white


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


LOWER, UPPER = "friction_static_lower", "friction_static_upper"
_READINGS = 3000
_FIRST_STEP = 1e-4  # of the way up along f_s, relative to the likeliest; each next step is twice as long
_FARTHEST = 3.0  # f_s over the likeliest where the way ends
_STEPS, _HALVINGS = 6, 5
_SLIP_DOUBT = 2.0  # later slips take back part of the first one: gauge 2 shows as much less in the end


def add_static_friction_bounds(
    joint: JointFit, tied: tuple[float, float] | None, budget: UncertaintyBudget
) -> None:
    """Add both bounds of f_s to the budget; `tied` is what `range_of_tied_static_friction` gives.

    None on a stand that is not ideal. Where a law with f_s explains the record, they are those of its
    motion: the largest demand that the joint stood without slip, and the smallest at which slip began.
    Where the likeliest law ties f_s to f_d, f_s may still be somewhat larger: up to where chi-square of
    the law that frees it has risen.
    """
    chosen, duration_s = joint.chosen, joint.duration_s
    if isinstance(chosen.law, StandModel):
        return
    if tied is not None:
        _add_tied(joint, tied, budget)
        return

    def bounds(parameters: Floats) -> Floats:
        return _bounds_of_motion(project_to_bounds(parameters, chosen.law), chosen.law, duration_s)

    point = chosen.parameters
    _add_finite(
        joint, budget, zip((LOWER, UPPER), bounds(point), numerical_gradient(bounds, point), strict=True)
    )


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
    budget.add(LOWER, value, shares)


def range_of_tied_static_friction(joint: JointFit) -> tuple[float, float] | None:
    """Likeliest f_s, and the one above it at which chi-square is higher by 3.84, all else refined.

    None unless the chosen law ties f_s to f_d, on an ideal stand; one of the candidates may have found a
    lower minimum with a free f_s.
    """
    chosen = joint.chosen
    if chosen.law.has_static_friction or isinstance(chosen.law, StandModel):
        return None
    law = compared_law(static_friction=True, tilt=chosen.law.has_tilt)
    some = joint.problem.decimated(_READINGS, joint.decay.dense_until_s)
    starts = [chosen.parameters, *(fit.parameters for fit in joint.candidates if fit.law is law)]
    best = min((some.minimise(start, law, 2 * _STEPS) for start in starts), key=lambda found: found.cost)
    likeliest = float(best.parameters[Parameter.FRICTION_STATIC])
    limit = CHI_SQUARE_RISE_95 * max(1.0, best.cost / some.sample_count)

    def allows(static: float) -> bool:
        start = best.parameters.copy()
        start[Parameter.FRICTION_STATIC] = static
        held = some.minimise(start, law, _STEPS, fixed=Parameter.FRICTION_STATIC, enough=best.cost + limit)
        return held.cost < best.cost + limit

    near, step = likeliest, _FIRST_STEP * likeliest
    while allows(near + step) and near < _FARTHEST * likeliest:
        near, step = near + step, 2.0 * step
    far = near + step
    for _ in range(_HALVINGS):
        middle = 0.5 * (near + far)
        near, far = (middle, far) if allows(middle) else (near, middle)
    return likeliest, far


def _add_tied(joint: JointFit, tied: tuple[float, float], budget: UncertaintyBudget) -> None:
    chosen = joint.chosen
    friction = chosen.value(Parameter.FRICTION_DYNAMIC)
    if not chosen.determines(Parameter.FRICTION_DYNAMIC):
        return
    shares = LinearForm.of_parameter(joint.uncertainty, Parameter.FRICTION_DYNAMIC).contributions()
    budget.add(LOWER, friction, shares)
    likeliest, end = max(tied[0], friction), max(tied[1], friction)
    noise = float(np.hypot((end - likeliest) / COVERAGE_FACTOR_95, shares[BudgetSource.NOISE]))
    budget.add(UPPER, likeliest, {**shares, BudgetSource.NOISE: noise})


def _unseen_slip_m(record: Record, decay: FreeDecay) -> float:
    """Largest slip that gauge 2 (or without it, gauge 1) may have missed."""
    if decay.relative is None or decay.plateau is None or decay.gauge_2_absolute:
        share = record.masses.plate_mass_kg / (record.masses.table_mass_kg + record.masses.plate_mass_kg)
        count = max(1.0, 0.25 * decay.period_s / decay.channels.interval_s)
        return _SLIP_DOUBT * 2.0 * decay.noise_m[0] / float(np.sqrt(count)) / share
    after_s = decay.release.time_s + 0.5 * decay.period_s
    shift_m, noise_m = _shift_of_gauge_2(decay.relative, decay.plateau, after_s, decay.noise_m[1])
    return _SLIP_DOUBT * (abs(shift_m) + 2.0 * noise_m)


def _shift_of_gauge_2(
    channel: Channel, plateau: tuple[float, float], after_s: float, noise_m: float
) -> tuple[float, float]:
    """Mean reading after a time minus that in the hold, and its standard uncertainty by noise (m)."""
    held, rest = channel.between(*plateau).value_m, channel.between(after_s, np.inf).value_m
    return float(rest.mean() - held.mean()), noise_m * float(np.sqrt(1.0 / len(held) + 1.0 / len(rest)))


def _bounds_of_motion(parameters: Floats, law: FrictionLaw, duration_s: float) -> Floats:
    """Least and largest f_s that leave the motion as it is, (2,); both f_s where a stick ends in slip."""
    phases = motion_phases(parameters, law, duration_s)
    stick = phases[:, 1] == 0.0
    if (stick[:-1] & ~stick[1:]).any():
        return np.full(2, parameters[Parameter.FRICTION_STATIC])
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
    mass = float(parameters[Parameter.TABLE_MASS] + parameters[Parameter.PLATE_MASS])
    n = float(parameters[Parameter.DAMPING]) / (2.0 * mass)
    w = float(np.sqrt(parameters[Parameter.STIFFNESS] / mass - n * n))
    tau = np.linspace(0.0, 2.0 * np.pi / w, 2000)
    a, b = phase[2], (phase[3] + n * phase[2]) / w
    decay, cosine, sine = np.exp(-n * tau), np.cos(w * tau), np.sin(w * tau)
    position = decay * (a * cosine + b * sine)
    velocity = decay * ((w * b - n * a) * cosine - (w * a + n * b) * sine)
    return float(_demand(parameters, position, velocity).max())


_DRAWS = 40  # of parameters, for the scatter of the end of slip: it is known to a ninth
_PLAUSIBLE = 2.0  # times the price of a parameter by which the BIC of a law that may be true is higher


@dataclass(frozen=True, slots=True)
class SlipEnd:
    """End of the last slip and its standard uncertainty."""

    time_s: float
    uncertainty_s: float

    @property
    def upper_limit_s(self) -> float:
        """A time at which slip has ended: two standard uncertainties later."""
        return self.time_s + 2.0 * self.uncertainty_s


ROUGH_END_PERIODS = 0.25 / float(np.sqrt(3.0))
"""Standard uncertainty of the end of slip by gauge 2 alone, to a quarter period."""


def find_slip_end(joint: JointFit, tied: tuple[float, float] | None) -> SlipEnd | None:
    """End of slip by the fitted motion; the later one of that and gauge 2's where no law explains the record.

    `tied` is what `range_of_tied_static_friction` gives. The last slips are often smaller than the noise.
    Gauge 2 alone gives the end to a quarter period, rather too early than too late. None where slip lasts to
    the end of the record, or comes again after it.
    """
    decay, chosen, adequate = joint.decay, joint.chosen, joint.selection.adequate
    end_s, largest = joint.end_s, np.inf if tied is None else tied[1]
    if adequate:  # a period later the widest swing is past
        later = _end_of(chosen.parameters, chosen.law, end_s + decay.period_s)
        if later is None or later > end_s:
            return None
    fitted = _fitted_slip_end(joint, largest)
    if fitted is not None and tied is not None:
        fitted = _with_static_open(fitted, chosen, largest, end_s)
    if fitted is None or adequate or decay.slip_end_s is None:
        return fitted
    apart_s = decay.slip_end_s - fitted.time_s
    rough_s = ROUGH_END_PERIODS * decay.period_s
    uncertainty_s = float(np.linalg.norm((fitted.uncertainty_s, apart_s, rough_s)))
    return SlipEnd(max(fitted.time_s, decay.slip_end_s), uncertainty_s)


def _fitted_slip_end(joint: JointFit, largest: float) -> SlipEnd | None:
    """End of the fitted slip, and how far it scatters when the parameters do, over every plausible law.

    A last small slip comes or goes with small changes of f_s, so that its end has no useful derivative:
    parameters are drawn from the fit's distribution. A law with more parameters that fits hardly better
    may be the true one, and gives another end; its f_s, which the fit may leave open, is `largest` at most.
    """
    chosen, end_s = joint.chosen, joint.end_s
    end = _end_of(chosen.parameters, chosen.law, end_s)
    if end is None:
        return None
    price = _PLAUSIBLE * float(np.log(joint.problem.sample_count))
    plausible = [fit for fit in joint.candidates if fit.bic <= chosen.bic + price]
    return SlipEnd(end, max(_scatter(fit, end, end_s, largest) for fit in plausible))


def build_events(joint: JointFit, slip_end: SlipEnd | None) -> Events:
    """Events in the record's time; no end of a slip that was not fitted, or may as well be the release."""
    decay, chosen = joint.decay, joint.chosen
    to_record, scale = decay.channels.to_record_time, decay.channels.clock_scale
    index = int(np.flatnonzero(chosen.free == Parameter.RELEASE)[0])
    release_uncertainty_s = float(np.sqrt(covariance(chosen.normal_matrix)[0][index, index]))
    rest = find_rest(decay)
    if slip_end is not None:
        lasts_s = slip_end.time_s - chosen.value(Parameter.RELEASE)
        if not chosen.determines(Parameter.FRICTION_DYNAMIC) or slip_end.uncertainty_s >= lasts_s:
            slip_end = None
    return Events(
        release_s=to_record(chosen.value(Parameter.RELEASE)),
        slip_end_s=None if slip_end is None else to_record(slip_end.time_s),
        rest_s=None if rest is None else to_record(rest[0]),
        free_decay_end_s=decay.early_end_s,
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


def _with_static_open(fitted: SlipEnd, chosen: Fit, largest: float, end_s: float) -> SlipEnd:
    """Widen by the ends of slip of every f_s that the record allows above f_d, to which the law ties it."""
    law = compared_law(static_friction=True, tilt=chosen.law.has_tilt)
    points = np.tile(chosen.parameters, (_DRAWS, 1))
    points[:, Parameter.FRICTION_STATIC] = np.linspace(
        chosen.value(Parameter.FRICTION_DYNAMIC), largest, _DRAWS
    )
    return SlipEnd(
        fitted.time_s, float(np.hypot(fitted.uncertainty_s, _rms_distance(points, law, fitted.time_s, end_s)))
    )


def _scatter(fit: Fit, about_s: float, end_s: float, largest: float) -> float:
    """Root mean square distance from `about_s` of the ends of slip of drawn parameters of `fit`.

    f_s is held where its standard deviation exceeds it: rounding decides how far a fit at f_s = f_d leaves
    it open, and `_with_static_open` takes every f_s that the record allows.
    """
    inverse, _ = covariance(fit.normal_matrix)
    # Scaled, since parameters differ by many orders, and symmetric, so that rounding decides nothing.
    variance = np.diag(inverse)
    scale = np.sqrt(np.where(variance > 0.0, variance, 1.0))
    values, vectors = np.linalg.eigh(inverse / np.outer(scale, scale))
    root = (vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T * scale
    drawn = np.tile(fit.parameters, (_DRAWS, 1))
    drawn[:, fit.free] += np.random.default_rng(_DRAWS).standard_normal((_DRAWS, len(fit.free))) @ root
    static = fit.value(Parameter.FRICTION_STATIC)
    is_open = variance[fit.free == Parameter.FRICTION_STATIC] > static**2
    drawn[:, Parameter.FRICTION_STATIC] = (
        static if is_open.any() else np.minimum(drawn[:, Parameter.FRICTION_STATIC], largest)
    )
    return _rms_distance(np.vstack((fit.parameters, drawn)), fit.law, about_s, end_s)


def _rms_distance(points: Floats, law: FrictionLaw, about_s: float, end_s: float) -> float:
    """Root mean square distance from `about_s` of the ends of slip at points (n, p)."""
    ends = [_end_of(project_to_bounds(point, law), law, end_s) for point in points]
    away = np.array([(end_s if end is None else end) - about_s for end in ends])
    return float(np.sqrt(np.mean(away**2)))
