"""Identification while the motion still dies away: running friction, period and damping.

Once a release and a few swings are recorded, minima are searched as for a whole record. After that each law
is refined from its last minimum. When no law explains the readings any more, the search is repeated. As long
as none does, friction comes from the plate alone: on a stand that is not ideal the joint fit is off by more
than its uncertainty. Further searches take a step in each update then.

Values and uncertainties are those that `analysis.identify` would find in the readings so far. Effects of a
stand are not fitted, but a law that explains the readings is tested for what it may miss: that widens f_d.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import chain, cycle

import numpy as np

from analysis.arrays import Floats
from analysis.averaging import average_record
from analysis.fitting.problem import FitProblem, motion_phases
from analysis.fitting.search import Fit, Search, build_problem, fit_at_minimum, guess_release, initial_guess
from analysis.fitting.stand_search import MissingEffect, StandSearch, friction_spread
from analysis.laws.catalogue import COMPARED_LAWS, PARAMETER_COUNT
from analysis.laws.law import FrictionLaw
from analysis.laws.parameters import Parameter
from analysis.laws.stand_parts import EFFECTS
from analysis.plate.friction import PlateFriction, estimate_plate_friction
from analysis.preparation.extension import extend_decay, refine_tail
from analysis.preparation.free_decay import FreeDecay, prepare
from analysis.quantities import BudgetSource, OtherLaw, Quantity
from analysis.record import Record, RecordError
from analysis.results.fitted_quantities import (
    ROUGH_END_PERIODS,
    find_slip_end,
    parameter_contributions,
    range_of_tied_static_friction,
)
from analysis.results.joint_fit import (
    DecayConstants,
    JointFit,
    choose_law,
    constants_from_joint_fit,
    constants_from_tail,
    identifiable_fits,
    joint_fit_uncertainty,
)
from analysis.results.verdict import MISFIT_MAX, combine_estimates
from analysis.stopping_rule import (
    LATEST_END_S,
    friction_variance_reduction,
    is_worth_waiting,
    tail_variance_reduction,
)
from analysis.uncertainty import NEGLIGIBLE, ParameterUncertainty

_FIRST_PERIODS = 1.5
_READINGS = 1200  # readings a channel for refining; the chosen law then sees all
_READINGS_SEARCHED = 600  # for a search in steps: the longest step is as long as a full analysis
_LOST = 1.3  # mean square of the residual over that of the noise from which on the motion was lost
_AGAIN = 1.1  # a search is not repeated before the record is longer by this factor ...
_AFTER_FAILURE = 2.0  # ... where it found no law that fits: on such a stand the next finds none either
_LIKELY = 20.0  # of the BIC with some readings: laws above the best by more stay out with all of them
_AGREE_SIGMAS = 3.0  # of the plate alone: a law that is all but adequate is shown where both agree so well
_CONTRADICTION = (
    0.2  # of f_d between the plate and all laws: gauges that do not show the table mislead the plate
)
_SPREAD_OF_PLATE = 0.005  # of f_d: stands that no law explains mislead the plate so far, by study_real_stand
_STEPS = 3
_ENDED = object()  # in place of a step of a search
_ANEW_S = 0.5  # interval of full analyses once slip has ended; between them the chosen law is refined
_CHECK_AGAIN = 0.05  # part by which a record grows between checks, which take as long as an analysis
_HALVES = EFFECTS[::2], EFFECTS[1::2]
"""Effects that are tested for in one check, and in the next: all at once would take too long."""
_ALL = (0, 1)
_CHECKS = ((0,), (1,), ())  # halves that a check tests for; without any it finds the begin of the tail
_SAME_START = 0.1  # tails that begin so close, in periods, are one
_TAIL_PERIODS = 10.0  # of a tail from which on it is computed what a longer one would narrow
_FRICTION_WEIGHTS = np.eye(PARAMETER_COUNT)[Parameter.FRICTION_DYNAMIC]
FRICTION, PERIOD, DAMPING = "friction_dynamic", "period_s", "damping_n1_per_s"


@dataclass(frozen=True, slots=True)
class LiveState:
    """What is known so far; None before it can be known."""

    time_s: float  # last row seen, in the record's time
    release_s: float | None = None
    """In the record's time; the slip end as fitted, None while the plate still slips."""
    slip_end_s: float | None = None
    law: str | None = None  # likeliest law so far
    friction_dynamic: Quantity | None = None  # of the joint fit, once a law explains the readings
    period_s: Quantity | None = None
    damping_n1_per_s: Quantity | None = None
    friction_dynamic_plate: Quantity | None = None  # from the plate alone, before that
    narrowing: tuple[str, ...] = (FRICTION, PERIOD, DAMPING)
    """Which of these three readings until 20 s after the release would still narrow by more than a twentieth
    of their standard uncertainty (`analysis.stopping_rule`)."""
    may_stop: bool = False
    """True once slip has ended, the law is adequate, and waiting does not narrow f_d (where nothing slips:
    neither of the others)."""
    is_enough: bool = False  # the same with none of the three narrowed: the record may end by itself


