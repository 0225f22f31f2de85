"""Motion of two masses whose friction falls with speed: f = f_d + (f_s - f_d) exp(-|w| / v_s).

Sticks keep their closed form, slips are integrated (see `analysis.motion.stribeck_integration`). Against
DOP853 displacements agree to 1e-11 m and velocities to 1e-8 m/s; largest rates are good to 1e-4 of their
values.
"""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.arrays import Floats
from analysis.motion.events import SIGN, START
from analysis.motion.motion import Motion, MotionError, MotionSamples, rising_times
from analysis.motion.stribeck_integration import integrate_stribeck
from analysis.motion.stribeck_sampling import (
    final_stribeck_relative,
    peak_stribeck_rates,
    sample_stribeck,
)
from analysis.motion.two_mass import TwoMassParameters


@dataclass(frozen=True, eq=False)
class StribeckMotion(Motion):
    """A motion with Stribeck friction."""

    parameters: TwoMassParameters
    stribeck_velocity_m_per_s: float
    _vector: Floats = field(repr=False)
    _phases: Floats = field(repr=False)
    _nodes: Floats = field(repr=False)

    def sample(self, times_s: ArrayLike) -> MotionSamples:
        """See `Motion.sample`."""
        times, back = rising_times(times_s, self.duration_s)
        table, relative, table_rate, plate_rate, table_second, plate_second = sample_stribeck(
            self._vector, self._phases, self._nodes, times, 6
        )
        phase = self.phase_signs[np.searchsorted(self.phase_starts_s, times, side="right") - 1]
        phase[times < 0.0] = 0
        samples = MotionSamples(
            times.copy(), table, relative, table_rate, plate_rate, table_second, plate_second, phase
        )
        return samples if back is None else samples.take(back)

    def sample_displacements(self, times_s: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """See `Motion.sample_displacements`."""
        times, back = rising_times(times_s, self.duration_s)
        table, relative = sample_stribeck(self._vector, self._phases, self._nodes, times, 2)
        return (table, relative) if back is None else (table[back], relative[back])


def simulate(
    parameters: TwoMassParameters, *, stribeck_velocity_m_per_s: float, duration_s: float = 10.0
) -> StribeckMotion:
    """Motion from release to `duration_s`.

    Parameters
    ----------
    parameters : TwoMassParameters
        f_s is the friction at standstill, f_d that at high speed.
    stribeck_velocity_m_per_s : float
        v_s, positive.
    duration_s : float
        Positive.

    Raises
    ------
    MotionError
        A velocity or duration that is not positive and finite.
    """
    velocity = stribeck_velocity_m_per_s
    if not 0.0 < velocity < math.inf:
        raise MotionError(f"stribeck_velocity_m_per_s is {velocity:g}: give a positive velocity")
    if not 0.0 < duration_s < math.inf:
        raise MotionError(f"duration_s is {duration_s:g}: give a positive number of seconds")
    vector = np.append(parameters.vector(), velocity)
    phases, nodes = integrate_stribeck(vector, duration_s)
    starts, signs = phases[:, START].copy(), phases[:, SIGN].astype(np.int8)
    return StribeckMotion(
        duration_s,
        starts,
        signs,
        float(starts[-1]) if signs[-1] == 0 else duration_s,
        final_stribeck_relative(phases, nodes),
        *peak_stribeck_rates(vector, phases, nodes, duration_s),
        parameters=parameters,
        stribeck_velocity_m_per_s=velocity,
        _vector=vector,
        _phases=phases,
        _nodes=nodes,
    )
