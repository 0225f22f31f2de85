"""From a record to one oriented free decay: release, slip end, stick tail, noise, signs of the gauges."""

from dataclasses import dataclass, replace

import numpy as np

from analysis.damped_cosine import DampedCosine, fit_damped_cosine
from analysis.preparation.channels import Channel, Channels, read_channels
from analysis.preparation.cleaning import remove_invalid_readings
from analysis.preparation.drift import drift_warning, find_drift, remove_drift
from analysis.preparation.mains_hum import detect_hum, hum_warning
from analysis.preparation.mounting import detect_mounting, relative_to_table
from analysis.preparation.noise import (
    NOISE_FLOOR_M,
    detrended_noise,
    merge_repeated_readings,
    noise_with_floor,
    pool_noise,
    third_difference_noise,
)
from analysis.preparation.plausibility import check_rate, check_span, estimate_period
from analysis.preparation.release import Release, find_last_slip, find_releases
from analysis.quantities import ResultWarning
from analysis.record import Record
from messages.message import message

TAIL_PERIODS_MIN = 2.0
_RELEASE_MARGIN_S = 0.004
"""Uncertainty of the release as `segments` finds it."""
_NEVER_SLIPS = 2.0
"""Residual of a damped cosine over noise, from which on there must have been slip."""
_KEPT_MIN = 0.5
"""A gauge 2 with a smaller share of sound readings is left out."""
_LONG_S = 1.5
"""A decay this long after a hold is worth more than any that begins in motion."""
_EARLY_PERIODS = 2.0
"""Slip comes in the first swings."""
_CHANCE = 5.0
"""Standard deviations by which two mean squares of the same noise differ at most."""


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
    warnings : list of ResultWarning
    drift_m_per_s, table_drift_m_per_s : float
        Steady drift of gauge 2 and 1 as turned; taken off `relative` and `table`, zero at the release.
    """

    channels: Channels
    table: Channel
    relative: Channel | None
    gauge_2_absolute: bool
    sign: int
    relative_sign: int
    release: Release
    slip_end_s: float | None
    slips: bool
    period_s: float
    tail: DampedCosine | None
    noise_m: tuple[float, float]
    noise_reading_counts: tuple[int, int]
    warnings: list[ResultWarning]
    drift_m_per_s: float = 0.0
    table_drift_m_per_s: float = 0.0

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
    channels, warnings = _readable(record)
    release = _choose(find_releases(channels.table), warnings)
    begin = release.plateau_start_s if release.plateau_start_s is not None else release.time_s
    table = channels.table.between(begin, release.end_s + 1e-9)
    relative = None if channels.relative is None else channels.relative.between(begin, release.end_s + 1e-9)
    period = estimate_period(table, release)
    rough = FreeDecay(
        channels=channels,
        table=table,
        relative=relative,
        gauge_2_absolute=record.gauge_2_measures_plate,
        sign=1,
        relative_sign=1,
        release=release,
        slip_end_s=None,
        slips=True,
        period_s=period,
        tail=None,
        noise_m=(NOISE_FLOOR_M, NOISE_FLOOR_M),
        noise_reading_counts=(0, 0),
        warnings=warnings,
    )
    oriented = _oriented(rough)
    return _with_noise(_without_dead_gauge(_with_tail(oriented)))


def _readable(record: Record) -> tuple[Channels, list[ResultWarning]]:
    """Readings that gauges can have seen, with what is said of the others."""
    channels, warnings = read_channels(record)
    if record.relative_displacement_m is None:
        text = message("the record has no gauge 2. The friction comes from the table channel alone.")
        warnings.append(ResultWarning("gauge-2-absent", text))
    check_span(channels.table)
    check_rate(channels.table)
    table, relative = remove_invalid_readings(channels.table, "gauge 1", warnings), channels.relative
    if relative is not None:
        relative = _most(relative, remove_invalid_readings(relative, "gauge 2", warnings), warnings)
    for gauge, channel in (("gauge 1", table), ("gauge 2", relative)):
        hum = None if channel is None else detect_hum(channel)
        if hum is not None:
            warnings.append(hum_warning(gauge, hum))
    return replace(channels, table=table, relative=relative), warnings


def _most(readings: Channel, kept: Channel, warnings: list[ResultWarning]) -> Channel | None:
    """What was kept of gauge 2, if that is most of it."""
    if len(kept) >= _KEPT_MIN * len(readings):
        return kept
    text = message(
        "only {count} of {count_2} readings of gauge 2 are sound: it is left out, and the friction"
        " comes from the table channel alone. Re-centre gauge 2.",
        count=len(kept),
        count_2=len(readings),
    )
    warnings.append(ResultWarning("gauge-2-absent", text))
    return None


def _choose(releases: list[Release], warnings: list[ResultWarning]) -> Release:
    """The release with the longest decay after it; one with a hold before it where there is one."""
    if len(releases) > 1:
        times = ", ".join(f"{release.time_s:.3f} s" for release in releases)
        text = message(
            "the table was released or pushed, or gauge 1 jumped, {count} times (at {times}); the"
            " longest decay is used.",
            count=len(releases),
            times=times,
        )
        warnings.append(ResultWarning("released-twice", text))
    chosen = max(releases, key=_worth)
    if chosen.plateau_start_s is None:
        text = message("the record begins after the release: pullback and release time are extrapolated.")
        warnings.append(ResultWarning("release-not-recorded", text))
    return chosen


def _worth(release: Release) -> tuple[bool, float]:
    length_s = release.end_s - release.time_s
    return release.plateau_start_s is not None and length_s > _LONG_S, length_s


def _oriented(decay: FreeDecay) -> FreeDecay:
    """Turn the channels so that pullback is positive and slip runs against the table."""
    first = decay.table.between(decay.release.time_s, decay.release.time_s + 0.5 * decay.period_s)
    sign = -1 if decay.plateau is not None and first.value_m[0] < first.value_m[-1] else 1
    if sign < 0:
        text = message(
            "the pullback is negative: both gauges are mounted the other way, or the table was pushed."
        )
        decay.warnings.append(ResultWarning("pullback-negative", text))
    table = decay.table.scaled(sign)
    release = replace(decay.release, level_m=sign * decay.release.level_m)
    turned = replace(decay, table=table, sign=sign, relative_sign=sign, release=release)
    return turned if decay.relative is None else _with_gauge_2(turned, decay.relative.scaled(sign))


def _with_gauge_2(decay: FreeDecay, relative: Channel) -> FreeDecay:
    """Turn gauge 2, mounted as its readings show."""
    table, release_s = decay.table, decay.release.time_s
    mounting = detect_mounting(table, relative, release_s, decay.period_s, decay.gauge_2_absolute)
    decay.warnings.extend(mounting.warnings)
    return replace(
        decay,
        relative=relative.scaled(mounting.sign),
        relative_sign=decay.sign * mounting.sign,
        gauge_2_absolute=mounting.measures_plate,
    )


def _with_tail(decay: FreeDecay) -> FreeDecay:
    """Find the slip end, then fit the stick tail and repeat with its period."""
    if decay.relative is None:
        return _tail_of_table_alone(decay)
    slip = relative_to_table(decay.table, decay.relative, decay.gauge_2_absolute)
    noise = (
        detrended_noise(_last(slip, 0.2), decay.period_s)
        if decay.gauge_2_absolute
        else third_difference_noise(slip)
    )
    noise = max(noise, NOISE_FLOOR_M)
    for _ in range(2):
        end = find_last_slip(slip, decay.release.time_s, decay.period_s, noise)
        decay = replace(decay, slip_end_s=end, slips=end is None or end > decay.release.time_s)
        decay = fit_tail(decay, end)
    decay = _without_table_drift(decay)
    if decay.tail is None:
        return decay
    return _without_drift(decay, slip.between(decay.tail.start_s, np.inf), noise)


def _without_drift(decay: FreeDecay, rest: Channel, noise_m: float) -> FreeDecay:
    """Take off what gauge 2 drifts while the plate sticks."""
    relative = decay.relative
    if relative is None:
        return decay
    drift = find_drift(None if decay.plateau is None else relative.between(*decay.plateau), rest, noise_m)
    if drift != 0.0:
        decay.warnings.append(drift_warning(2, relative, drift))
    if not drift:
        return decay
    return replace(decay, relative=remove_drift(relative, drift, decay.release.time_s), drift_m_per_s=drift)


def _without_table_drift(decay: FreeDecay) -> FreeDecay:
    """Take off what gauge 1 drifts, as the tail leaves it over, and fit the tail again."""
    tail = decay.tail
    if tail is None:
        return decay
    left = Channel(decay.table.between(tail.start_s, np.inf).time_s, tail.residual_m)
    held = None if decay.plateau is None else decay.table.between(*decay.plateau)
    drift = find_drift(held, left, NOISE_FLOOR_M)
    if drift != 0.0:
        decay.warnings.append(drift_warning(1, decay.table, drift))
    if not drift:
        return decay
    table = remove_drift(decay.table, drift, decay.release.time_s)
    return fit_tail(replace(decay, table=table, table_drift_m_per_s=drift), tail.start_s)


def fit_tail(decay: FreeDecay, start_s: float | None) -> FreeDecay:
    """Fit the stick tail from `start_s` to the end, where it is long enough."""
    if start_s is None:
        return replace(decay, tail=None)
    tail = decay.table.between(start_s, np.inf)
    length_s = float(tail.time_s[-1] - tail.time_s[0]) if len(tail) > 10 else 0.0
    if length_s < TAIL_PERIODS_MIN * decay.period_s:
        return replace(decay, tail=None)
    fitted = fit_damped_cosine(tail, decay.period_s)
    return replace(decay, tail=fitted, period_s=fitted.period_s)


def _tail_of_table_alone(decay: FreeDecay) -> FreeDecay:
    """Without gauge 2 the last half of the motion is taken as tail until the joint fit knows better.

    Unless the whole motion is that of one mass: then nothing slipped that the table could tell of.
    """
    middle = 0.5 * (decay.release.time_s + float(decay.table.time_s[-1]))
    late = replace(fit_tail(decay, middle), slip_end_s=None, slips=True)
    whole = fit_tail(decay, decay.release.time_s + _RELEASE_MARGIN_S)
    return replace(whole, slip_end_s=None, slips=False) if _explained(whole, late) else late


def _explained(whole: FreeDecay, late: FreeDecay) -> bool:
    """Whether one decay leaves no more of the first swings than the late one of its own stretch: noise."""
    if whole.tail is None:
        return False
    early = whole.tail.residual_m[: int(_EARLY_PERIODS / whole.tail.periods * len(whole.tail.residual_m))]
    noise, count = (
        _tail_noise(late) if late.tail is not None else (third_difference_noise(whole.table), len(early))
    )
    chance = float(np.exp(_CHANCE * np.sqrt(2.0 / len(early) + 2.0 / count)))
    floor = noise_with_floor(0.0, whole.channels.quantisation_m[0]) ** 2
    return float(np.mean(early**2)) <= chance * noise**2 + floor


def _without_dead_gauge(decay: FreeDecay) -> FreeDecay:
    """Leave gauge 2 out where it shows no slip and the table does not swing like a mass that never slips."""
    if decay.slips or decay.relative is None or decay.tail is None:
        return decay
    if decay.tail.rms_m <= _NEVER_SLIPS * third_difference_noise(decay.table) + NOISE_FLOOR_M:
        return decay
    text = message(
        "gauge 2 shows no slip, but the table does not swing as one mass does: gauge 2 is taken as"
        " dead. The friction comes from the table channel alone."
    )
    decay.warnings.append(ResultWarning("gauge-2-dead", text))
    return _tail_of_table_alone(replace(decay, relative=None))


def _last(channel: Channel, share: float) -> Channel:
    start = channel.time_s[-1] - share * (channel.time_s[-1] - channel.time_s[0])
    return channel.between(start, np.inf)


def _with_noise(decay: FreeDecay) -> FreeDecay:
    """Noise of both gauges: in the hold, and about the tail or after slip."""
    steps = decay.channels.quantisation_m
    table = pool_noise(
        [_hold_noise(decay, decay.table), _tail_noise(decay)], third_difference_noise(decay.table)
    )
    relative = (0.0, 0)
    if decay.relative is not None:
        found = [_hold_noise(decay, decay.relative), _rest_noise(decay, decay.relative)]
        relative = pool_noise(found, third_difference_noise(decay.relative))
    noise = noise_with_floor(table[0], steps[0]), noise_with_floor(relative[0], steps[1])
    return replace(
        decay,
        table=merge_repeated_readings(decay.table, table[0], steps[0]),
        relative=None
        if decay.relative is None
        else merge_repeated_readings(decay.relative, relative[0], steps[1]),
        noise_m=noise,
        noise_reading_counts=(table[1], relative[1]),
    )


def _hold_noise(decay: FreeDecay, channel: Channel) -> tuple[float, int]:
    if decay.plateau is None:
        return 0.0, 0
    hold = channel.between(*decay.plateau)
    return detrended_noise(hold, 0.5 * decay.period_s), len(hold)


def _tail_noise(decay: FreeDecay) -> tuple[float, int]:
    """Residual of gauge 1 about the damped cosine."""
    return (0.0, 0) if decay.tail is None else (decay.tail.rms_m, len(decay.tail.residual_m))


def _rest_noise(decay: FreeDecay, relative: Channel) -> tuple[float, int]:
    """Noise of gauge 2 after slip, where it reads the plate against the table."""
    if decay.slip_end_s is None or decay.gauge_2_absolute:
        return 0.0, 0
    rest = relative.between(decay.slip_end_s, np.inf)
    return detrended_noise(rest, 0.5 * decay.period_s), len(rest)
