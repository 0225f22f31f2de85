"""End of a free decay before that of the record: a hand that moves the plate or stops the table."""

from itertools import pairwise

import numpy as np

from analysis.preparation.channels import Channel
from analysis.preparation.oscillation import quarter_steps

_REST_PERIODS = 2.0
"""A plate at rest for so long never slips again: it would have done so in one of these swings."""
_MOVED = 0.05  # share of the travel of gauge 2 that a plate put back moves by at the least
_MOVED_SIGMAS = 10.0
_LOSS_FACTOR = 3.0  # no damping makes a swing lose more as it becomes smaller
_LOSS_SIGMAS = 12.0  # the range of a period's readings scatters by some standard deviations of the noise
_ONSET = 2  # periods over which a hand takes hold
_SWINGS_MIN = 4


def find_moved_plate(relative: Channel, release_s: float, period_s: float, noise_m: float) -> float | None:
    """Time before which a plate at rest was not yet moved again, or None.

    `relative` is the plate against the table.
    """
    quarters = quarter_steps(relative, release_s, period_s, noise_m)
    if quarters is None:
        return None
    ends, moved = quarters
    places = np.concatenate(([0], np.flatnonzero(moved) + 1))
    for before, after in pairwise(places.tolist()):
        rest_s = float(ends[after - 1] - ends[before])
        if rest_s < (_REST_PERIODS + 1.0) * period_s:
            continue
        end_s = float(ends[after]) - period_s  # a hand begins slowly
        rest = relative.between(float(ends[before]), end_s)
        later = relative.between(float(ends[after]), np.inf)
        shift_m = abs(float(np.median(later.value_m)) - float(np.median(rest.value_m)))
        if shift_m > max(_MOVED * float(np.ptp(relative.value_m)), _MOVED_SIGMAS * noise_m):
            return end_s
    return None


def find_stopped_table(tail: Channel, period_s: float, noise_m: float) -> float | None:
    """Time before which a table that swings freely was not yet stopped, or None.

    `tail` is gauge 1 without slip. A swing that decays freely loses less and less from period to period.
    """
    edges = np.arange(tail.time_s[0], tail.time_s[-1], period_s) if len(tail) else np.zeros(0)
    periods = [tail.between(first, first + period_s).value_m for first in edges[:-1]]
    if len(periods) < _SWINGS_MIN or min(len(values) for values in periods) < _SWINGS_MIN:
        return None
    swings = np.array([np.ptp(values) for values in periods])
    losses = -np.diff(swings)
    for place in range(_SWINGS_MIN, len(losses)):
        usual = float(np.abs(losses[: place - _ONSET]).max())
        stays_small = swings[place + 1 :].max() < swings[place] - 0.5 * losses[place]
        if losses[place] > _LOSS_FACTOR * usual + _LOSS_SIGMAS * noise_m and stays_small:
            return float(edges[place - _ONSET])
    return None
