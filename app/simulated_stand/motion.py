"""Motion of the simulated stand: repeated pullback tests, and the parameters of the chosen series."""

from collections.abc import Mapping
from dataclasses import dataclass, fields

import numpy as np

from analysis.laws.coulomb import COULOMB
from analysis.laws.stand_parts import STAND_PLACES, StandSolver
from analysis.laws.stribeck import STRIBECK_TILT
from analysis.motion.stand_motion import STAND_PARAMETER_COUNT
from analysis.motion.two_mass import Motion, TwoMassParameters, simulate_kernels, stiffness_and_damping
from app.simulated_stand.effects import STRIBECK, motion_values
from app.simulated_stand.options import SimulatedStandOptions, Timetable
from app.simulated_stand.truth import StandTruth
from config.files import published_row
from config.schema import Stand
from drivers.arrays import Flags, Floats


@dataclass(frozen=True, eq=False)
class RepeatedPullback:
    """Pullback tests one after another, with the same release each time.

    Each test leaves the plate where it came to rest, and the next one begins there unless the operator
    re-centres it. Friction along the track and wear begin anew with each test, so the motion is the same.
    """

    pullback_m: float
    released: Motion  # motion after a release, simulated for decay and re-centring at least
    timetable: Timetable
    plate_offset_m: float = 0.0

    def displacements(self, time_s: Floats) -> tuple[Floats, Floats]:
        """Table against base and plate against table (m), each (n,), at times since the first test began."""
        test, within_s = self._locate(time_s)
        table = self.pullback_m * _smooth((within_s - self.timetable.rest_s) / self.timetable.pull_s)
        relative = self.initial_offset_m(test)
        free = np.flatnonzero(within_s > self.timetable.release_s)
        if free.size:
            since_s = within_s[free] - self.timetable.release_s
            left = self._remaining(since_s)
            moved_s = np.minimum(since_s, self.timetable.decay_s + self.timetable.recentre_s)
            table_m, relative_m = self.released.sample_displacements(moved_s)
            table[free] = left * table_m
            relative[free] = (relative[free] + relative_m) * np.where(self._puts_back(test[free]), left, 1.0)
        return table, relative

    def drift_time_s(self, time_s: Floats) -> Floats:
        """Time (s) since the zero was last set, while the table was stilled."""
        _, within_s = self._locate(time_s)
        return within_s * self._remaining(within_s - self.timetable.release_s)

    def initial_offset_m(self, test: Floats) -> Floats:
        """Position of the plate (m), (n,), at the beginning of tests counted from 0."""
        every = self.timetable.recentre_every
        since_put_back = np.mod(test, every) if every else test
        first = np.where(test < every, self.plate_offset_m, 0.0) if every else self.plate_offset_m
        return first + since_put_back * self.released.residual_displacement_m

    def _locate(self, time_s: Floats) -> tuple[Floats, Floats]:
        """Number of the test and time (s) within it; after the last one, the rest before one more."""
        test = np.floor(time_s / self.timetable.cycle_s)
        within_s = time_s - test * self.timetable.cycle_s
        count = self.timetable.count
        if count is not None:
            within_s = np.where(test < count, within_s, 0.0)
            test = np.minimum(test, count)
        return test, within_s

    def _puts_back(self, test: Floats) -> Flags:
        every = self.timetable.recentre_every
        return np.mod(test + 1.0, every) == 0.0 if every else np.zeros(len(test), dtype=np.bool_)

    def _remaining(self, since_release_s: Floats) -> Floats:
        """Share of the displacement while the table is stilled: 1 during the decay, then down to 0."""
        return 1.0 - _smooth((since_release_s - self.timetable.decay_s) / self.timetable.recentre_s)


def released_motion(true: StandTruth, timetable: Timetable, effects: Mapping[str, float] = {}) -> Motion:
    """Motion after each release. Raises MotionError for parameters that no stand can have."""
    of_motion = {each.name: getattr(true, each.name) for each in fields(TwoMassParameters)}
    duration_s = timetable.decay_s + timetable.recentre_s
    return simulate_stand(TwoMassParameters(**of_motion), motion_values(effects), duration_s)


def simulate_stand(parameters: TwoMassParameters, values: Mapping[str, float], duration_s: float) -> Motion:
    """Motion with these values of the stand and of Stribeck's friction; the exact one without any.

    Raises MotionError.
    """
    if not values:
        return parameters.simulate(duration_s)
    stand = np.zeros(STAND_PARAMETER_COUNT)
    for name in values.keys() - {STRIBECK}:
        stand[STAND_PLACES[name]] = values[name]
    own = [values[STRIBECK]] if STRIBECK in values else []
    kernels = StandSolver(STRIBECK_TILT if own else COULOMB).kernels
    return simulate_kernels(kernels, np.concatenate((parameters.vector(), own, stand)), duration_s)


def _smooth(x: Floats) -> Floats:
    """Step from 0 (x <= 0) to 1 (x >= 1) with continuous velocity and acceleration."""
    x = np.clip(x, 0.0, 1.0)
    return x**3 * (10.0 + x * (6.0 * x - 15.0))


def stand_truth(options: SimulatedStandOptions, stand: Stand) -> StandTruth:
    """Parameters of the chosen series, with what the options change. Raises ConfigError."""
    series = stand.series(options.series)
    row = published_row(series.code)
    friction = _or(options.friction, row.friction_dynamic)
    decay = {"period_s": row.period_s, "damping_n1_per_s": row.damping_n1_per_s}
    masses = {"table_mass_kg": stand.table_mass_kg, "plate_mass_kg": series.plate_mass_kg}
    stiffness, damping = stiffness_and_damping(**decay, **masses)
    return StandTruth(
        series=series.code,
        friction_dynamic=friction,
        friction_static=_or(options.static_friction, friction),
        tilt_rad=options.tilt_rad,
        pullback_m=_or(options.pullback_m, series.pullback_m),
        gravity_m_per_s2=stand.gravity_m_per_s2,
        stiffness_n_per_m=stiffness,
        damping_coefficient_kg_per_s=damping,
        **decay,
        **masses,
    )


def _or(chosen: float | None, usual: float) -> float:
    return usual if chosen is None else chosen
