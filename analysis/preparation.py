"""From a record to one oriented free decay: release, slip end, stick tail, noise, signs of the gauges."""

from dataclasses import dataclass, replace

import numpy as np

from analysis.channels import Channel, Channels, read_channels
from analysis.decay import Decay, dominant_period, fit_decay
from analysis.hygiene import cleaned
from analysis.quantities import Caution
from analysis.record import Record
from analysis.segments import Release, find_releases, find_slip_end, local_slopes, median_of_three

NOISE_FLOOR_M = 1e-9
"""Noise below this is not believed: the readings are computed, not measured."""
TAIL_PERIODS_MIN = 2.0
_RELEASE_MARGIN_S = 0.004
_READINGS_MIN = 30
_NEVER_SLIPS = 2.0
"""Residual of a damped cosine over noise, from which on there must have been slip."""
_DITHER = 0.4
"""Noise above this share of the converter's step makes rounding errors independent."""
_ABSOLUTE_SHARE = 0.5
"""Gauge 2 that swings with more than this share of the table's tail measures the plate against the base."""


@dataclass(frozen=True, eq=False, slots=True)
class FreeDecay:
    """One free decay, turned so that the pullback is positive.

    Attributes
    ----------
    channels : Channels
        As read.
    table : Channel
        From the hold to the end of free motion, times `sign`.
    relative : Channel or None
        Gauge 2 likewise, turned so that it is positive where the plate lies ahead of the table;
        against the base where `absolute`.
    absolute : bool
    sign, relative_sign : int
        What the readings of gauge 1 and 2 were multiplied by.
    release : Release
    slip_end_s : float or None
        None where slip lasts to the end or nothing tells.
    slips : bool
        Does gauge 2 show any slip?
    period_s : float
        Of the stick tail, or of the spectrum where the tail is too short.
    tail : Decay or None
        None where the tail is shorter than two periods.
    noise_m : (float, float)
    noise_readings : (int, int)
        Number of readings that the noise was measured from.
    cautions : list of Caution
    """

    channels: Channels
    table: Channel
    relative: Channel | None
    absolute: bool
    sign: int
    relative_sign: int
    release: Release
    slip_end_s: float | None
    slips: bool
    period_s: float
    tail: Decay | None
    noise_m: tuple[float, float]
    noise_readings: tuple[int, int]
    cautions: list[Caution]

    @property
    def hold_end_s(self) -> float:
        """A time shortly before the release."""
        return self.release.time_s - max(_RELEASE_MARGIN_S, 2.0 * self.channels.interval_s)

    @property
    def dense_until_s(self) -> float:
        """Half a period after the last slip that gauge 2 shows."""
        return np.inf if self.slip_end_s is None else self.slip_end_s + 0.5 * self.period_s

    @property
    def plateau(self) -> tuple[float, float] | None:
        """First and last time of the hold, where the record has it."""
        start = self.release.plateau_start_s
        return None if start is None or start >= self.hold_end_s else (start, self.hold_end_s)


def prepare(record: Record) -> FreeDecay:
    """Find the free decay in `record`.

    Raises
    ------
    RecordError
        When there is none.
    """
    channels, cautions = read_channels(record)
    channels = replace(
        channels,
        table=cleaned(channels.table, "gauge 1", cautions),
        relative=None if channels.relative is None else cleaned(channels.relative, "gauge 2", cautions),
    )
    release = _choose(find_releases(channels.table), cautions)
    begin = release.plateau_start_s if release.plateau_start_s is not None else release.time_s
    table = channels.table.between(begin, release.end_s + 1e-9)
    relative = None if channels.relative is None else channels.relative.between(begin, release.end_s + 1e-9)
    period = dominant_period(table.between(release.time_s, np.inf))
    rough = FreeDecay(
        channels,
        table,
        relative,
        record.gauge_2_measures_plate,
        1,
        1,
        release,
        None,
        True,
        period,
        None,
        (NOISE_FLOOR_M, NOISE_FLOOR_M),
        (0, 0),
        cautions,
    )
    oriented = _oriented(rough)
    return _with_noise(_without_dead_gauge(_with_tail(oriented)))


def against_table(table: Channel, relative: Channel, absolute: bool) -> Channel:
    """Displacement of the plate against the table."""
    if not absolute:
        return relative
    return Channel(
        relative.time_s, relative.value_m - np.interp(relative.time_s, table.time_s, table.value_m)
    )


def noise_about_lines(channel: Channel, block_s: float) -> float:
    """Standard deviation of readings at rest about straight lines over blocks: drift does not count."""
    if len(channel) < 6:
        return 0.0
    edges = np.arange(channel.time_s[0], channel.time_s[-1], block_s)
    squares, freedom = 0.0, 0
    for part in np.split(np.arange(len(channel)), np.searchsorted(channel.time_s, edges[1:])):
        if len(part) >= 6:
            t, x = channel.time_s[part] - channel.time_s[part[0]], channel.value_m[part]
            residual = x - np.polyval(np.polyfit(t, x, 1), t)
            squares, freedom = squares + float(residual @ residual), freedom + len(part) - 2
    return float(np.sqrt(squares / freedom)) if freedom else 0.0


