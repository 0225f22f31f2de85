"""The motion as a function of the parameters that are fitted."""

import numpy as np

from analysis.arrays import Floats
from analysis.fitting.models import MOTION_PARAMETERS, STRIBECK_PARAMETERS, Model, Place
from analysis.motion.phases import SHORTEST_S, final_relative, largest_rates, walk
from analysis.motion.sampling import sample_displacements
from analysis.motion.stribeck_sampling import (
    final_stribeck_relative,
    largest_stribeck_rates,
    sample_stribeck,
)
from analysis.motion.stribeck_steps import walk_stribeck


def sample_motion(parameters: Floats, time_s: Floats, model: Model) -> Floats:
    """Displacements (2, n) of the table, and of the plate against it, at rising `time_s`."""
    duration = _duration(parameters, time_s)
    if model is Model.STRIBECK_TILT:
        vector = parameters[:STRIBECK_PARAMETERS]
        phases, nodes = walk_stribeck(vector, duration)
        return sample_stribeck(vector, phases, nodes, time_s, 2)
    vector = parameters[:MOTION_PARAMETERS]
    return sample_displacements(vector, walk(vector, duration), time_s)


def phases_of(parameters: Floats, model: Model, duration_s: float) -> Floats:
    """Phases (m, 5) from release: start, sign of slip (0 stick), and u1, u1', u2 - u1 there."""
    duration = max(SHORTEST_S, duration_s)
    if model is Model.STRIBECK_TILT:
        return walk_stribeck(parameters[:STRIBECK_PARAMETERS], duration)[0][:, :5]
    return walk(parameters[:MOTION_PARAMETERS], duration)


def residual_displacement(parameters: Floats, model: Model, duration_s: float) -> float:
    """u2 - u1 at the end (m)."""
    if model is Model.STRIBECK_TILT:
        return float(final_stribeck_relative(*walk_stribeck(parameters[:STRIBECK_PARAMETERS], duration_s)))
    vector = parameters[:MOTION_PARAMETERS]
    return float(final_relative(vector, walk(vector, duration_s), duration_s))


def largest_rates_of(parameters: Floats, model: Model, duration_s: float) -> Floats:
    """Largest |u1'|, |u2'|, |u1''|, |u2''|, (4,)."""
    if model is Model.STRIBECK_TILT:
        vector = parameters[:STRIBECK_PARAMETERS]
        return np.array(largest_stribeck_rates(vector, *walk_stribeck(vector, duration_s), duration_s))
    vector = parameters[:MOTION_PARAMETERS]
    return np.array(largest_rates(vector, walk(vector, duration_s), duration_s))


def static_bounds(parameters: Floats, model: Model, duration_s: float) -> Floats:
    """Least and largest f_s that leave the motion as it is, (2,); both f_s where a stick ends in slip."""
    phases = phases_of(parameters, model, duration_s)
    stick = phases[:, 1] == 0.0
    if (stick[:-1] & ~stick[1:]).any():
        return np.array([parameters[Place.FRICTION_STATIC], parameters[Place.FRICTION_STATIC]])
    demands = _demand(parameters, phases[:, 2], phases[:, 3])
    upper = float(demands[~stick].min()) if (~stick).any() else np.inf
    lower = _largest_demand(parameters, phases[-1]) if stick[-1] else np.nan
    return np.array([lower, upper])


def _duration(parameters: Floats, time_s: Floats) -> float:
    return max(SHORTEST_S, float(time_s[-1]) - float(parameters[Place.RELEASE]))


def _demand(parameters: Floats, position: Floats, velocity: Floats) -> Floats:
    """|u1'' - g alpha| / g of the joint motion: the f_s that it takes to stick."""
    _, _, stiffness, damping, _, tilt, _, table_mass, plate_mass, gravity = parameters[:MOTION_PARAMETERS]
    acceleration = -(damping * velocity + stiffness * position) / (table_mass + plate_mass)
    return np.asarray(np.abs(acceleration / gravity - tilt))


def _largest_demand(parameters: Floats, phase: Floats) -> float:
    """Largest demand during a last stick."""
    mass = float(parameters[Place.TABLE_MASS] + parameters[Place.PLATE_MASS])
    n = float(parameters[Place.DAMPING]) / (2.0 * mass)
    w = float(np.sqrt(parameters[Place.STIFFNESS] / mass - n * n))
    tau = np.linspace(0.0, 2.0 * np.pi / w, 2000)
    a, b = phase[2], (phase[3] + n * phase[2]) / w
    decay, cosine, sine = np.exp(-n * tau), np.cos(w * tau), np.sin(w * tau)
    position = decay * (a * cosine + b * sine)
    velocity = decay * ((w * b - n * a) * cosine - (w * a + n * b) * sine)
    return float(_demand(parameters, position, velocity).max())
