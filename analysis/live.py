"""Identification while the motion still dies away: running friction, period and damping.

Once a release and a few swings are recorded, minima are searched as for a whole record. After that each law
is refined from its last minimum. When no law explains the readings any more, the search is repeated. As long
as none does, friction comes from the plate alone: on a stand that is not ideal the joint fit is off by more
than its uncertainty. Further searches take a step in each update then; effects of a stand are not looked for.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from analysis.arrays import Floats
from analysis.averaging import average_record
from analysis.fitting.problem import FitProblem, covariance, motion_phases
from analysis.fitting.search import Fit, Search, build_problem, fit_at_minimum, guess_release, initial_guess
from analysis.laws.catalogue import COMPARED_LAWS, PARAMETER_COUNT
from analysis.laws.law import FrictionLaw
from analysis.laws.parameters import Parameter
from analysis.plate.friction import estimate_plate_friction
from analysis.preparation.channels import Channel, remove_drift
from analysis.preparation.free_decay import FreeDecay, prepare
from analysis.preparation.oscillation import DampedCosine, damped_cosine, refit_damped_cosine
from analysis.quantities import BudgetSource, Quantity
from analysis.record import GaugeUncertainty, Record, RecordError
from analysis.results.joint_fit import (
    DecayConstants,
    assess_model,
    constants_from_joint_fit,
    constants_from_tail,
    identifiable_fits,
    joint_fit_uncertainty,
)
from analysis.uncertainty import ParameterUncertainty

_FIRST_PERIODS = 1.5
_READINGS = 1200  # readings a channel for refining; the chosen law then sees all
_READINGS_SEARCHED = 600  # for a search in steps: the longest step is as long as a full analysis
_LOST = 1.3  # mean square of the residual over that of the noise from which on the motion was lost
_AGAIN = 1.1  # a search is not repeated before the record is longer by this factor ...
_AFTER_FAILURE = 2.0  # ... where it found no law that fits: on such a stand the next finds none either
_AGREE_SIGMAS = 3.0  # of the plate alone: a law that is all but adequate is shown where both agree so well
_STEPS = 3
_ENDED = object()  # in place of a step of a search
_ANEW_S = 0.5  # interval of full analyses once slip has ended; between them the chosen law is refined
_SAME_START = 0.1  # tails that begin so close, in periods, are one
_TAIL_PERIODS = 10.0
"""A tail this long gives period and damping. Until then the joint fit determines them far better."""
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
    of their standard uncertainty (`analysis.live`)."""
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
        self._by_plate: _PlateFit | None = None  # the last without an adequate law

    def update(self, record: Record) -> LiveState:
        """Take the record so far; never raises for what it does not hold yet."""
        now_s = float(record.time_s[-1]) if len(record.time_s) else 0.0
        record = average_record(record)
        try:
            known = (
                self._refine(record, now_s)
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

    def _refine(self, record: Record, now_s: float) -> "_LiveFit | None":
        """Refine the chosen law with the new readings; None when a full analysis is due."""
        last = self._last
        if last is None or last.decay.tail is None or now_s > last.anew_s + _ANEW_S:
            return None
        decay = extend_decay(last.decay, record)
        if decay is None:
            return None
        problem = build_problem(record, decay)
        law = last.fit.law
        fit = fit_at_minimum(problem, law, problem.minimise(last.fit.parameters, law, _STEPS))
        if not _explains(problem, fit):
            return None
        known = _known(now_s, record, decay, problem, fit, last.decay.tail)
        state = replace(
            known.state,
            narrowing=last.state.narrowing,
            may_stop=last.state.may_stop,
            is_enough=last.state.is_enough,
        )
        return replace(known, state=state, anew_s=last.anew_s)

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
        decay = _with_tail(decay, last.decay.tail.start_s, last.decay.tail)
        period, damping = _period_and_damping(constants_from_tail(record, decay))
        return replace(last.state, time_s=now_s, period_s=period, damping_n1_per_s=damping)

    def _analyse_by_plate(self, record: Record, decay: FreeDecay, now_s: float) -> LiveState:
        """What is known without an adequate law: friction from the plate alone, and the tail."""
        friction = None
        last = self._by_plate
        if last is not None and _have_same_slips(last.decay, decay):
            friction = last.state.friction_dynamic_plate
        elif (plate := estimate_plate_friction(record, decay)) is not None:
            friction = Quantity.normal(plate.friction_dynamic, plate.standard_uncertainty, "1")
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
        candidates = identifiable_fits(fits)
        best = min(candidates, key=lambda fit: fit.bic)
        chosen = fit_at_minimum(problem, best.law, problem.minimise(best.parameters, best.law, _STEPS))
        self._minima[chosen.law] = chosen.parameters
        judged = assess_model(problem, chosen, candidates, decay.noise_reading_counts, decay.period_s)
        if not judged.adequate:
            by_plate = self._analyse_by_plate(record, decay, now_s)
            if not (_explains(problem, chosen) and _agree(chosen, by_plate.friction_dynamic_plate)):
                return by_plate
        known = _known(now_s, record, decay, problem, chosen, None)
        narrowing = _narrowing(known, problem)
        state = replace(
            known.state,
            narrowing=narrowing,
            may_stop=judged.adequate and FRICTION not in narrowing,
            is_enough=judged.adequate and not narrowing,
        )
        return replace(known, state=state)

    def _fit_laws(self, record: Record, decay: FreeDecay, problem: FitProblem, since_s: float) -> list[Fit]:
        """Refine every law; search where there is none yet, and again where none explains the readings.

        After a search that found no law another one takes a step in each of the next updates: the result is
        empty then.
        """
        some = problem.decimated(_READINGS, decay.dense_until_s)
        fits = self._refined(some)
        if fits and (any(_explains(some, fit) for fit in fits) or since_s < _AGAIN * self._searched_s):
            return fits
        if self._failed_s:
            few = problem.decimated(_READINGS_SEARCHED, decay.dense_until_s)
            self._search = self._search_minima(record, decay, few, since_s)
            return []
        for _ in self._search_minima(record, decay, some if fits else problem, since_s):
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
    decay: FreeDecay
    fit: Fit
    fitted: ParameterUncertainty
    constants: DecayConstants
    anew_s: float


@dataclass(frozen=True, eq=False, slots=True)
class _PlateFit:
    """What is known from the plate alone, at the full analysis at `anew_s`."""

    state: LiveState
    decay: FreeDecay
    anew_s: float


def _known(
    now_s: float, record: Record, decay: FreeDecay, problem: FitProblem, fit: Fit, before: DampedCosine | None
) -> _LiveFit:
    """Results of the fitted law; `before` is the tail as last fitted."""
    fitted = joint_fit_uncertainty(record, decay, problem, fit, [fit])
    stuck_s = _stuck_since(fit, decay)
    decay = _with_tail(decay, stuck_s, before)
    is_tail = decay.tail is not None and decay.tail.periods > _TAIL_PERIODS
    constants = constants_from_tail(record, decay) if is_tail else constants_from_joint_fit(fit, fitted)
    period, damping = _period_and_damping(constants)
    to_record = decay.channels.to_record_time
    state = LiveState(
        now_s,
        to_record(fit.value(Parameter.RELEASE)),
        None if stuck_s is None else to_record(stuck_s),
        fit.law.name,
        _friction(fit, fitted),
        period,
        damping,
    )
    return _LiveFit(state, decay, fit, fitted, constants, now_s)


def _narrowing(known: _LiveFit, problem: FitProblem) -> tuple[str, ...]:
    """Names of what readings until the latest end would still narrow."""
    decay = known.decay
    if decay.tail is None:
        return FRICTION, PERIOD, DAMPING
    end_s = decay.release.time_s + LATEST_END_S
    noise = float(known.fitted.noise_covariance[Parameter.FRICTION_DYNAMIC, Parameter.FRICTION_DYNAMIC])
    removed = friction_variance_reduction(problem, known.fit, noise, end_s)
    worth = is_worth_waiting(_beside_clock(known.fitted, _FRICTION_WEIGHTS), removed)
    return (FRICTION,) * worth + _narrowing_tail(decay, known.constants, end_s)


def _have_same_slips(before: FreeDecay, now: FreeDecay) -> bool:
    """Whether slip had ended before, and no reading of a slip is new since."""
    if before.slip_end_s is None or now.slip_end_s is None or before.tail is None:
        return False
    return abs(now.slip_end_s - before.slip_end_s) < _SAME_START * now.period_s


def extend_decay(decay: FreeDecay, record: Record) -> FreeDecay | None:
    """`decay` extended by the later readings of the record, with the same signs.

    None where its motion had ended before, or the clock is now known to go otherwise.
    """
    if decay.channels.clock_scale != record.clock_scale:
        return None
    table = _newer(decay.table, record, record.table_displacement_m, record.table_gauge)
    table = remove_drift(table.scaled(decay.sign), decay.table_drift_m_per_s, decay.release.time_s)
    grown = replace(decay, table=_joined(decay.table, table))
    if decay.channels.table.time_s[-1] > decay.table.time_s[-1]:
        return None
    if decay.relative is None or record.relative_displacement_m is None:
        return grown
    relative = _newer(decay.relative, record, record.relative_displacement_m, record.relative_gauge)
    relative = remove_drift(relative.scaled(decay.relative_sign), decay.drift_m_per_s, decay.release.time_s)
    return replace(grown, relative=_joined(decay.relative, relative))


def _newer(channel: Channel, record: Record, value_m: Floats, gauge: GaugeUncertainty) -> Channel:
    """Readings after the last one of `channel`, on its time."""
    time_s = (record.time_s - record.time_s[0]) * record.clock_scale - gauge.lateness_s
    within = np.isfinite(value_m) & (time_s > channel.time_s[-1])
    if gauge.range_m is not None:
        within &= ~(np.abs(value_m) >= gauge.range_m)
    return Channel(time_s[within], value_m[within])


def _joined(before: Channel, after: Channel) -> Channel:
    return Channel(
        np.concatenate((before.time_s, after.time_s)), np.concatenate((before.value_m, after.value_m))
    )


def _with_tail(decay: FreeDecay, stuck_s: float | None, before: DampedCosine | None) -> FreeDecay:
    """The stick tail from the fitted slip end, as refined from the last one where that began there."""
    if stuck_s is None or before is None or abs(before.start_s - stuck_s) > _SAME_START * decay.period_s:
        return decay.with_tail_from(stuck_s)
    tail = refit_damped_cosine(decay.table.between(before.start_s, np.inf), before)
    return replace(decay, tail=tail, period_s=tail.period_s)


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


def _friction(chosen: Fit, fitted: ParameterUncertainty) -> Quantity:
    value = chosen.value(Parameter.FRICTION_DYNAMIC)
    return Quantity.normal(value, fitted.standard_uncertainty(_FRICTION_WEIGHTS), "1")


def _period_and_damping(constants: DecayConstants) -> tuple[Quantity, Quantity]:
    deviations = [constants.uncertainty.standard_uncertainty(weights) for weights in np.eye(4)[:2]]
    return (
        Quantity.normal(float(constants.point[0]), deviations[0], "s"),
        Quantity.normal(float(constants.point[1]), deviations[1], "1/s"),
    )


def _explains(problem: FitProblem, fit: Fit) -> bool:
    return fit.chi_square < _LOST * problem.sample_count


def _agree(fit: Fit, plate: Quantity | None) -> bool:
    """Whether the plate alone does not contradict a fit."""
    if plate is None:
        return True
    difference = fit.value(Parameter.FRICTION_DYNAMIC) - plate.value
    return abs(difference) < _AGREE_SIGMAS * plate.standard_uncertainty


def _stuck_since(chosen: Fit, decay: FreeDecay) -> float | None:
    """Fitted slip end, once the plate has stuck for a period."""
    release_s, now_s = chosen.value(Parameter.RELEASE), float(decay.table.time_s[-1])
    last = motion_phases(chosen.parameters, chosen.law, now_s - release_s)[-1]
    end_s = float(last[0]) + release_s
    return end_s if last[1] == 0.0 and now_s - end_s > decay.period_s else None


RELATIVE_REDUCTION_MIN = 0.05
"""Waiting that takes away a smaller part of a standard uncertainty is not worth it."""
LATEST_END_S = 20.0  # after the release no record goes on for longer
_LATER_READINGS = 400  # later readings a channel that stand for all of them, with the noise of their mean


def is_worth_waiting(deviation: float, removed_variance: float) -> bool:
    """Whether taking `removed_variance` away narrows a standard uncertainty by more than a twentieth."""
    return removed_variance > (1.0 - (1.0 - RELATIVE_REDUCTION_MIN) ** 2) * deviation**2


def friction_variance_reduction(problem: FitProblem, fit: Fit, noise_variance: float, end_s: float) -> float:
    """Variance of f_d that readings until `end_s` would take away.

    `noise_variance` is the part of the variance of f_d that comes from noise, as the residuals show it.
    """
    now, _ = covariance(fit.normal_matrix)
    later = _later(problem, end_s)
    if later is None:
        return 0.0
    then, _ = covariance(fit.normal_matrix + _information(later, fit))
    place = int(np.flatnonzero(fit.free == Parameter.FRICTION_DYNAMIC)[0])
    white = float((now @ _information(problem, fit) @ now)[place, place])
    factor = noise_variance / white if white > 0.0 else 1.0
    return float(now[place, place] - then[place, place]) * factor


def tail_variance_reduction(tail: DampedCosine, end_s: float) -> Floats:
    """Shares (2,) of the noise variance of T and of n1 that a tail until `end_s` would take away."""
    if end_s <= tail.end_s:
        return np.zeros(2)
    density_hz = len(tail.residual_m) / (tail.end_s - tail.start_s)
    times_s = np.linspace(tail.end_s, end_s, _LATER_READINGS)
    _, columns = damped_cosine(tail.parameters, times_s - tail.start_s)
    weight = density_hz * (end_s - tail.end_s) / _LATER_READINGS
    variance = float(np.mean(tail.residual_m**2))
    now = tail.covariance
    then = np.linalg.inv(np.linalg.inv(now) + weight * columns @ columns.T / variance)
    shares = 1.0 - np.diag(then)[:2] / np.diag(now)[:2]
    return np.asarray(shares[::-1])


def _later(problem: FitProblem, end_s: float) -> FitProblem | None:
    """The same gauges after their last reading, with the noise of the mean of as many as one stands for."""
    start_s = float(problem.table.time_s[-1])
    if end_s <= start_s:
        return None
    times_s = np.linspace(start_s, end_s, _LATER_READINGS)
    empty = Channel(times_s, np.zeros(_LATER_READINGS))
    table = problem.table
    density_hz = len(table) / float(table.time_s[-1] - table.time_s[0])
    stands_for = max(density_hz * (end_s - start_s) / _LATER_READINGS, 1e-9)
    noise = problem.noise_m[0] / stands_for**0.5, problem.noise_m[1] / stands_for**0.5
    relative = None if problem.relative is None else empty
    return replace(problem, table=empty, relative=relative, noise_m=noise)


def _information(problem: FitProblem, fit: Fit) -> Floats:
    """Curvature (k, k) of half of chi-square that the readings of `problem` bring, without priors."""
    systems = problem.normal_equations(fit.parameters, fit.law, fit.free)
    return np.asarray(np.sum(systems, axis=0)[:-1, :-1])
