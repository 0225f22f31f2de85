"""Identification while the motion still dies away: running friction, period and damping.

The first time that a release and a few swings are there, minima are searched as for a whole record; from
then on each law is only refined from where it stood. When none explains the readings any more, the motion
has branched elsewhere, and the search is repeated. Period and damping come from the stick tail as soon as
it is two periods long, as they will in the end.
"""

from dataclasses import dataclass

import numpy as np

from analysis.averaging import averaged
from analysis.channels import FloatArray
from analysis.constants import DecayConstants, joint_constants, tail_constants
from analysis.fitted_motion import phases_of
from analysis.friction import Fit, Search, finished
from analysis.late_start import guess_releases
from analysis.models import BY_LIKELIHOOD, PARAMETERS, Model, Place
from analysis.preparation import FreeDecay, fit_tail, prepare
from analysis.problem import Problem
from analysis.quantities import Quantity
from analysis.record import Record, RecordError
from analysis.results import full_spread
from analysis.start import problem_of, start_of
from analysis.uncertainty import Spread
from analysis.verdict import told_apart
from analysis.waiting import LATEST_S, is_worth, removed_from_friction, removed_from_tail

_FIRST_PERIODS = 1.5
_READINGS = 1200
"""Readings a channel for refining; the chosen law then sees all."""
_LOST = 1.3
"""Mean square of the residual over that of the noise from which on the motion was lost."""
_AGAIN = 1.1
"""A search that found no law that fits is not repeated before the record is longer by this factor."""
_STEPS = 3
FRICTION, PERIOD, DAMPING = "friction_dynamic", "period_s", "damping_n1_per_s"


@dataclass(frozen=True, slots=True)
class LiveState:
    """What is known so far; None before it can be known.

    Attributes
    ----------
    time_s : float
        Last row seen, in the record's time.
    release_s, slip_end_s : float or None
        In the record's time; the slip end as fitted, None while the plate still slips.
    law : str or None
        Likeliest law so far.
    friction_dynamic, period_s, damping_n1_per_s : Quantity or None
    narrowing : tuple of str
        Which of these three readings until 20 s after the release would still narrow by more than a
        twentieth of their standard uncertainty (`analysis.waiting`).
    may_stop : bool
        True once slip has ended, the motion is explained, and nothing is narrowed by waiting.
    """

    time_s: float
    release_s: float | None = None
    slip_end_s: float | None = None
    law: str | None = None
    friction_dynamic: Quantity | None = None
    period_s: Quantity | None = None
    damping_n1_per_s: Quantity | None = None
    narrowing: tuple[str, ...] = (FRICTION, PERIOD, DAMPING)
    may_stop: bool = False


class LiveIdentification:
    """Follows one test. Hand `update` the whole record so far, as often as wanted."""

    def __init__(self) -> None:
        self._minima: dict[Model, FloatArray] = {}
        self._searched_s = 0.0

    def update(self, record: Record) -> LiveState:
        """Take the record so far; never raises for what it does not hold yet."""
        now_s = float(record.time_s[-1]) if len(record.time_s) else 0.0
        record = averaged(record)
        try:
            decay = prepare(record)
        except RecordError:
            return LiveState(now_s)
        release_s = decay.channels.to_record_time(decay.release.time_s)
        since_s = float(decay.table.time_s[-1]) - decay.release.time_s
        if since_s < _FIRST_PERIODS * decay.period_s:
            return LiveState(now_s, release_s)
        if not decay.slips:
            return _without_slip(now_s, release_s, record, decay)
        problem = problem_of(record, decay)
        try:
            told = told_apart(self._follow(record, decay, problem, since_s))
        except RecordError:
            return LiveState(now_s, release_s)
        best = min(told, key=lambda fit: fit.bic)
        chosen = finished(problem, best.model, problem.minimise(best.parameters, best.model, _STEPS))
        self._minima[chosen.model] = chosen.parameters
        return _state(now_s, record, decay, problem, chosen)

    def _follow(self, record: Record, decay: FreeDecay, problem: Problem, since_s: float) -> list[Fit]:
        """Refine every law, or search anew where there is none yet or all have lost the motion."""
        some = problem.thinned(_READINGS, decay.dense_until_s)
        if self._minima:
            fits = _refined(some, self._minima)
            if any(_explains(some, fit) for fit in fits) or since_s < _AGAIN * self._searched_s:
                return fits
        self._searched_s = since_s
        start, guided = start_of(problem, decay)
        search = Search(problem, guided, decay.period_s, decay.dense_until_s)
        if decay.plateau is not None:
            points = [search.first_slip(start)]
        else:
            points = guess_releases(guided, start, decay.period_s, record.pullback_m)
        fits = search.fit_all(BY_LIKELIHOOD, search.widest(points))
        self._minima = {fit.model: fit.parameters for fit in fits}
        return _refined(some, self._minima)


