"""Oscillation of a channel: releases, last slip, plausible period, and the damped cosine of its tail."""

import contextlib
from dataclasses import dataclass, replace
from itertools import pairwise
from statistics import median

import numpy as np
from numpy.typing import NDArray

from analysis.arrays import Floats
from analysis.formatting import format_length, format_number
from analysis.laws.parameters import FRICTION_MAX, PERIOD_MAX_S, PERIOD_MIN_S, TRAVEL_MAX_M
from analysis.preparation.channels import NOISE_FLOOR_M, Channel, detect_hum, remove_hum
from analysis.preparation.sums import swing_equations, swing_residual, window_slopes
from analysis.quantities import ResultWarning, result_warning
from analysis.record import RecordError
from messages.i18n import N_

_HALF_WINDOW_S = 0.006
"""Of the lines whose slopes are speeds: short beside any swing, long beside noise at 500 Hz."""
_FAST = 0.35
"""A table this fast, relative to its fastest, is swinging: a pull by the screw is ten times slower."""
_SLOW = 0.05
_HELD_S = 0.1
"""A table slower than `_SLOW`, relative to its fastest, for longer than this is held: no turn lasts."""
_PLATEAU_MAX_S = 1.0
_PLATEAU_MIN_S = 0.05
_HELD_LAST_S = 0.15
_HELD_READINGS = 5
"""A hold is judged by its last 0.15 s, or where these are few by the last five readings of twice the time."""
_STILL = 0.005  # share of the widest swing that hum may move a table that is held
_CHANCE = 4.0
"""A median distance of n readings exceeds that of many by more than this over sqrt(n) only once in 10,000."""
_SETTLED_S = 0.02  # a period of hum: so long are the parts of the hold that are compared with its end
_SETTLED_SIGMAS = (
    7.0  # of such a mean of white noise; medians of three scatter less than what they are made of
)
_RISE_S = 0.3  # from the hold to the fastest swing takes less
_RISE_LAG_S = 0.02  # readings this long before the table has left its hold for sure may belong to the release
_LEFT = 0.03  # share of the way to the fastest sample; passed some hundredths of a second after the release
_GROWTH = 1.25  # a free decay never swings this much wider than before; a second release does
_SMALL_SWING = 0.03  # share of the widest swing
_STEP_SIGMAS = 5.0
_READINGS_MIN = 8
_GAP = 5.0  # readings this many median intervals apart have a gap between them
_NEAR_GAP = 0.2  # share of a swing's time
_TRAVEL_SIGMAS = 20.0  # a travel wider than so many standard deviations of the noise is one


@dataclass(frozen=True, slots=True)
class Release:
    """The last hold before a free decay, and the stretch of free motion that follows."""

    time_s: float  # when the table was let go, to about a sample; the first sample if the record begins later
    plateau_start_s: float | None
    """Begin of the hold (at most a second of it is used); None if the record begins after the release."""
    level_m: float  # reading of gauge 1 in the hold, or of the first sample
    end_s: float
    """End of the free motion: of the record, or of the stretch before somebody touched the table again."""


def find_releases(table: Channel) -> list[Release]:
    """Find every release in the record, in order of time; more than one means that it was disturbed.

    Raises RecordError when gauge 1 shows no free oscillation.
    """
    return find_releases_beside(detect_hum(table), table)


def find_releases_beside(hum: tuple[float, float] | None, table: Channel) -> list[Release]:
    """`find_releases` where the hum of the mains is known as `detect_hum` gives it."""
    smooth, noise = remove_hum(median_of_three(table), hum), white_noise(table)
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
    return window_slopes(channel.time_s, channel.value_m, half_window_s)


def white_noise(channel: Channel) -> float:
    """Standard deviation of white noise (m), from third differences: slow motion does not count."""
    if len(channel) < 8:
        return 0.0
    return float(np.sqrt(np.mean(np.diff(channel.value_m, 3) ** 2) / 20.0))


