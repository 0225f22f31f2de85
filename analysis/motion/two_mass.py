"""Exact motion of two masses with dry friction between them, event to event on closed forms.

Source: the paper's Eqs. (1)-(3) with a tilt of the sliding plane and static friction added (PHYSICS,
"Motion"). Nothing is stepped in time; displacements are good to 1e-15 m, event times to 1e-15 s, except
where the joint acceleration only grazes its limit, so that a slip is shorter than rounding can resolve.
"""

import math
from dataclasses import dataclass, field
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.arrays import Floats
from analysis.motion.events import SIGN, START, final_relative, integrate_events, peak_rates
from analysis.motion.motion import Motion, MotionError, MotionSamples, rising_times
from analysis.motion.sampling import sample


@dataclass(frozen=True, kw_only=True)
class TwoMassParameters:
    """The stand, the contact and the pullback of one test.

    Attributes
    ----------
    table_mass_kg, plate_mass_kg : float
        m1, m2; positive.
    stiffness_n_per_m : float
        c; positive.
    damping_coefficient_kg_per_s : float
        mu; not negative, and the slipping table underdamped: mu < 2 sqrt(c m1).
    friction_dynamic : float
        f_d; not negative.
    friction_static : float or None
        f_s, not less than f_d; None means f_d.
    tilt_rad : float
        alpha, positive where gravity pulls the plate forward; |alpha| <= f_s, else the plate would not
        have waited for the release.
    pullback_m : float
        u1 before release.
    gravity_m_per_s2 : float
        Positive.

    Raises
    ------
    MotionError
        A value outside these limits.
    """

    table_mass_kg: float
    plate_mass_kg: float
    stiffness_n_per_m: float
    damping_coefficient_kg_per_s: float
    friction_dynamic: float
    friction_static: float | None = None
    tilt_rad: float = 0.0
    pullback_m: float
    gravity_m_per_s2: float = 9.81

    def __post_init__(self) -> None:
        _check(self)

    @classmethod
    def from_free_decay(
        cls,
        *,
        period_s: float,
        damping_n1_per_s: float,
        table_mass_kg: float,
        plate_mass_kg: float,
        friction_dynamic: float,
        pullback_m: float,
        friction_static: float | None = None,
        tilt_rad: float = 0.0,
        gravity_m_per_s2: float = 9.81,
    ) -> Self:
        """Parameters with c and mu from the decay of the joint motion (see `stiffness_and_damping`)."""
        stiffness, damping = stiffness_and_damping(
            period_s, damping_n1_per_s, table_mass_kg=table_mass_kg, plate_mass_kg=plate_mass_kg
        )
        return cls(
            table_mass_kg=table_mass_kg,
            plate_mass_kg=plate_mass_kg,
            stiffness_n_per_m=stiffness,
            damping_coefficient_kg_per_s=damping,
            friction_dynamic=friction_dynamic,
            friction_static=friction_static,
            tilt_rad=tilt_rad,
            pullback_m=pullback_m,
            gravity_m_per_s2=gravity_m_per_s2,
        )

    @property
    def static_or_dynamic(self) -> float:
        """f_s, which is f_d where none was given."""
        return self.friction_dynamic if self.friction_static is None else self.friction_static

    def vector(self, release_s: float = 0.0) -> NDArray[np.float64]:
        """The parameter vector of the compiled kernels, (10,), in the order of `analysis.motion.events`."""
        return np.array(
            (
                self.friction_dynamic,
                self.static_or_dynamic,
                self.stiffness_n_per_m,
                self.damping_coefficient_kg_per_s,
                self.pullback_m,
                self.tilt_rad,
                release_s,
                self.table_mass_kg,
                self.plate_mass_kg,
                self.gravity_m_per_s2,
            )
        )

    def simulate(self, duration_s: float = 10.0) -> "TwoMassMotion":
        """Motion from release to `duration_s`.

        Raises
        ------
        MotionError
            The duration is not positive and finite.
        """
        if not 0.0 < duration_s < math.inf:
            raise MotionError(
                "duration_s is {duration_s:g}: give a positive number of seconds", duration_s=duration_s
            )
        parameters = self.vector()
        phases = integrate_events(parameters, duration_s)
        starts, signs = phases[:, START].copy(), phases[:, SIGN].astype(np.int8)
        return TwoMassMotion(
            duration_s,
            starts,
            signs,
            _slip_end(starts, signs, duration_s),
            final_relative(parameters, phases, duration_s),
            *peak_rates(parameters, phases, duration_s),
            parameters=self,
            _vector=parameters,
            _phases=phases,
        )


