"""The paper's own algorithm: three states at a fixed step, to reproduce its figures and to compare.

At each step both slips are tried, friction +f_d and -f_d, by the paper's Eq. (6). When their relative
velocities at the end of the step differ in sign the plates move together; else the slip with the smaller
relative velocity is the true one. Eq. (6) is taken with the sign of f of Eqs. (1)-(5), from which its
printed form differs, and with k2 as damped frequency, as printed. Plates that begin to move together do
so with the velocity of the table, the only one that enters the paper's formulas.

The result depends on the step: 1FFM0 ends at -10.23 mm with 1e-4 s, at -10.265 mm exactly. A step in
which the slip reverses counts as joint motion, so the largest plate acceleration can exceed g f_d: the
3.75 m/s2 that the paper gives for 1FFM0 will be such a step.
"""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from analysis.arrays import Floats
from analysis.compiled import compiled, compiled_part
from analysis.motion.events import (
    PULLBACK,
    oscillation_amplitudes,
    oscillation_derivative,
    oscillator,
    raise_largest,
)
from analysis.motion.two_mass import Motion, MotionError, TwoMassParameters
from messages.i18n import N_

_MOST_STEPS = 10_000_000


@dataclass(frozen=True, eq=False)
class SteppedMotion(Motion):
    """A motion stepped in time; between steps it follows the formulas that the step took."""

    step_s: float
    _vector: Floats = field(repr=False)
    _states: Floats = field(repr=False)
    _signs: NDArray[np.int8] = field(repr=False)

    def _sample_rising(self, times_s: Floats, count: int) -> Floats:
        return self._sample_steps(times_s)[0][:count]

    def _phase_at(self, times_s: Floats) -> NDArray[np.int8]:
        return self._sample_steps(times_s)[1]

    def _sample_steps(self, times_s: Floats) -> tuple[Floats, NDArray[np.int8]]:
        sampled: tuple[Floats, NDArray[np.int8]] = _sample_steps(
            self._vector, self._states, self._signs, self.step_s, times_s
        )
        return sampled


def simulate(
    parameters: TwoMassParameters, *, duration_s: float = 10.0, step_s: float = 1e-4
) -> SteppedMotion:
    """Motion from release to `duration_s` by the paper's algorithm.

    Raises MotionError if f_s differs from f_d or the plane is tilted, if duration or step are impossible, or
    for more than ten million steps.
    """
    _check(parameters, duration_s, step_s)
    vector = parameters.vector()
    states, signs = _integrate_steps(vector, step_s, math.ceil(duration_s / step_s * (1.0 - 1e-12)))
    changed = np.flatnonzero(np.diff(signs)) + 1
    starts = np.concatenate(([0.0], changed * step_s))
    phases = signs[np.concatenate(([0], changed))]
    largest: tuple[float, float, float, float] = _largest_rates(vector, states, signs)
    end, _ = _sample_steps(vector, states, signs, step_s, np.array([duration_s]))
    return SteppedMotion(
        duration_s,
        starts,
        phases,
        float(starts[-1]) if phases[-1] == 0 else duration_s,
        float(end[1, 0]),
        *largest,
        step_s,
        vector,
        states,
        signs,
    )


def _check(parameters: TwoMassParameters, duration_s: float, step_s: float) -> None:
    static, dynamic = parameters.static_or_dynamic, parameters.friction_dynamic
    if static != dynamic:
        template = N_(
            "friction_static is {static:g}, but the paper's method knows only friction_dynamic"
            " ({dynamic:g}): leave it out, or take the exact method"
        )
        raise MotionError(template, static=static, dynamic=dynamic)
    if parameters.tilt_rad != 0.0:
        raise MotionError(
            "tilt_rad is {tilt_rad:g}, but the paper's method knows no tilt: leave it out, or"
            " take the exact method",
            tilt_rad=parameters.tilt_rad,
        )
    if not 0.0 < duration_s < math.inf:
        raise MotionError(
            "duration_s is {duration_s:g}: give a positive number of seconds", duration_s=duration_s
        )
    if not 0.0 < step_s <= duration_s:
        template = N_("step_s is {step_s:g}: give more than 0 and at most the duration, {duration_s:g}")
        raise MotionError(template, step_s=step_s, duration_s=duration_s)
    if duration_s / step_s > _MOST_STEPS:
        raise MotionError(
            "step_s is {step_s:g}, {steps:.0f} steps: give at least {smallest:g}",
            step_s=step_s,
            steps=duration_s / step_s,
            smallest=duration_s / _MOST_STEPS,
        )


@compiled_part
def _mode(parameters: Floats, sign: float) -> tuple[float, float, float, float]:
    """As `oscillator`, but with k2 for the damped frequency of a slip."""
    damping, frequency, load, drive = oscillator(parameters, sign)
    if sign != 0.0:
        frequency = math.hypot(frequency, damping)
    return damping, frequency, load, drive