def find_last_slip(relative: Channel, release_s: float, period_s: float, noise_m: float) -> float | None:
    """Last time that gauge 2 moves, to a quarter period; None if it moves until the end.

    The fitted motion shows later whether there was a slip too small to be seen.
    """
    quarters = quarter_steps(relative, release_s, period_s, noise_m)
    if quarters is None:
        return None
    ends, moved = quarters
    if not moved.any():
        return release_s
    last = int(np.flatnonzero(moved)[-1]) + 1
    return None if last >= len(ends) - 2 else float(ends[last])


def quarter_steps(
    relative: Channel, release_s: float, period_s: float, noise_m: float
) -> tuple[Floats, NDArray[np.bool_]] | None:
    """Ends (n,) of quarter periods up to the last reading, and whether gauge 2 moved into each but the first.

    Means of quarter periods are compared with their neighbours, against the noise and a steady drift.
    A slip smaller than about five standard deviations of such a mean is not seen. None with under four of
    them.
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
    return ends, np.abs(steps - drift) > limit


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
    slopes, scatter = local_slopes(table, _HALF_WINDOW_S), slope_noise(table, _HALF_WINDOW_S, noise)
    speed = np.abs(slopes)
    fast = int(np.argmax(speed > _FAST * speed.max()))
    pivots = _pivots(
        table.value_m, _turning_points(slopes, fast, max(5.0 * scatter, 0.01 * float(speed.max()))), noise
    )
    if len(pivots) < 2:
        return None
    held = _held_after(table, speed, fast, pivots[1])
    if held is not None:  # what was fast was a pull
        return _next_release(table.between(held, np.inf), noise)
    end = _disturbance(table, pivots)
    release = _release_at(table, speed, fast, pivots[0], noise)
    return replace(release, end_s=float(table.time_s[end]))


def slope_noise(channel: Channel, half_window_s: float, noise_m: float) -> float:
    """Standard deviation of `local_slopes` of white noise (m/s)."""
    interval_s = float(np.median(np.diff(channel.time_s)))
    count = max(5.0, 2.0 * half_window_s / interval_s)
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
    usual, earliest = np.searchsorted(t[:end], (t[end] - _HELD_LAST_S, t[end] - 2.0 * _HELD_LAST_S))
    last = x[min(usual, max(earliest, end - _HELD_READINGS)) : end]
    if len(last) < _HELD_READINGS:
        return None
    level = float(np.median(last))
    scatter = 1.4826 * float(np.median(np.abs(last - level)))
    away = np.flatnonzero(np.abs(x[:end] - level) > 6.0 * max(scatter, scatter_max_m / 3.0))
    start = int(away[-1]) + 1 if len(away) else 0
    start += _unsettled(Channel(t[start:end], x[start:end]), scatter)
    by_chance = 1.0 + _CHANCE / float(np.sqrt(len(last)))
    is_long = t[end] - t[start] >= _PLATEAU_MIN_S and end - start >= _HELD_READINGS
    return start if is_long and scatter <= by_chance * scatter_max_m else None


def _unsettled(hold: Channel, scatter_m: float) -> int:
    """Count of the first readings off the line through the second half: the end of the pull."""
    half = len(hold) // 2
    if half < _READINGS_MIN:
        return 0
    t = hold.time_s - hold.time_s[half]
    off_m = hold.value_m - np.polyval(np.polyfit(t[half:], hold.value_m[half:], 1), t)
    bounds = np.searchsorted(t[:half], np.arange(t[0], 0.0, _SETTLED_S))
    sums, counts = np.diff(np.concatenate(([0.0], np.cumsum(off_m)))[bounds]), np.diff(bounds)
    # At its far end the line is uncertain by sqrt(28 / half) standard deviations.
    limit = _SETTLED_SIGMAS * (scatter_m + NOISE_FLOOR_M) * np.sqrt(counts + 28.0 * counts**2 / half)
    off = np.flatnonzero(np.abs(sums) > limit)
    return int(bounds[off[-1] + 1]) if len(off) else 0


def _release_time(rising: Channel, level: float) -> float:
    """Time at which the square root of the travel, a line at first, passes zero.

    The first of the `rising` readings where steps of a coarse converter hide that line.
    """
    travel = np.abs(rising.value_m - level)
    used = (travel > 0.04 * travel.max()) & (travel < 0.3 * travel.max())
    if used.sum() < 3:
        return float(rising.time_s[0])
    slope, offset = np.polyfit(rising.time_s[used] - rising.time_s[0], np.sqrt(travel[used]), 1)
    since_s = -offset / slope if slope > 0.0 else np.inf
    return float(rising.time_s[0] + (since_s if abs(since_s) < _RISE_S else 0.0))


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
        if swings[index] > _GROWTH * median(swings[counted[max(0, place - 3) : place]].tolist()):
            return pivots[index]
    return len(table) - 1


def _away_from_gaps(time_s: Floats, pivots: list[int]) -> NDArray[np.bool_]:
    """Whether no gap lies within a fraction of a swing of each pivot."""
    steps = np.diff(time_s)
    near_s = _NEAR_GAP * float(np.median(np.diff(time_s[pivots])))
    gaps = np.flatnonzero(steps > max(_GAP * float(np.median(steps)), near_s))
    edges = np.concatenate((time_s[gaps], time_s[gaps + 1], [np.inf]))
    return np.array([np.abs(edges - time_s[pivot]).min() > near_s for pivot in pivots])


_LENGTH_MIN_S = 1e-3
_LENGTH_MAX_S = 7200.0
_GAP_MAX_S = 10.0
_SLOW_S = 0.01  # readings closer together than this are enough for any stand with a period of 0.1 s or more
_SWINGS_CLEARLY = 0.2  # largest residual of a swing over its amplitude
_SWINGS_NEEDED = 1.25  # with fewer an oscillation cannot be told from a drift
_READINGS_A_SWING = 10  # fewer hide when the table is let go, and how fast it swings
_PULLBACK_FACTOR = 3.0
"""Between pullback and that of the series: beyond it is not the operator who pulled otherwise."""


def check_span(table: Channel) -> None:
    """Raise RecordError for readings that span hours or no swing, have a long gap, or travel too far."""
    length_s = float(table.time_s[-1] - table.time_s[0])
    if length_s < _LENGTH_MIN_S:
        raise RecordError(
            "the record spans {length_s:.1g} s, in which no stand swings. Check the unit of its times.",
            length_s=length_s,
        )
    if length_s > _LENGTH_MAX_S:
        template = N_("the record spans {length_s} s, a test takes a minute. Check the unit of its times.")
        raise RecordError(template, length_s=format_number(length_s))
    check_gap(table, _GAP_MAX_S)
    travel_m = float(np.ptp(np.quantile(table.value_m, (0.001, 0.999))))
    if travel_m > TRAVEL_MAX_M:
        raise RecordError(
            "gauge 1 moves over {travel_m}, no stand does. Check the unit: are the readings in millimetres?",
            travel_m=format_length(travel_m),
        )


def check_gap(table: Channel, longest_s: float) -> None:
    """Raise RecordError for readings that stay away for more than `longest_s`."""
    steps_s = np.diff(table.time_s)
    widest = int(np.argmax(steps_s))
    if steps_s[widest] > longest_s:
        raise RecordError(
            "gauge 1 has no reading for {gap_s} s after {start_s} s of the record. Take the"
            " stretch before or after that gap.",
            gap_s=format_number(steps_s[widest]),
            start_s=format_number(table.time_s[widest], 6),
        )


def check_rate(table: Channel) -> None:
    """Raise RecordError where a swing has too few readings to tell its release and slips.

    By the strongest oscillation of the steps between readings: a hold has none, and noise hardly any
    beside those of a swing that is read seldom.
    """
    steps_s = np.diff(table.time_s)
    interval_s = float(np.median(steps_s))
    if interval_s <= _SLOW_S:
        return
    period_s = dominant_period(Channel(table.time_s[1:], np.diff(table.value_m)))
    if period_s < _READINGS_A_SWING * interval_s:
        raise RecordError(
            "gauge 1 is read every {interval_s:.3g} s, {readings:.2g} times a swing. Record"
            " {needed} readings a swing at the least, better 100.",
            interval_s=interval_s,
            readings=period_s / interval_s,
            needed=_READINGS_A_SWING,
        )


def estimate_period(table: Channel, release: Release, relative: Channel | None = None) -> float:
    """Period of the swing after `release` (s), to some per cent.

    Raises RecordError if the record ends within one and a quarter swings, or no stand has this period; or if
    gauge 2, of the readings `relative`, swings in place of gauge 1.
    """
    swing = table.between(release.time_s, np.inf)
    if not len(swing):
        raise _no_swing_error(swing, relative)
    try:
        period_s = dominant_period(swing)
    except RecordError:
        raise _no_swing_error(swing, relative) from None
    if not PERIOD_MIN_S <= period_s <= PERIOD_MAX_S:
        raise RecordError(
            "gauge 1 swings with a period of {period_s} s, no stand does ({shortest_s:g} to"
            " {longest_s:g} s). Check the unit of its times: are they seconds?",
            period_s=format_number(period_s),
            shortest_s=PERIOD_MIN_S,
            longest_s=PERIOD_MAX_S,
        )
    return period_s


def _no_swing_error(swing: Channel, relative: Channel | None) -> RecordError:
    """Error for readings `swing` of gauge 1 after a release in which nothing oscillates."""
    length_s = float(swing.time_s[-1] - swing.time_s[0]) if len(swing) else 0.0
    late = None if relative is None else relative.between(float(relative.time_s[-1]) - 0.5 * length_s, np.inf)
    if late is not None and len(late):
        with contextlib.suppress(RecordError):
            decay = fit_damped_cosine(late, dominant_period(late))
            if decay.rms_m < _SWINGS_CLEARLY * decay.amplitude_m:
                return RecordError(
                    "gauge 1 does not swing after the release, but gauge 2 does, with a period of {period_s}"
                    " s: their channels look swapped. Exchange them where the gauges are stated, or in the"
                    " import.",
                    period_s=format_number(decay.period_s),
                )
    if length_s > _SWINGS_NEEDED * PERIOD_MAX_S:
        return no_decay_error(length_s)
    return RecordError(
        "the record ends {length_s} s after the release, before the table has swung once and"
        " a quarter. Record for 20 s after the release, or until rest.",
        length_s=format_number(length_s),
    )


def pullback_warnings(pullback_m: float, nominal_m: float | None) -> list[ResultWarning]:
    """Whether the pullback is far from that of the series."""
    if nominal_m is None or nominal_m == 0.0:
        return []
    ratio = abs(pullback_m / nominal_m)
    if 1.0 / _PULLBACK_FACTOR < ratio < _PULLBACK_FACTOR:
        return []
    template = N_(
        "the table was pulled back by {pullback_m}, the series by {nominal_m}: check the unit of the"
        " readings, the calibration and the series."
    )
    pullback, nominal = format_length(abs(pullback_m)), format_length(abs(nominal_m))
    return [result_warning("pullback-unlike-series", template, pullback_m=pullback, nominal_m=nominal)]


def check_friction(friction_dynamic: float) -> None:
    """Raise RecordError for a coefficient that no dry plates have."""
    if friction_dynamic > FRICTION_MAX:
        template = N_(
            "the fit gives f_d = {friction_dynamic}, over {largest:g}, which no dry"
            " plates have. Check the units of times and readings, and whether gauge 1 shows"
            " the swing of the table."
        )
        raise RecordError(template, friction_dynamic=format_number(friction_dynamic, 4), largest=FRICTION_MAX)


_DECAY, _FREQUENCY, _COSINE, _SINE, _OFFSET = range(5)
_PERIOD_FACTOR = 2.0  # between the fitted period and the one started from, which is known to a tenth
_GROWTH_EXPONENT_MAX = 50.0  # of a swing that grows; some hundred overflow, and no free swing grows by ten


@dataclass(frozen=True, eq=False, slots=True)
class DampedCosine:
    """Damped cosine  offset + exp(-n tau) (a cos w tau + b sin w tau),  tau = t - start_s."""

    start_s: float  # stretch of the record that was fitted
    end_s: float
    parameters: Floats  # (5,) float64: n (1/s), damped w (rad/s), a, b, offset (m)
    covariance: Floats  # (5, 5) float64: from the residual, type A
    residual_m: Floats  # (n,) float64: reading minus curve

    @property
    def damping_per_s(self) -> float:
        """Decay constant n of the envelope."""
        return float(self.parameters[_DECAY])

    @property
    def period_s(self) -> float:
        return 2.0 * np.pi / float(self.parameters[_FREQUENCY])

    @property
    def offset_m(self) -> float:
        """Rest position of the gauge."""
        return float(self.parameters[_OFFSET])

    @property
    def amplitude_m(self) -> float:
        return float(np.hypot(self.parameters[_COSINE], self.parameters[_SINE]))

    @property
    def periods(self) -> float:
        return (self.end_s - self.start_s) / self.period_s

    @property
    def rms_m(self) -> float:
        return float(np.sqrt(np.mean(self.residual_m**2)))

    @property
    def period_uncertainty_s(self) -> float:
        w = self.parameters[_FREQUENCY]
        return float(2.0 * np.pi / w**2 * np.sqrt(self.covariance[_FREQUENCY, _FREQUENCY]))

    @property
    def damping_uncertainty_per_s(self) -> float:
        return float(np.sqrt(self.covariance[_DECAY, _DECAY]))


def dominant_period(channel: Channel) -> float:
    """Period (s) of the strongest oscillation, from a Hann-windowed spectrum; a few per cent.

    Raises RecordError when no oscillation of at least two cycles stands out.
    """
    count = int(np.clip(len(channel), 256, 8192))
    t = np.linspace(channel.time_s[0], channel.time_s[-1], count)
    x = np.interp(t, channel.time_s, channel.value_m)
    x = (x - x.mean()) * np.hanning(count)
    power = np.abs(np.fft.rfft(x, 4 * count)) ** 2
    first = 5
    peak = first + int(np.argmax(power[first:-1]))
    if peak <= first or power[peak] <= 0.0:
        template = N_("no oscillation found in {length_s} s of gauge 1. Record a free decay of some periods.")
        raise RecordError(template, length_s=format_number(t[-1] - t[0]))
    below, top, above = np.log(power[peak - 1 : peak + 2] + 1e-300)
    shift = 0.5 * (below - above) / (below - 2.0 * top + above)
    return float(4 * count * (t[1] - t[0]) / (peak + shift))


def fit_damped_cosine(channel: Channel, period_s: float) -> DampedCosine:
    """Fit a damped cosine with offset by least squares, over two periods first and then over twice as many.

    `period_s` is the period to start from, within a tenth. Raises RecordError when the channel is shorter
    than a period, holds fewer than ten readings, or no damped cosine of about that period fits it.
    """
    length_s = float(channel.time_s[-1] - channel.time_s[0]) if len(channel) else 0.0
    if len(channel) < 10 or length_s < period_s:
        template = N_("a decay of {length_s} s is shorter than its period. Record longer.")
        raise RecordError(template, length_s=format_number(length_s))
    shape = np.array([0.1, 2.0 * np.pi / period_s])
    stretch_s = 2.0 * period_s
    while True:
        part = channel.between(channel.time_s[0], channel.time_s[0] + stretch_s)
        parameters = _refine(part, shape)
        shape = parameters[:2]
        if stretch_s > length_s:
            break
        stretch_s *= 2.0
    if not 1.0 / _PERIOD_FACTOR < parameters[_FREQUENCY] * period_s / (2.0 * np.pi) < _PERIOD_FACTOR:
        raise no_decay_error(length_s)
    return _finished(channel, parameters)


def refit_damped_cosine(channel: Channel, before: DampedCosine) -> DampedCosine:
    """Fit a channel whose decay an earlier fit has met, but for where it begins or ends."""
    return _finished(channel, _refine(channel, before.parameters[:2]))


def no_decay_error(length_s: float) -> RecordError:
    """Error for readings over `length_s` that are no damped oscillation."""
    return RecordError(
        "{length_s} s of gauge 1 show no free decay: no damped cosine fits. Record a free decay"
        " of some periods.",
        length_s=format_number(length_s),
    )


_ROWS = 1 << 16  # readings whose derivatives are in memory at once


def envelope_curvature(channel: Channel, decay: DampedCosine) -> float:
    """How far the log of the envelope bends, in standard deviations of the noise; negative for dry friction.

    The significance of q in an envelope exp(-n tau + q tau^2), from one step of least squares.
    """
    normal, descent = np.zeros((6, 6)), np.zeros(6)
    for first in range(0, len(channel), _ROWS):
        tau = channel.time_s[first : first + _ROWS] - decay.start_s
        curve, columns = damped_cosine(decay.parameters, tau)
        rows = np.vstack((columns, tau**2 * (curve - decay.offset_m)))
        normal += rows @ rows.T
        descent += rows @ decay.residual_m[first : first + _ROWS]
    scale = np.sqrt(np.diag(normal))
    inverse = np.linalg.inv(normal / np.outer(scale, scale))
    if not inverse[-1, -1] > 0.0:  # the tail is too short to tell a bend from damping
        return 0.0
    bend = inverse @ (descent / scale)
    return float(bend[-1] / np.sqrt(inverse[-1, -1])) / max(decay.rms_m, 1e-12)


def damped_cosine(parameters: Floats, tau_s: Floats) -> tuple[Floats, Floats]:
    """Curve (n,) and its derivatives (5, n) by the parameters of `Decay`."""
    n, w, a, b, offset = parameters
    envelope = np.exp(-n * tau_s)
    cosine, sine = envelope * np.cos(w * tau_s), envelope * np.sin(w * tau_s)
    swing = a * cosine + b * sine
    by_w = tau_s * (b * cosine - a * sine)
    return offset + swing, np.stack((-tau_s * swing, by_w, cosine, sine, np.ones_like(tau_s)))


def _refine(channel: Channel, shape: Floats) -> Floats:
    """Gauss-Newton from the decay constant and frequency in `shape`; the rest is linear."""
    tau = channel.time_s - channel.time_s[0]
    x = channel.value_m
    parameters = np.concatenate((shape, np.zeros(3)))
    system = swing_equations(parameters, tau, x)
    parameters[2:] = np.linalg.lstsq(system[2:5, 2:5], system[2:5, 5], rcond=1e-14)[0]
    cost = np.inf
    for _ in range(30):
        system = swing_equations(parameters, tau, x)
        before, cost = cost, float(system[5, 5])
        step = np.linalg.lstsq(system[:5, :5], system[:5, 5], rcond=1e-14)[0]
        step[:2] = np.clip(step[:2], -0.05 * parameters[1], 0.05 * parameters[1])
        parameters = parameters + step
        if not _is_swing(parameters, float(tau[-1])):
            raise no_decay_error(float(tau[-1]))
        if abs(before - cost) <= 1e-10 * cost:
            break
    return np.asarray(parameters)


def _is_swing(parameters: Floats, length_s: float) -> bool:
    """Whether a fit still is an oscillation that may decay; one that is not has no sums of squares."""
    n, w = parameters[:2]
    return bool(abs(n) < w and -n * length_s < _GROWTH_EXPONENT_MAX)


def _finished(channel: Channel, parameters: Floats) -> DampedCosine:
    tau = channel.time_s - channel.time_s[0]
    residual = swing_residual(parameters, tau, channel.value_m)
    variance = float(residual @ residual) / max(1, len(tau) - 5)
    normal = swing_equations(parameters, tau, channel.value_m)[:5, :5]
    try:
        covariance = np.asarray(variance * np.linalg.inv(normal), dtype=np.float64)
    except np.linalg.LinAlgError:
        raise no_decay_error(float(tau[-1])) from None
    return DampedCosine(float(channel.time_s[0]), float(channel.time_s[-1]), parameters, covariance, residual)
