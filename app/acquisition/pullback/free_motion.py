"""Table and plate after the release: is it one, does the plate slip, when do they swing together and rest."""

import math

import numpy as np

from app.acquisition.messages import EndReason, PullbackState
from app.acquisition.pullback.averages import BinAverages, Floats, RecentAverages
from app.acquisition.pullback.hold import Hold
from app.acquisition.pullback.plan import Excursion, PullbackMeasurement, PullbackPlan, Transition
from app.acquisition.pullback.stationarity import fit_parabola_start, noise_m
from messages.message import EMPTY, Message, message

LET_DOWN_NOTE = message(
    "The table was let down, not released. Pull back again, hold still, and let go at once"
)
NO_SLIP_NOTE = message(
    "The plate did not slip: the run gives T, n1 and a lower bound of f_s. Pull further for f_d"
)
SILENT_PLATE_NOTE = message(
    "Gauge 2 gives no reading, so it is unknown whether the plate slips. Check its cable"
)

_RELEASE_FIT_S = 0.04
_PARABOLA_S = 0.01
"""So long after a release was noticed, the table still falls by the square of time."""
_CONFIRM_S = 1.5
_STUCK_S = 0.6
"""Longer than a period: within one, the plates stick and slip again."""
_REST_S = 1.0
_OVERSHOOT = 0.05
"""Part of the pullback by which a released table swings to the other side, at least."""
_REST_NOISES = 0.5
_REST_M = 1e-6
_STUCK_M = 5e-6
_SLIP_NOISES = 6.0
_SLIP_M = 20e-6
_BINS_TO_SLIP = 2
_UNDECIDED = (PullbackState.RELEASED, PullbackState.NO_SLIP)


