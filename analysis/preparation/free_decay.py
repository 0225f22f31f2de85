"""Finds the free decay in a record: release, end of slip, stick tail, noise, mounting of the gauges."""

import contextlib
from dataclasses import dataclass, replace
from typing import NamedTuple, Self

import numpy as np

from analysis.formatting import format_number
from analysis.preparation import oscillation
from analysis.preparation.channels import (
    NOISE_FLOOR_M,
    Channel,
    Channels,
    detect_hum,
    detrended_noise,
    drift_warning,
    find_drift,
    hum_warning,
    merge_repeated_readings,
    noise_with_floor,
    pool_noise,
    read_channels,
    remove_drift,
    remove_invalid_readings,
    third_difference_noise,
)
from analysis.preparation.disturbance import find_moved_plate, find_stopped_table
from analysis.preparation.oscillation import DampedCosine, Release
from analysis.quantities import ResultWarning, result_warning
from analysis.record import Record, RecordError
from messages.i18n import N_
from messages.message import message

_SURE = 0.1  # slope of gauge 2 against gauge 1, once the plate sticks, is -1, 0 or 1 to within this
_UNEXPLAINED = 0.02
"""Swing of gauge 2 beyond that slope, as a share of the table's: the plate still slips where it is more."""
_NOISE_SIGMAS = 3.0
_SWINGS = 0.05  # the swing is followed until it falls below this share of its first
_AGAINST = 0.3  # correlation of gauge 2's first slips with the table's velocity from which on it is reversed
_LINE_READINGS = 10
_MEANS = 60


def relative_to_table(table: Channel, relative: Channel, measures_plate: bool) -> Channel:
    """Displacement of the plate against the table."""
    if not measures_plate:
        return relative
    return Channel(
        relative.time_s, relative.value_m - np.interp(relative.time_s, table.time_s, table.value_m)
    )


def _detect_mounting(
    table: Channel,
    relative: Channel,
    release: tuple[float, float],
    stated_absolute: bool,
    warnings: list[ResultWarning],
) -> tuple[bool, int]:
    """Whether gauge 2 measures the plate against the base, and the sign of its readings ahead of the table.

    `release` is its time and the period of the swing (s). Once the plate sticks, gauge 2 stands still, or
    follows the table, or mirrors it.
    """
    slope = _slope_on_table(table, relative, *release)
    absolute = stated_absolute if slope is None else slope != 0
    sign = slope or 1
    if not absolute and _leads(table, relative, *release):
        sign = -1
    if absolute and not stated_absolute:
        warnings.append(_warning("gauge-2-absolute"))
    if stated_absolute and not absolute:
        warnings.append(_warning("gauge-2-relative"))
    if sign < 0:
        warnings.append(_warning("gauge-2-reversed"))
    return absolute, sign


