"""The motion as a function of the parameters that are fitted, with its derivatives."""

import numpy as np

from analysis.channels import FloatArray
from analysis.motion.gradients import sample_with_gradient
from analysis.motion.phases import final_relative, largest_rates, walk
from analysis.motion.sampling import sample_displacements

_PARAMETERS = 10
_RELEASE = 6
_SHORTEST_S = 1e-3


def sample_motion(parameters: FloatArray, time_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Displacements of table and plate against table (n,) at rising `time_s`."""
    table, relative = sample_displacements(
        parameters, walk(parameters, _duration(parameters, time_s)), time_s
    )
    return np.asarray(table), np.asarray(relative)


def sample_with_derivatives(
    parameters: FloatArray, time_s: FloatArray, directions: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Displacements (2, n), and their derivatives (q, 2, n) along `directions` (q, 10)."""
    phases = walk(parameters, _duration(parameters, time_s))
    motion, gradient = sample_with_gradient(parameters, phases, time_s, directions)
    return motion, gradient


def phases_of(parameters: FloatArray, duration_s: float) -> FloatArray:
    """Phases (m, 5) from release: start, sign of slip (0 stick), and u1, u1', u2 - u1 there."""
    return walk(parameters[:_PARAMETERS], max(_SHORTEST_S, duration_s))


def residual_displacement(parameters: FloatArray, duration_s: float) -> float:
    """u2 - u1 at the end (m)."""
    return float(final_relative(parameters[:_PARAMETERS], phases_of(parameters, duration_s), duration_s))


def largest_rates_of(parameters: FloatArray, duration_s: float) -> FloatArray:
    """Largest |u1'|, |u2'|, |u1''|, |u2''|, (4,)."""
    return np.array(largest_rates(parameters[:_PARAMETERS], phases_of(parameters, duration_s), duration_s))


def static_bounds(parameters: FloatArray, duration_s: float) -> FloatArray:
    """Least and largest f_s that leave the motion as it is, (2,); both f_s where a stick ends in slip."""
    phases = phases_of(parameters, duration_s)
    stick = phases[:, 1] == 0.0
    if (stick[:-1] & ~stick[1:]).any():
        return np.array([parameters[1], parameters[1]])
    demands = _demand(parameters, phases[:, 2], phases[:, 3])
    upper = float(demands[~stick].min()) if (~stick).any() else np.inf
    lower = _largest_demand(parameters, phases[-1]) if stick[-1] else np.nan
    return np.array([lower, upper])


def _duration(parameters: FloatArray, time_s: FloatArray) -> float:
    return max(_SHORTEST_S, float(time_s[-1]) - float(parameters[_RELEASE]))


def _demand(parameters: FloatArray, position: FloatArray, velocity: FloatArray) -> FloatArray:
    """|u1'' - g alpha| / g of the joint motion: the f_s that it takes to stick."""
    _, _, stiffness, damping, _, tilt, _, table_mass, plate_mass, gravity = parameters[:_PARAMETERS]
    acceleration = -(damping * velocity + stiffness * position) / (table_mass + plate_mass)
    return np.asarray(np.abs(acceleration / gravity - tilt))


def _largest_demand(parameters: FloatArray, phase: FloatArray) -> float:
    """Largest demand during a last stick."""
    mass = float(parameters[7] + parameters[8])
    n = float(parameters[3]) / (2.0 * mass)
    w = float(np.sqrt(parameters[2] / mass - n * n))
    tau = np.linspace(0.0, 2.0 * np.pi / w, 2000)
    a, b = phase[2], (phase[3] + n * phase[2]) / w
    decay, cosine, sine = np.exp(-n * tau), np.cos(w * tau), np.sin(w * tau)
    position = decay * (a * cosine + b * sine)
    velocity = decay * ((w * b - n * a) * cosine - (w * a + n * b) * sine)
    return float(_demand(parameters, position, velocity).max())
