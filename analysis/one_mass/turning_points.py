"""Turning points of a free decay, and the period, log decrement and Coulomb part that follow from them."""

import math
from dataclasses import dataclass

import numpy as np

from analysis.arrays import Floats
from analysis.preparation.channels import Channel
from analysis.preparation.oscillation import median_of_three, white_noise
from analysis.record import RecordError

_DEAD_BAND = (0.03, 0.35)  # least and largest dead band about the middle, as shares of the largest swing
_HOLD_PERIODS = 0.8  # a half swing takes half a period; one of large friction or a pendulum's less than this
_HOLD_SHARE = 0.7  # of the widest swing: the mean of a half swing is 2 / pi of it
_PASSAGES_MIN = 3  # without them nothing swings
_EARLY = 9  # passages that the first estimate of the period is taken from: later ones may be those of hum
_CLASSICAL_SHARE = 0.1  # the classical log decrement counts the swings above this share of the first


@dataclass(frozen=True, eq=False, slots=True)
class TurningPoints:
    """Measured extremes of a decay."""

    number: "np.ndarray[tuple[int], np.dtype[np.int64]]"  # (k,): half cycles since the first, with gaps
    time_s: Floats
    value: Floats
    side: Floats  # (k,) float64: +1 for a maximum, -1 for a minimum
    noise_gain: Floats  # (k,) float64: standard uncertainty of `value` per unit of noise in a reading


@dataclass(frozen=True, slots=True)
class HalfCycleRegression:
    """Line through neighbouring turning points, ``|X_(i+1)| = b |X_i| - loss``."""

    ratio: float  # b = exp(-n T / 2) (1)
    loss: float  # (1 + b) x_k, in the unit of the readings
    offset: float


@dataclass(frozen=True, slots=True)
class Crossings:
    """When the readings first swing through their middle, and how long a swing takes, to some per cent."""

    first_s: float
    period_s: float


def find_crossings(channel: Channel) -> Crossings:
    """Find the passages through the middle of the swing, with a dead band against noise.

    Raises RecordError when there are fewer than three.
    """
    smooth = median_of_three(channel)
    away = smooth.value_m - _middle(smooth.value_m)
    reach = float(np.abs(away).max())
    dead = reach * float(np.clip(6.0 * white_noise(smooth) / max(reach, 1e-300), *_DEAD_BAND))
    seen = np.flatnonzero(np.abs(away) > dead)
    flips = np.flatnonzero(np.diff(np.sign(away[seen])))
    before, after = seen[flips], seen[flips + 1]
    if len(flips) < _PASSAGES_MIN:
        raise RecordError(
            "no free decay: the readings pass their middle {count} times. Record at least two free swings.",
            count=len(flips),
        )
    share = away[before] / (away[before] - away[after])
    t = smooth.time_s[before] + share * (smooth.time_s[after] - smooth.time_s[before])
    t = _after_hold(t, Channel(smooth.time_s, np.abs(away)), _HOLD_SHARE * reach)
    return Crossings(float(t[0]), _period_of(t))


def _after_hold(crossing_s: Floats, distance: Channel, far: float) -> Floats:
    """The passages after the last hold, longer than a half swing and on average `far` from the middle."""
    lengths_s = np.diff(crossing_s)
    for number in np.flatnonzero(lengths_s > _HOLD_PERIODS * _period_of(crossing_s))[::-1].tolist():
        held = distance.between(float(crossing_s[number]), float(crossing_s[number + 1])).value_m
        if len(crossing_s) - number > _PASSAGES_MIN and len(held) and float(held.mean()) > far:
            return crossing_s[number + 1 :]
    return crossing_s


def find_turning_points(channel: Channel, first_s: float, period_s: float) -> TurningPoints:
    """Measure the extremes that lie half periods apart from `first_s` on, up to the first lost in noise.

    Each is the top of a sine of the known period, fitted with an offset to the half period about it, so that
    coarse sampling does not matter. Extremes in gaps are left out.
    """
    found = []
    halves = (channel.time_s - first_s) / (0.5 * period_s)
    read = np.unique(np.round(halves))  # a gap may be millions of half periods long
    for count in read[(read >= 0.0) & (read <= halves[-1])].tolist():
        middle_s = first_s + 0.5 * period_s * count
        part = channel.between(middle_s - 0.26 * period_s, middle_s + 0.26 * period_s)
        if len(part) < 5 or part.time_s[-1] - part.time_s[0] < 0.35 * period_s:
            continue
        time_s, value, side, height, noise, gain = _extreme(part, middle_s, period_s)
        if height < 4.0 * gain * noise:
            break
        found.append((count, time_s, value, side, gain))
    number, *columns = np.array(found, dtype=np.float64).reshape(-1, 5).T
    return TurningPoints(number.astype(np.int64), *columns)