class LiveIdentification:
    """Follows one test. Hand `update` the whole record so far, as often as wanted."""

    def __init__(self) -> None:
        self._minima: dict[FrictionLaw, Floats] = {}
        self._searched_s = 0.0
        self._failed_s = 0.0
        """Length of the record, after the release, when a search last found no law that fits."""
        self._search: Iterator[None] | None = None  # under way, a step in each update
        self._last: _LiveFit | None = None
        self._is_doubted = False  # whether the chosen law leaves more than noise
        self._checked: FrictionLaw | None = None
        self._checked_s, self._check_s = -np.inf, -np.inf  # when the law was checked, and is to be next
        self._checks: Iterator[tuple[int, ...]] = iter(())
        self._missing: list[list[MissingEffect]] = [[] for _ in _HALVES]  # as last tested
        self._by_plate: _PlateFit | None = None  # the last without an adequate law

    def update(self, record: Record) -> LiveState:
        """Take the record so far; never raises for what it does not hold yet."""
        now_s = float(record.time_s[-1]) if len(record.time_s) else 0.0
        record = average_record(record)
        try:
            known = (
                self._check(record, now_s)
                or self._refine(record, now_s)
                or self._continue_search(now_s)
                or self._extend_by_plate(record, now_s)
                or self._analyse_again(record, now_s)
            )
        except (RecordError, np.linalg.LinAlgError):  # half a record may be anything
            return LiveState(now_s)
        if isinstance(known, LiveState):
            self._last = None
            return known
        self._last, self._by_plate, self._search = known, None, None
        return known.state

    def _check(self, record: Record, now_s: float) -> "_LiveFit | None":
        """Test the law for some of the effects that it may miss, or find the begin of the tail again.

        None while no check is due. What else is known stays: with a fit besides, the update would take too
        long.
        """
        last = self._last
        if last is None or not 0.0 < now_s - self._check_s < _ANEW_S:
            return None
        if self._is_doubted or last.state.time_s <= self._checked_s:
            return None
        if record.clock_scale != last.joint.record.clock_scale:
            return None
        halves, joint = next(self._checks), last.joint
        self._test(joint, halves, now_s)
        if not halves:
            joint = replace(joint, decay=joint.decay.with_tail_from(_tail_start(joint)))
        known = self._known(now_s, joint, last.plate)
        return replace(
            last, state=_as_before(known.state, last.state), joint=joint, constants=known.constants
        )

    def _test(self, joint: JointFit, halves: tuple[int, ...], now_s: float) -> None:
        """Test the law for these halves of the effects, and set when it is checked again."""
        search = Search(joint.problem, joint.problem, joint.decay.period_s, joint.decay.dense_until_s)
        stand_search = StandSearch(search, joint.chosen.law, joint.chosen)
        for half in halves:
            self._missing[half] = stand_search.missing_effects(joint.chosen, _HALVES[half])
        self._checked_s, self._check_s = now_s, now_s + max(_ANEW_S, _CHECK_AGAIN * joint.duration_s)

    @property
    def _missed(self) -> float:
        """Standard uncertainty of f_d by effects that the law may miss."""
        return friction_spread([effect for half in self._missing for effect in half])

    def _refine(self, record: Record, now_s: float) -> "_LiveFit | None":
        """Refine the chosen law with the new readings; None when a full analysis is due."""
        last = self._last
        if last is None or last.joint.decay.tail is None or now_s > last.anew_s + _ANEW_S:
            return None
        tail = last.joint.decay.tail
        decay = extend_decay(last.joint.decay, record)
        if decay is None:
            return None
        problem = build_problem(record, decay)
        law = last.joint.chosen.law
        fit = fit_at_minimum(problem, law, problem.minimise(last.joint.chosen.parameters, law, _STEPS))
        if not _explains(problem, fit):
            return None
        fitted = _with_other_laws(
            joint_fit_uncertainty(record, decay, problem, fit, [fit]), last.joint.uncertainty
        )
        decay = refine_tail(decay, tail)
        joint = JointFit(record, decay, problem, fit, [fit], fitted, last.joint.selection)
        known = self._known(now_s, joint, last.plate)
        return replace(known, state=_as_before(known.state, last.state), anew_s=last.anew_s)

    def _continue_search(self, now_s: float) -> LiveState | None:
        """Take a step of the search that is under way, and repeat what is known; None where there is none."""
        if self._search is None or self._by_plate is None:
            return None
        if next(self._search, _ENDED) is _ENDED:
            self._search = None
        return replace(self._by_plate.state, time_s=now_s)

    def _extend_by_plate(self, record: Record, now_s: float) -> LiveState | None:
        """Extend the tail after the last slip; None when a full analysis is due."""
        last = self._by_plate
        if last is None or last.decay.tail is None or now_s > last.anew_s + _ANEW_S:
            return None
        decay = extend_decay(last.decay, record)
        if decay is None:
            return None
        decay = refine_tail(decay, last.decay.tail)
        period, damping = _period_and_damping(constants_from_tail(record, decay))
        return replace(last.state, time_s=now_s, period_s=period, damping_n1_per_s=damping)

    def _analyse_by_plate(self, record: Record, decay: FreeDecay, now_s: float) -> LiveState:
        """What is known without an adequate law: friction from the plate alone, and the tail."""
        friction, last = None, self._by_plate
        if decay.slip_end_s is not None:
            decay = decay.with_tail_from(decay.slip_end_s + 2.0 * ROUGH_END_PERIODS * decay.period_s)
        if last is not None and _have_same_slips(last.decay, decay):
            friction = last.state.friction_dynamic_plate
        elif (plate := estimate_plate_friction(record, decay)) is not None and self._may_hold(plate):
            deviation = float(np.hypot(plate.standard_uncertainty, _SPREAD_OF_PLATE * plate.friction_dynamic))
            friction = Quantity.normal(plate.friction_dynamic, deviation, "1")
        to_record = decay.channels.to_record_time
        period, damping = None, None
        if decay.tail is not None:
            period, damping = _period_and_damping(constants_from_tail(record, decay))
        state = LiveState(
            now_s,
            to_record(decay.release.time_s),
            None if decay.slip_end_s is None or decay.tail is None else to_record(decay.slip_end_s),
            friction_dynamic_plate=friction,
            period_s=period,
            damping_n1_per_s=damping,
        )
        self._by_plate = _PlateFit(state, decay, now_s)
        return state

    def _may_hold(self, plate: PlateFriction) -> bool:
        """Whether neither its own readings nor all laws contradict friction from the plate alone."""
        found = [point[Parameter.FRICTION_DYNAMIC] for point in self._minima.values()]
        is_near = any(abs(plate.friction_dynamic / value - 1.0) < _CONTRADICTION for value in found)
        return plate.misfit < MISFIT_MAX and (is_near or not found)

    def _analyse_again(self, record: Record, now_s: float) -> "_LiveFit | LiveState":
        """Analyse the whole record again, as if it were complete."""
        decay = prepare(record)
        release_s = decay.channels.to_record_time(decay.release.time_s)
        since_s = float(decay.table.time_s[-1]) - decay.release.time_s
        if since_s < _FIRST_PERIODS * decay.period_s:
            return LiveState(now_s, release_s)
        if not decay.slips:
            return _without_slip(now_s, release_s, record, decay)
        if since_s < _AFTER_FAILURE * self._failed_s:
            return self._analyse_by_plate(record, decay, now_s)
        problem = build_problem(record, decay)
        fits = self._fit_laws(record, decay, problem, since_s)
        if not fits:
            return self._analyse_by_plate(record, decay, now_s)
        joint = self._choose_law(record, decay, problem, fits)
        plate, self._is_doubted = None, not joint.selection.adequate
        if joint.chosen.law is not self._checked:
            self._checked, self._check_s, self._checks = (
                joint.chosen.law,
                now_s,
                chain([_ALL], cycle(_CHECKS)),
            )
        elif now_s >= self._check_s + _ANEW_S and not self._is_doubted:  # updates are rare
            self._test(joint, _ALL, now_s)
        if self._is_doubted:
            by_plate = self._analyse_by_plate(record, decay, now_s)
            plate = by_plate.friction_dynamic_plate
            if not (_explains(problem, joint.chosen) and _agree(joint.chosen, plate)):
                return by_plate
        known = self._known(now_s, replace(joint, decay=self._with_tail_of(joint)), plate)
        narrowing, adequate = self._narrowing(known), joint.selection.adequate
        state = replace(
            known.state,
            narrowing=narrowing,
            may_stop=adequate and FRICTION not in narrowing,
            is_enough=adequate and not narrowing,
        )
        return replace(known, state=state)

    def _with_tail_of(self, joint: JointFit) -> FreeDecay:
        """The decay with the stick tail, from its last begin on where the law is the same."""
        last = self._last
        is_same = last is not None and last.joint.chosen.law is joint.chosen.law
        tail = last.joint.decay.tail if last is not None and is_same else None
        if tail is None or _stuck_since(joint) is None:
            return joint.decay.with_tail_from(_tail_start(joint))
        return refine_tail(joint.decay, tail)

    def _choose_law(self, record: Record, decay: FreeDecay, problem: FitProblem, fits: list[Fit]) -> JointFit:
        """Fit the likely laws to all readings, and choose the likeliest."""
        candidates = identifiable_fits(fits)
        best = min(fit.bic for fit in candidates)
        likely = [
            fit_at_minimum(problem, fit.law, problem.minimise(fit.parameters, fit.law, _STEPS))
            for fit in candidates
            if fit.bic <= best + _LIKELY
        ]
        self._minima.update({fit.law: fit.parameters for fit in likely})
        return choose_law(record, decay, problem, likely)

    def _known(self, now_s: float, joint: JointFit, plate: Quantity | None) -> "_LiveFit":
        """Results of the fitted law, period and damping from the tail where there is one.

        `plate` is f_d of the plate alone where the law is not adequate: its period and damping do not count.
        """
        constants, period, damping = None, None, None
        if joint.decay.tail is not None:
            constants = constants_from_tail(joint.record, joint.decay)
        elif joint.selection.adequate:
            constants = constants_from_joint_fit(joint.chosen, joint.uncertainty)
        if constants is not None:
            period, damping = _period_and_damping(constants)
        to_record, stuck_s = joint.decay.channels.to_record_time, _stuck_since(joint)
        state = LiveState(
            now_s,
            to_record(joint.chosen.value(Parameter.RELEASE)),
            None if stuck_s is None else to_record(stuck_s),
            joint.chosen.law.name,
            self._friction(joint, plate),
            period,
            damping,
        )
        return _LiveFit(state, joint, constants, plate, now_s)

    def _friction(self, joint: JointFit, plate: Quantity | None) -> Quantity:
        """f_d; that of a law that is not adequate and of the `plate` together."""
        shares, _ = parameter_contributions(joint, Parameter.FRICTION_DYNAMIC)
        deviation = float(np.hypot.reduce(list(shares.values())))
        own = Quantity.normal(joint.chosen.value(Parameter.FRICTION_DYNAMIC), deviation, "1")
        if plate is not None:
            value, together = combine_estimates(own, plate, joint.selection.residual_share or 0.0)
            return Quantity.normal(value, float(np.hypot.reduce(list(together.values()))), "1")
        if self._missed > NEGLIGIBLE * deviation:
            own = Quantity.normal(own.value, float(np.hypot(deviation, self._missed)), "1")
        return own

    def _narrowing(self, known: "_LiveFit") -> tuple[str, ...]:
        """Names of what readings until the latest end would still narrow."""
        joint = known.joint
        if joint.decay.tail is None or known.constants is None:
            return FRICTION, PERIOD, DAMPING
        end_s, place = joint.decay.release.time_s + LATEST_END_S, Parameter.FRICTION_DYNAMIC
        noise = float(joint.uncertainty.noise_covariance[place, place])
        removed = friction_variance_reduction(joint.problem, joint.chosen, noise, end_s)
        deviation = float(np.hypot(_beside_clock(joint.uncertainty, _FRICTION_WEIGHTS), self._missed))
        worth = is_worth_waiting(deviation, removed)
        return (FRICTION,) * worth + _narrowing_tail(joint.decay, known.constants, end_s)

    def _fit_laws(self, record: Record, decay: FreeDecay, problem: FitProblem, since_s: float) -> list[Fit]:
        """Refine every law; search where there is none yet, and again where none explains the readings.

        After a search that found no law another one takes a step in each of the next updates: the result is
        empty then.
        """
        some = problem.decimated(_READINGS, decay.dense_until_s)
        fits = self._refined(some)
        is_lost = not any(_explains(some, fit) for fit in fits)
        again = _AGAIN if is_lost else _AFTER_FAILURE
        if fits and not ((is_lost or self._is_doubted) and since_s >= again * self._searched_s):
            return fits
        few = problem.decimated(_READINGS_SEARCHED, decay.dense_until_s)
        if self._failed_s:
            self._search = self._search_minima(record, decay, few, since_s)
            return []
        for _ in self._search_minima(record, decay, few if fits else problem, since_s):
            pass
        return self._refined(some)

    def _refined(self, problem: FitProblem) -> list[Fit]:
        return [
            fit_at_minimum(problem, law, problem.minimise(parameters, law, _STEPS))
            for law, parameters in self._minima.items()
        ]

    def _search_minima(
        self, record: Record, decay: FreeDecay, problem: FitProblem, since_s: float
    ) -> Iterator[None]:
        """Search the minimum of every law, with a pause after each step."""
        self._searched_s = since_s
        start, guided = initial_guess(problem, decay)
        search = Search(problem, guided, decay.period_s, decay.dense_until_s)
        if decay.plateau is not None:
            points = [search.fit_first_slip(start)]
        else:
            points = guess_release(guided, start, decay.period_s, record.pullback_m)
        minima = yield from search.follow_minima(points)
        fits = yield from search.fit_closed_forms(COMPARED_LAWS, minima)
        self._minima = {fit.law: fit.parameters for fit in fits}
        if not any(_explains(problem, fit) for fit in fits):
            self._failed_s = since_s


