"""Motion of two masses with dry friction between them: what every simulation returns, and the exact one.

Source of the equations: the paper's Eqs. (1)-(3) with a tilt of the sliding plane and static friction added.
The exact motion is computed from event to event in closed form. Displacements are good to 1e-15 m and event
times to 1e-15 s, except where the joint acceleration only grazes its limit, so that a slip is shorter than
rounding can resolve.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.arrays import Floats
from analysis.motion.events import SIGN, START
from analysis.motion.sampling import EXACT, MotionKernels, out_of_order
from analysis.record import AnalysisError, StandMasses
from messages.i18n import N_


class MotionError(AnalysisError, ValueError):
    """A motion that cannot be simulated or sampled as asked."""


@dataclass(frozen=True, eq=False)
class MotionSamples:
    """A motion at given times, arrays of shape (n,). Before release the table is held at the pullback."""

    time_s: NDArray[np.float64]  # as asked for, zero at release
    table_displacement_m: NDArray[np.float64]  # u1 from the rest position
    relative_displacement_m: NDArray[np.float64]  # u2 - u1 since release
    table_velocity_m_per_s: NDArray[np.float64]
    plate_velocity_m_per_s: NDArray[np.float64]
    table_acceleration_m_per_s2: NDArray[np.float64]  # where a phase begins, its own first value
    plate_acceleration_m_per_s2: NDArray[np.float64]
    phase: NDArray[np.int8]  # 0 where the masses move together, else the sign of u2' - u1'

    def columns(self) -> dict[str, NDArray[np.float64] | NDArray[np.int8]]:
        """Arrays by name, in the order in which they are written to files."""
        return {field.name: getattr(self, field.name) for field in fields(self)}

    def take(self, places: NDArray[np.intp]) -> Self:
        columns: dict[str, Any] = {name: column[places] for name, column in self.columns().items()}
        return type(self)(**columns)


PEAK_RATES = (
    "table_velocity_max_m_per_s",
    "plate_velocity_max_m_per_s",
    "table_acceleration_max_m_per_s2",
    "plate_acceleration_max_m_per_s2",
)
"""Fields of a `Motion`, and results, in the order in which `peak_rates` of a solver gives them."""


@dataclass(frozen=True, eq=False)
class Motion(ABC):
    """One simulated test from release to `duration_s`."""

    duration_s: float
    phase_starts_s: NDArray[np.float64]  # (m,) float64: first 0.0, the release
    phase_signs: NDArray[np.int8]  # (m,) int8: 0 where the masses move together, else the sign of u2' - u1'
    slip_end_s: float
    """When the last slip ended: 0.0 when nothing slips, `duration_s` when it still slips then."""
    residual_displacement_m: float  # u2 - u1 at the end
    table_velocity_max_m_per_s: float
    plate_velocity_max_m_per_s: float
    table_acceleration_max_m_per_s2: float  # all four are largest absolute values
    plate_acceleration_max_m_per_s2: float

    def sample(self, times_s: ArrayLike) -> MotionSamples:
        """Motion at `times_s` (n,), in any order, seconds from release, negative before it.

        Raises MotionError if a time is not a number, or later than `duration_s`.
        """
        times, back = rising_times(times_s, self.duration_s)
        columns: list[Any] = [times.copy(), *self._sample_rising(times, 6), self._phase_at(times)]
        samples = MotionSamples(*columns)
        return samples if back is None else samples.take(back)

    def sample_displacements(self, times_s: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """u1 and u2 - u1 (m) at `times_s`: what the gauges see, several times faster than `sample`."""
        times, back = rising_times(times_s, self.duration_s)
        table, relative = self._sample_rising(times, 2)
        return (table, relative) if back is None else (table[back], relative[back])

    @abstractmethod
    def _sample_rising(self, times_s: Floats, count: int) -> Floats:
        """The first `count` of u1, u2 - u1, u1', u2', u1'', u2'' at rising times, (count, n)."""

    def _phase_at(self, times_s: Floats) -> NDArray[np.int8]:
        phase = self.phase_signs[np.searchsorted(self.phase_starts_s, times_s, side="right") - 1]
        phase[times_s < 0.0] = 0
        return phase


def rising_times(
    times_s: ArrayLike, duration_s: float
) -> tuple[NDArray[np.float64], NDArray[np.intp] | None]:
    """Times as the kernels want them (rising, contiguous, writable), and where each given time went.

    None where they rose already. Raises MotionError if a time is not a number, or later than `duration_s`.
    """
    times = np.atleast_1d(np.asarray(times_s, dtype=np.float64))
    if times.ndim != 1:
        raise MotionError("times of shape {shape}: give one dimension", shape=str(times.shape))
    if not (times.flags.c_contiguous and times.flags.writeable):
        times = times.copy()
    back = None
    if out_of_order(times):
        if np.isnan(times).any():
            template = N_("time {index} is not a number: leave it out")
            raise MotionError(template, index=np.flatnonzero(np.isnan(times))[0])
        order = np.argsort(times, kind="stable")
        back = np.empty_like(order)
        back[order] = np.arange(len(order))
        times = times[order]
    if len(times) and times[-1] > duration_s * (1 + 1e-12):
        template = N_("time {time_s:g} s is after the simulated {duration_s:g} s: simulate longer")
        raise MotionError(template, time_s=times[-1], duration_s=duration_s)
    return times, back


@dataclass(frozen=True, eq=False)
class KernelMotion(Motion):
    """A motion sampled by the kernels that integrated it."""

    _kernels: MotionKernels = field(repr=False)
    _vector: Floats = field(repr=False)
    _state: tuple[Floats, ...] = field(repr=False)

    def _sample_rising(self, times_s: Floats, count: int) -> Floats:
        return self._kernels.sample(self._vector, *self._state, times_s, count)


def simulate_kernels(kernels: MotionKernels, vector: Floats, duration_s: float) -> KernelMotion:
    """Motion from release to `duration_s` (s); raises MotionError if that is not positive and finite."""
    if not 0.0 < duration_s < math.inf:
        template = N_("duration_s is {duration_s:g}: give a positive number of seconds")
        raise MotionError(template, duration_s=duration_s)
    state = kernels.integrate(vector, duration_s)
    starts, signs = state[0][:, START].copy(), state[0][:, SIGN].astype(np.int8)
    return KernelMotion(
        duration_s,
        starts,
        signs,
        duration_s if signs[-1] else float(starts[-1]),  # the last stick follows the last slip
        kernels.final_relative(vector, state, duration_s),
        *kernels.peak_rates(vector, *state, duration_s),
        kernels,
        vector,
        state,
    )


@dataclass(frozen=True, kw_only=True)
class TwoMassParameters:
    """The stand, the contact and the pullback of one test.

    Raises MotionError if a value is outside these limits.
    """

    table_mass_kg: float  # m1; positive
    plate_mass_kg: float  # m2; positive
    stiffness_n_per_m: float  # c; positive
    damping_coefficient_kg_per_s: float
    """mu; not negative, and the slipping table underdamped: mu < 2 sqrt(c m1)."""
    friction_dynamic: float  # f_d; not negative
    friction_static: float | None = None  # f_s, not less than f_d; None means f_d
    tilt_rad: float = 0.0
    """alpha, positive where gravity pulls the plate forward; |alpha| <= f_s, else the plate would
    slide before the release."""
    pullback_m: float  # u1 before release
    gravity_m_per_s2: float = 9.81  # positive

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
        **others: Any,
    ) -> Self:
        """Parameters with c and mu from the decay of the joint motion (see `stiffness_and_damping`)."""
        masses = {"table_mass_kg": table_mass_kg, "plate_mass_kg": plate_mass_kg}
        stiffness, damping = stiffness_and_damping(period_s, damping_n1_per_s, **masses)
        return cls(stiffness_n_per_m=stiffness, damping_coefficient_kg_per_s=damping, **masses, **others)

    @classmethod
    def from_fit(cls, fitted: Mapping[str, float], **changes: float) -> Self:
        """The parameters of an `Identification`, with some of them changed."""
        values = {field.name: fitted[field.name] for field in fields(cls)}
        return cls(**{**values, **changes})

    @property
    def static_or_dynamic(self) -> float:
        """f_s, which is f_d where none was given."""
        return self.friction_dynamic if self.friction_static is None else self.friction_static

    @property
    def masses(self) -> StandMasses:
        """Masses and gravity, known exactly."""
        return StandMasses(self.table_mass_kg, self.plate_mass_kg, gravity_m_per_s2=self.gravity_m_per_s2)

    def vector(self, release_s: float = 0.0) -> NDArray[np.float64]:
        """The parameter vector of the compiled kernels, (10,), in the order of `analysis.motion.events`."""
        friction = (self.friction_dynamic, self.static_or_dynamic)
        springs = (self.stiffness_n_per_m, self.damping_coefficient_kg_per_s)
        masses = (self.table_mass_kg, self.plate_mass_kg, self.gravity_m_per_s2)
        return np.array((*friction, *springs, self.pullback_m, self.tilt_rad, release_s, *masses))

    def simulate(self, duration_s: float = 10.0) -> Motion:
        """Motion from release to `duration_s`; raises MotionError if that is not positive and finite."""
        return simulate_kernels(EXACT, self.vector(), duration_s)


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


def _check(parameters: TwoMassParameters) -> None:
    for name in ("table_mass_kg", "plate_mass_kg", "stiffness_n_per_m", "gravity_m_per_s2"):
        value = getattr(parameters, name)
        if not 0.0 < value < math.inf:
            raise MotionError("{name} is {value:g}: give a positive number", name=name, value=value)
    for name in ("damping_coefficient_kg_per_s", "friction_dynamic"):
        value = getattr(parameters, name)
        if not 0.0 <= value < math.inf:
            raise MotionError("{name} is {value:g}: give zero or a positive number", name=name, value=value)
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
        template = N_(
            "friction_static is {static:g}, less than friction_dynamic {friction_dynamic:g}:"
            " give at least that"
        )
        raise MotionError(template, static=static, friction_dynamic=parameters.friction_dynamic)
    if not abs(parameters.tilt_rad) <= static:
        template = N_(
            "tilt_rad is {tilt_rad:g}, steeper than friction_static {static:g}: the plate"
            " slides off before release; give a smaller tilt"
        )
        raise MotionError(template, tilt_rad=parameters.tilt_rad, static=static)
