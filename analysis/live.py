"""Identification while the motion still dies away: running friction, period and damping.

The first time that a release and a few swings are there, minima are searched as for a whole record; from
then on each law is only refined from where it stood. When none explains the readings any more, the motion
has branched elsewhere, and the search is repeated.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.channels import FloatArray
from analysis.constants import DecayConstants, joint_constants, tail_constants
from analysis.fitted_motion import phases_of
from analysis.friction import Fit, Search, finished
from analysis.late_start import guess_releases
from analysis.models import BY_LIKELIHOOD, Model, Place
from analysis.preparation import FreeDecay, prepare
from analysis.problem import Problem
from analysis.quantities import Quantity
from analysis.record import Record, RecordError
from analysis.results import full_spread
from analysis.start import problem_of, start_of
from analysis.uncertainty import Spread
from analysis.verdict import told_apart

_FIRST_PERIODS = 1.5
_READINGS = 1200
"""Readings a channel for refining; the chosen law then sees all."""
_LOST = 1.3
"""Mean square of the residual over that of the noise from which on the motion was lost."""
_RATE_HZ = 500.0
_STEPS = 3
_ENOUGH = 0.02
"""A second that narrows f_d by less than this share is not worth waiting for."""
_LOOK_BACK_S = 1.0


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
    may_stop : bool
        True once slip has ended and another second would narrow f_d by less than a fiftieth.
    """

    time_s: float
    release_s: float | None = None
    slip_end_s: float | None = None
    law: str | None = None
    friction_dynamic: Quantity | None = None
    period_s: Quantity | None = None
    damping_n1_per_s: Quantity | None = None
    may_stop: bool = False


class LiveIdentification:
    """Follows one test. Hand `update` the whole record so far, as often as wanted."""

    def __init__(self) -> None:
        self._minima: dict[Model, FloatArray] = {}
        self._history: list[tuple[float, float]] = []

    def update(self, record: Record) -> LiveState:
        """Take the record so far; never raises for what it does not hold yet."""
        now_s = float(record.time_s[-1]) if len(record.time_s) else 0.0
        try:
            decay = prepare(averaged(record))
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
            fits = self._follow(record, decay, problem)
            told = told_apart(fits)
        except RecordError:
            return LiveState(now_s, release_s)
        best = min(told, key=lambda fit: fit.bic)
        chosen = finished(problem, best.model, problem.minimise(best.parameters, best.model, _STEPS))
        self._minima[chosen.model] = chosen.parameters
        return self._state(now_s, decay, chosen, full_spread(record, decay, problem, chosen, [chosen]))

    def _follow(self, record: Record, decay: FreeDecay, problem: Problem) -> list[Fit]:
        """Refine every law, or search anew where there is none yet or all have lost the motion."""
        some = problem.thinned(_READINGS, decay.dense_until_s)
        if self._minima:
            fits = _refined(some, self._minima)
            if min(fit.chi_square for fit in fits) < _LOST * some.samples:
                return fits
        start, guided = start_of(problem, decay)
        search = Search(problem, guided, decay.period_s, decay.dense_until_s)
        if decay.plateau is not None:
            points = [search.first_slip(start)]
        else:
            points = guess_releases(guided, start, decay.period_s, record.pullback_m)
        fits = search.fit_all(BY_LIKELIHOOD, search.widest(points))
        self._minima = {fit.model: fit.parameters for fit in fits}
        return _refined(some, self._minima)

    def _state(self, now_s: float, decay: FreeDecay, chosen: Fit, fitted: Spread) -> LiveState:
        period, damping = _period_and_damping(joint_constants(chosen, fitted))
        weights = np.zeros(len(chosen.parameters))
        weights[Place.FRICTION_DYNAMIC] = 1.0
        friction = Quantity.normal(chosen.value(Place.FRICTION_DYNAMIC), fitted.deviation(weights), "1")
        end_s = _slip_end(chosen, decay)
        return LiveState(
            now_s,
            decay.channels.to_record_time(chosen.value(Place.RELEASE)),
            end_s,
            chosen.model.value,
            friction,
            period,
            damping,
            self._may_stop(now_s, friction.standard_uncertainty) and end_s is not None,
        )

    def _may_stop(self, now_s: float, deviation: float) -> bool:
        """Whether the last second has hardly narrowed f_d."""
        self._history.append((now_s, deviation))
        before = [earlier for time_s, earlier in self._history if time_s <= now_s - _LOOK_BACK_S]
        return bool(before) and deviation > (1.0 - _ENOUGH) * before[-1]


def _without_slip(now_s: float, release_s: float, record: Record, decay: FreeDecay) -> LiveState:
    if decay.tail is None:
        return LiveState(now_s, release_s)
    period, damping = _period_and_damping(tail_constants(record, decay))
    return LiveState(now_s, release_s, period_s=period, damping_n1_per_s=damping)


def _period_and_damping(constants: DecayConstants) -> tuple[Quantity, Quantity]:
    deviations = [constants.spread.deviation(weights) for weights in np.eye(4)[:2]]
    return (
        Quantity.normal(float(constants.point[0]), deviations[0], "s"),
        Quantity.normal(float(constants.point[1]), deviations[1], "1/s"),
    )


def averaged(record: Record) -> Record:
    """The record with neighbouring rows averaged to about 500 a second: enough for a screen."""
    rows = len(record.time_s)
    if rows < 2:
        return record
    rate_hz = (rows - 1) / float(record.time_s[-1] - record.time_s[0])
    count = int(rate_hz / _RATE_HZ)
    if count < 2:
        return record
    return record.replace(
        time_s=_means(record.time_s, count),
        table_displacement_m=_means(_without(record.table_displacement_m, record.table_overload), count),
        relative_displacement_m=None
        if record.relative_displacement_m is None
        else _means(_without(record.relative_displacement_m, record.relative_overload), count),
        table_overload=None,
        relative_overload=None,
    )


def _means(values: FloatArray, count: int) -> FloatArray:
    """Means of `count` neighbours, NaN where one is absent; what does not fill a block is left out."""
    return np.asarray(values[: len(values) // count * count].reshape(-1, count).mean(axis=1))


def _without(values: FloatArray, overload: NDArray[np.bool_] | None) -> FloatArray:
    return values if overload is None else np.where(overload, np.nan, values)


def _refined(some: Problem, minima: dict[Model, FloatArray]) -> list[Fit]:
    return [
        finished(some, model, some.minimise(parameters, model, _STEPS))
        for model, parameters in minima.items()
    ]


def _slip_end(chosen: Fit, decay: FreeDecay) -> float | None:
    """Fitted slip end in the record's time, once the plate has stuck for a period."""
    release_s, now_s = chosen.value(Place.RELEASE), float(decay.table.time_s[-1])
    last = phases_of(chosen.parameters, chosen.model, now_s - release_s)[-1]
    end_s = float(last[0]) + release_s
    stuck = last[1] == 0.0 and now_s - end_s > decay.period_s
    return decay.channels.to_record_time(end_s) if stuck else None
