"""Where a pullback record holds still, is released, slips, and swings as one mass."""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from analysis.arrays import Floats
from analysis.formatting import format_length
from analysis.preparation.channels import Channel
from analysis.preparation.noise import detect_hum, remove_hum
from analysis.record import RecordError

_HALF_WINDOW_S = 0.006
"""Of the lines whose slopes are speeds: short beside any swing, long beside noise at 500 Hz."""
_FAST = 0.35
"""A table this fast, relative to its fastest, is swinging: a pull by the screw is ten times slower."""
_SLOW = 0.05
_HELD_S = 0.1
"""A table slower than `_SLOW`, relative to its fastest, for longer than this is held: no turn lasts."""
_PLATEAU_MAX_S = 1.0
_PLATEAU_MIN_S = 0.05
_STILL = 0.005
"""Share of the widest swing that hum may move a table that is held."""
_CHANCE = 4.0
"""A median distance of n readings exceeds that of many by more than this over sqrt(n) only once in 10,000."""
_RISE_S = 0.3
"""From the hold to the fastest swing takes less."""
_RISE_LAG_S = 0.02
"""Readings this long before the table has left its hold for sure may belong to the release."""
_LEFT = 0.03
"""Share of the way to the fastest sample; passed some hundredths of a second after the release."""
_GROWTH = 1.25
"""A free decay never swings this much wider than before; a second release does."""
_SMALL_SWING = 0.03
"""Share of the widest swing."""
_STEP_SIGMAS = 5.0
_READINGS_MIN = 8
_GAP = 5.0
"""Readings this many median intervals apart have a gap between them."""
_NEAR_GAP = 0.2
"""Share of a swing's time."""
_TRAVEL_SIGMAS = 20.0
"""A travel wider than so many standard deviations of the noise is one."""


@dataclass(frozen=True, slots=True)
class Release:
    """The last hold before a free decay, and the stretch of free motion that follows.

    Attributes
    ----------
    time_s : float
        When the table was let go, to about a sample; the first sample if the record begins later.
    plateau_start_s : float or None
        Begin of the hold (at most a second of it is used); None if the record begins after the release.
    level_m : float
        Reading of gauge 1 in the hold, or of the first sample.
    end_s : float
        End of the free motion: of the record, or of the stretch before somebody touched the table again.
    """

    time_s: float
    plateau_start_s: float | None
    level_m: float
    end_s: float


def find_releases(table: Channel) -> list[Release]:
    """Find every release in the record, in order of time; more than one means that it was disturbed.

    Raises
    ------
    RecordError
        When gauge 1 shows no free oscillation.
    """
    smooth, noise = remove_hum(median_of_three(table), detect_hum(table)), white_noise(table)
    releases: list[Release] = []
    start_s, last_s = float(table.time_s[0]), float(table.time_s[-1])
    while True:
        release = _next_release(smooth.between(start_s, np.inf), noise)
        if release is None:
            break
        releases.append(release)
        if release.end_s >= last_s or len(releases) == 8:
            break
        start_s = release.end_s
    if not releases:
        raise RecordError(_why_none(smooth, noise))
    return releases


def median_of_three(channel: Channel) -> Channel:
    """Readings without single spikes; for finding things, never for fitting."""
    x = channel.value_m
    if len(x) < 3:
        return channel
    low, high = np.minimum(x[:-2], x[1:-1]), np.maximum(x[:-2], x[1:-1])
    middle = np.maximum(low, np.minimum(high, x[2:]))
    return Channel(channel.time_s, np.concatenate((middle[:1], middle, middle[-1:])))


def local_slopes(channel: Channel, half_window_s: float) -> Floats:
    """Slope of the line through readings within +-half_window_s of each time (m/s); times may be uneven."""
    t, x = channel.time_s - channel.time_s[0], channel.value_m - channel.value_m.mean()
    index = np.arange(len(t))
    first = np.minimum(np.searchsorted(t, t - half_window_s), np.maximum(index - 2, 0))
    last = np.maximum(np.searchsorted(t, t + half_window_s, "right"), np.minimum(index + 3, len(t)))
    sums = [np.concatenate(([0.0], np.cumsum(y))) for y in (t, x, t * t, t * x)]
    s_t, s_x, s_tt, s_tx = (total[last] - total[first] for total in sums)
    count = last - first
    spread = s_tt - s_t * s_t / count
    return np.asarray((s_tx - s_t * s_x / count) / np.where(spread > 0.0, spread, np.inf))


def white_noise(channel: Channel) -> float:
    """Standard deviation of white noise (m), from third differences: slow motion does not count."""
    if len(channel) < 8:
        return 0.0
    return float(np.sqrt(np.mean(np.diff(channel.value_m, 3) ** 2) / 20.0))


