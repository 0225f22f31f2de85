"""Readings of the gauges: invalid ones left out; noise, drift and mains hum measured."""

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from analysis.arrays import Floats
from analysis.formatting import format_length, format_number
from analysis.preparation.sums import (
    median_of_five,
    off_cubic,
    wave_amplitudes,
    widest_intervals,
    window_means,
)
from analysis.quantities import ResultWarning, result_warning
from analysis.record import Record, RecordError, StandMasses
from messages.i18n import N_
from messages.message import Message, message

_Time = TypeVar("_Time", float, Floats)
DELAY_MAX_S = 0.5  # a gauge later than this is not read in the same test
SAMPLES_MIN = 50  # with fewer readings a decay cannot be distinguished from noise or drift


@dataclass(frozen=True, eq=False, slots=True)
class Channel:
    """Valid readings of one gauge: `time_s` (n,) from the record's first sample, and `value_m` (n,)."""

    time_s: Floats
    value_m: Floats

    def __len__(self) -> int:
        return len(self.time_s)

    def between(self, start_s: float, end_s: float) -> "Channel":
        """Readings with start_s <= time < end_s."""
        first, last = np.searchsorted(self.time_s, (start_s, end_s))
        return Channel(self.time_s[first:last], self.value_m[first:last])

    def scaled(self, factor: float) -> "Channel":
        """The same where `factor` is 1."""
        return self if factor == 1.0 else Channel(self.time_s, self.value_m * factor)


@dataclass(frozen=True, eq=False, slots=True)
class Channels:
    """Both gauges on true time."""

    table: Channel  # gauge 1
    relative: Channel | None
    """Gauge 2 as it reads (against the table, or against the base where `Record` says so)."""
    origin_s: float  # record time of the first sample
    clock_scale: float  # true seconds per second of the record
    interval_s: float  # median time between rows
    quantisation_m: tuple[float, float]  # smallest step of each gauge's readings

    def to_record_time(self, time_s: _Time) -> _Time:
        """Time in the base of `Record.time_s`."""
        return self.origin_s + time_s / self.clock_scale

    def from_record_time(self, time_s: _Time) -> _Time:
        """True seconds since the first sample, of times in the base of `Record.time_s`."""
        return (time_s - self.origin_s) * self.clock_scale


def read_channels(record: Record) -> tuple[Channels, list[ResultWarning]]:
    """Check `record` and take its valid readings; the warnings say what was left out, and why.

    Raises RecordError for times that go back, columns of unequal length, masses or clock that cannot be, and
    no valid reading.
    """
    check_masses(record.masses)
    check_gauges(record)
    _check_columns(record)
    time_s = (record.time_s - record.time_s[0]).astype(np.float64, copy=False)
    time_s *= record.clock_scale
    warnings: list[ResultWarning] = []
    table_valid = _valid(
        record.table_displacement_m, record.table_overload, record.table_gauge.range_m, gauge=1
    )
    table = _chosen(record.table_displacement_m, table_valid, time_s, record.table_gauge.lateness_s)
    relative = None
    if record.relative_displacement_m is not None:
        relative = _relative(record, record.relative_displacement_m, time_s, warnings)
    steps = (quantisation_m(table.value_m), 0.0 if relative is None else quantisation_m(relative.value_m))
    channels = Channels(
        table, relative, float(record.time_s[0]), record.clock_scale, float(np.median(np.diff(time_s))), steps
    )
    return channels, warnings


def check_masses(masses: StandMasses) -> None:
    """Raise RecordError unless masses and gravity are positive and finite."""
    for name in ("table_mass_kg", "plate_mass_kg", "gravity_m_per_s2"):
        value = getattr(masses, name)
        if not (np.isfinite(value) and value > 0.0):
            template = N_("{name} = {value!r} is not a positive number. Give the stand's true value.")
            raise RecordError(template, name=name, value=value)
        stated = name.replace("_kg", "_uncertainty_kg").replace("gravity_", "gravity_uncertainty_")
        _check_not_negative(stated, getattr(masses, stated))


