"""Agreement of the halves of a decay that no model explains to within the noise."""

import math

import numpy as np

from analysis.arrays import Floats
from analysis.one_mass.fit import COULOMB, DAMPING, OFFSET, OneMassFit, envelope, fit_places
from analysis.record import RecordError

_PERIODS_MIN = 2.0  # of a half: in less, damping is not told from the shape of a swing
_READINGS_MIN = 20
_TURNING_S, _TURNING, _OMEGA = 0, 1, 2
_SWING = (_TURNING_S, _TURNING, _OMEGA, OFFSET)
_LEFT_MAX = 0.05  # residual over the swing: with more, the decay is not what moves most
_PERIOD_MAX = 0.01  # difference of halves from their mean, of the period
_DAMPING_MAX = 0.15  # the same of n, of the mean damping over the record


def spread_of_halves(found: OneMassFit) -> Floats | None:
    """How far the parameters (10,) of either half lie from their mean; None where halves are too short.

    Frequency and n are fitted with x_k as in the whole, and x_k with n as in the whole: a half does not tell
    them apart. Those that were not fitted have 0.
    """
    start_s, end_s = found.channel.time_s[[0, -1]]
    middle_s = float(0.5 * (start_s + end_s))
    halves = found.channel.between(-math.inf, middle_s), found.channel.between(middle_s, math.inf)
    lasts = middle_s - start_s >= _PERIODS_MIN * found.parameters.period_s
    if not lasts or min(map(len, halves)) < _READINGS_MIN:
        return None
    spread = np.zeros(len(found.parameters))
    try:
        for place in (DAMPING, COULOMB):
            if place == DAMPING or found.parameters[place] > 0.0:
                one, other = (fit_places(half, found, (*_SWING, place)).parameters for half in halves)
                spread[place] = 0.5 * abs(one[place] - other[place])
                if place == DAMPING:
                    spread[_OMEGA] = 0.5 * abs(one[_OMEGA] - other[_OMEGA])
    except (RecordError, np.linalg.LinAlgError):
        return None
    return spread


def halves_agree(found: OneMassFit, spread: Floats) -> bool:
    """Tell whether period and damping hold to within the `spread` of the halves, though a model fails."""
    ends_s = found.channel.time_s[[0, -1]]
    first, last = envelope(found.parameters, ends_s).tolist()
    if not 0.0 < last < first:
        return False
    mean_damping_per_s = math.log(first / last) / float(ends_s[1] - ends_s[0])
    swing = 0.5 * float(np.ptp(found.channel.value_m))
    return bool(
        found.rms < _LEFT_MAX * swing
        and spread[_OMEGA] < _PERIOD_MAX * found.parameters.omega_rad_per_s
        and spread[DAMPING] < _DAMPING_MAX * mean_damping_per_s
    )
