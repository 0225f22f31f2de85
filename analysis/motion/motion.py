"""What a simulated test is, whichever method simulated it."""

from abc import ABC, abstractmethod
from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.motion.sampling import out_of_order
from analysis.record import AnalysisError


class MotionError(AnalysisError, ValueError):
    """A motion that cannot be simulated or sampled as asked."""


@dataclass(frozen=True, eq=False)
class MotionSamples:
    """A motion at given times; every array has shape (n,). Before release the table is held at the pullback.

    Attributes
    ----------
    time_s : float64
        As asked for, zero at release.
    table_displacement_m, relative_displacement_m : float64
        u1 from the rest position, and u2 - u1 since release (m).
    table_velocity_m_per_s, plate_velocity_m_per_s : float64
    table_acceleration_m_per_s2, plate_acceleration_m_per_s2 : float64
        Where a phase begins, its own first value.
    phase : int8
        0 where the masses move together, else the sign of u2' - u1'.
    """

    time_s: NDArray[np.float64]
    table_displacement_m: NDArray[np.float64]
    relative_displacement_m: NDArray[np.float64]
    table_velocity_m_per_s: NDArray[np.float64]
    plate_velocity_m_per_s: NDArray[np.float64]
    table_acceleration_m_per_s2: NDArray[np.float64]
    plate_acceleration_m_per_s2: NDArray[np.float64]
    phase: NDArray[np.int8]

    def columns(self) -> dict[str, NDArray[np.float64] | NDArray[np.int8]]:
        """Arrays by name, in the order in which they are written to files."""
        return {field.name: getattr(self, field.name) for field in fields(self)}

    def take(self, places: NDArray[np.intp]) -> Self:
        """The samples at `places`, in that order."""
        columns: dict[str, Any] = {name: column[places] for name, column in self.columns().items()}
        return type(self)(**columns)


@dataclass(frozen=True, eq=False)
class Motion(ABC):
    """One simulated test from release to `duration_s`.

    Attributes
    ----------
    duration_s : float
    phase_starts_s : (m,) float64
        First 0.0, the release.
    phase_signs : (m,) int8
        0 where the masses move together, else the sign of u2' - u1'.
    slip_end_s : float
        When the last slip ended: 0.0 when nothing slips, `duration_s` when it still slips then.
    residual_displacement_m : float
        u2 - u1 at the end.
    table_velocity_max_m_per_s, plate_velocity_max_m_per_s : float
    table_acceleration_max_m_per_s2, plate_acceleration_max_m_per_s2 : float
        Largest absolute values.
    """

    duration_s: float
    phase_starts_s: NDArray[np.float64]
    phase_signs: NDArray[np.int8]
    slip_end_s: float
    residual_displacement_m: float
    table_velocity_max_m_per_s: float
    plate_velocity_max_m_per_s: float
    table_acceleration_max_m_per_s2: float
    plate_acceleration_max_m_per_s2: float

    @abstractmethod
    def sample(self, times_s: ArrayLike) -> MotionSamples:
        """Motion at `times_s` (n,), in any order, seconds from release, negative before it.

        Raises
        ------
        MotionError
            A time is not a number, or later than `duration_s`.
        """

    @abstractmethod
    def sample_displacements(self, times_s: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """u1 and u2 - u1 (m) at `times_s`: what the gauges see, several times faster than `sample`."""


def rising_times(
    times_s: ArrayLike, duration_s: float
) -> tuple[NDArray[np.float64], NDArray[np.intp] | None]:
    """Times as the kernels want them: rising, contiguous, writable.

    Returns
    -------
    (n,) float64
        The given array itself where it is so already.
    (n,) intp or None
        Where each given time went; None when they rose already.

    Raises
    ------
    MotionError
        A time is not a number, or later than `duration_s`.
    """
    times = np.atleast_1d(np.asarray(times_s, dtype=np.float64))
    if times.ndim != 1:
        raise MotionError("times of shape {shape}: give one dimension", shape=str(times.shape))
    if not (times.flags.c_contiguous and times.flags.writeable):
        times = times.copy()
    back = None
    if out_of_order(times):
        if np.isnan(times).any():
            raise MotionError(
                "time {index} is not a number: leave it out",
                index=np.flatnonzero(np.isnan(times))[0],
            )
        order = np.argsort(times, kind="stable")
        back = np.empty_like(order)
        back[order] = np.arange(len(order))
        times = times[order]
    if len(times) and times[-1] > duration_s * (1 + 1e-12):
        raise MotionError(
            "time {time_s:g} s is after the simulated {duration_s:g} s: simulate longer",
            time_s=times[-1],
            duration_s=duration_s,
        )
    return times, back
