"""When the table was let go, when slip ended and when the swing sank into the noise, with uncertainty."""

from dataclasses import dataclass

import numpy as np

from analysis.arrays import Floats
from analysis.fitting.least_squares import covariance
from analysis.fitting.problem import motion_phases, project_to_bounds
from analysis.fitting.search import Fit
from analysis.identification import Events
from analysis.laws.catalogue import compared_law
from analysis.laws.law import FrictionLaw
from analysis.laws.parameters import Parameter
from analysis.preparation.free_decay import FreeDecay
from analysis.results.joint_fit import JointFit
from analysis.results.static_bounds import largest_static_friction

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

    The last slips are often smaller than the noise, so that gauge 2 alone tells the end to a quarter period
    and too early rather than too late.

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
