"""Degree of the MSK-64 seismic scale that a largest velocity of the ground corresponds to."""

import math
from itertools import pairwise
from typing import Final

from analysis.record import AnalysisError

_DEGREES: Final = ("V", "VI", "VII", "VIII", "IX", "X")
_BOUNDS_M_PER_S: Final = (0.01, 0.02, 0.04, 0.08, 0.16, 0.32, 0.64)


def msk64_degree(velocity_max_m_per_s: float) -> str:
    """MSK-64 degree of a largest velocity (m/s, 0 or above).

    Degrees are intervals of velocity, each closed above: V (1, 2] cm/s, VI (2, 4], VII (4, 8],
    VIII (8, 16], IX (16, 32], X (32, 64] (PHYSICS.md; Medvedev, Sponheuer and Karnik 1964). Outside them
    "below V" or "above X". Raises AnalysisError for a velocity that is negative or not finite.
    """
    if not (math.isfinite(velocity_max_m_per_s) and velocity_max_m_per_s >= 0.0):
        raise AnalysisError(
            f"velocity {velocity_max_m_per_s!r} m/s has no MSK-64 degree: give a finite number, 0 or above"
        )
    if velocity_max_m_per_s <= _BOUNDS_M_PER_S[0]:
        return "below V"
    for degree, (_, upper) in zip(_DEGREES, pairwise(_BOUNDS_M_PER_S), strict=True):
        if velocity_max_m_per_s <= upper:
            return degree
    return "above X"