def regress_half_cycles(points: TurningPoints) -> HalfCycleRegression | None:
    """Separate viscous from Coulomb damping and the offset, from turning points alone.

    With Y = offset + side |X| the half-cycle rule is linear in its unknowns:
    Y_(i+1) = -b Y_i + (1 + b) offset + side_i (1 + b) x_k. None with fewer than five neighbouring pairs.
    """
    pairs = np.flatnonzero(np.diff(points.number) == 1)
    if len(pairs) < 5:
        return None
    y = points.value
    columns = np.column_stack((-y[pairs], np.ones(len(pairs)), points.side[pairs]))
    ratio, shift, loss = np.linalg.lstsq(columns, y[pairs + 1], rcond=None)[0]
    if not 0.0 < ratio < 1.5:
        return None
    return HalfCycleRegression(float(ratio), float(loss), float(shift / (1.0 + ratio)))


def classical_log_decrement(points: TurningPoints, noise: float) -> tuple[float, float] | None:
    """Plain log decrement of a period, as if all damping were viscous, and its standard uncertainty.

    ln(S_0 / S_m) 2 / m from the swings S_i = |Y_(i+1) - Y_i| (no offset needed), m the last half cycle whose
    swing is above a tenth of the first. `noise` is that of a reading. None where m is under two.
    """
    pairs = np.flatnonzero(np.diff(points.number) == 1)
    if len(pairs) < 3:
        return None
    swing = np.abs(points.value[pairs + 1] - points.value[pairs])
    last = int(np.flatnonzero(swing > _CLASSICAL_SHARE * swing[0])[-1])
    halves = int(points.number[pairs[last]] - points.number[pairs[0]])
    if halves < 2:
        return None
    both = pairs[[0, last]]
    gain = np.hypot(points.noise_gain[both], points.noise_gain[both + 1]) / swing[[0, last]]
    deviation = 2.0 / halves * noise * math.hypot(*gain)
    return 2.0 / halves * math.log(swing[0] / swing[last]), deviation


def _middle(value: Floats) -> float:
    """Middle of the range of the later half: where the swing dies, whatever came before."""
    low, high = np.percentile(value[len(value) // 2 :], (1.0, 99.0))
    return float(0.5 * (low + high))


def _period_of(crossing_s: Floats) -> float:
    """Period from the first passages, where the swing is widest, numbered by their median cycle."""
    early_s = crossing_s[:_EARLY]
    whole_s = float(np.median(early_s[2:] - early_s[:-2]))
    number = np.round(2.0 * (early_s - early_s[0]) / whole_s)
    return 2.0 * float(np.polyfit(number, early_s, 1)[0]) if number[-1] > 1.0 else whole_s


def _extreme(
    part: Channel, middle_s: float, period_s: float
) -> tuple[float, float, float, float, float, float]:
    """Top of a sine with offset, fitted to half a period about `middle_s`.

    Time, reading and side there, height above the offset, noise of a reading, and standard uncertainty per
    unit of that noise.
    """
    angle = 2.0 * math.pi * (part.time_s - middle_s) / period_s
    columns = np.column_stack((np.ones(len(part)), np.cos(angle), np.sin(angle)))
    level, cosine, sine = np.linalg.lstsq(columns, part.value_m, rcond=None)[0].tolist()
    residual = part.value_m - columns @ (level, cosine, sine)
    side, height = math.copysign(1.0, cosine), math.hypot(cosine, sine)
    at_top = np.array([1.0, side * cosine / height, side * sine / height]) if height else np.ones(3)
    return (
        middle_s + math.atan2(side * sine, side * cosine) / (2.0 * math.pi) * period_s,
        level + side * height,
        side,
        height,
        math.sqrt(float(residual @ residual) / (len(part) - 3)),
        math.sqrt(float(at_top @ np.linalg.pinv(columns.T @ columns) @ at_top)),
    )
