"""The motion as a function of the parameters that are fitted."""

import numpy as np

from analysis.arrays import Floats
from analysis.fitting.models import MOTION_PARAMETER_COUNT, STRIBECK_PARAMETER_COUNT, FrictionLaw, Parameter
from analysis.motion.events import DURATION_MIN_S, final_relative, integrate_events, peak_rates
from analysis.motion.sampling import sample_displacements
from analysis.motion.stribeck_integration import integrate_stribeck
from analysis.motion.stribeck_sampling import (
    final_stribeck_relative,
    peak_stribeck_rates,
    sample_stribeck,
)


def sample_motion(parameters: Floats, time_s: Floats, law: FrictionLaw) -> Floats:
    """Displacements (2, n) of the table, and of the plate against it, at rising `time_s`."""
    duration = _duration(parameters, time_s)
    if law is FrictionLaw.STRIBECK_TILT:
        vector = parameters[:STRIBECK_PARAMETER_COUNT]
        phases, nodes = integrate_stribeck(vector, duration)
        return sample_stribeck(vector, phases, nodes, time_s, 2)
    vector = parameters[:MOTION_PARAMETER_COUNT]
    return sample_displacements(vector, integrate_events(vector, duration), time_s)


def motion_phases(parameters: Floats, law: FrictionLaw, duration_s: float) -> Floats:
    """Phases (m, 5) from release: start, sign of slip (0 stick), and u1, u1', u2 - u1 there."""
    duration = max(DURATION_MIN_S, duration_s)
    if law is FrictionLaw.STRIBECK_TILT:
        return integrate_stribeck(parameters[:STRIBECK_PARAMETER_COUNT], duration)[0][:, :5]
    return integrate_events(parameters[:MOTION_PARAMETER_COUNT], duration)


def residual_displacement(parameters: Floats, law: FrictionLaw, duration_s: float) -> float:
    """u2 - u1 at the end (m)."""
    if law is FrictionLaw.STRIBECK_TILT:
        return float(
            final_stribeck_relative(*integrate_stribeck(parameters[:STRIBECK_PARAMETER_COUNT], duration_s))
        )
    vector = parameters[:MOTION_PARAMETER_COUNT]
    return float(final_relative(vector, integrate_events(vector, duration_s), duration_s))


def fitted_peak_rates(parameters: Floats, law: FrictionLaw, duration_s: float) -> Floats:
    """Largest |u1'|, |u2'|, |u1''|, |u2''|, (4,)."""
    if law is FrictionLaw.STRIBECK_TILT:
        vector = parameters[:STRIBECK_PARAMETER_COUNT]
        return np.array(peak_stribeck_rates(vector, *integrate_stribeck(vector, duration_s), duration_s))
    vector = parameters[:MOTION_PARAMETER_COUNT]
    return np.array(peak_rates(vector, integrate_events(vector, duration_s), duration_s))


def static_friction_bounds(parameters: Floats, law: FrictionLaw, duration_s: float) -> Floats:
    """Least and largest f_s that leave the motion as it is, (2,); both f_s where a stick ends in slip."""
    phases = motion_phases(parameters, law, duration_s)
    stick = phases[:, 1] == 0.0
    if (stick[:-1] & ~stick[1:]).any():
        return np.array([parameters[Parameter.FRICTION_STATIC], parameters[Parameter.FRICTION_STATIC]])
    demands = _demand(parameters, phases[:, 2], phases[:, 3])
    upper = float(demands[~stick].min()) if (~stick).any() else np.inf
    lower = _largest_demand(parameters, phases[-1]) if stick[-1] else np.nan
    return np.array([lower, upper])


def _duration(parameters: Floats, time_s: Floats) -> float:
    return max(DURATION_MIN_S, float(time_s[-1]) - float(parameters[Parameter.RELEASE]))


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
