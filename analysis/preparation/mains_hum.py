"""Hum of the mains in the readings of a gauge: told from the motion, and averaged out to find the release."""

import numpy as np

from analysis.arrays import Floats
from analysis.formatting import format_length
from analysis.preparation.channels import Channel
from analysis.quantities import ResultWarning
from messages.message import message

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


def hum_warning(gauge: str, hum: tuple[float, float]) -> ResultWarning:
    """Say that a gauge hums."""
    text = message(
        "{gauge} hums at {hum:.0f} Hz by {hum_2}: f_d may be biased. Check its shield and the ground"
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