def find_last_slip(relative: Channel, release_s: float, period_s: float, noise_m: float) -> float | None:
    """Last time that gauge 2 moves, to a quarter period; None if it moves until the end.

    Means of quarter periods are compared with their neighbours, against the noise and a steady drift.
    A slip smaller than about five standard deviations of such a mean is not seen: the fitted motion
    tells later whether there was one.
    """
    moving = relative.between(release_s, np.inf)
    edges = np.arange(relative.time_s[-1], release_s, -period_s / 4.0)[::-1]
    if len(edges) < 4:
        return None
    bounds = np.searchsorted(moving.time_s, edges)
    counts = np.diff(bounds)
    full = counts > 0
    sums = np.diff(np.concatenate(([0.0], np.cumsum(moving.value_m)))[bounds])
    means, counts, ends = sums[full] / counts[full], counts[full], edges[1:][full]
    steps = np.diff(means)
    drift = float(np.median(steps[len(steps) // 2 :]))
    limit = _STEP_SIGMAS * noise_m * np.sqrt(1.0 / counts[1:] + 1.0 / counts[:-1]) + 1e-9
    moved = np.flatnonzero(np.abs(steps - drift) > limit)
    if len(moved) == 0:
        return release_s
    last = int(moved[-1]) + 1
    return None if last >= len(ends) - 2 else float(ends[last])


def _why_none(smooth: Channel, noise_m: float) -> str:
    """What readings without a release show instead."""
    speed = np.abs(local_slopes(smooth, _HALF_WINDOW_S)) if len(smooth) >= _READINGS_MIN else np.zeros(1)
    travel_m = float(np.ptp(smooth.value_m))
    if travel_m > _TRAVEL_SIGMAS * noise_m and speed[-1] > _FAST * speed.max():
        return (
            f"the record ends while the table still moves, {format_length(travel_m)} from where it began:"
            " it is too short. Record for 20 s after the release, or until rest."
        )
    return (
        f"no release found: gauge 1 moves over {format_length(travel_m)} and never swings."
        " Record from the hold before the release until rest."
    )


def _next_release(table: Channel, noise: float) -> Release | None:
    """First release in the readings, or None where nothing swings."""
    if len(table) < _READINGS_MIN:
        return None
    slopes, slope_noise = local_slopes(table, _HALF_WINDOW_S), _slope_noise(table, noise)
    speed = np.abs(slopes)
    fast = int(np.argmax(speed > _FAST * speed.max()))
    pivots = _pivots(
        table.value_m, _turning_points(slopes, fast, max(5.0 * slope_noise, 0.01 * float(speed.max()))), noise
    )
    if len(pivots) < 2:
        return None
    held = _held_after(table, speed, fast, pivots[1])
    if held is not None:  # what was fast was a pull
        return _next_release(table.between(held, np.inf), noise)
    end = _disturbance(table, pivots)
    release = _release_at(table, speed, fast, pivots[0], noise)
    return replace(release, end_s=float(table.time_s[end]))


def _slope_noise(table: Channel, noise_m: float) -> float:
    """Standard deviation of `local_slopes` of white noise (m/s)."""
    interval_s = float(np.median(np.diff(table.time_s)))
    count = max(5.0, 2.0 * _HALF_WINDOW_S / interval_s)
    return noise_m * float(np.sqrt(12.0 / count**3)) / interval_s


def _held_after(table: Channel, speed: Floats, fast: int, second_turn: int) -> float | None:
    """Begin of a hold between `fast` and the second turning point, where a free table would only swing."""
    slow = np.concatenate(([False], speed[fast:second_turn] < _SLOW * speed.max(), [False]))
    edges = np.flatnonzero(np.diff(slow.astype(np.int8)))
    steps = np.diff(table.time_s)
    seen_s = np.concatenate(([0.0], np.cumsum(np.minimum(steps, _GAP * float(np.median(steps))))))
    for first, last in zip(edges[::2], edges[1::2], strict=True):
        if seen_s[fast + last - 1] - seen_s[fast + first] > _HELD_S:
            return float(table.time_s[fast + first])
    return None


def _release_at(table: Channel, speed: Floats, fast: int, pivot: int, noise_m: float) -> Release:
    """Describe the hold before the first swing, which is fastest between samples `fast` and `pivot`."""
    t, top = table.time_s, fast + int(np.argmax(speed[fast : pivot + 1]))
    x = table.value_m if table.value_m[top] < table.value_m[max(0, fast - 1)] else -table.value_m
    near = int(np.searchsorted(t, t[fast] - _RISE_S))
    level = float(np.quantile(x[near : fast + 1], 0.9))
    left = np.flatnonzero(x[near : top + 1] >= level - max(_LEFT * (level - x[top]), 4.0 * noise_m))
    rise = near + int(left[-1]) if len(left) else near
    start = _hold_begin(Channel(t, x), rise, noise_m + 0.3 * _STILL * float(np.ptp(x[fast:])))
    if start is None:
        return Release(float(t[0]), None, float(table.value_m[0]), float(t[-1]))
    held = table.between(t[start], t[rise] - _RISE_LAG_S)
    rising = table.between(t[rise], t[top])  # nothing where times are so wrong that both are one
    released = _release_time(rising, float(np.median(held.value_m))) if len(rising.time_s) else float(t[rise])
    return Release(
        released,
        max(float(t[start]), released - _PLATEAU_MAX_S),
        float(np.median(held.value_m)),
        float(t[-1]),
    )


def _hold_begin(table: Channel, rise: int, scatter_max_m: float) -> int | None:
    """First sample of the hold that ends shortly before sample `rise`; None where the table is not still."""
    t, x = table.time_s, table.value_m
    end = int(np.searchsorted(t, t[rise] - _RISE_LAG_S))
    last = x[int(np.searchsorted(t, t[end] - 0.15)) : end]
    if len(last) < 5:
        return None
    level = float(np.median(last))
    scatter = 1.4826 * float(np.median(np.abs(last - level)))
    away = np.flatnonzero(np.abs(x[:end] - level) > 6.0 * max(scatter, scatter_max_m / 3.0))
    start = int(away[-1]) + 1 if len(away) else 0
    by_chance = 1.0 + _CHANCE / float(np.sqrt(len(last)))
    still = scatter <= by_chance * scatter_max_m and t[end] - t[start] >= _PLATEAU_MIN_S and end - start >= 5
    return start if still else None


def _release_time(rising: Channel, level: float) -> float:
    """Time at which the square root of the travel, a line at first, passes zero."""
    travel = np.abs(rising.value_m - level)
    used = (travel > 0.04 * travel.max()) & (travel < 0.3 * travel.max())
    if used.sum() < 3:
        return float(rising.time_s[0])
    slope, offset = np.polyfit(rising.time_s[used] - rising.time_s[0], np.sqrt(travel[used]), 1)
    return float(rising.time_s[0] - offset / slope)


def _turning_points(slopes: Floats, fast: int, dead: float) -> NDArray[np.int64]:
    """Indices after sample `fast` at which the direction of motion changes."""
    side = np.where(slopes[fast:] > dead, 1, np.where(slopes[fast:] < -dead, -1, 0))
    moving = np.flatnonzero(side)
    turns = np.flatnonzero(np.diff(side[moving]))
    return np.asarray(fast + (moving[turns] + moving[turns + 1]) // 2, dtype=np.int64)


def _pivots(x: Floats, turns: NDArray[np.int64], noise_m: float) -> list[int]:
    """Indices of the extremes of wide swings, small ones on the way (noise, hum) passed over."""
    extremes: list[int] = []
    for first, last in pairwise([*turns.tolist(), len(x)]):
        piece = x[first:last]
        extremes += sorted((first + int(piece.argmin()), first + int(piece.argmax())))
    width = max(12.0 * noise_m, _SMALL_SWING * float(np.ptp(x[extremes]))) if extremes else 0.0
    pivots = extremes[:1]
    for index in extremes[1:]:
        step = x[index] - x[pivots[-1]]
        if len(pivots) > 1 and step * (x[pivots[-1]] - x[pivots[-2]]) > 0.0:
            pivots[-1] = index
        elif abs(step) > width:
            pivots.append(index)
    return pivots


def _disturbance(table: Channel, pivots: list[int]) -> int:
    """Last sample before the swings grow again; the last one of all if they never do.

    Swings to an extreme beside a gap do not count: the gap may hide the true one.
    """
    swings = np.abs(np.diff(table.value_m[pivots]))
    whole = _away_from_gaps(table.time_s, pivots)
    counted = [index for index in range(len(swings)) if whole[index] and whole[index + 1]]
    for place, index in enumerate(counted[1:], start=1):
        if swings[index] > _GROWTH * float(np.median(swings[counted[max(0, place - 3) : place]])):
            return pivots[index]
    return len(table) - 1


def _away_from_gaps(time_s: Floats, pivots: list[int]) -> NDArray[np.bool_]:
    """Whether no gap lies within a fraction of a swing of each pivot."""
    steps = np.diff(time_s)
    near_s = _NEAR_GAP * float(np.median(np.diff(time_s[pivots])))
    gaps = np.flatnonzero(steps > max(_GAP * float(np.median(steps)), near_s))
    edges = np.concatenate((time_s[gaps], time_s[gaps + 1], [np.inf]))
    return np.array([np.abs(edges - time_s[pivot]).min() > near_s for pivot in pivots])