@compiled_part
def _moved(
    mode: tuple[float, float, float, float], position: float, velocity: float, tau: float
) -> tuple[float, float, float]:
    """Displacement, velocity and acceleration of the table after `tau`."""
    damping, frequency, load, _ = mode
    cosine, sine, rate_cosine, rate_sine = oscillation_amplitudes(
        damping, frequency, position - load, velocity
    )
    second_cosine, second_sine = oscillation_derivative(damping, frequency, rate_cosine, rate_sine)
    decay = math.exp(-damping * tau)
    cos, sin = decay * math.cos(frequency * tau), decay * math.sin(frequency * tau)
    return (
        load + (cosine * cos + sine * sin),
        rate_cosine * cos + rate_sine * sin,
        second_cosine * cos + second_sine * sin,
    )


@compiled_part
def _propagator(mode: tuple[float, float, float, float], step: float) -> tuple[float, float, float, float]:
    """What a step makes of a displacement from the load's position and of a velocity: (xx, xv, vx, vv)."""
    free = mode[0], mode[1], 0.0, 0.0
    xx, vx, _ = _moved(free, 1.0, 0.0, step)
    xv, vv, _ = _moved(free, 0.0, 1.0, step)
    return xx, xv, vx, vv


@compiled
def _integrate_steps(parameters: Floats, step: float, count: int) -> tuple[Floats, NDArray[np.int8]]:
    """States u1, u1', u2 - u1, u2' at the steps, (count + 1, 4), and the sign taken by each, (count,)."""
    states, signs = np.empty((count + 1, 4)), np.empty(count, np.int8)
    position, velocity, relative, plate = parameters[PULLBACK], 0.0, 0.0, 0.0
    _, _, load, drive = _mode(parameters, 1.0)
    slip, stick = _propagator(_mode(parameters, 1.0), step), _propagator(_mode(parameters, 0.0), step)
    for k in range(count + 1):
        states[k, 0], states[k, 1], states[k, 2], states[k, 3] = position, velocity, relative, plate
        if k == count:
            break
        forward = plate + drive * step - (slip[2] * (position - load) + slip[3] * velocity)
        backward = plate - drive * step - (slip[2] * (position + load) + slip[3] * velocity)
        if forward * backward < 0.0:
            signs[k] = 0
            x = position
            position, velocity = stick[0] * x + stick[1] * velocity, stick[2] * x + stick[3] * velocity
            plate = velocity
            continue
        sign = 1.0 if abs(forward) < abs(backward) else -1.0
        signs[k] = int(sign)
        x = position - sign * load
        moved = sign * load + (slip[0] * x + slip[1] * velocity)
        relative += (plate + 0.5 * sign * drive * step) * step - (moved - position)
        position, velocity = moved, slip[2] * x + slip[3] * velocity
        plate += sign * drive * step
    return states, signs


@compiled
def _largest_rates(
    parameters: Floats, states: Floats, signs: NDArray[np.int8]
) -> tuple[float, float, float, float]:
    """Largest |u1'|, |u2'|, |u1''|, |u2''| at the beginnings of the steps."""
    largest = np.zeros(4)
    for k in range(len(signs)):
        mode = _mode(parameters, float(signs[k]))
        _, velocity, acceleration = _moved(mode, states[k, 0], states[k, 1], 0.0)
        plate = velocity if signs[k] == 0 else states[k, 3]
        plate_acceleration = acceleration if signs[k] == 0 else mode[3]
        raise_largest(largest, velocity, plate, acceleration, plate_acceleration)
    return largest[0], largest[1], largest[2], largest[3]


@compiled
def _sample_steps(
    parameters: Floats, states: Floats, signs: NDArray[np.int8], step: float, times: Floats
) -> tuple[Floats, NDArray[np.int8]]:
    """u1, u2 - u1, u1', u2', u1'', u2'' at `times`, (6, n), and the sign of the step that each is in."""
    out, phase = np.zeros((6, len(times))), np.zeros(len(times), np.int8)
    for j in range(len(times)):
        if times[j] < 0.0:
            out[0, j] = parameters[PULLBACK]
            continue
        k = min(int(times[j] / step), len(signs) - 1)
        tau, sign = max(0.0, times[j] - k * step), float(signs[k])
        mode = _mode(parameters, sign)
        position, relative, plate = states[k, 0], states[k, 2], states[k, 3]
        out[0, j], out[2, j], out[4, j] = _moved(mode, position, states[k, 1], tau)
        phase[j] = signs[k]
        if sign == 0.0:
            out[1, j], out[3, j], out[5, j] = relative, out[2, j], out[4, j]
            continue
        slipped = (plate + 0.5 * mode[3] * tau) * tau - (out[0, j] - position)
        out[1, j], out[3, j], out[5, j] = relative + slipped, plate + mode[3] * tau, mode[3]
    return out, phase
