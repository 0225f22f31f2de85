"""Exact free decay of one mass with viscous damping and Coulomb friction, to its stop off zero.

The motion is ``m u'' + 2 m n u' + c u + F sign(u') = 0`` with ``x_k = F / c``. Between two turning
points it is a damped oscillation about ``-sign(u') x_k`` that lasts half a period, so the turning points
follow ``|X_(i+1)| = b |X_i| - (1 + b) x_k`` with ``b = exp(-n T / 2)``, and the mass stays at the first
one inside ``|X| <= x_k`` (docs/explanation/identification.md, "One mass"). Nothing is stepped through time.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.arrays import Floats
from analysis.record import AnalysisError


class DecayError(AnalysisError, ValueError):
    """Parameters that describe no free decay."""


@dataclass(frozen=True, slots=True)
class OneMassDecay:
    """A free decay, given by one of its turning points."""

    period_s: float  # damped period ``2 pi / sqrt(k^2 - n^2)`` (s), above 0
    damping_n_per_s: float  # viscous damping constant n (1/s), 0 or above
    coulomb_displacement_m: float  # x_k = F / c (m), 0 or above
    turning_s: float  # time (s) and displacement from the middle of the rest band (m) of a turning point
    turning_m: float

    def __post_init__(self) -> None:
        _check("period_s", self.period_s, self.period_s > 0.0, "above 0")
        for name in ("damping_n_per_s", "coulomb_displacement_m"):
            _check(name, getattr(self, name), getattr(self, name) >= 0.0, "0 or above")
        _check("turning_s", self.turning_s, True, "")
        _check("turning_m", self.turning_m, True, "")


@dataclass(frozen=True, eq=False)
class OneMassMotion:
    """Motion at the asked times, and where it ends."""

    time_s: Floats  # (n,) float64
    displacement_m: Floats
    velocity_m_per_s: Floats
    acceleration_m_per_s2: Floats
    turning_s: Floats  # (k,) float64: turning points from the given one to the last asked time or the stop
    turning_m: Floats
    stop_s: float | None  # time of the stop (s); None when the mass still moves at the last asked time


def simulate(decay: OneMassDecay, time_s: Floats) -> OneMassMotion:
    """Motion of `decay` at `time_s` ((n,), s, in any order, also before the given turning point).

    Exact to rounding. At a turning point velocity is 0 and the acceleration is that of the half cycle
    which begins there.
    """
    time_s = np.asarray(time_s, dtype=np.float64)
    start = decay.turning_s, decay.turning_m, 2.0 * math.pi / decay.period_s
    losses = decay.damping_n_per_s, decay.coulomb_displacement_m
    displacement_m, velocity, acceleration = (
        free_decay(time_s, *start, *losses, order=order) for order in range(3)
    )
    last_s = float(time_s.max()) if time_s.size else decay.turning_s
    turning_s, turning_m, stopped = _turning_points(decay, last_s)
    stop_s = float(turning_s[-1]) if stopped else None
    return OneMassMotion(time_s, displacement_m, velocity, acceleration, turning_s, turning_m, stop_s)


def free_decay(
    time_s: Floats,
    turning_s: complex,
    turning_m: complex,
    omega_rad_per_s: complex,
    damping_n_per_s: complex,
    coulomb_m: complex,
    *,
    order: int = 0,
) -> NDArray[Any]:
    """Displacement (order 0), velocity (1) or acceleration (2) of a free decay at `time_s`.

    The bare formula behind `simulate`, without checks: also for negative damping and for complex
    parameters, so that complex steps give exact derivatives.
    """
    half_s = math.pi / omega_rad_per_s
    decrement = damping_n_per_s * half_s
    cycle = np.floor(((time_s - turning_s) / half_s).real)
    first_m = turning_m if turning_m.real >= 0.0 else -turning_m
    stop = _stop_cycle(cycle, first_m, decrement, coulomb_m)
    moving = cycle < stop
    cycle = np.minimum(cycle, stop)
    magnitude_m = turning_magnitude(cycle, first_m, decrement, coulomb_m)
    side = np.where(cycle % 2.0 == 0.0, 1.0, -1.0) * math.copysign(1.0, turning_m.real)
    wave = _half_wave(time_s - turning_s - cycle * half_s, omega_rad_per_s, damping_n_per_s, order)
    centre_m, rest_m = (coulomb_m, magnitude_m) if order == 0 else (0.0, 0.0)
    return np.asarray(side * np.where(moving, centre_m + (magnitude_m - coulomb_m) * wave, rest_m))


def turning_magnitude(
    cycle: Floats, first_m: complex, half_cycle_decrement: complex, coulomb_m: complex
) -> NDArray[Any]:
    """|X_i| after `cycle` half cycles (negative: before them), from |X_0| = `first_m`.

    Closed form of the half-cycle rule, with b = exp(-`half_cycle_decrement`):
    ``|X_i| = b^i |X_0| - (1 + b) x_k (1 - b^i) / (1 - b)``. It does not know the stop.
    """
    if half_cycle_decrement == 0.0:
        return np.asarray(first_m - 2.0 * coulomb_m * cycle)
    losses = np.expm1(-cycle * half_cycle_decrement) / np.expm1(-half_cycle_decrement)
    loss_m = coulomb_m * (1.0 + np.exp(-half_cycle_decrement))
    return np.asarray(first_m * np.exp(-cycle * half_cycle_decrement) - loss_m * losses)


def _stop_cycle(cycle: Floats, first_m: complex, decrement: complex, coulomb_m: complex) -> float:
    """First turning point from the given one on that lies inside x_k; infinity when none does yet."""
    if coulomb_m.real <= 0.0 or not cycle.size:
        return math.inf
    cycles = np.arange(max(float(cycle.max()), 0.0) + 1.0)
    magnitude_m = turning_magnitude(cycles, first_m.real, decrement.real, coulomb_m.real)
    inside = np.flatnonzero(magnitude_m <= coulomb_m.real)
    return float(inside[0]) if inside.size else math.inf


def _half_wave(since_s: NDArray[Any], omega: complex, n: complex, order: int) -> NDArray[Any]:
    """Derivative `order` of e^(-n t) (cos w t + n/w sin w t): oscillation about 0 from rest at 1."""
    decay, cosine, sine = np.exp(-n * since_s), np.cos(omega * since_s), np.sin(omega * since_s)
    if order == 0:
        return np.asarray(decay * (cosine + (n / omega) * sine))
    stiffness = omega**2 + n**2
    if order == 1:
        return np.asarray(decay * (-stiffness / omega) * sine)
    return np.asarray(-stiffness * decay * (cosine - (n / omega) * sine))


def _turning_points(decay: OneMassDecay, last_s: float) -> tuple[Floats, Floats, bool]:
    """Times and displacements of the turning points up to `last_s` or the stop, and whether it stopped."""
    half_s = 0.5 * decay.period_s
    decrement = decay.damping_n_per_s * half_s
    cycles = np.arange(max(0.0, math.floor((last_s - decay.turning_s) / half_s)) + 1.0)
    first_m = abs(decay.turning_m)
    stop = _stop_cycle(cycles, first_m, decrement, decay.coulomb_displacement_m)
    cycles = cycles[cycles <= stop]
    magnitude_m = turning_magnitude(cycles, first_m, decrement, decay.coulomb_displacement_m)
    side = np.where(cycles % 2.0 == 0.0, 1.0, -1.0) * math.copysign(1.0, decay.turning_m)
    return decay.turning_s + cycles * half_s, side * magnitude_m, math.isfinite(stop)


def _check(name: str, value: float, allowed: bool, range_text: str) -> None:
    if not (math.isfinite(value) and allowed):
        needed = f"a finite number {range_text}".rstrip()
        raise DecayError(
            "{name} = {value!r} describes no free decay: give {needed}", name=name, value=value, needed=needed
        )
