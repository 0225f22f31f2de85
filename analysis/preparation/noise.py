"""White noise, steady drift and mains hum of a gauge, measured from its readings."""

import numpy as np

from analysis.arrays import Floats
from analysis.formatting import format_length
from analysis.preparation.channels import Channel
from analysis.quantities import ResultWarning
from messages.message import message

NOISE_FLOOR_M = 1e-9
"""Noise below this is not believed: the readings are computed, not measured."""
_SPECTRUM_READINGS_MIN = 30
_DITHER = 0.4
"""Noise above this share of the converter's step makes rounding errors independent."""


def detrended_noise(channel: Channel, block_s: float) -> float:
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


def third_difference_noise(channel: Channel) -> float:
    """Noise from third differences over all of the readings: slip and swing are smooth."""
    third = np.diff(channel.value_m, 3)
    return float(np.median(np.abs(third))) / 0.6745 / float(np.sqrt(20.0))


def pool_noise(found: list[tuple[float, int]], otherwise: float) -> tuple[float, int]:
    """Common standard deviation of several stretches; not of those that are noisier than the quietest.

    That is by a fifth at least, and by more than the number of readings lets it seem.
    """
    used = [(noise, count) for noise, count in found if count >= _SPECTRUM_READINGS_MIN]
    if not used:
        return otherwise, _SPECTRUM_READINGS_MIN
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

    A repeated reading repeats its rounding error, so it says nothing new; counted each time, a plate at
    rest would outvote its motion.
    """
    if noise_m > _DITHER * step_m or step_m < NOISE_FLOOR_M:
        return channel
    bounds = np.concatenate(([0], np.flatnonzero(np.diff(channel.value_m)) + 1, [len(channel)]))
    times = 0.5 * (channel.time_s[bounds[:-1]] + channel.time_s[bounds[1:] - 1])
    return Channel(times, channel.value_m[bounds[:-1]])


_DRIFT_SIGMAS = 6.0
"""So far from none the drift of all readings must be, ..."""
_STEADY_SIGMAS = 3.5
"""... and so far that of the later half. It is steady where its parts differ by less."""
_LINE_READINGS = 10


def find_drift(held: Channel | None, rest: Channel, noise_m: float) -> float | None:
    """Steady drift of a gauge (m/s): its slope after slip, where that stands out; 0 where it does not.

    None where it drifts, but neither alike in both halves of `rest` nor as before the release: it has
    not one drift then. A late slip too small to be seen moves the first half only, and is no drift.
    """
    whole, half = _line(rest, noise_m), _line(_later_half(rest), noise_m)
    if abs(whole[0]) < _DRIFT_SIGMAS * whole[1] or abs(half[0]) < _STEADY_SIGMAS * half[1]:
        return 0.0
    others = [half] if held is None or len(held) < _LINE_READINGS else [half, _line(held, noise_m)]
    steady = all(abs(whole[0] - slope) < _STEADY_SIGMAS * deviation for slope, deviation in others)
    return whole[0] if steady else None


def drift_warning(gauge: int, channel: Channel, drift_m_per_s: float | None) -> ResultWarning:
    """Warning of the drift of gauge 1 or 2; None as drift means that it is not steady."""
    if drift_m_per_s is None:
        text = message(
            "gauge {gauge} drifts or jumps after slip, not steadily: f_d may be biased. Let the"
            " amplifier warm up.",
            gauge=gauge,
        )
    else:
        moved_m = abs(drift_m_per_s) * float(channel.time_s[-1] - channel.time_s[0])
        text = message(
            "gauge {gauge} drifts by {drift_m_per_s}/s, {moved_m} in this record: the drift is taken"
            " off. Let the amplifier warm up.",
            gauge=gauge,
            drift_m_per_s=format_length(drift_m_per_s),
            moved_m=format_length(moved_m),
        )
    return ResultWarning(f"gauge-{gauge}-drifts", text)


def remove_drift(channel: Channel, drift_m_per_s: float, zero_s: float) -> Channel:
    """Readings without a drift that is zero at `zero_s`."""
    return Channel(channel.time_s, channel.value_m - drift_m_per_s * (channel.time_s - zero_s))


def _later_half(channel: Channel) -> Channel:
    return channel.between(0.5 * float(channel.time_s[0] + channel.time_s[-1]), np.inf)


def _line(channel: Channel, noise_m: float) -> tuple[float, float]:
    """Slope of readings in time and its standard uncertainty from their scatter, `noise_m` at least."""
    t = channel.time_s - channel.time_s.mean()
    slope, level = np.polyfit(t, channel.value_m, 1)
    scatter = max(noise_m, float(np.std(channel.value_m - slope * t - level)))
    return float(slope), scatter / float(np.sqrt(t @ t))


MAINS_HZ = (50.0, 60.0)
_BESIDE_HZ = (35.0, 42.5, 55.0, 67.5, 75.0)
_HUM_BLOCK_S = 0.4
"""Whole cycles of 50, 60 and of all the frequencies beside them."""
_BLOCKS = 25
_REMAINING_POWER = (1.0 - np.sinc(np.array([*MAINS_HZ, *_BESIDE_HZ]) / MAINS_HZ[0])) ** 2
"""What taking off means over a cycle, twice, leaves of each frequency."""
_BLOCK_READINGS_MIN = 20
_HUM_RATIO_MIN = 8.0
"""Mean power of the mains over that beside them."""
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
    text = message(
        "gauge {gauge} hums at {hum:.0f} Hz by {hum_2}: f_d may be biased. Check its shield and the ground"
        " of the amplifier.",
        gauge=gauge,
        hum=hum[0],
        hum_2=format_length(hum[1]),
    )
    return ResultWarning("mains-hum", text)


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
    turns = np.exp(2j * np.pi * np.outer((*MAINS_HZ, *_BESIDE_HZ), block.time_s))
    return np.asarray(2.0 / len(block) * np.abs(turns @ block.value_m)) / _REMAINING_POWER


def _means(channel: Channel, window_s: float) -> Floats:
    """Mean of the readings within half of `window_s` of each."""
    t, x = channel.time_s, channel.value_m
    half_s = 0.5 * window_s * (1.0 + 1e-6)  # even windows, whatever rounding does to times
    first, last = np.searchsorted(t, t - half_s), np.searchsorted(t, t + half_s, "right")
    sums = np.concatenate(([0.0], np.cumsum(x - x.mean())))
    return np.asarray((sums[last] - sums[first]) / (last - first) + x.mean())
