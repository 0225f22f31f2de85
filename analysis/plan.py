"""Plan of a test: expected motion, gauge ranges in use, and expected uncertainty of f_d.

The uncertainty is that of the joint fit at its minimum: Fisher information of readings with white noise about
the exact motion, and every stated source by the law of propagation, as in `identify`. Where chi-square is no
parabola (f_s close to f_d), a real test may report a larger uncertainty.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Self

import numpy as np

from analysis.arrays import Floats
from analysis.catalogue import MILLIMETRE
from analysis.fitting.problem import FitProblem, predict_gauge_1, predict_gauge_2
from analysis.fitting.search import Fit, build_problem_from_channels, fit_at_minimum
from analysis.fitting.stand_search import stand_problem
from analysis.laws.catalogue import compared_law, default_point
from analysis.laws.law import FrictionLaw
from analysis.laws.parameters import Parameter
from analysis.laws.stand_parts import (
    CORNER_NAMES,
    EFFECTS,
    PULLBACK_POWERS,
    StandEffect,
    StandModel,
    compose,
    extended_point,
    squared_constant_s2,
)
from analysis.motion.two_mass import Motion, TwoMassParameters
from analysis.preparation.channels import SAMPLES_MIN, Channel
from analysis.preparation.free_decay import TAIL_PERIODS_MIN
from analysis.quantities import BudgetLine, BudgetSource, Quantity, ResultWarning, result_warning
from analysis.record import AnalysisError, GaugeUncertainty, Record, StandMasses, unstated_gain_warnings
from analysis.results.diagnosis import result_names
from analysis.results.fitted_quantities import msk64_degree
from analysis.results.joint_fit import (
    FRICTION_PARAMETERS,
    SIGNED_PARAMETERS,
    add_systematic_uncertainty,
    law_places,
)
from analysis.uncertainty import LinearForm, UncertaintyBudget, propagate_expected
from messages.i18n import N_
from messages.message import message

CLOCK_UNCERTAINTY = 5e-5  # relative, of a device's rate after ten seconds beside a quiet host (decision 6)
_NOTHING_STATED = GaugeUncertainty()
_RELEASE_PHASE = 0.3  # of the release between two samples: a real one hardly ever coincides with one
_SETTLED_S = 60.0  # shortest simulated duration: the motion has ended by then
_NOISE_MIN_M = 1e-7  # with less, rounding errors decide the normal equations
_FRICTION_MIN = 1e-4  # the search does not look for less
_PER_PERIOD = 400  # points a period: extremes of a sine are then exact to 3e-5 of the amplitude
_READINGS_MAX, _PERIODS_MAX = 1e7, 1e4  # more than a small computer holds, and than any test lasts
_TESTS_MAX = 1000  # in a row without re-centring; more counts as any number


@dataclass(frozen=True, kw_only=True)
class PlannedTest:
    """A planned test, with the stated uncertainties of stand and gauges.

    Raises AnalysisError for impossible values.
    """

    parameters: TwoMassParameters
    rate_hz: float = 1000.0
    duration_s: float = 10.0
    hold_s: float = 1.0
    noise_m: float = 2e-5  # standard deviation of the readings of both gauges; at least 0.1 µm
    table_mass_uncertainty_kg: float = 0.0
    plate_mass_uncertainty_kg: float = 0.0
    gravity_uncertainty_m_per_s2: float = 0.0
    clock_scale_uncertainty: float = CLOCK_UNCERTAINTY
    table_gauge: GaugeUncertainty = _NOTHING_STATED
    relative_gauge: GaugeUncertainty = _NOTHING_STATED
    gauge_2_measures_plate: bool = False  # gauge 2 measures against the base instead of the table
    effects: Mapping[str, float] = field(default_factory=dict)
    """Sizes of the stand's effects at `effects_pullback_m`, by the names of their results. The analysis is
    expected to find these effects, and fits their sizes."""
    effects_pullback_m: float | None = None  # None: the planned one
    model_spread: float = 0.0  # standard uncertainty of f_d as a share, by what models leave unexplained

    def __post_init__(self) -> None:
        for name in ("rate_hz", "duration_s", "hold_s", "noise_m"):
            value = getattr(self, name)
            if not 0.0 < value < math.inf:
                raise AnalysisError(
                    "{name} is {value:g}: give a positive number to plan a test with", name=name, value=value
                )
        friction = self.parameters.friction_dynamic
        if friction < _FRICTION_MIN:
            template = N_(
                "friction_dynamic is {friction_dynamic:g}: give {friction_min:g} or more to plan a test with"
            )
            raise AnalysisError(template, friction_dynamic=friction, friction_min=_FRICTION_MIN)
        readings, periods = self.rate_hz * (self.duration_s + self.hold_s), self.duration_s / self.period_s
        for many, what, most in ((readings, "readings", _READINGS_MAX), (periods, "periods", _PERIODS_MAX)):
            if many > most:
                raise AnalysisError(
                    "the test would have {many:.3g} {what}, {most:.0g} are planned at most."
                    " Check rate, duration, stiffness and masses",
                    many=many,
                    what=message(what),
                    most=most,
                )

    def replace(self, **changes: Any) -> Self:
        return replace(self, **changes)

    @property
    def law(self) -> FrictionLaw:
        static = self.parameters.static_or_dynamic > self.parameters.friction_dynamic
        law = compared_law(static_friction=static, tilt=self.parameters.tilt_rad != 0.0)
        return compose(law, self.stand_effects) if self.stand_effects else law

    @property
    def stand_effects(self) -> tuple[StandEffect, ...]:
        """Effects of which all sizes are given."""
        return tuple(
            effect
            for effect in EFFECTS
            if (names := result_names(effect)) and all(name in self.effects for name in names)
        )

    @property
    def stand_values(self) -> dict[str, float]:
        """Parameters of the effects at the planned pullback, by name."""
        pullback_m = abs(self.parameters.pullback_m)
        over = pullback_m / abs(self.effects_pullback_m) if self.effects_pullback_m else 1.0
        values = {name: size * over ** PULLBACK_POWERS.get(name, 0) for name, size in self.effects.items()}
        corners = {own: values.pop(name) for own, name in CORNER_NAMES.items() if name in values}
        return values | {own: squared_constant_s2(corner_hz) for own, corner_hz in corners.items()}

    @property
    def period_s(self) -> float:
        k1, n1 = _joint(self.parameters)
        return 2.0 * math.pi / math.sqrt(k1**2 - n1**2)

    def motion(self) -> Motion:
        duration_s, law = max(self.duration_s, _SETTLED_S), self.law
        if not self.stand_effects:
            return self.parameters.simulate(duration_s)
        return law.simulate(self.parameters, [self.stand_values[own.name] for own in law.own], duration_s)


@dataclass(frozen=True, slots=True)
class RangeUse:
    """Readings of a gauge during a motion: from `lowest_m` to `highest_m`, within ±`range_m`."""

    lowest_m: float
    highest_m: float
    range_m: float | None

    @property
    def share(self) -> float | None:
        return None if self.range_m is None else max(abs(self.lowest_m), abs(self.highest_m)) / self.range_m

    def fits(self, shift_m: float = 0.0) -> bool:
        """Tell whether the readings stay within the range when they begin at `shift_m`."""
        limit = math.inf if self.range_m is None else self.range_m
        return -limit <= self.lowest_m + shift_m and self.highest_m + shift_m <= limit


@dataclass(frozen=True, eq=False, slots=True)
class Plan:
    """Expected outcome of a test."""

    law: FrictionLaw
    motion: Motion
    msk64_degree: str
    rest_s: float | None  # after the release, when the swing is as small as the noise; None without damping
    table_use: RangeUse
    relative_use: RangeUse  # from a centred plate
    tests_without_recentring: int | None  # that fit the range of gauge 2; None for any number
    results: dict[str, Quantity]  # friction_dynamic and friction_static; absent where undetermined
    budget: list[BudgetLine]
    warnings: list[ResultWarning]


def plan(test: PlannedTest) -> Plan:
    """Plan a test. Raises AnalysisError for an impossible one."""
    motion = test.motion()
    table_use, relative_use = range_use(test, motion)
    budget = expected_budget(test)

    offsets_m = motion.residual_displacement_m * np.arange(_TESTS_MAX)
    without = next((count for count, offset in enumerate(offsets_m) if not relative_use.fits(offset)), None)
    return Plan(
        test.law,
        motion,
        msk64_degree(motion.table_velocity_max_m_per_s),
        _rest_s(test),
        table_use,
        relative_use,
        without,
        budget.results,
        budget.lines,
        list(_warnings(test, motion, (table_use, relative_use), budget)),
    )


def range_use(test: PlannedTest, motion: Motion) -> tuple[RangeUse, RangeUse]:
    """Range in use of both gauges."""
    count = round(motion.duration_s / test.period_s * _PER_PERIOD) + 2
    times = np.union1d(np.linspace(0.0, motion.duration_s, count), motion.phase_starts_s)
    table, relative = motion.sample_displacements(times)
    second = relative + table if test.gauge_2_measures_plate else relative
    gauges = (table, test.table_gauge), (second, test.relative_gauge)
    first, other = (RangeUse(float(x.min()), float(x.max()), gauge.range_m) for x, gauge in gauges)
    return first, other


def expected_budget(test: PlannedTest) -> UncertaintyBudget:
    """Friction with its expected uncertainty by source; empty where the test does not determine it."""
    record, budget = _record(test), UncertaintyBudget()
    problem = _problem(test, record) if test.motion().slip_end_s > 0.0 else None
    if problem is None:
        return budget
    fit = _fit(test, problem)
    fitted = add_systematic_uncertainty(record, problem, fit, propagate_expected(problem, fit))
    for place, name in FRICTION_PARAMETERS.items():
        if place in test.law.free_parameters and fit.determines(place):
            value, shares = fit.value(place), LinearForm.of_parameter(fitted, place).contributions()
            if place == Parameter.FRICTION_DYNAMIC:
                shares[BudgetSource.MODEL] = test.model_spread * value
            budget.add(name, value, shares)
    return budget


def smallest_pullback_m(parameters: TwoMassParameters) -> float:
    """Smallest pullback at which the plate slips: k1^2 u0 reaches g (f_s - |tilt|)."""
    k1, _ = _joint(parameters)
    limit = parameters.static_or_dynamic - abs(parameters.tilt_rad)
    return parameters.gravity_m_per_s2 * limit / k1**2


def _joint(parameters: TwoMassParameters) -> tuple[float, float]:
    """k1 and n1 (rad/s, 1/s)."""
    mass = parameters.table_mass_kg + parameters.plate_mass_kg
    k1 = math.sqrt(parameters.stiffness_n_per_m / mass)
    return k1, parameters.damping_coefficient_kg_per_s / (2.0 * mass)


def _record(test: PlannedTest) -> Record:
    """Expected record without noise, with signs such that the pullback is positive."""
    held = round(test.hold_s * test.rate_hz)
    count = held + math.floor(test.duration_s * test.rate_hz)
    time_s = np.arange(count) / test.rate_hz
    since_s = np.minimum((np.arange(count) - held - _RELEASE_PHASE) / test.rate_hz, test.duration_s)
    parameters = test.parameters
    if test.stand_effects:
        point, law = _true_point(test), test.law
        table = predict_gauge_1(point, time_s, law)
        second = predict_gauge_2(point, time_s, law, test.gauge_2_measures_plate)
    else:
        side = -1.0 if parameters.pullback_m < 0.0 else 1.0
        table, relative = test.motion().sample_displacements(since_s)
        second = side * (relative + table if test.gauge_2_measures_plate else relative)
        table = side * table
    return Record(
        time_s,
        table,
        second,
        StandMasses(
            parameters.table_mass_kg,
            parameters.plate_mass_kg,
            test.table_mass_uncertainty_kg,
            test.plate_mass_uncertainty_kg,
            parameters.gravity_m_per_s2,
            test.gravity_uncertainty_m_per_s2,
        ),
        clock_scale_uncertainty=test.clock_scale_uncertainty,
        table_gauge=test.table_gauge,
        relative_gauge=test.relative_gauge,
        gauge_2_measures_plate=test.gauge_2_measures_plate,
    )


def _problem(test: PlannedTest, record: Record) -> FitProblem | None:
    """Fit problem of the expected record; None where a gauge has too few readings in its range."""
    channels = (
        _within(record.time_s, record.table_displacement_m, test.table_gauge.range_m),
        _within(record.time_s, record.relative_displacement_m, test.relative_gauge.range_m),
    )
    if min(map(len, channels)) < SAMPLES_MIN:
        return None
    noise_m = (max(test.noise_m, _NOISE_MIN_M),) * 2
    problem = build_problem_from_channels(
        record, channels, noise_m, test.period_s, absolute=test.gauge_2_measures_plate
    )
    law = test.law
    return stand_problem(problem, law) if isinstance(law, StandModel) else problem


def _within(time_s: Floats, value_m: Floats | None, range_m: float | None) -> Channel:
    if value_m is None:
        return Channel(np.empty(0), np.empty(0))
    kept = np.abs(value_m) <= (range_m or math.inf)
    return Channel(time_s[kept], value_m[kept])


def _fit(test: PlannedTest, problem: FitProblem) -> Fit:
    """Fit at the true parameters."""
    return fit_at_minimum(problem, test.law, problem.minimise(_true_point(test), test.law, 1))


def _true_point(test: PlannedTest) -> Floats:
    """Parameters of the fit (p,), turned so that the pullback is positive."""
    point, law = default_point(), test.law
    release_s = (round(test.hold_s * test.rate_hz) + _RELEASE_PHASE) / test.rate_hz
    motion = test.parameters.vector(release_s)
    point[: len(motion)] = motion
    if isinstance(law, StandModel):
        point, values = extended_point(point), test.stand_values
        for place, name in law_places(law).items():
            point[place] = values[name]
    if test.parameters.pullback_m < 0.0:
        point[[place for place in SIGNED_PARAMETERS if place < len(point)]] *= -1.0
    return point


def _rest_s(test: PlannedTest) -> float | None:
    motion = test.motion()
    _, n1 = _joint(test.parameters)
    if n1 == 0.0:
        return None
    start_s = min(motion.slip_end_s, motion.duration_s)
    since_s = np.linspace(max(0.0, start_s - test.period_s), start_s, _PER_PERIOD)
    table, _ = motion.sample_displacements(since_s)
    swing_m = 0.5 * float(np.ptp(table)) if start_s > 0.0 else abs(test.parameters.pullback_m)
    return start_s + max(0.0, math.log(max(swing_m, 1e-12) / test.noise_m)) / n1


def _warnings(
    test: PlannedTest, motion: Motion, uses: tuple[RangeUse, RangeUse], budget: UncertaintyBudget
) -> Iterator[ResultWarning]:
    remedies = (message("Pull back less."), message("Place the plate off centre, or pull back less."))
    for number, use, remedy in zip((1, 2), uses, remedies, strict=True):
        if use.range_m is not None and not use.fits():
            yield result_warning(
                f"gauge-{number}-range",
                "gauge {number} will read {read}, beyond its range of {range_m:.2f} mm: clipped"
                " readings are left out. {remedy}",
                number=number,
                read=f"{MILLIMETRE.number(use.lowest_m, 2)} to {MILLIMETRE.text(use.highest_m, 2)}",
                range_m=MILLIMETRE.scale * use.range_m,
                remedy=remedy,
            )
    if motion.slip_end_s == 0.0:
        needed_mm = MILLIMETRE.scale * smallest_pullback_m(test.parameters)
        template = N_("the plate will not slip: it takes a pullback of more than {needed_mm:.2f} mm.")
        yield result_warning("no-slip", template, needed_mm=needed_mm)
        return
    if motion.slip_end_s >= test.duration_s:
        template = N_("the plate will still slip after {duration_s:g} s. Record longer.")
        yield result_warning("slip-to-end", template, duration_s=test.duration_s)
    elif test.duration_s < (needed_s := motion.slip_end_s + TAIL_PERIODS_MIN * test.period_s):
        template = N_("the stick tail will be shorter than two periods. Record {needed_s:.1f} s or more.")
        yield result_warning("tail-too-short", template, needed_s=needed_s)
    if "friction_dynamic" not in budget.results:
        yield result_warning(
            "friction-undetermined",
            "the record will not tell f_d. Sample faster and longer, within the gauges' ranges.",
        )
    yield from unstated_gain_warnings(test.table_gauge, test.relative_gauge)