def _choose(releases: list[Release], cautions: list[Caution]) -> Release:
    """The release with the longest decay after it."""
    if len(releases) > 1:
        times = ", ".join(f"{release.time_s:.3f} s" for release in releases)
        message = (
            f"the table was released or pushed {len(releases)} times (at {times}); the longest decay is used."
        )
        cautions.append(Caution("released-twice", message))
    chosen = max(releases, key=lambda release: release.end_s - release.time_s)
    if chosen.plateau_start_s is None:
        message = "the record begins after the release: pullback and release time are extrapolated."
        cautions.append(Caution("release-not-recorded", message))
    return chosen


def _oriented(decay: FreeDecay) -> FreeDecay:
    """Turn the channels so that pullback is positive and slip runs against the table."""
    first = decay.table.between(decay.release.time_s, decay.release.time_s + 0.5 * decay.period_s)
    sign = -1 if decay.plateau is not None and first.value_m[0] < first.value_m[-1] else 1
    if sign < 0:
        message = "the pullback is negative: both gauges are mounted the other way, or the table was pushed."
        decay.cautions.append(Caution("pullback-negative", message))
    table = decay.table.scaled(sign)
    release = replace(decay.release, level_m=sign * decay.release.level_m)
    turned = replace(decay, table=table, sign=sign, relative_sign=sign, release=release)
    if decay.relative is None:
        return turned
    return _relative_oriented(replace(turned, relative=decay.relative.scaled(sign)))


def _relative_oriented(decay: FreeDecay) -> FreeDecay:
    """Notice a gauge 2 that measures the plate against the base, or is mounted the other way."""
    relative = decay.relative
    if relative is None:
        return decay
    share = _share_of_table(decay, relative)
    absolute = decay.absolute
    if not absolute and share > _ABSOLUTE_SHARE:
        message = (
            "gauge 2 swings with the table after slip: it is taken as measuring the plate against the base."
        )
        decay.cautions.append(Caution("gauge-2-absolute", message))
        absolute = True
    moving = decay.release.time_s, decay.release.time_s + 3.0 * decay.period_s
    slip = median_of_three(against_table(decay.table, relative, absolute).between(*moving))
    v1 = np.interp(slip.time_s, decay.table.time_s, local_slopes(decay.table, decay.period_s / 24.0))
    w = local_slopes(slip, decay.period_s / 24.0)
    if absolute or float(w @ v1) <= 0.3 * float(np.sqrt((w @ w) * (v1 @ v1))):
        return replace(decay, absolute=absolute)
    message = (
        "gauge 2 moves with the table in the first slips: it is mounted the other way, and taken as reversed."
    )
    decay.cautions.append(Caution("gauge-2-reversed", message))
    return replace(decay, relative=relative.scaled(-1.0), relative_sign=-decay.relative_sign)


def _share_of_table(decay: FreeDecay, relative: Channel) -> float:
    """Slope of gauge 2's readings against gauge 1's over the last third of the motion."""
    start = decay.table.time_s[-1] - (decay.table.time_s[-1] - decay.release.time_s) / 3.0
    late = relative.between(start, np.inf)
    if len(late) < 10:
        return 0.0
    u1 = np.interp(late.time_s, decay.table.time_s, decay.table.value_m)
    u1 = u1 - u1.mean()
    return float(u1 @ late.value_m / (u1 @ u1))


def _with_tail(decay: FreeDecay) -> FreeDecay:
    """Find the slip end, then fit the stick tail and repeat with its period."""
    if decay.relative is None:
        return _tail_of_table_alone(decay)
    slip = against_table(decay.table, decay.relative, decay.absolute)
    noise = noise_about_lines(_last(slip, 0.2), decay.period_s) if decay.absolute else _steady_noise(slip)
    for _ in range(2):
        end = find_slip_end(slip, decay.release.time_s, decay.period_s, max(noise, NOISE_FLOOR_M))
        decay = replace(decay, slip_end_s=end, slips=end is None or end > decay.release.time_s)
        decay = fit_tail(decay, end)
    return decay


def fit_tail(decay: FreeDecay, start_s: float | None) -> FreeDecay:
    """Fit the stick tail from `start_s` to the end, where it is long enough."""
    if start_s is None:
        return replace(decay, tail=None)
    tail = decay.table.between(start_s, np.inf)
    length_s = float(tail.time_s[-1] - tail.time_s[0]) if len(tail) > 10 else 0.0
    if length_s < TAIL_PERIODS_MIN * decay.period_s:
        return replace(decay, tail=None)
    fitted = fit_decay(tail, decay.period_s)
    return replace(decay, tail=fitted, period_s=fitted.period_s)