class FreeMotion:
    """Follows one release.

    Parameters
    ----------
    readings : Readings
        Holds each short average before `see` is told of it.
    facts : PullbackFacts
        Filled in with what is found.
    hold : Hold
        From which it was released.
    noticed_at : float
        Sample at which the release was noticed.
    remark : Message
        What there is to say of this release, once it is sure.
    """

    def __init__(
        self,
        plan: PullbackPlan,
        readings: RecentAverages,
        facts: PullbackMeasurement,
        hold: Hold,
        noticed_at: float,
        remark: Message,
    ) -> None:
        self._plan = plan
        self._readings = readings
        self._facts = facts
        self._from = hold.reference
        self._noticed_at = noticed_at
        self._remark = remark
        self._state = PullbackState.RELEASED
        self._slip_limit_m = max(_SLIP_NOISES * self._from.relative_noise_m, _SLIP_M)
        self._slipping_bins = 0
        self._slip_index: float | None = None
        self._is_silence_said = False
        facts.release_index = self._release_before(noticed_at)

    @property
    def is_settled(self) -> bool:
        """Tell whether slow questions alone are left: `see` may be told of all bins until a tick at once."""
        is_open = self._slip_index is None or self._state in _UNDECIDED
        return self._facts.release_confirmed and not is_open

    def update(self, bins: BinAverages, samples_per_bin: int, is_tick: bool) -> list[Transition]:
        """Take the next averages; return the new states. Slow questions are asked at ticks only."""
        index, table_m = bins.center[-1].item(), bins.table_m[-1].item()
        self._follow_plate(bins)
        since_s = (index - (self._facts.release_index or 0)) / self._plan.rate_hz
        if not self._facts.release_confirmed:
            return self._confirm(table_m, since_s, index)
        if self._slip_index is not None and self._state in _UNDECIDED:
            return [self._turn(PullbackState.SLIPPING, self._slip_index)]
        if not is_tick or since_s <= _STUCK_S:
            return []
        turns = self._after_a_period(index)
        return turns + self._look_for_rest(index, samples_per_bin) if since_s > _REST_S else turns

    def _follow_plate(self, bins: BinAverages) -> None:
        if self._facts.plate_m is not None:
            seen_m = bins.relative_m + bins.table_m if self._plan.gauge_2_on_base else bins.relative_m
            self._widen(seen_m - self._facts.plate_m)
        if self._slip_index is None:
            self._look_for_slip(bins.center[-1].item(), bins.relative_m[-1].item())

    def _look_for_slip(self, index: float, relative_m: float) -> None:
        if math.isnan(relative_m):
            return
        is_off = abs(relative_m - self._from.relative_m) > self._slip_limit_m
        self._slipping_bins = self._slipping_bins + 1 if is_off else 0
        if self._slipping_bins >= _BINS_TO_SLIP:
            self._slip_index = index

    def _widen(self, gone_m: Floats) -> None:
        before = self._facts.excursion or Excursion(0.0, 0.0)
        low_m, high_m = float(np.fmin.reduce(gone_m)), float(np.fmax.reduce(gone_m))
        if low_m < before.low_m or high_m > before.high_m:
            self._facts.excursion = Excursion(min(before.low_m, low_m), max(before.high_m, high_m))

    def _confirm(self, table_m: float, since_s: float, index: float) -> list[Transition]:
        facts = self._facts
        across_m = facts.side * ((facts.zero_m or 0.0) - table_m)
        if across_m > _OVERSHOOT * abs(facts.pulled_m):
            facts.release_confirmed = True
            facts.release_index = self._release_before(self._noticed_at + _PARABOLA_S * self._plan.rate_hz)
            return [self._turn(PullbackState.RELEASED, facts.release_index, self._remark)]
        if since_s > _CONFIRM_S:
            facts.release_index = facts.excursion = None
            return [Transition(PullbackState.PULLING, round(index), LET_DOWN_NOTE)]
        return []

    def _after_a_period(self, index: float) -> list[Transition]:
        if self._state is PullbackState.RELEASED:
            return self._judge_stuck_plate(index)
        return self._look_for_tail() if self._state is PullbackState.SLIPPING else []

    def _judge_stuck_plate(self, index: float) -> list[Transition]:
        """No single average showed a slip: see whether their mean does."""
        if math.isnan(self._readings.relative_mean(_STUCK_S, index)):
            is_new, self._is_silence_said = not self._is_silence_said, True
            return [self._turn(self._state, index, SILENT_PLATE_NOTE)] if is_new else []
        level = self._readings.stationary_relative(_STUCK_S, _STUCK_M)
        limit_m = _SLIP_NOISES * self._from.relative_error_m + _STUCK_M
        if level is not None and not abs(level.mean_m - self._from.relative_m) > limit_m:
            return [self._turn(PullbackState.NO_SLIP, index, NO_SLIP_NOTE)]
        return [self._turn(PullbackState.SLIPPING, self._facts.release_index or index)]

    def _look_for_tail(self) -> list[Transition]:
        level = self._readings.stationary_relative(_STUCK_S, _STUCK_M)
        if level is None:
            return []
        # A slip in the first quarter may have gone unseen: rather late than early.
        stuck_since = level.since + _STUCK_S * self._plan.rate_hz / 4
        self._facts.slip_end_index = round(stuck_since)
        return [self._turn(PullbackState.TAIL, stuck_since)]

    def _look_for_rest(self, index: float, samples_per_bin: int) -> list[Transition]:
        if self._facts.rest_index is not None:
            return []
        values_m = self._readings.table(_REST_S)[:, 1]
        bin_noise_m = noise_m(values_m)
        off_m = values_m - values_m.sum() / len(values_m)
        moving_m = math.sqrt(max(0.0, float(off_m @ off_m) / len(off_m) - bin_noise_m**2))
        sample_noise_m = bin_noise_m * math.sqrt(samples_per_bin)
        if moving_m >= _REST_NOISES * sample_noise_m + _REST_M:
            return []
        self._facts.rest_index = round(index - _REST_S * self._plan.rate_hz)
        if self._plan.duration_s is not None:
            return []
        return [Transition(PullbackState.CLOSING, round(index) + 1, end_reason=EndReason.REST)]

    def _release_before(self, last: float) -> int:
        """Sample at which the table left its hold, from readings until `last`."""
        first = last - _RELEASE_FIT_S * self._plan.rate_hz
        falling = self._readings.table_between(first, last).copy()
        falling[:, 1] = self._facts.side * (self._from.table_m - falling[:, 1])
        return round(fit_parabola_start(falling))

    def _turn(self, state: PullbackState, index: float, note: Message = EMPTY) -> Transition:
        self._state = state
        return Transition(state, round(index), note, is_stored=bool(note))
