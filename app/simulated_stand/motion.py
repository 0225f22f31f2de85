"""Motion of the simulated stand: repeated pullback tests, and the parameters of the chosen series."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace

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

_EARLY = 1.0 / 3.0  # part of the pullback at which a table is let go too early, unless told otherwise
_EARLY_HOLD_S = 0.1  # shorter than anything that counts as a hold
_EARLY_DECAY_S = 5.0  # until the operator stills the table and pulls again


@dataclass(frozen=True, eq=False, slots=True)
class PullbackTest:
    """One test of table and plate, which stands at `offset_m` before it."""

    start_s: float
    pullback_m: float
    released: Motion  # motion after the release, simulated for decay and re-centring at least
    timetable: Timetable
    offset_m: float
    is_put_back: bool  # the plate, while the table is stilled

    @property
    def release_s(self) -> float:
        return self.start_s + self.timetable.release_s

    @property
    def end_s(self) -> float:
        return self.start_s + self.timetable.parts_s

    @property
    def last_offset_m(self) -> float:
        """Position of the plate after the test."""
        return 0.0 if self.is_put_back else self.offset_m + self.released.residual_displacement_m

    def stilled(self, time_s: float) -> "PullbackTest":
        """The same test, in which the operator begins to still the table at `time_s`, after the release."""
        return replace(self, timetable=replace(self.timetable, decay_s=time_s - self.release_s))

    def displacements(self, time_s: Floats) -> tuple[Floats, Floats]:
        """Table against base and plate against table (m), each (n,), from the beginning of the test on."""
        within_s = time_s - self.start_s
        table = self.pullback_m * _smooth((within_s - self.timetable.rest_s) / self.timetable.pull_s)
        relative = np.full(len(time_s), self.offset_m)
        free = np.flatnonzero(within_s > self.timetable.release_s)
        if free.size:
            since_s = within_s[free] - self.timetable.release_s
            left = self._remaining(since_s)
            moved_s = np.minimum(since_s, self.timetable.decay_s + self.timetable.recentre_s)
            table_m, relative_m = self.released.sample_displacements(moved_s)
            table[free] = left * table_m
            relative[free] = (self.offset_m + relative_m) * (left if self.is_put_back else 1.0)
        relative[within_s > self.timetable.parts_s] = self.last_offset_m
        return table, relative

    def drift_time_s(self, time_s: Floats) -> Floats:
        within_s = time_s - self.start_s
        return within_s * self._remaining(within_s - self.timetable.release_s)

    def _remaining(self, since_release_s: Floats) -> Floats:
        """Share of the displacement while the table is stilled: 1 during the decay, then down to 0."""
        return 1.0 - _smooth((since_release_s - self.timetable.decay_s) / self.timetable.recentre_s)


class RepeatedPullback:
    """Pullback tests one after another, or with `on_demand` each when it is asked for.

    Each test leaves the plate where it came to rest, and the next one begins there unless the operator
    re-centres it. Friction along the track and wear begin anew with each test, so the motion is the same. A
    test that is let go too early is followed by a full one at once; `release_from` gives its motion.
    """

    def __init__(
        self,
        pullback_m: float,
        released: Motion,
        timetable: Timetable,
        plate_offset_m: float = 0.0,
        *,
        on_demand: bool = False,
        release_from: Callable[[float], Motion] | None = None,
    ) -> None:
        self.pullback_m = pullback_m
        self.released = released
        self.timetable = timetable
        self._first_offset_m = plate_offset_m
        self._on_demand = on_demand
        self._release_from = release_from
        self._tests: list[PullbackTest] = []
        self._full_tests = 0
        self._early_s = 0.0  # time that tests took which were let go too early
        self._early_m: float | None = None
        self._evaluated_s = 0.0

    def restart(self) -> None:
        """Begin anew at time 0."""
        self._tests.clear()
        self._full_tests, self._early_s, self._evaluated_s, self._early_m = 0, 0.0, 0.0, None

    def let_go_early(self, pulled_m: float | None = None) -> None:
        """Let the next test go as soon as the table is pulled so far, a third of the pullback if None."""
        self._early_m = pulled_m or _EARLY * abs(self.pullback_m)

    def request(self, now_s: float) -> None:
        """Begin a test as soon as it can be, unless the last one is not released yet.

        A table that swings is stilled first.
        """
        start_s = max(now_s, self._evaluated_s)
        last = self._tests[-1] if self._tests else None
        if not self._on_demand or (last is not None and start_s < last.release_s):
            return
        if last is not None and start_s < last.release_s + last.timetable.decay_s:
            last = self._tests[-1] = last.stilled(start_s)
        self._begin(start_s if last is None else max(start_s, last.end_s))

    def displacements(self, time_s: Floats) -> tuple[Floats, Floats]:
        """Table against base and plate against table (m), each (n,), at times since the first test began."""
        table, relative = np.zeros(len(time_s)), np.full(len(time_s), self._first_offset_m)
        for picked, test in self._parts(time_s):
            table[picked], relative[picked] = test.displacements(time_s[picked])
        return table, relative

    def drift_time_s(self, time_s: Floats) -> Floats:
        """Time (s) since the zero was last set, while the table was stilled; 0 before the first test."""
        drift_s = np.zeros(len(time_s))
        for picked, test in self._parts(time_s):
            drift_s[picked] = test.drift_time_s(time_s[picked])
        return drift_s

    def count_releases(self, until_s: float) -> int:
        """Number of releases until then, early ones among them."""
        self._follow_on(until_s)
        count = len(self._tests)
        while count and self._tests[count - 1].release_s > until_s:
            count -= 1
        return count

    def first_tests(self, count: int) -> list[PullbackTest]:
        return self._tests[:count]

    def _parts(self, time_s: Floats) -> list[tuple[Flags, PullbackTest]]:
        """Which of the times (n,) fall into each test, and into the rest after it."""
        self._evaluated_s = max(self._evaluated_s, float(time_s.max(initial=0.0)))
        self._follow_on(self._evaluated_s)
        numbers = np.searchsorted([test.start_s for test in self._tests], time_s, side="right") - 1
        return [(numbers == number, self._tests[number]) for number in np.unique(numbers) if number >= 0]

    def _follow_on(self, until_s: float) -> None:
        """Begin the tests that follow by themselves."""
        count = self.timetable.count
        while not self._on_demand and (count is None or self._full_tests < count):
            start_s = self._early_s + self._full_tests * self.timetable.cycle_s
            if start_s > until_s:
                return
            self._begin(start_s)

    def _begin(self, start_s: float) -> None:
        early_m, self._early_m = self._early_m, None
        every = self.timetable.recentre_every
        if early_m is not None and self._release_from is not None:
            usual, pullback_m = self.timetable, math.copysign(early_m, self.pullback_m)
            timetable = replace(usual, hold_s=_EARLY_HOLD_S, decay_s=min(_EARLY_DECAY_S, usual.decay_s))
            released = self._release_from(pullback_m)
            early = PullbackTest(start_s, pullback_m, released, timetable, self._offset_m, every > 0)
            self._tests.append(early)
            self._early_s += timetable.parts_s
            start_s = early.end_s
        self._full_tests += 1
        is_put_back = every > 0 and self._full_tests % every == 0
        test = PullbackTest(
            start_s, self.pullback_m, self.released, self.timetable, self._offset_m, is_put_back
        )
        self._tests.append(test)

    @property
    def _offset_m(self) -> float:
        """Position of the plate (m) before the next test."""
        return self._tests[-1].last_offset_m if self._tests else self._first_offset_m


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