@dataclass(frozen=True, eq=False, slots=True)
class _LiveFit:
    """What the next update begins with; `anew_s` is the time of the last full analysis."""

    state: LiveState
    joint: JointFit
    constants: DecayConstants | None
    plate: Quantity | None  # f_d of the plate alone, where the law is not adequate
    anew_s: float


@dataclass(frozen=True, eq=False, slots=True)
class _PlateFit:
    """What is known from the plate alone, at the full analysis at `anew_s`."""

    state: LiveState
    decay: FreeDecay
    anew_s: float


def _with_other_laws(own: ParameterUncertainty, rough: ParameterUncertainty) -> ParameterUncertainty:
    """The uncertainty of a fit with the doubt about its law from that of a rougher fit."""
    doubt = [(source, shift) for source, shift in rough.shifts.items() if isinstance(source, OtherLaw)]
    return replace(own, shifts=dict([*own.shifts.items(), *doubt]))


def _have_same_slips(before: FreeDecay, now: FreeDecay) -> bool:
    """Whether slip had ended before, and no reading of a slip is new since."""
    if before.slip_end_s is None or now.slip_end_s is None or before.tail is None:
        return False
    return abs(now.slip_end_s - before.slip_end_s) < _SAME_START * now.period_s


def _as_before(state: LiveState, last: LiveState) -> LiveState:
    """The state with what was last said of waiting."""
    return replace(state, narrowing=last.narrowing, may_stop=last.may_stop, is_enough=last.is_enough)


