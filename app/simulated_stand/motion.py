"""What the simulated stand does, for ever: rest, pull back, hold, release, decay, be put back."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.motion.motion import Motion
from analysis.motion.two_mass import simulate
from app.simulated_stand.timetable import Timetable
from app.simulated_stand.truth import StandTruth

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class RepeatedPullback:
    """Pullback tests one after another, with the same release each time.

    Attributes
    ----------
    pullback_m : float
        Table displacement while held (m).
    released : Motion
        What follows a release, simulated for decay and re-centring at least.
    timetable : Timetable
    """

    pullback_m: float
    released: Motion
    timetable: Timetable

    def displacements(self, time_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Table against base and plate against table (m), each (n,), at times since the first test began."""
        within_s = np.mod(time_s, self.timetable.cycle_s)
        table = self.pullback_m * _smooth((within_s - self.timetable.rest_s) / self.timetable.pull_s)
        relative = np.zeros_like(table)
        free = np.flatnonzero(within_s > self.timetable.release_s)
        if free.size:
            since_s = within_s[free] - self.timetable.release_s
            left = self._left(since_s)
            table[free], relative[free] = (left * u for u in self.released.sample_displacements(since_s))
        return table, relative

    def drifting_s(self, time_s: FloatArray) -> FloatArray:
        """For how long (s) a zero has crept since it was last set, while the plate was put back."""
        within_s = np.mod(time_s, self.timetable.cycle_s)
        return within_s * self._left(within_s - self.timetable.release_s)

    def _left(self, since_release_s: FloatArray) -> FloatArray:
        """What the operator's hand leaves: 1 during the decay, then down to 0."""
        return 1.0 - _smooth((since_release_s - self.timetable.decay_s) / self.timetable.recentre_s)


def released_motion(true: StandTruth, timetable: Timetable) -> Motion:
    """Exact motion after each release. Raises MotionError for parameters that no stand can have."""
    return simulate(
        table_mass_kg=true.table_mass_kg,
        plate_mass_kg=true.plate_mass_kg,
        stiffness_n_per_m=true.stiffness_n_per_m,
        damping_coefficient_kg_per_s=true.damping_coefficient_kg_per_s,
        friction_dynamic=true.friction_dynamic,
        friction_static=true.friction_static,
        tilt_rad=true.tilt_rad,
        pullback_m=true.pullback_m,
        duration_s=timetable.decay_s + timetable.recentre_s,
        gravity_m_per_s2=true.gravity_m_per_s2,
    )


def _smooth(x: FloatArray) -> FloatArray:
    """Go from 0 (x <= 0) to 1 (x >= 1) without a jump in velocity or acceleration."""
    x = np.clip(x, 0.0, 1.0)
    return x**3 * (10.0 + x * (6.0 * x - 15.0))