def check_gauges(record: Record) -> None:
    """Raise RecordError unless what is stated of gauges, clock and pullback can be."""
    _check_not_negative("clock_scale_uncertainty", record.clock_scale_uncertainty)
    for gauge, known in (("table_gauge", record.table_gauge), ("relative_gauge", record.relative_gauge)):
        _check_not_negative(f"{gauge}.gain_relative", known.gain_relative or 0.0)
        _check_not_negative(f"{gauge}.nonlinearity_m", known.nonlinearity_m)
        _check_not_negative(f"{gauge}.delay_s_uncertainty", known.delay_s_uncertainty)
        if not abs(known.delay_s) <= DELAY_MAX_S:
            template = N_("{gauge}.delay_s = {delay_s!r} is not within {delay_max_s:g} s. Measure it anew.")
            raise RecordError(template, gauge=gauge, delay_s=known.delay_s, delay_max_s=DELAY_MAX_S)
        if known.range_m is not None and not known.range_m > 0.0:
            template = N_("{gauge}.range_m = {range_m!r} is not positive. Give the range, or none.")
            raise RecordError(template, gauge=gauge, range_m=known.range_m)
    if record.pullback_m is not None and not np.isfinite(record.pullback_m):
        template = N_("pullback_m = {pullback_m!r} is not a number. Give the pullback, or none.")
        raise RecordError(template, pullback_m=record.pullback_m)


def quantisation_m(value_m: Floats) -> float:
    """Smallest step between different readings (m): their resolution, where they are quantised."""
    steps = np.diff(np.unique(value_m))
    return float(steps.min()) if len(steps) else 0.0


def _check_not_negative(name: str, value: float) -> None:
    if not (np.isfinite(value) and value >= 0.0):
        template = N_("{name} = {value!r} is not zero or a positive number. State it, or leave it out.")
        raise RecordError(template, name=name, value=value)


def _check_columns(record: Record) -> None:
    time_s = record.time_s
    if len(time_s) < SAMPLES_MIN:
        template = N_("the record has {count} samples, too short for a decay. Record from the hold to rest.")
        raise RecordError(template, count=len(time_s))
    for name in ("table_displacement_m", "relative_displacement_m", "table_overload", "relative_overload"):
        column = getattr(record, name)
        if column is not None and len(column) != len(time_s):
            template = N_("{name} has {count} values for {times} times. Give one for each time.")
            raise RecordError(template, name=name, count=len(column), times=len(time_s))
    if not (np.isfinite(record.clock_scale) and 0.5 < record.clock_scale < 2.0):
        template = N_("clock_scale = {clock_scale!r} is not near 1. Check the clock fit of the run.")
        raise RecordError(template, clock_scale=record.clock_scale)
    _check_times(time_s)


def _check_times(time_s: Floats) -> None:
    if not np.isfinite(time_s).all():
        row = int(np.flatnonzero(~np.isfinite(time_s))[0])
        raise RecordError(
            "time_s[{row}] is {time_s}. Leave out rows without a time.", row=row, time_s=time_s[row]
        )
    steps = np.diff(time_s)
    if (steps <= 0.0).any():
        row = int(np.flatnonzero(steps <= 0.0)[0]) + 1
        raise RecordError(
            "time goes back at row {row}: {before_s} s, then {after_s} s. Sort the rows, or"
            " take one stretch of them.",
            row=row,
            before_s=format_number(time_s[row - 1], 15),
            after_s=format_number(time_s[row], 15),
        )


def _valid(
    value_m: Floats, overload: NDArray[np.bool_] | None, range_m: float | None, gauge: int
) -> NDArray[np.bool_]:
    present = np.isfinite(value_m)
    if not present.any():
        template = N_("gauge {gauge} holds no reading (all are NaN). Check its cable and the import column.")
        raise RecordError(template, gauge=gauge)
    valid = present.copy()
    if overload is not None:
        valid &= ~overload
    if range_m is not None:
        valid[present] &= np.abs(value_m[present]) < range_m
    if int(valid.sum()) < SAMPLES_MIN:
        template = N_(
            "gauge {gauge} has {count} valid readings of {total}, the rest missing or clipped."
            " Re-centre the gauge or choose a wider range, and record again."
        )
        raise RecordError(template, gauge=gauge, count=int(valid.sum()), total=len(value_m))
    return valid


def _relative(
    record: Record, value_m: Floats, time_s: Floats, warnings: list[ResultWarning]
) -> Channel | None:
    gauge = record.relative_gauge
    try:
        valid = _valid(value_m, record.relative_overload, gauge.range_m, gauge=2)
    except RecordError as error:
        template = N_("{error} The friction comes from the table channel alone.")
        warnings.append(result_warning("gauge-2-absent", template, error=error))
        return None
    return _chosen(value_m, valid, time_s, gauge.lateness_s)


