"""How a law's motion is computed, and how it is compared with the readings: in closed form, or integrated."""

from typing import Protocol

import numpy as np

from analysis.arrays import Floats, Indices
from analysis.compiled import compiled
from analysis.laws.closed_form import GAUGE_1, GAUGE_2_BASE, gauge_normal_equations
from analysis.laws.parameters import Parameter
from analysis.motion import events
from analysis.motion.events import DURATION_MIN_S, integrate_events
from analysis.motion.gradients import phase_responses
from analysis.motion.integration import Friction, final_relative, integrated_kernels, simulate_integrated
from analysis.motion.sampling import sample_displacements
from analysis.motion.two_mass import Motion, TwoMassParameters

Gauge = tuple[Floats, Floats, int, float]
"""Times, readings (m), which gauge (see `closed_form`) and standard deviation of the noise (m)."""


class MotionSolver(Protocol):
    """Motion of the stand with one friction law; a `vector` holds what `FrictionLaw.vector` returns."""

    @property
    def is_closed_form(self) -> bool:
        """Whether it is fast enough for scans, and for following chi-square to the ends of an interval."""

    def simulate(self, parameters: TwoMassParameters, own: list[float], duration_s: float) -> Motion:
        """Motion from release to `duration_s`; `own` are the values of the law's own parameters."""

    def phases(self, vector: Floats, duration_s: float) -> Floats:
        """Phases (m, 5) from release: start, sign of slip (0 stick), and u1, u1', u2 - u1 there."""

    def displacements(self, vector: Floats, time_s: Floats, duration_s: float) -> Floats:
        """u1 and u2 - u1 (2, n) at rising `time_s`, the last of them `duration_s` after release."""

    def final_relative(self, vector: Floats, duration_s: float) -> float:
        """u2 - u1 at the end (m)."""

    def peak_rates(self, vector: Floats, duration_s: float) -> Floats:
        """Largest |u1'|, |u2'|, |u1''|, |u2''|, (4,)."""

    def normal_equations(
        self, point: Floats, vector: Floats, free: Indices, directions: Floats, gauges: list[Gauge]
    ) -> list[Floats]:
        """Gauss-Newton form of each gauge's chi-square over the `free` places (k,) of a point (p,).

        Parameters
        ----------
        free : (k,) int64
            Those that move the motion first.
        directions : (q, v) float64
            How these move `vector`.

        Returns
        -------
        list of (k + 1, k + 1) float64
            Normal matrix, descent (last column) and chi-square (corner), priors aside.
        """


class ClosedFormSolver:
    """Coulomb friction in each phase: every phase is a damped oscillation with constant load."""

    is_closed_form = True

    def simulate(self, parameters: TwoMassParameters, own: list[float], duration_s: float) -> Motion:  # noqa: ARG002
        """See `MotionSolver`."""
        return parameters.simulate(duration_s)

    def phases(self, vector: Floats, duration_s: float) -> Floats:
        """See `MotionSolver`."""
        return integrate_events(vector, duration_s)

    def displacements(self, vector: Floats, time_s: Floats, duration_s: float) -> Floats:
        """See `MotionSolver`."""
        return sample_displacements(vector, integrate_events(vector, duration_s), time_s)

    def final_relative(self, vector: Floats, duration_s: float) -> float:
        """See `MotionSolver`."""
        return float(events.final_relative(vector, integrate_events(vector, duration_s), duration_s))

    def peak_rates(self, vector: Floats, duration_s: float) -> Floats:
        """See `MotionSolver`."""
        return np.array(events.peak_rates(vector, integrate_events(vector, duration_s), duration_s))

    def normal_equations(
        self, point: Floats, vector: Floats, free: Indices, directions: Floats, gauges: list[Gauge]
    ) -> list[Floats]:
        """See `MotionSolver`."""
        end_s = max(float(gauge[0][-1]) for gauge in gauges)
        phases = integrate_events(vector, max(DURATION_MIN_S, end_s - float(point[Parameter.RELEASE])))
        rows = phase_responses(vector, phases, directions)
        return [gauge_normal_equations(point, free, phases, rows, *gauge) for gauge in gauges]