def _slope_on_table(table: Channel, relative: Channel, release_s: float, period_s: float) -> int | None:
    """Slope -1, 0 or 1 of gauge 2 on gauge 1 late in the swing; None where the plate slips until then.

    A plate with very little friction stays where it is while it slips, and gauge 2 mirrors the table
    nearly as well: so the slope must be exact, over a period at least.
    """
    away = np.abs(table.value_m - np.median(table.value_m[-len(table) // 3 :]))
    end_s = float(table.time_s[np.flatnonzero(away >= _SWINGS * away.max())[-1]])
    late = relative.between(end_s - (end_s - release_s) / 3.0, end_s)
    if len(late) < _LINE_READINGS or late.time_s[-1] - late.time_s[0] < period_s:
        return None
    u1 = np.interp(late.time_s, table.time_s, table.value_m)
    t = late.time_s - late.time_s.mean()
    columns = np.column_stack((u1 - u1.mean(), np.ones(len(t)), t))
    found = np.linalg.lstsq(columns, late.value_m, rcond=None)[0]
    count = max(1, len(t) // _MEANS)
    whole = len(late) // count * count  # means, so that noise does not pass for motion
    left = (late.value_m - columns @ found)[:whole].reshape(-1, count).mean(axis=1)
    noise = np.hypot(oscillation.white_noise(table), oscillation.white_noise(relative)) / np.sqrt(count)
    slope = round(float(found[0]))
    clear = abs(slope) <= 1 and abs(found[0] - slope) < _SURE
    return slope if clear and left.std() < _UNEXPLAINED * u1.std() + _NOISE_SIGMAS * noise else None


def _leads(table: Channel, relative: Channel, release_s: float, period_s: float) -> bool:
    """Whether gauge 2 moves with the table in the first slips, where the plate lags behind it.

    False, too, where it has no readings in them that would tell.
    """
    slip = oscillation.median_of_three(relative.between(release_s, release_s + 3.0 * period_s))
    if len(slip) < _LINE_READINGS:
        return False
    v1 = np.interp(slip.time_s, table.time_s, oscillation.local_slopes(table, period_s / 24.0))
    w = oscillation.local_slopes(slip, period_s / 24.0)
    return float(w @ v1) > _AGAINST * float(np.sqrt((w @ w) * (v1 @ v1)))


def _warning(code: str) -> ResultWarning:
    return ResultWarning(code, message(_MOUNTINGS[code]))


_MOUNTINGS = {
    "gauge-2-absolute": N_(
        "gauge 2 swings with the table after slip: it is taken as measuring the plate against the base."
    ),
    "gauge-2-relative": N_(
        "gauge 2 is said to measure the plate against the base, but does not swing with the table after"
        " slip: it is taken as measuring the plate against the table."
    ),
    "gauge-2-reversed": N_(
        "gauge 2 moves against the plate: it is mounted the other way, and taken as reversed."
    ),
}


TAIL_PERIODS_MIN = 2.0  # a shorter tail does not tell damping from a drift of the zero
_SAME_PERIOD = 0.01  # relative difference: two stretches of one tail have the same period
_SURELY_BEFORE = 2.0  # sampling intervals that a decay ends before the readings, to be told
_RELEASE_MARGIN_S = 0.004
"""Uncertainty of the release as `find_releases` gives it: the half window of its slopes, rounded down."""
_NEVER_SLIPS = 2.0  # residual of a damped cosine over noise above which there must have been slip
_KEPT_MIN = 0.5  # gauge 2 is left out where a smaller share of its readings is valid
_LONG_S = 1.5  # a decay this long after a hold is preferred to any that begins in motion
_EARLY_PERIODS = 2.0  # slip comes in the first swings
_CHANCE = 5.0  # two mean squares of the same noise differ by this many standard deviations at most
_SLIPPING_SHARE = 1.0 / 3.0  # of a motion without gauge 2, in which the plate may slip
_NOISE_SHARE = 0.2
"""Last part of the record in which gauge 2 against the base is taken for at rest relative to the table."""


@dataclass(frozen=True, eq=False, slots=True)
class _Stretch:
    """Both gauges from the hold to the end of free motion, turned so that the pullback is positive."""

    channels: Channels  # as read
    table: Channel  # gauge 1 times `sign`; in a `FreeDecay` without drift
    relative: Channel | None
    """Gauge 2 likewise, positive where the plate lies ahead of the table; against the base where
    `gauge_2_absolute`."""
    gauge_2_absolute: bool
    sign: int  # what the readings of gauge 1 were multiplied by
    relative_sign: int
    release: Release

    @property
    def hold_end_s(self) -> float:
        """A time shortly before the release."""
        return self.release.time_s - max(_RELEASE_MARGIN_S, 2.0 * self.channels.interval_s)

    @property
    def plateau(self) -> tuple[float, float] | None:
        """First and last time of the hold, where the record has it."""
        start_s, end_s = self.release.plateau_start_s, self.hold_end_s
        return None if start_s is None or start_s >= end_s else (start_s, end_s)

    def plateau_of(self, channel: Channel) -> Channel | None:
        """Readings of the hold."""
        return None if self.plateau is None else channel.between(*self.plateau)


@dataclass(frozen=True, eq=False, slots=True)
class FreeDecay(_Stretch):
    """One free decay."""

    slip_end_s: float | None  # None where slip lasts to the end or the readings do not tell
    slips: bool  # whether the plate slips at all
    period_s: float  # of the stick tail, or of the spectrum where the tail is too short
    tail: DampedCosine | None  # None where the tail is shorter than `TAIL_PERIODS_MIN`
    noise_m: tuple[float, float]
    noise_reading_counts: tuple[int, int]  # numbers of readings that the noise was measured from
    warnings: tuple[ResultWarning, ...]
    drift_m_per_s: float = 0.0  # steady drift of gauge 2 as turned, already subtracted; zero at the release
    table_drift_m_per_s: float = 0.0  # the same of gauge 1

    @property
    def early_end_s(self) -> float | None:
        """Record time at which the free decay ends; None where it lasts as long as the readings."""
        end_s, steps_s = self.release.end_s, _SURELY_BEFORE * self.channels.interval_s
        is_early = end_s < float(self.channels.table.time_s[-1]) - steps_s
        return self.channels.to_record_time(end_s) if is_early else None

    @property
    def dense_until_s(self) -> float:
        """Half a period after the last slip that gauge 2 shows."""
        return np.inf if self.slip_end_s is None else self.slip_end_s + 0.5 * self.period_s

    def with_tail_from(self, start_s: float | None) -> Self:
        """The same with the stick tail fitted from `start_s` on, or none."""
        tail = fit_tail(self.table, start_s, self.period_s, self.tail)
        return replace(self, tail=tail, period_s=self.period_s if tail is None else tail.period_s)


class _Slip(NamedTuple):
    """End of slip, whether there was any, and the stick tail after it."""

    end_s: float | None
    occurs: bool
    tail: DampedCosine | None
    period_s: float


def prepare(record: Record) -> FreeDecay:
    """Find the free decay in `record`.

    Raises RecordError if there is none.
    """
    warnings: list[ResultWarning] = []
    channels, hum = _valid_channels(record, warnings)
    release = _choose_release(oscillation.find_releases_beside(hum, channels.table), record.release, warnings)
    if record.decay_end_s is not None:
        end_s = min(channels.from_record_time(record.decay_end_s), release.end_s)
        release = replace(release, end_s=end_s)
    stretch, period_s = _oriented_stretch(channels, release, record.gauge_2_measures_plate, warnings)
    undisturbed = _until_disturbance(stretch, period_s)
    if record.decay_end_s is not None or undisturbed is not stretch:
        warnings.append(_moved_warning(undisturbed.release))
    stretch = undisturbed
    if stretch.relative is None:
        slip, drift, table_drift = _slip_by_table_alone(stretch, period_s), 0.0, 0.0
    else:
        stretch, slip, drift, table_drift = _slip_by_gauge_2(stretch, stretch.relative, period_s, warnings)
    if stretch.relative is not None and not slip.occurs and _is_dead(stretch, slip, warnings):
        stretch = replace(stretch, relative=None)
        slip = _slip_by_table_alone(stretch, slip.period_s)
    (noise, table), (relative_noise, relative) = _table_noise(stretch, slip), _relative_noise(stretch, slip)
    return FreeDecay(
        channels=channels,
        table=table,
        relative=relative,
        gauge_2_absolute=stretch.gauge_2_absolute,
        sign=stretch.sign,
        relative_sign=stretch.relative_sign,
        release=stretch.release,
        slip_end_s=slip.end_s,
        slips=slip.occurs,
        period_s=slip.period_s,
        tail=slip.tail,
        noise_m=(noise[0], relative_noise[0]),
        noise_reading_counts=(noise[1], relative_noise[1]),
        warnings=tuple(warnings),
        drift_m_per_s=drift,
        table_drift_m_per_s=table_drift,
    )


def fit_tail(
    table: Channel, start_s: float | None, period_s: float, near: DampedCosine | None = None
) -> DampedCosine | None:
    """Fit the stick tail from `start_s` to the end, beginning at a fit `near` it where there is one.

    None where it is too short or does not begin, or is no damped oscillation.
    """
    if start_s is None:
        return None
    tail = table.between(start_s, np.inf)
    length_s = float(tail.time_s[-1] - tail.time_s[0]) if len(tail) > 10 else 0.0
    if length_s < TAIL_PERIODS_MIN * period_s:
        return None
    if near is not None:
        with contextlib.suppress(RecordError):
            found = oscillation.refit_damped_cosine(tail, near)
            if abs(found.period_s / near.period_s - 1.0) < _SAME_PERIOD:
                return found
    try:
        return oscillation.fit_damped_cosine(tail, period_s)
    except RecordError:
        return None


def _valid_channels(
    record: Record, warnings: list[ResultWarning]
) -> tuple[Channels, tuple[float, float] | None]:
    """Readings that the gauges can have seen, and the hum of gauge 1."""
    channels, found = read_channels(record)
    warnings += found
    if record.relative_displacement_m is None:
        template = N_("the record has no gauge 2. The friction comes from the table channel alone.")
        warnings.append(result_warning("gauge-2-absent", template))
    oscillation.check_span(channels.table)
    oscillation.check_rate(channels.table)
    table, relative = remove_invalid_readings(channels.table, 1, warnings), channels.relative
    if relative is not None:
        relative = _if_mostly_valid(relative, remove_invalid_readings(relative, 2, warnings), warnings)
    hums = (detect_hum(table), None if relative is None else detect_hum(relative))
    warnings += [hum_warning(gauge, hum) for gauge, hum in enumerate(hums, 1) if hum is not None]
    return replace(channels, table=table, relative=relative), hums[0]


def _if_mostly_valid(readings: Channel, valid: Channel, warnings: list[ResultWarning]) -> Channel | None:
    if len(valid) >= _KEPT_MIN * len(readings):
        return valid
    template = N_(
        "only {count} of {total} readings of gauge 2 are sound: it is left out, and the friction"
        " comes from the table channel alone. Re-centre gauge 2."
    )
    warnings.append(result_warning("gauge-2-absent", template, count=len(valid), total=len(readings)))
    return None


def _choose_release(releases: list[Release], number: int | None, warnings: list[ResultWarning]) -> Release:
    """The release of this number, from 1, else that of the longest decay, after a hold if there is one."""
    count, times = len(releases), ", ".join(f"{release.time_s:.3f} s" for release in releases)
    if number is not None and not 1 <= number <= count:
        raise RecordError(
            "the record has no release {number}: {count} were found (at {times}). Choose one of these.",
            number=number,
            count=count,
            times=times,
        )
    if count > 1:
        chosen_one = message("the longest decay is used")
        if number is not None:
            chosen_one = message("the decay after number {number} is used", number=number)
        template = N_(
            "the table was released or pushed, or gauge 1 jumped, {count} times (at {times}); {chosen}."
        )
        warnings.append(
            result_warning("released-twice", template, count=count, times=times, chosen=chosen_one)
        )
    chosen = max(releases, key=_release_preference) if number is None else releases[number - 1]
    if chosen.plateau_start_s is None:
        text = message("the record begins after the release: pullback and release time are extrapolated.")
        warnings.append(ResultWarning("release-not-recorded", text))
    return chosen


def _release_preference(release: Release) -> tuple[bool, float]:
    length_s = release.end_s - release.time_s
    return release.plateau_start_s is not None and length_s > _LONG_S, length_s


def _oriented_stretch(
    channels: Channels, release: Release, measures_plate: bool, warnings: list[ResultWarning]
) -> tuple[_Stretch, float]:
    """Cut both gauges and turn them so that the pullback is positive; the period (s) comes with them."""
    begin_s = release.plateau_start_s if release.plateau_start_s is not None else release.time_s
    end_s = release.end_s + 1e-9
    table = channels.table.between(begin_s, end_s)
    period_s = oscillation.estimate_period(table, release, channels.relative)
    first = table.between(release.time_s, release.time_s + 0.5 * period_s).value_m
    stretch = _Stretch(channels, table, None, measures_plate, 1, 1, release)
    sign = -1 if stretch.plateau is not None and first[0] < first[-1] else 1
    if sign < 0:
        text = message(
            "the pullback is negative: both gauges are mounted the other way, or the table was pushed."
        )
        warnings.append(ResultWarning("pullback-negative", text))
    turned = replace(release, level_m=sign * release.level_m)
    stretch = replace(stretch, table=table.scaled(sign), sign=sign, relative_sign=sign, release=turned)
    if channels.relative is None:
        return stretch, period_s
    relative = channels.relative.between(begin_s, end_s).scaled(sign)
    timing = release.time_s, period_s
    absolute, turn = _detect_mounting(stretch.table, relative, timing, measures_plate, warnings)
    relative = relative.scaled(turn)
    stretch = replace(stretch, relative=relative, gauge_2_absolute=absolute, relative_sign=sign * turn)
    return stretch, period_s


def _until_disturbance(stretch: _Stretch, period_s: float) -> _Stretch:
    """The stretch up to where a hand moves the plate or stops the table, itself if none does."""
    release_s, table = stretch.release.time_s, stretch.table
    still_s, moved_s = release_s + _SLIPPING_SHARE * (float(table.time_s[-1]) - release_s), None
    if stretch.relative is not None:
        slip = relative_to_table(table, stretch.relative, stretch.gauge_2_absolute)
        noise = noise_with_floor(third_difference_noise(slip), stretch.channels.quantisation_m[1])
        moved_s = find_moved_plate(slip, release_s, period_s, noise)
        before = slip.between(-np.inf, np.inf if moved_s is None else moved_s)
        slip_end_s = oscillation.find_last_slip(before, release_s, period_s, noise)
        still_s = np.inf if slip_end_s is None else slip_end_s
    noise = noise_with_floor(third_difference_noise(table), stretch.channels.quantisation_m[0])
    stopped_s = find_stopped_table(table.between(still_s, np.inf), period_s, noise)
    end_s = min((end_s for end_s in (moved_s, stopped_s) if end_s is not None), default=None)
    if end_s is None:
        return stretch
    relative = None if stretch.relative is None else stretch.relative.between(-np.inf, end_s)
    release = replace(stretch.release, end_s=end_s)
    return replace(stretch, table=table.between(-np.inf, end_s), relative=relative, release=release)


def _moved_warning(release: Release) -> ResultWarning:
    template = N_(
        "the plate or the table was moved before the record ended: only readings until {after_s} s after the"
        " release are used. Leave the stand alone until the record has ended."
    )
    return result_warning("moved-again", template, after_s=format_number(release.end_s - release.time_s))


def _slip_by_gauge_2(
    stretch: _Stretch, relative: Channel, period_s: float, warnings: list[ResultWarning]
) -> tuple[_Stretch, _Slip, float, float]:
    """End of slip by gauge 2, and both gauges without their drift, which is returned (gauge 2, gauge 1)."""
    release_s = stretch.release.time_s
    slip = relative_to_table(stretch.table, relative, stretch.gauge_2_absolute)
    if stretch.gauge_2_absolute:
        start_s = slip.time_s[-1] - _NOISE_SHARE * (slip.time_s[-1] - slip.time_s[0])
        noise = detrended_noise(slip.between(start_s, np.inf), period_s)
    else:
        noise = third_difference_noise(slip)
    noise = max(noise, NOISE_FLOOR_M)
    end_s, tail = None, None
    for _ in range(2):  # the second time with the period of the tail
        end_s = oscillation.find_last_slip(slip, release_s, period_s, noise)
        tail = fit_tail(stretch.table, end_s, period_s)
        period_s = period_s if tail is None else tail.period_s
    occurs = end_s is None or end_s > release_s
    if tail is None:
        return stretch, _Slip(end_s, occurs, None, period_s), 0.0, 0.0
    at_rest = slip.between(tail.start_s, np.inf)
    table, table_drift = _without_table_drift(stretch, tail, warnings)
    if table_drift:
        refitted = fit_tail(table, tail.start_s, period_s)
        tail, period_s = refitted, period_s if refitted is None else refitted.period_s
    drift = 0.0
    if tail is not None:
        drift = _drift(2, relative, stretch.plateau_of(relative), at_rest, noise, warnings)
    if drift:
        relative = remove_drift(relative, drift, release_s)
    level = replace(stretch, table=table, relative=relative)
    return level, _Slip(end_s, occurs, tail, period_s), drift, table_drift


def _without_table_drift(
    stretch: _Stretch, tail: DampedCosine, warnings: list[ResultWarning]
) -> tuple[Channel, float]:
    """Gauge 1 without the drift that the tail leaves as residual, and that drift (m/s)."""
    table = stretch.table
    residual = Channel(table.between(tail.start_s, np.inf).time_s, tail.residual_m)
    drift = _drift(1, table, stretch.plateau_of(table), residual, NOISE_FLOOR_M, warnings)
    return (remove_drift(table, drift, stretch.release.time_s) if drift else table), drift


def _drift(
    gauge: int,
    channel: Channel,
    held: Channel | None,
    at_rest: Channel,
    noise_m: float,
    warnings: list[ResultWarning],
) -> float:
    """Steady drift (m/s); 0 where there is none, or none that is steady."""
    drift = find_drift(held, at_rest, noise_m)
    if drift != 0.0:
        warnings.append(drift_warning(gauge, channel, drift))
    return drift or 0.0


def _slip_by_table_alone(stretch: _Stretch, period_s: float) -> _Slip:
    """Without gauge 2 the last half of the motion is taken as tail until the joint fit determines it.

    Unless the whole motion is that of one mass: then nothing slipped that the table could show.
    """
    table, release_s = stretch.table, stretch.release.time_s
    late = fit_tail(table, 0.5 * (release_s + float(table.time_s[-1])), period_s)
    whole = fit_tail(table, release_s + _RELEASE_MARGIN_S, period_s)
    if whole is not None and _explains_first_swings(whole, late, stretch):
        return _Slip(None, False, whole, whole.period_s)
    return _Slip(None, True, late, period_s if late is None else late.period_s)


def _explains_first_swings(whole: DampedCosine, late: DampedCosine | None, stretch: _Stretch) -> bool:
    """Whether one decay leaves no more of the first swings than the late one of its own part: noise."""
    early = whole.residual_m[: int(_EARLY_PERIODS / whole.periods * len(whole.residual_m))]
    noise, count = third_difference_noise(stretch.table), len(early)
    if late is not None:
        noise, count = late.rms_m, len(late.residual_m)
    chance = float(np.exp(_CHANCE * np.sqrt(2.0 / len(early) + 2.0 / count)))
    floor = noise_with_floor(0.0, stretch.channels.quantisation_m[0]) ** 2
    return float(np.mean(early**2)) <= chance * noise**2 + floor


def _is_dead(stretch: _Stretch, slip: _Slip, warnings: list[ResultWarning]) -> bool:
    """Whether gauge 2 shows no slip though the table does not swing like a mass that never slips."""
    limit = _NEVER_SLIPS * third_difference_noise(stretch.table) + NOISE_FLOOR_M
    if slip.tail is None or slip.tail.rms_m <= limit:
        return False
    text = message(
        "gauge 2 shows no slip, but the table does not swing as one mass does: gauge 2 is taken as"
        " dead. The friction comes from the table channel alone."
    )
    warnings.append(ResultWarning("gauge-2-dead", text))
    return True


def _table_noise(stretch: _Stretch, slip: _Slip) -> tuple[tuple[float, int], Channel]:
    """Noise of gauge 1 in the hold and about the tail, the number of readings, and the readings to fit."""
    table, tail = stretch.table, slip.tail
    of_tail = (0.0, 0) if tail is None else (tail.rms_m, len(tail.residual_m))
    noise, count = pool_noise([_hold_noise(stretch, table, slip), of_tail], third_difference_noise(table))
    step_m = stretch.channels.quantisation_m[0]
    return (noise_with_floor(noise, step_m), count), merge_repeated_readings(table, noise, step_m)


def _relative_noise(stretch: _Stretch, slip: _Slip) -> tuple[tuple[float, int], Channel | None]:
    """The same of gauge 2, in the hold and after slip."""
    relative, step_m = stretch.relative, stretch.channels.quantisation_m[1]
    if relative is None:
        return (noise_with_floor(0.0, step_m), 0), None
    at_rest = (0.0, 0)
    if slip.end_s is not None and not stretch.gauge_2_absolute:
        rest = relative.between(slip.end_s, np.inf)
        at_rest = detrended_noise(rest, 0.5 * slip.period_s), len(rest)
    noise, count = pool_noise(
        [_hold_noise(stretch, relative, slip), at_rest], third_difference_noise(relative)
    )
    return (noise_with_floor(noise, step_m), count), merge_repeated_readings(relative, noise, step_m)


def _hold_noise(stretch: _Stretch, channel: Channel, slip: _Slip) -> tuple[float, int]:
    hold = stretch.plateau_of(channel)
    return (0.0, 0) if hold is None else (detrended_noise(hold, 0.5 * slip.period_s), len(hold))