def _chosen(value_m: Floats, valid: NDArray[np.bool_], time_s: Floats, lateness_s: float) -> Channel:
    """The valid readings on true time; no copies where none is needed, as of a million readings."""
    whole = bool(valid.all())
    times = time_s if whole else time_s[valid]
    values = np.require(value_m if whole else value_m[valid], np.float64, ("C", "W"))
    return Channel(times - lateness_s if lateness_s else times, values)


_SPIKE_SIGMAS = 9.0
_SPIKE_SHARE_MAX = 0.02
"""More readings than this do not stand out by accident: they are not spikes but something else."""
_PASSES = 8
_NEIGHBOURS = np.array([-2, -1, 1, 2])
_WIDE = 4.0
"""A distance from the median of five beyond so many times what 97 % of the readings keep is a spike."""
_JUMP = 0.6  # a motion that starts or stops goes a third of its next step at most in the first
_NOISELESS_M = 2e-8  # scatter of readings that are computed, not measured
_FROZEN_RUN = 8
_FROZEN_MAX = 0.2  # a gauge that stands still for longer than this share of the record is at rest
_CLIPPED_RUN = 4
_READINGS_MIN = 16
_GAP = 3.5  # readings this many median intervals apart are no neighbours
_KINK_M_PER_S2 = 4.0
"""A jump of acceleration, of 20 m/s2 at most, moves a reading off the cubic by a tenth of it times an
interval squared; intervals are not all alike."""
_REPEATS_MAX = 0.05  # a converter that repeats more of its readings than this is merely coarse


def remove_invalid_readings(channel: Channel, gauge: int, warnings: list[ResultWarning]) -> Channel:
    """Leave out what the gauge cannot have seen, with a warning for each kind."""
    repeated = np.concatenate(([False], np.diff(channel.value_m) == 0.0))
    clipped = _clipped(channel.value_m, repeated)
    frozen = _frozen(channel, repeated) & ~clipped
    kinds = (
        ("clipped", clipped, message("stand still at the end of its range")),
        ("frozen", frozen, message("repeat the one before exactly, at length")),
    )
    bad = np.zeros(len(channel), dtype=bool)
    for code, found, what in kinds:
        if found.any():
            warnings.append(_warning(code, gauge, int(found.sum()), len(channel), what))
            bad |= found
    channel = Channel(channel.time_s[~bad], channel.value_m[~bad]) if bad.any() else channel
    spikes = _spikes(channel)
    if not spikes.any():
        return channel
    what = message(
        "stand out from their neighbours by over {sigmas:.0f} standard deviations", sigmas=_SPIKE_SIGMAS
    )
    warnings.append(_warning("spikes", gauge, int(spikes.sum()), len(channel), what))
    return Channel(channel.time_s[~spikes], channel.value_m[~spikes])


def _warning(code: str, gauge: int, count: int, total: int, what: Message) -> ResultWarning:
    template = N_("{count} of {total} readings of gauge {gauge} {what}: they are left out.")
    return result_warning(code, template, count=count, total=total, gauge=gauge, what=what)


def _long_runs(member: NDArray[np.bool_], length: int) -> list[tuple[int, int]]:
    """(first, past the last) of runs of at least `length` members."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], member, [False])).astype(np.int8)))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a >= length]


def _clipped(x: Floats, repeated: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Readings at the largest or smallest value, where that is reached and held more than once."""
    clipped = np.zeros(len(x), dtype=bool)
    for extreme in (x.max(), x.min()):
        at = x == extreme
        elsewhere = repeated & ~at
        if len(_long_runs(at, _CLIPPED_RUN)) > 1 and elsewhere.mean() < _REPEATS_MAX:
            clipped |= at
    return clipped


