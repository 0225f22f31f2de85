"""Free decay of one mass whose stiffness or damping depends on its swing, integrated numerically.

The motion is ``u'' + 2 n (1 + r u^2) u' + d |u'| u' + k^2 (g(u) + x_k sign(u')) = 0`` with
``g(u) = sin(a u) / a + b u^3`` (a^2 = `sine`, b = `cubic`) and ``k^2 = w^2 + n^2``. With
r = d = a = b = 0 it is that of `analysis.motion.one_mass`. Steps of the classical Runge-Kutta method are at
most 1/(20 w) long and end at the turning points: the phase drifts by about 3e-7 a period.
"""

import math

import numpy as np

from analysis.arrays import Floats
from analysis.compiled import compiled, compiled_part

_STEP_RAD = 0.05
_TURN_STEPS = 6  # of Newton's method, to the time of a turning point within a step


def nonlinear_decay(time_s: Floats, motion: Floats, order: int = 0) -> Floats:
    """Displacement (order 0), velocity (1) or acceleration (2) at `time_s` ((n,), ascending).

    `motion` is (turning_s, turning, omega_rad_per_s, damping_n_per_s, coulomb, cubic, sine, drag, rise),
    given by one of its turning points. Before that point the motion is traced back as if it had been free.
    """
    since = np.ascontiguousarray(time_s, dtype=np.float64) - motion[0]
    after = int(np.searchsorted(since, 0.0))
    later = _integrate(since[after:].copy(), motion, 1.0)
    earlier = _integrate(-since[:after][::-1], motion, -1.0)[:, ::-1]
    earlier[1] *= -1.0
    return np.concatenate((earlier[order], later[order]))


@compiled_part
def _acceleration(u: float, v: float, motion: Floats, side: float, flow: float) -> float:
    """Acceleration while the velocity has the sign `side`; `flow` is -1 for time that runs backwards."""
    omega, n = motion[2], motion[3]
    stiffness = omega * omega + n * n
    loss = 2.0 * n * (1.0 + motion[8] * u * u) * v + side * (motion[7] * v * v + stiffness * motion[4])
    return float(-stiffness * _restoring(u, motion[5], motion[6]) - flow * loss)


@compiled_part
def _restoring(u: float, cubic: float, sine: float) -> float:
    """Restoring force over the stiffness of small swings."""
    square = sine * u * u
    shape = 1.0 - square / 6.0
    if square > 1e-6:
        shape = math.sin(math.sqrt(square)) / math.sqrt(square)
    return u * (shape + cubic * u * u)


@compiled_part
def _step(u: float, v: float, step_s: float, motion: Floats, side: float, flow: float) -> tuple[float, float]:
    """Displacement and velocity after one step of the classical Runge-Kutta method."""
    half_s = 0.5 * step_s
    a1 = _acceleration(u, v, motion, side, flow)
    v2 = v + half_s * a1
    a2 = _acceleration(u + half_s * v, v2, motion, side, flow)
    v3 = v + half_s * a2
    a3 = _acceleration(u + half_s * v2, v3, motion, side, flow)
    v4 = v + step_s * a3
    a4 = _acceleration(u + step_s * v3, v4, motion, side, flow)
    sixth_s = step_s / 6.0
    return u + sixth_s * (v + 2.0 * (v2 + v3) + v4), v + sixth_s * (a1 + 2.0 * (a2 + a3) + a4)


@compiled
def _integrate(since_s: Floats, motion: Floats, flow: float) -> Floats:
    """Displacement, velocity and acceleration (3, n) at ascending times after the turning point."""
    states = np.zeros((3, len(since_s)))
    u, v, now_s, side = motion[1], 0.0, 0.0, -1.0 if motion[1] > 0.0 else 1.0
    longest_s = _STEP_RAD / motion[2]
    stopped = False
    for i in range(len(since_s)):
        while not stopped and now_s < since_s[i]:
            left_s = since_s[i] - now_s
            step_s = left_s / math.ceil(left_s / longest_s)
            u_end, v_end = _step(u, v, step_s, motion, side, flow)
            if v_end * side < 0.0:
                for _ in range(_TURN_STEPS):
                    slope = _acceleration(u_end, v_end, motion, side, flow)
                    step_s = min(max(step_s - v_end / slope, 0.0), longest_s)
                    u_end, v_end = _step(u, v, step_s, motion, side, flow)
                v_end, side = 0.0, -side
                stopped = _acceleration(u_end, v_end, motion, side, flow) * side <= 0.0
            u, v, now_s = u_end, v_end, now_s + step_s
        states[0, i], states[1, i] = u, v
        if not stopped:
            states[2, i] = _acceleration(u, v, motion, side, flow)
    return states