def _tail_of_table_alone(decay: FreeDecay) -> FreeDecay:
    """Without gauge 2 the last half of the motion is taken as tail until the joint fit knows better."""
    middle = 0.5 * (decay.release.time_s + float(decay.table.time_s[-1]))
    return replace(fit_tail(decay, middle), slip_end_s=None, slips=True)


def _without_dead_gauge(decay: FreeDecay) -> FreeDecay:
    """Leave gauge 2 out where it shows no slip and the table does not swing like a mass that never slips."""
    if decay.slips or decay.relative is None or decay.tail is None:
        return decay
    if decay.tail.rms_m <= _NEVER_SLIPS * _steady_noise(decay.table) + NOISE_FLOOR_M:
        return decay
    message = (
        "gauge 2 shows no slip, but the table does not swing as one mass does: gauge 2 is taken as dead."
        " The friction comes from the table channel alone."
    )
    decay.cautions.append(Caution("gauge-2-dead", message))
    return _tail_of_table_alone(replace(decay, relative=None))


def _steady_noise(slip: Channel) -> float:
    """Noise of gauge 2 from third differences over all of its readings: slip is smooth."""
    third = np.diff(slip.value_m, 3)
    return float(np.median(np.abs(third))) / 0.6745 / float(np.sqrt(20.0))


def _last(channel: Channel, share: float) -> Channel:
    start = channel.time_s[-1] - share * (channel.time_s[-1] - channel.time_s[0])
    return channel.between(start, np.inf)


def _with_noise(decay: FreeDecay) -> FreeDecay:
    """Noise of both gauges: in the hold, and about the tail or after slip."""
    steps = decay.channels.quantisation_m
    table = _pooled([_hold_noise(decay, decay.table), _tail_noise(decay)], _steady_noise(decay.table))
    relative = (0.0, 0)
    if decay.relative is not None:
        found = [_hold_noise(decay, decay.relative), _rest_noise(decay, decay.relative)]
        relative = _pooled(found, _steady_noise(decay.relative))
    noise = _floored(table[0], steps[0]), _floored(relative[0], steps[1])
    return replace(
        decay,
        table=_without_repeats(decay.table, table[0], steps[0]),
        relative=None if decay.relative is None else _without_repeats(decay.relative, relative[0], steps[1]),
        noise_m=noise,
        noise_readings=(table[1], relative[1]),
    )


def _without_repeats(channel: Channel, noise_m: float, step_m: float) -> Channel:
    """Readings of a converter coarser than the noise with each run of equal ones as a single reading.

    A repeated reading repeats its rounding error, so it says nothing new; counted each time, a plate at
    rest would outvote its motion.
    """
    if noise_m > _DITHER * step_m or step_m < NOISE_FLOOR_M:
        return channel
    bounds = np.concatenate(([0], np.flatnonzero(np.diff(channel.value_m)) + 1, [len(channel)]))
    times = 0.5 * (channel.time_s[bounds[:-1]] + channel.time_s[bounds[1:] - 1])
    return Channel(times, channel.value_m[bounds[:-1]])


def _hold_noise(decay: FreeDecay, channel: Channel) -> tuple[float, int]:
    if decay.plateau is None:
        return 0.0, 0
    hold = channel.between(*decay.plateau)
    return noise_about_lines(hold, 0.5 * decay.period_s), len(hold)


def _tail_noise(decay: FreeDecay) -> tuple[float, int]:
    """Residual of gauge 1 about the damped cosine."""
    return (0.0, 0) if decay.tail is None else (decay.tail.rms_m, len(decay.tail.residual_m))


def _rest_noise(decay: FreeDecay, relative: Channel) -> tuple[float, int]:
    """Noise of gauge 2 after slip, where it reads the plate against the table."""
    if decay.slip_end_s is None or decay.absolute:
        return 0.0, 0
    rest = relative.between(decay.slip_end_s, np.inf)
    return noise_about_lines(rest, 0.5 * decay.period_s), len(rest)


def _pooled(found: list[tuple[float, int]], otherwise: float) -> tuple[float, int]:
    """Common standard deviation of several stretches; not of those that are noisier than the quietest.

    That is by a fifth at least, and by more than the number of readings lets it seem.
    """
    used = [(noise, count) for noise, count in found if count >= _READINGS_MIN]
    if not used:
        return otherwise, _READINGS_MIN
    least, fewest = min(used)
    chance = [float(np.exp(5.0 * np.sqrt(0.5 / fewest + 0.5 / count))) for _, count in used]
    limits = [max(1.2, by_chance) * least + NOISE_FLOOR_M for by_chance in chance]
    used = [pair for pair, limit in zip(used, limits, strict=True) if pair[0] <= limit]
    total = sum(count for _, count in used)
    return float(np.sqrt(sum(noise**2 * count for noise, count in used) / total)), total


def _floored(noise_m: float, step_m: float) -> float:
    return max(noise_m, step_m / float(np.sqrt(12.0)), NOISE_FLOOR_M)