def _frozen(channel: Channel, repeated: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Readings in long runs of one value, where readings seldom repeat.

    Readings without noise, or with less than a converter's step, may repeat at rest; there a run counts
    only if it begins or ends with a jump.
    """
    x = channel.value_m
    frozen = np.zeros(len(x), dtype=bool)
    runs = _long_runs(repeated, _FROZEN_RUN - 1)
    inside = sum(b - a for a, b in runs)
    if not runs or repeated.sum() - inside > _REPEATS_MAX * len(x) or inside > _FROZEN_MAX * len(x):
        return frozen
    noise, step = 1.4826 * float(np.median(np.abs(np.diff(x, 6)))) / float(np.sqrt(924.0)), quantisation_m(x)
    may_repeat = noise < max(_NOISELESS_M, step)
    smallest, whole_s = _NOISELESS_M + 2.0 * step, _GAP * float(np.median(np.diff(channel.time_s)))
    for first, past in runs:
        before, after = slice(max(0, first - 3), first), slice(past - 1, past + 2)
        steps_out = [
            (np.diff(x[end])[::order], np.diff(channel.time_s[end])[::order])
            for end, order in ((before, -1), (after, 1))
        ]
        if not may_repeat or any(_jumps(*out, smallest, whole_s) for out in steps_out):
            frozen[first - 1 : past] = True
    return frozen


def _jumps(steps: Floats, times: Floats, smallest: float, whole_s: float) -> bool:
    """Whether the first of two steps out of a run is not the start of a motion; unknown across a gap."""
    if len(steps) < 2 or times.max() > whole_s or abs(steps[0]) <= smallest:
        return False
    back = steps[0] * steps[1] < 0.0 and abs(steps[1]) > _JUMP * abs(steps[0])  # that is a spike
    return not back and bool(abs(steps[0] / times[0]) > _JUMP * abs(steps[1] / times[1]))


def _spikes(channel: Channel) -> NDArray[np.bool_]:
    """Readings far from their neighbours; slow motion passes unnoticed, and so do kinks of it and gaps."""
    x = channel.value_m
    found = np.zeros(len(x), dtype=bool)
    if len(x) < _READINGS_MIN:
        return found
    widest_s = widest_intervals(channel.time_s)
    even = widest_s < _GAP * float(np.median(np.diff(channel.time_s)))
    # What a kink in the motion (a slip that begins or ends) or a converter's step may look like.
    coarse = float(np.quantile(np.abs(np.diff(x, 2)), 0.9)) + 3.0 * quantisation_m(x)
    kink = coarse + _KINK_M_PER_S2 * np.where(even, widest_s, 0.0) ** 2
    off = np.where(even, x - median_of_five(x), 0.0)
    found |= np.abs(off) > _WIDE * (float(np.quantile(np.abs(off), 0.97)) + kink)
    smooth = x.copy()
    if found.any():
        smooth[found] = np.interp(channel.time_s[found], channel.time_s[~found], x[~found])
    for _ in range(_PASSES):
        off = off_cubic(channel.time_s, smooth)
        size = np.abs(off)
        typical = float(np.median(size[even]))
        far = np.flatnonzero((size > _SPIKE_SIGMAS * 1.4826 * typical + kink) & even)  # none at the ends
        spikes = far[(size[far] >= size[far + _NEIGHBOURS[:, None]]).all(axis=0)]
        if not len(spikes):
            break
        smooth[spikes] -= off[spikes]
        found[spikes] = True
    if found.mean() > _SPIKE_SHARE_MAX:
        found[:] = False
    return found


NOISE_FLOOR_M = 1e-9  # noise below this is not believed: the readings are computed, not measured
_POOLED_READINGS_MIN = 30
_BLOCK_MIN = 6  # readings: with fewer about a line their scatter is hardly known
_DITHER = 0.4  # noise above this share of the converter's step makes rounding errors independent


def detrended_noise(channel: Channel, block_s: float) -> float:
    """Standard deviation of readings at rest about straight lines over blocks: drift does not count."""
    if len(channel) < _BLOCK_MIN:
        return 0.0
    edges = np.arange(channel.time_s[0], channel.time_s[-1], block_s)
    firsts = np.unique(np.concatenate(([0], np.searchsorted(channel.time_s, edges[1:]))))
    counts = np.diff(np.append(firsts, len(channel)))

    def about_mean(values: Floats) -> Floats:
        return values - np.repeat(np.add.reduceat(values, firsts) / counts, counts)

    t, x = about_mean(channel.time_s), about_mean(channel.value_m)
    slopes = np.add.reduceat(t * x, firsts) / (np.add.reduceat(t * t, firsts) + (counts == 1))
    squares = np.add.reduceat((x - np.repeat(slopes, counts) * t) ** 2, firsts)
    used = counts >= _BLOCK_MIN
    return float(np.sqrt(squares[used].sum() / (counts[used] - 2).sum())) if used.any() else 0.0


def third_difference_noise(channel: Channel) -> float:
    """Noise from third differences over all of the readings: slip and swing are smooth."""
    third = np.diff(channel.value_m, 3)
    return float(np.median(np.abs(third))) / 0.6745 / float(np.sqrt(20.0))


def pool_noise(found: list[tuple[float, int]], otherwise: float) -> tuple[float, int]:
    """Common standard deviation of several stretches; not of those that are noisier than the quietest.

    That is by a fifth at least, and by more than the number of readings lets it seem.
    """
    used = [(noise, count) for noise, count in found if count >= _POOLED_READINGS_MIN]
    if not used:
        return otherwise, _POOLED_READINGS_MIN
    least, fewest = min(used)
    chance = [float(np.exp(5.0 * np.sqrt(0.5 / fewest + 0.5 / count))) for _, count in used]
    limits = [max(1.2, by_chance) * least + NOISE_FLOOR_M for by_chance in chance]
    used = [pair for pair, limit in zip(used, limits, strict=True) if pair[0] <= limit]
    total = sum(count for _, count in used)
    return float(np.sqrt(sum(noise**2 * count for noise, count in used) / total)), total


def noise_with_floor(noise_m: float, step_m: float) -> float:
    """Return `noise_m`, or that of rounding to steps of `step_m` where this is larger."""
    return max(noise_m, step_m / float(np.sqrt(12.0)), NOISE_FLOOR_M)


def merge_repeated_readings(channel: Channel, noise_m: float, step_m: float) -> Channel:
    """Readings of a converter coarser than the noise with each run of equal ones as a single reading.

    A repeated reading repeats its rounding error, so it adds no information. Counted each time, a
    plate at rest would outweigh its motion.
    """
    if noise_m > _DITHER * step_m or step_m < NOISE_FLOOR_M:
        return channel
    bounds = np.concatenate(([0], np.flatnonzero(np.diff(channel.value_m)) + 1, [len(channel)]))
    times = 0.5 * (channel.time_s[bounds[:-1]] + channel.time_s[bounds[1:] - 1])
    return Channel(times, channel.value_m[bounds[:-1]])


_DRIFT_SIGMAS = 6.0  # so far from none the drift of all readings must be, ..
_STEADY_SIGMAS = 3.5  # ... and so far that of the later half. It is steady where its parts differ by less.
_LINE_READINGS = 10


def find_drift(held: Channel | None, rest: Channel, noise_m: float) -> float | None:
    """Steady drift of a gauge (m/s): its slope after slip, where that stands out; 0 where it does not.

    None where it drifts, but neither alike in both halves of `rest` nor as before the release: it has
    not one drift then. A late slip too small to be seen moves the first half only, and is no drift.
    """
    later_half = rest.between(0.5 * float(rest.time_s[0] + rest.time_s[-1]), np.inf)
    whole, half = _line(rest, noise_m), _line(later_half, noise_m)
    if abs(whole[0]) < _DRIFT_SIGMAS * whole[1] or abs(half[0]) < _STEADY_SIGMAS * half[1]:
        return 0.0
    others = [half] if held is None or len(held) < _LINE_READINGS else [half, _line(held, noise_m)]
    steady = all(abs(whole[0] - slope) < _STEADY_SIGMAS * deviation for slope, deviation in others)
    return whole[0] if steady else None


def drift_warning(gauge: int, channel: Channel, drift_m_per_s: float | None) -> ResultWarning:
    """Warning of the drift of gauge 1 or 2; None as drift means that it is not steady."""
    code = f"gauge-{gauge}-drifts"
    if drift_m_per_s is None:
        template = N_(
            "gauge {gauge} drifts or jumps after slip, not steadily: f_d may be biased. Let the"
            " amplifier warm up."
        )
        return result_warning(code, template, gauge=gauge)
    template = N_(
        "gauge {gauge} drifts by {drift_m_per_s}/s, {moved_m} in this record: the drift is taken"
        " off. Let the amplifier warm up."
    )
    drift, moved_m = format_length(drift_m_per_s), abs(drift_m_per_s) * float(np.ptp(channel.time_s))
    return result_warning(code, template, gauge=gauge, drift_m_per_s=drift, moved_m=format_length(moved_m))


def remove_drift(channel: Channel, drift_m_per_s: float, zero_s: float) -> Channel:
    """Readings without a drift that is zero at `zero_s`."""
    return Channel(channel.time_s, channel.value_m - drift_m_per_s * (channel.time_s - zero_s))


def _line(channel: Channel, noise_m: float) -> tuple[float, float]:
    """Slope of readings in time and its standard uncertainty from their scatter, `noise_m` at least."""
    t, x = channel.time_s - channel.time_s.mean(), channel.value_m - channel.value_m.mean()
    square = float(t @ t)
    slope = float(t @ x) / square
    scatter = max(noise_m, float(np.std(x - slope * t)))
    return slope, scatter / float(np.sqrt(square))


MAINS_HZ = (50.0, 60.0)
_BESIDE_HZ = (35.0, 42.5, 55.0, 67.5, 75.0)
_HUM_BLOCK_S = 0.4  # whole cycles of 50, 60 and of all the frequencies beside them
_BLOCKS = 25
_HUM_HZ = np.array([*MAINS_HZ, *_BESIDE_HZ])
_REMAINING_POWER = (1.0 - np.sinc(_HUM_HZ / MAINS_HZ[0])) ** 2
"""What taking off means over a cycle, twice, leaves of each frequency."""
_BLOCK_READINGS_MIN = 20
_HUM_RATIO_MIN = 8.0  # mean power of the mains over that beside them
_NOTHING_M = 1e-7
_DISTURBS = 0.002
"""Hum of less than this share of the widest swing does not disturb the search for the release."""


def detect_hum(channel: Channel) -> tuple[float, float] | None:
    """Frequency (Hz) and amplitude (m) of the mains in the readings; None where they do not stand out."""
    powers = _powers(channel)
    if powers is None:
        return None
    beside = max(float(np.median(powers[len(MAINS_HZ) :])), _NOTHING_M**2)
    strongest = int(np.argmax(powers[: len(MAINS_HZ)]))
    if powers[strongest] <= _HUM_RATIO_MIN * beside:
        return None
    return MAINS_HZ[strongest], float(np.sqrt(powers[strongest]))


def remove_hum(channel: Channel, hum: tuple[float, float] | None) -> Channel:
    """Means over a cycle of both mains, where `hum` is wide enough to pass for motion; for finding things."""
    if hum is None or hum[1] < _DISTURBS * float(np.ptp(channel.value_m)):
        return channel
    for frequency in MAINS_HZ:
        channel = Channel(channel.time_s, _means(channel, 1.0 / frequency))
    return channel


def hum_warning(gauge: int, hum: tuple[float, float]) -> ResultWarning:
    """Warning of mains hum, given frequency (Hz) and amplitude (m)."""
    template = N_(
        "gauge {gauge} hums at {hum:.0f} Hz by {hum_2}: f_d may be biased. Check its shield and the ground"
        " of the amplifier."
    )
    return result_warning("mains-hum", template, gauge=gauge, hum=hum[0], hum_2=format_length(hum[1]))


def _powers(channel: Channel) -> Floats | None:
    """Squared amplitudes at the mains and beside them, typical of blocks of whole cycles; None for few."""
    still = Channel(channel.time_s, channel.value_m - _means(channel, 1.0 / MAINS_HZ[0]))
    still = Channel(still.time_s, still.value_m - _means(still, 1.0 / MAINS_HZ[0]))
    starts = np.arange(channel.time_s[0], channel.time_s[-1] - _HUM_BLOCK_S, _HUM_BLOCK_S)
    chosen = starts[:: max(1, len(starts) // _BLOCKS)]
    found = [_amplitudes(still.between(start, start + _HUM_BLOCK_S)) for start in chosen]
    whole = [amplitudes for amplitudes in found if amplitudes is not None]
    return np.median(np.square(whole), axis=0) if len(whole) > 1 else None


def _amplitudes(block: Channel) -> Floats | None:
    """Amplitudes at all frequencies; None for a block with a gap."""
    steps = np.diff(block.time_s)
    if len(block) < _BLOCK_READINGS_MIN or steps.max() > 0.1 * _HUM_BLOCK_S:
        return None
    return wave_amplitudes(block.time_s, block.value_m, _HUM_HZ) / _REMAINING_POWER


def _means(channel: Channel, window_s: float) -> Floats:
    """Mean of the readings within half of `window_s` of each."""
    half_s = 0.5 * window_s * (1.0 + 1e-6)  # even windows, whatever rounding does to times
    return window_means(channel.time_s, channel.value_m, half_s)
