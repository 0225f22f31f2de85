"""Steady drift of a gauge, told from its readings while nothing slips."""

import numpy as np

from analysis.formatting import format_length
from analysis.preparation.channels import Channel
from analysis.quantities import ResultWarning
from messages.message import message

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
    """Say how gauge 1 or 2 drifts, and what is made of it."""
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