def _without_slip(now_s: float, release_s: float, record: Record, decay: FreeDecay) -> LiveState:
    if decay.tail is None:
        return LiveState(now_s, release_s)
    constants = constants_from_tail(record, decay)
    period, damping = _period_and_damping(constants)
    narrowing = _narrowing_tail(decay, constants, decay.release.time_s + LATEST_END_S)
    return LiveState(
        now_s,
        release_s,
        period_s=period,
        damping_n1_per_s=damping,
        narrowing=narrowing,
        may_stop=not narrowing,
        is_enough=not narrowing,
    )


def _narrowing_tail(decay: FreeDecay, constants: DecayConstants, end_s: float) -> tuple[str, ...]:
    """Which of period and damping a tail until `end_s` would still narrow."""
    if decay.tail is None or decay.tail.periods <= _TAIL_PERIODS:
        return PERIOD, DAMPING
    removed = tail_variance_reduction(decay.tail, end_s) * np.diag(constants.uncertainty.noise_covariance)[:2]
    deviations = [_beside_clock(constants.uncertainty, weights) for weights in np.eye(4)[:2]]
    pairs = zip((PERIOD, DAMPING), deviations, removed, strict=True)
    return tuple(name for name, deviation, variance in pairs if is_worth_waiting(deviation, float(variance)))


