"""Readings that are none: spikes, frozen stretches and clipped tops, left out and said."""

import numpy as np
from numpy.typing import NDArray

from analysis.arrays import Floats
from analysis.preparation.channels import Channel, quantisation_m
from analysis.quantities import ResultWarning
from messages.message import Message, message

_SPIKE_SIGMAS = 9.0
_SPIKE_SHARE_MAX = 0.02
"""More readings than this do not stand out by accident: they are not spikes but something else."""
_PASSES = 8
_WIDE = 4.0
"""A distance from the median of five beyond so many times what 97 % of the readings keep is a spike."""
_JUMP = 0.6
"""A motion that starts or stops goes a third of its next step at most in the first."""
_NOISELESS_M = 2e-8
"""Scatter of readings that are computed, not measured."""
_FROZEN_RUN = 8
_FROZEN_MAX = 0.2
"""A gauge that stands still for longer than this share of the record is at rest."""
_CLIPPED_RUN = 4
_READINGS_MIN = 16
_GAP = 3.5
"""Readings this many median intervals apart are no neighbours."""
_EVEN = 35.0 / 18.0
"""1 + sum of squared weights of the cubic at even times."""
_KINK_M_PER_S2 = 4.0
"""A jump of acceleration, of 20 m/s2 at most, moves a reading off the cubic by a tenth of it times an
interval squared; intervals are not all alike."""
_REPEATS_MAX = 0.05
"""A converter that repeats more of its readings than this is merely coarse."""


def remove_invalid_readings(channel: Channel, gauge: int, warnings: list[ResultWarning]) -> Channel:
    """Leave out what the gauge cannot have seen, with a warning for each kind."""
    repeated = _repeated(channel.value_m)
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
    return ResultWarning(
        code,
        message(
            "{count} of {total} readings of gauge {gauge} {what}: they are left out.",
            count=count,
            total=total,
            gauge=gauge,
            what=what,
        ),
    )


def _repeated(x: Floats) -> NDArray[np.bool_]:
    """True for a reading that equals the one before."""
    return np.concatenate(([False], np.diff(x) == 0.0))


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
    weights, widest_s = _cubic(channel.time_s)
    even = widest_s < _GAP * float(np.median(np.diff(channel.time_s)))
    # What a kink in the motion (a slip that begins or ends) or a converter's step may look like.
    coarse = float(np.quantile(np.abs(np.diff(x, 2)), 0.9)) + 3.0 * quantisation_m(x)
    kink = coarse + _KINK_M_PER_S2 * np.where(even, widest_s, 0.0) ** 2
    off = np.where(even, x - _median_of_five(x), 0.0)
    found |= np.abs(off) > _WIDE * (float(np.quantile(np.abs(off), 0.97)) + kink)
    smooth = np.where(found, np.interp(channel.time_s, channel.time_s[~found], x[~found]), x)
    for _ in range(_PASSES):
        off = _off_cubic(smooth, weights)
        limit = _SPIKE_SIGMAS * 1.4826 * float(np.median(np.abs(off[even]))) + kink
        largest = np.abs(off)
        for shift in (-2, -1, 1, 2):
            largest = np.maximum(largest, np.abs(np.roll(off, shift)))
        spikes = (np.abs(off) > limit) & (np.abs(off) >= largest) & even
        if not spikes.any():
            break
        smooth[spikes] -= off[spikes]
        found |= spikes
    if found.mean() > _SPIKE_SHARE_MAX:
        found[:] = False
    return found


def _median_of_five(x: Floats) -> Floats:
    padded = np.concatenate((x[:1], x[:1], x, x[-1:], x[-1:]))
    return np.asarray(np.median(np.lib.stride_tricks.sliding_window_view(padded, 5), axis=1))


def _cubic(time_s: Floats) -> tuple[Floats, Floats]:
    """Weights (4, n) of four neighbours in the cubic through them, and the widest interval among them (s)."""
    widest_s = np.full(len(time_s), np.inf)
    weights = np.zeros((4, len(time_s)))
    windows = np.lib.stride_tricks.sliding_window_view(time_s, 5)
    widest_s[2:-2] = np.diff(windows, axis=1).max(axis=1)
    away = windows[:, (0, 1, 3, 4)] - windows[:, 2:3]
    for j in range(4):
        others = np.delete(away, j, axis=1)
        weights[j, 2:-2] = np.prod(others / (others - away[:, j : j + 1]), axis=1)
    return weights, widest_s


def _off_cubic(x: Floats, weights: Floats) -> Floats:
    """Reading minus the cubic through its four neighbours, in the scale of even times; zero at the ends."""
    off = np.zeros_like(x)
    curve = sum(w[2:-2] * y for w, y in zip(weights, (x[:-4], x[1:-3], x[3:-1], x[4:]), strict=True))
    off[2:-2] = (x[2:-2] - curve) * np.sqrt(_EVEN / (1.0 + np.sum(weights[:, 2:-2] ** 2, axis=0)))
    return off