class IntegratedSolver:
    """Friction that depends on the sliding velocity: slips are integrated, derivatives are differences.

    Parameters
    ----------
    friction : callable
        Compiled, see `analysis.motion.integration.Friction`.
    name : str
        An identifier that no other law has.
    """

    is_closed_form = False

    def __init__(self, friction: Friction, name: str) -> None:
        self.kernels = integrated_kernels(friction, name)

    def simulate(self, parameters: TwoMassParameters, own: list[float], duration_s: float) -> Motion:
        """See `MotionSolver`."""
        return simulate_integrated(self.kernels, np.append(parameters.vector(), own), duration_s)

    def phases(self, vector: Floats, duration_s: float) -> Floats:
        """See `MotionSolver`."""
        return self.kernels.integrate(vector, duration_s)[0][:, :5]

    def displacements(self, vector: Floats, time_s: Floats, duration_s: float) -> Floats:
        """See `MotionSolver`."""
        return self.kernels.sample(vector, *self.kernels.integrate(vector, duration_s), time_s, 2)

    def final_relative(self, vector: Floats, duration_s: float) -> float:
        """See `MotionSolver`."""
        return float(final_relative(*self.kernels.integrate(vector, duration_s)))

    def peak_rates(self, vector: Floats, duration_s: float) -> Floats:
        """See `MotionSolver`."""
        phases, nodes = self.kernels.integrate(vector, duration_s)
        return np.array(self.kernels.peak_rates(vector, phases, nodes, duration_s))

    def normal_equations(
        self, point: Floats, vector: Floats, free: Indices, directions: Floats, gauges: list[Gauge]
    ) -> list[Floats]:
        """See `MotionSolver`."""
        extra, systems = free[len(directions) :], []
        release = int(np.flatnonzero(free == Parameter.RELEASE)[0])
        sampled_s, motion, slopes = None, np.empty(0), np.empty(0)
        for times, readings, which, noise in gauges:
            if sampled_s is None or not np.array_equal(times, sampled_s):
                sampled_s = times
                motion, slopes = self.kernels.sample_with_gradient(vector, times, directions)
            moved = motion[0], slopes[:, 0].copy()
            if which != GAUGE_1:
                moved = motion[1], slopes[:, 1].copy()
            if which == GAUGE_2_BASE:
                moved = motion[1] + motion[0], slopes[:, 1] + slopes[:, 0]
            response = _RESPONSES[0 if which == GAUGE_1 else 1]
            systems.append(
                _sampled_normal_equations(*moved, response, release, point, extra, readings, noise)
            )
        return systems


@compiled
def _sampled_normal_equations(
    moved: Floats,
    slopes: Floats,
    response: Indices,
    release: int,
    point: Floats,
    extra: Indices,
    readings: Floats,
    noise: float,
) -> Floats:
    """X X^T of a gauge: the rows of X are the derivatives and, last, the residual, over the noise.

    Parameters
    ----------
    moved, slopes : (n,) and (q, n) float64
        Displacement that the gauge reads, and its derivatives by the q free parameters of the motion.
    response : (3,) int64
        Places of the gauge's offset, gain and delay; -1 for a gauge without delay.
    release : int
        Row of the release in `slopes`: a delay of the gauge is a later release.
    extra : (e,) int64
        The other free places.
    """
    weight, gain, late = 1.0 / noise, 1.0 + point[response[1]], response[2] >= 0
    rows = np.zeros((len(slopes) + len(extra) + 1, len(readings)))
    for k in range(len(slopes)):
        for j in range(len(readings)):
            rows[k, j] = weight * gain * slopes[k, j]
    last = rows[len(rows) - 1]
    for j in range(len(readings)):
        value = moved[j]
        if late:
            value += point[response[2]] * rows[release, j] / (weight * gain)
        last[j] = weight * (readings[j] - point[response[0]] - gain * value)
        for k in range(len(extra)):
            if extra[k] == response[0]:
                rows[len(slopes) + k, j] = weight
            elif extra[k] == response[1]:
                rows[len(slopes) + k, j] = weight * value
            elif extra[k] == response[2]:
                rows[len(slopes) + k, j] = rows[release, j]
    system: Floats = np.dot(rows, rows.T)
    return system


_RESPONSES = (
    np.array([Parameter.TABLE_OFFSET, Parameter.TABLE_GAIN, -1]),
    np.array([Parameter.RELATIVE_OFFSET, Parameter.RELATIVE_GAIN, Parameter.LAG]),
)
"""Places of offset, gain and delay of either gauge."""
CLOSED_FORM = ClosedFormSolver()