def _beside_clock(known: ParameterUncertainty, weights: Floats) -> float:
    """Standard uncertainty but for the time base: a longer run times the device's clock better, too."""
    shares = known.contributions(weights)
    return float(
        np.sqrt(sum(share**2 for source, share in shares.items() if source is not BudgetSource.TIME_BASE))
    )


def _period_and_damping(constants: DecayConstants) -> tuple[Quantity, Quantity]:
    deviations = [constants.uncertainty.standard_uncertainty(weights) for weights in np.eye(4)[:2]]
    return (
        Quantity.normal(float(constants.point[0]), deviations[0], "s"),
        Quantity.normal(float(constants.point[1]), deviations[1], "1/s"),
    )


def _explains(problem: FitProblem, fit: Fit) -> bool:
    return fit.chi_square < _LOST * problem.sample_count


def _agree(fit: Fit, plate: Quantity | None) -> bool:
    """Whether the plate alone confirms a fit."""
    if plate is None:
        return False
    difference = fit.value(Parameter.FRICTION_DYNAMIC) - plate.value
    return abs(difference) < _AGREE_SIGMAS * plate.standard_uncertainty


def _tail_start(joint: JointFit) -> float | None:
    """When slip has ended for certain; None until it has for a period."""
    if _stuck_since(joint) is None:
        return None
    slip_end = find_slip_end(joint, range_of_tied_static_friction(joint))
    return None if slip_end is None else slip_end.upper_limit_s


def _stuck_since(joint: JointFit) -> float | None:
    """Fitted slip end, once the plate has stuck for a period."""
    release_s, now_s = joint.chosen.value(Parameter.RELEASE), joint.end_s
    last = motion_phases(joint.chosen.parameters, joint.chosen.law, now_s - release_s)[-1]
    end_s = float(last[0]) + release_s
    return end_s if last[1] == 0.0 and now_s - end_s > joint.decay.period_s else None