def _state(now_s: float, record: Record, decay: FreeDecay, problem: Problem, chosen: Fit) -> LiveState:
    fitted = full_spread(record, decay, problem, chosen, [chosen])
    stuck_s = _stuck_since(chosen, decay)
    decay = fit_tail(decay, stuck_s)
    constants = joint_constants(chosen, fitted) if decay.tail is None else tail_constants(record, decay)
    period, damping = _period_and_damping(constants)
    friction = _friction(chosen, fitted)
    end_s = decay.release.time_s + LATEST_S
    narrowing = [FRICTION, PERIOD, DAMPING]
    if decay.tail is not None:
        noise = float(fitted.noise[Place.FRICTION_DYNAMIC, Place.FRICTION_DYNAMIC])
        removed = removed_from_friction(problem, chosen, noise, end_s)
        worth = is_worth(friction.standard_uncertainty, removed)
        narrowing = [FRICTION] * worth + _narrowing_tail(decay, constants, end_s)
    to_record = decay.channels.to_record_time
    return LiveState(
        now_s,
        to_record(chosen.value(Place.RELEASE)),
        None if stuck_s is None else to_record(stuck_s),
        chosen.model.value,
        friction,
        period,
        damping,
        tuple(narrowing),
        may_stop=not narrowing and _explains(problem, chosen),
    )


def _without_slip(now_s: float, release_s: float, record: Record, decay: FreeDecay) -> LiveState:
    if decay.tail is None:
        return LiveState(now_s, release_s)
    constants = tail_constants(record, decay)
    period, damping = _period_and_damping(constants)
    narrowing = tuple(_narrowing_tail(decay, constants, decay.release.time_s + LATEST_S))
    return LiveState(
        now_s,
        release_s,
        period_s=period,
        damping_n1_per_s=damping,
        narrowing=narrowing,
        may_stop=not narrowing,
    )


def _narrowing_tail(decay: FreeDecay, constants: DecayConstants, end_s: float) -> list[str]:
    """Which of period and damping a tail until `end_s` would still narrow."""
    if decay.tail is None:
        return [PERIOD, DAMPING]
    removed = removed_from_tail(decay.tail, end_s) * np.diag(constants.spread.noise)[:2]
    deviations = [constants.spread.deviation(weights) for weights in np.eye(4)[:2]]
    pairs = zip((PERIOD, DAMPING), deviations, removed, strict=True)
    return [name for name, deviation, variance in pairs if is_worth(deviation, float(variance))]


def _friction(chosen: Fit, fitted: Spread) -> Quantity:
    weights = np.zeros(PARAMETERS)
    weights[Place.FRICTION_DYNAMIC] = 1.0
    return Quantity.normal(chosen.value(Place.FRICTION_DYNAMIC), fitted.deviation(weights), "1")


def _period_and_damping(constants: DecayConstants) -> tuple[Quantity, Quantity]:
    deviations = [constants.spread.deviation(weights) for weights in np.eye(4)[:2]]
    return (
        Quantity.normal(float(constants.point[0]), deviations[0], "s"),
        Quantity.normal(float(constants.point[1]), deviations[1], "1/s"),
    )


def _refined(some: Problem, minima: dict[Model, FloatArray]) -> list[Fit]:
    return [
        finished(some, model, some.minimise(parameters, model, _STEPS))
        for model, parameters in minima.items()
    ]


def _explains(problem: Problem, fit: Fit) -> bool:
    return fit.chi_square < _LOST * problem.samples


def _stuck_since(chosen: Fit, decay: FreeDecay) -> float | None:
    """Fitted slip end, once the plate has stuck for a period."""
    release_s, now_s = chosen.value(Place.RELEASE), float(decay.table.time_s[-1])
    last = phases_of(chosen.parameters, chosen.model, now_s - release_s)[-1]
    end_s = float(last[0]) + release_s
    return end_s if last[1] == 0.0 and now_s - end_s > decay.period_s else None
