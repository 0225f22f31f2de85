"""Noise of readings: about lines, by third differences, and pooled over the quiet stretches of a record."""

import numpy as np

from analysis.preparation.channels import Channel

NOISE_FLOOR_M = 1e-9
"""Noise below this is not believed: the readings are computed, not measured."""
_READINGS_MIN = 30
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
    used = [(noise, count) for noise, count in found if count >= _READINGS_MIN]
    if not used:
        return otherwise, _READINGS_MIN
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
