"""Slips of the plate: when it slides, and the reversals that join two slips without a stick."""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from analysis.arrays import Floats, Indices
from analysis.preparation.channels import Channel
from analysis.preparation.free_decay import FreeDecay
from analysis.preparation.oscillation import local_slopes

_WINDOW_PERIODS = 1.0 / 24.0  # half window of slopes: they err by 1 % of the swing's velocity
_WINDOW_READINGS = 3.0
_SPEED_SHARE = 0.08  # of the fastest slip's speed: slower parts of a slip may lie within a transition
_SPEED_SIGMAS = 6.0  # noise of slopes that is not taken for sliding
_READINGS_MIN = 8  # of a slip
_PAUSE = 1.6  # a pause between slips, over that of a reversal at the accelerations beside it: stick
_REVERSAL_WINDOW = 1.5  # half windows of slopes
_EXTREME_STEPS = 4  # of Gauss and Newton: the extreme moves by microseconds then
_SIDE_READINGS_MIN = 4  # at each side of it
_DRIVING_MIN = 0.35
"""Acceleration after a reversal, over that before. Near a stick it is small."""


@dataclass(frozen=True, eq=False, slots=True)
class Slip:
    """Readings of gauge 2 from one reversal, or begin after a stick, to the next."""

    readings: Indices  # without the edges, in which friction changes
    begin_s: float  # of sliding
    end_s: float
    sign: int  # of u2' - u1'
    joins: bool  # follows the slip before it without a stick


@dataclass(frozen=True, eq=False, slots=True)
class Sliding:
    """Relative displacement with its velocity, and what noise says of it."""

    relative: Channel
    speed_m_per_s: Floats
    half_window_s: float  # of the slopes that are speeds
    limit_m_per_s: float  # slower is not taken for sliding

    @classmethod
    def of(cls, relative: Channel, decay: FreeDecay) -> "Sliding":
        half_window_s = slope_half_window_s(decay)
        speed = local_slopes(relative, half_window_s)
        noise_m = float(np.hypot(*decay.noise_m)) if decay.gauge_2_absolute else decay.noise_m[1]
        count = max(_WINDOW_READINGS, 2.0 * half_window_s / decay.channels.interval_s)
        slope_noise = noise_m * np.sqrt(12.0 / count) / (2.0 * half_window_s)
        limit = max(_SPEED_SIGMAS * slope_noise, _SPEED_SHARE * float(np.abs(speed).max()))
        return cls(relative, speed, half_window_s, float(limit))


def slope_half_window_s(decay: FreeDecay) -> float:
    """Half window of the lines whose slopes are speeds."""
    return max(decay.period_s * _WINDOW_PERIODS, _WINDOW_READINGS * decay.channels.interval_s)


def find_slips(sliding: Sliding, edge_s: float) -> list[Slip]:
    """Slips long enough for a parabola, without `edge_s` at each end."""
    time_s = sliding.relative.time_s
    fast = np.abs(sliding.speed_m_per_s) > sliding.limit_m_per_s
    direction = np.where(fast, np.sign(sliding.speed_m_per_s), 0.0)
    cuts = np.flatnonzero(np.diff(direction)) + 1
    parts = [part for part in np.split(np.arange(len(time_s)), cuts) if direction[part[0]]]
    reversals = [None, *(_find_reversal(sliding, *pair) for pair in pairwise(parts)), None]
    loose_edge_s = max(edge_s, 0.5 * sliding.half_window_s)
    slips: list[Slip] = []
    last = -1
    for number, part in enumerate(parts):
        begin, end = reversals[number], reversals[number + 1]
        first_s = time_s[part[0]] + loose_edge_s if begin is None else begin + edge_s
        last_s = time_s[part[-1]] - loose_edge_s if end is None else end - edge_s
        readings = np.arange(*np.searchsorted(time_s, (first_s, last_s)))
        if len(readings) < _READINGS_MIN:
            continue
        begin_s = float(time_s[part[0]]) if begin is None else begin
        end_s = float(time_s[part[-1]]) if end is None else end
        joins = begin is not None and last == number - 1
        slips.append(Slip(readings, begin_s, end_s, int(direction[part[0]]), joins))
        last = number
    return slips


def part_slips(slips: list[Slip], number: int, sliding: Sliding) -> list[Slip]:
    """Slips of which the one of that number does not join the one before, without the readings beside.

    The stick between them is shorter than the window of velocities, and the reversal lies within it.
    """
    time_s, parted = sliding.relative.time_s, list(slips)
    before, after = slips[number - 1], slips[number]
    is_before = time_s[before.readings] < before.end_s - sliding.half_window_s
    is_after = time_s[after.readings] >= after.begin_s + sliding.half_window_s
    parted[number - 1] = replace(before, readings=before.readings[is_before])
    parted[number] = replace(after, readings=after.readings[is_after], joins=False)
    return parted


def _find_reversal(sliding: Sliding, before: Indices, after: Indices) -> float | None:
    """Time of a reversal (s); None where the plate may stick."""
    t, speed = sliding.relative.time_s, sliding.speed_m_per_s
    last, first = int(before[-1]), int(after[0])
    if speed[last] * speed[first] > 0.0:
        return None
    braking, driving = abs(_acceleration(sliding, last, -1)), abs(_acceleration(sliding, first, 1))
    if not driving > _DRIVING_MIN * braking > 0.0:
        return None
    pause_s = sliding.limit_m_per_s * (1.0 / braking + 1.0 / driving)
    if t[first] - t[last] > _PAUSE * pause_s + 2.0 * (t[last] - t[last - 1]):
        return None
    window_s = _REVERSAL_WINDOW * sliding.half_window_s + 0.5 * float(t[first] - t[last])
    reversal_s = _fit_extreme(sliding.relative, 0.5 * float(t[first] + t[last]), window_s)
    return reversal_s if reversal_s is not None and t[before[0]] < reversal_s < t[after[-1]] else None


def _fit_extreme(channel: Channel, about_s: float, window_s: float) -> float | None:
    """Time of an extreme of readings; they are a quartic near it, but for a jump of the second derivative.

    An error of a millisecond would be one of a micrometre where slips join.
    """
    for _ in range(_EXTREME_STEPS):
        near = channel.between(about_s - window_s, about_s + window_s)
        tau = (near.time_s - about_s) / window_s
        if min((tau < 0.0).sum(), (tau > 0.0).sum()) < _SIDE_READINGS_MIN:
            return None
        sides = np.minimum(tau, 0.0) ** 2, np.maximum(tau, 0.0) ** 2
        columns = np.column_stack((*sides, tau, tau**3, tau**4, np.ones(len(tau))))
        before, after, slope = np.linalg.lstsq(columns, near.value_m, rcond=None)[0][:3]
        if before * after <= 0.0:
            return None
        about_s -= float(np.clip(slope / (before + after), -0.5, 0.5)) * window_s
    return about_s


def _acceleration(sliding: Sliding, index: int, away: int) -> float:
    """Mean relative acceleration between a reading and two half windows before (-1) or after (1) it."""
    t, speed = sliding.relative.time_s, sliding.speed_m_per_s
    other = int(np.searchsorted(t, t[index] + 2.0 * away * sliding.half_window_s))
    other = min(max(other, 0), len(t) - 1)
    return float((speed[other] - speed[index]) / (t[other] - t[index])) if other != index else 0.0