@dataclass(frozen=True, eq=False)
class TwoMassMotion(Motion):
    """A motion in closed form: sampled at any time without interpolation."""

    parameters: TwoMassParameters
    _vector: Floats = field(repr=False)
    _phases: Floats = field(repr=False)

    def sample(self, times_s: ArrayLike) -> MotionSamples:
        """See `Motion.sample`."""
        times, order = rising_times(times_s, self.duration_s)
        table, relative, table_rate, plate_rate, table_second, plate_second = sample(
            self._vector, self._phases, times, 6
        )
        held = times < 0.0
        phase = self.phase_signs[np.searchsorted(self.phase_starts_s, times, side="right") - 1]
        phase[held] = 0
        samples = MotionSamples(
            times.copy(), table, relative, table_rate, plate_rate, table_second, plate_second, phase
        )
        return samples if order is None else samples.take(order)

    def sample_displacements(self, times_s: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """See `Motion.sample_displacements`."""
        times, order = rising_times(times_s, self.duration_s)
        table, relative = sample(self._vector, self._phases, times, 2)
        return (table, relative) if order is None else (table[order], relative[order])


def simulate(
    *,
    table_mass_kg: float,
    plate_mass_kg: float,
    stiffness_n_per_m: float,
    damping_coefficient_kg_per_s: float,
    friction_dynamic: float,
    friction_static: float | None = None,
    tilt_rad: float = 0.0,
    pullback_m: float,
    duration_s: float = 10.0,
    gravity_m_per_s2: float = 9.81,
) -> TwoMassMotion:
    """Motion after a pullback, from release to `duration_s`; see `TwoMassParameters` for the arguments."""
    return TwoMassParameters(
        table_mass_kg=table_mass_kg,
        plate_mass_kg=plate_mass_kg,
        stiffness_n_per_m=stiffness_n_per_m,
        damping_coefficient_kg_per_s=damping_coefficient_kg_per_s,
        friction_dynamic=friction_dynamic,
        friction_static=friction_static,
        tilt_rad=tilt_rad,
        pullback_m=pullback_m,
        gravity_m_per_s2=gravity_m_per_s2,
    ).simulate(duration_s)


def stiffness_and_damping(
    period_s: float, damping_n1_per_s: float, *, table_mass_kg: float, plate_mass_kg: float
) -> tuple[float, float]:
    """Stiffness c (N/m) and damping mu (kg/s) from the damped period and n1 of the joint motion.

    c = ((2 pi / T)^2 + n1^2) (m1 + m2), mu = 2 n1 (m1 + m2).
    """
    if not 0.0 < period_s < math.inf:
        raise MotionError("period_s is {period_s:g}: give a positive number of seconds", period_s=period_s)
    mass = table_mass_kg + plate_mass_kg
    frequency = 2.0 * math.pi / period_s
    return (frequency**2 + damping_n1_per_s**2) * mass, 2.0 * damping_n1_per_s * mass


def _slip_end(starts: Floats, signs: NDArray[np.int8], duration_s: float) -> float:
    if signs[-1] != 0:
        return duration_s
    return float(starts[-1])  # a walk never has two sticks in a row, so the last stick follows the last slip


def _check(parameters: TwoMassParameters) -> None:
    positive = ("table_mass_kg", "plate_mass_kg", "stiffness_n_per_m", "gravity_m_per_s2")
    for name in positive:
        if not 0.0 < getattr(parameters, name) < math.inf:
            raise MotionError(
                "{name} is {value:g}: give a positive number", name=name, value=getattr(parameters, name)
            )
    for name in ("damping_coefficient_kg_per_s", "friction_dynamic"):
        if not 0.0 <= getattr(parameters, name) < math.inf:
            raise MotionError(
                "{name} is {value:g}: give zero or a positive number",
                name=name,
                value=getattr(parameters, name),
            )
    if not math.isfinite(parameters.pullback_m):
        raise MotionError(
            "pullback_m is {pullback_m:g}: give a finite number of metres", pullback_m=parameters.pullback_m
        )
    _check_friction(parameters)
    critical = 2.0 * math.sqrt(parameters.stiffness_n_per_m * parameters.table_mass_kg)
    if parameters.damping_coefficient_kg_per_s >= critical:
        raise MotionError(
            "damping_coefficient_kg_per_s is {damping_coefficient_kg_per_s:g}: the table does"
            " not oscillate from {critical:g} on (2 sqrt(c m1)); give less",
            damping_coefficient_kg_per_s=parameters.damping_coefficient_kg_per_s,
            critical=critical,
        )


def _check_friction(parameters: TwoMassParameters) -> None:
    static = parameters.static_or_dynamic
    if not parameters.friction_dynamic <= static < math.inf:
        raise MotionError(
            "friction_static is {static:g}, less than friction_dynamic {friction_dynamic:g}:"
            " give at least that",
            static=static,
            friction_dynamic=parameters.friction_dynamic,
        )
    if not abs(parameters.tilt_rad) <= static:
        raise MotionError(
            "tilt_rad is {tilt_rad:g}, steeper than friction_static {static:g}: the plate"
            " slides off before release; give a smaller tilt",
            tilt_rad=parameters.tilt_rad,
            static=static,
        )
