"""The hold of the table and its release: whether the plate slips, and when both swing together and rest."""

import math
from collections import deque
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from app.acquisition.messages import EndReason, PullbackState
from app.acquisition.pullback.averages import (
    BinAverages,
    RecentAverages,
    StationaryLevel,
    fit_parabola_start,
    noise_m,
)
from app.acquisition.pullback.notes import LET_DOWN_NOTE, NO_SLIP_NOTE, SILENT_PLATE_NOTE
from app.acquisition.pullback.plan import Excursion, PullbackMeasurement, PullbackPlan, Transition
from drivers.arrays import Floats
from messages.message import EMPTY, Message

_RELEASE_NOISES = 6.0
"""Standard deviations of the noise that a release must exceed: fewer would be noticed by chance."""
_CREEP = 0.01  # fraction of the pullback that a release must exceed, and that a hold may move: less is creep
_RELEASE_FIT_S = 0.04  # readings before the notice to which the parabola of the release is fitted
_PARABOLA_S = 0.01  # time after a release was noticed during which the table moves by the square of time
_CONFIRM_S = 1.5  # a table that has not swung to the other side by then was let down
_STUCK_S = 0.6  # longer than a period: within one, the plates stick and slip again
_REST_S = 1.0  # window over which rest is judged
_OVERSHOOT = 0.05  # fraction of the pullback by which a released table swings to the other side, at least
_REST_NOISES = 0.5  # at rest, the motion is less than this part of the noise of a sample, plus `_REST_M`
_REST_M = 1e-6
_STUCK_M = 5e-6  # motion of the plate against the table that still counts as sticking
_SLIP_NOISES = 6.0
"""A slip must exceed so many standard deviations, and `_SLIP_M`, in `_BINS_TO_SLIP` averages in a row."""
_SLIP_M = 20e-6
_BINS_TO_SLIP = 2
_UNDECIDED = (PullbackState.RELEASED, PullbackState.NO_SLIP)


_Reading = TypeVar("_Reading", float, Floats)


@dataclass(frozen=True, slots=True)
class HoldReference:
    """What both gauges read in the last few hundredths of a second (m); NaN without gauge 2."""

    table_m: float
    relative_m: float
    relative_noise_m: float
    relative_error_m: float


class Hold:
    """A hold of the table; a release is `bins_to_release` averages in a row beyond the limit."""

    def __init__(self, level: StationaryLevel, side: float, pulled_m: float, bins_to_release: int) -> None:
        self.start = level.since  # sample at which it began
        self.since = level.since  # sample from which on it has not crept noticeably
        self._level_m = level.mean_m
        self._side = side
        self._pulled_m = pulled_m
        self._bins_to_release = bins_to_release
        self._noise_m = level.noise_m
        self._references: deque[HoldReference] = deque(maxlen=2)
        self._beyond = 0

    @property
    def reference(self) -> HoldReference:
        """Where table and plate stood a moment ago: before the release, if it has begun."""
        return self._references[0]

    @property
    def is_leaving(self) -> bool:
        return self._beyond > 0

    def update(self, level: StationaryLevel, reference: HoldReference) -> None:
        """Take a new level; a table that has crept too far begins a new hold."""
        if abs(level.mean_m - self._level_m) > _CREEP * self._pulled_m:
            self.since, self._level_m = level.since, level.mean_m
        self._noise_m = level.noise_m
        self._references.append(reference)

    def contains(self, table_m: Floats) -> bool:
        """Tell whether none of these averages (n,) is beyond the limit."""
        return not self._references or bool((self._gone_m(table_m) <= self._limit_m).all())

    def detect_release(self, table_m: float) -> bool:
        """Take the next average; return whether the table leaves its hold towards its zero."""
        if self._references:
            self._beyond = self._beyond + 1 if self._gone_m(table_m) > self._limit_m else 0
        return self._beyond >= self._bins_to_release

    @property
    def _limit_m(self) -> float:
        return max(_RELEASE_NOISES * self._noise_m, _CREEP * self._pulled_m)

    def _gone_m(self, table_m: _Reading) -> _Reading:
        return self._side * (self.reference.table_m - table_m)


class FreeMotion:
    """Follows one release, noticed at sample `noticed_at`; `measurement` receives what it finds."""

    def __init__(
        self,
        plan: PullbackPlan,
        readings: RecentAverages,
        measurement: PullbackMeasurement,
        hold: Hold,
        noticed_at: float,
        remark: Message,
    ) -> None:
        self._plan = plan
        self._readings = readings
        self._measurement = measurement
        self._from = hold.reference
        self._noticed_at = noticed_at
        self._remark = remark
        self._state = PullbackState.RELEASED
        self._slip_limit_m = max(_SLIP_NOISES * self._from.relative_noise_m, _SLIP_M)
        self._slipping_bins = 0
        self._slip_index: float | None = None
        self._is_silence_said = False
        measurement.release_index = self._release_before(noticed_at)

    @property
    def is_settled(self) -> bool:
        """Tell whether only checks at ticks are left: `update` may then receive all bins until a tick."""
        is_open = self._slip_index is None or self._state in _UNDECIDED
        return self._measurement.release_confirmed and not is_open

    def update(self, bins: BinAverages, samples_per_bin: int, is_tick: bool) -> list[Transition]:
        """Take the next averages; return the new states."""
        index, table_m = bins.center[-1].item(), bins.table_m[-1].item()
        self._follow_plate(bins)
        since_s = (index - (self._measurement.release_index or 0)) / self._plan.rate_hz
        if not self._measurement.release_confirmed:
            return self._confirm(table_m, since_s, index)
        if self._slip_index is not None and self._state in _UNDECIDED:
            return [self._enter(PullbackState.SLIPPING, self._slip_index)]
        if not is_tick or since_s <= _STUCK_S:
            return []
        transitions = self._after_a_period(index)
        return transitions + self._look_for_rest(index, samples_per_bin) if since_s > _REST_S else transitions

    def _follow_plate(self, bins: BinAverages) -> None:
        if self._measurement.plate_m is not None:
            seen_m = bins.relative_m + bins.table_m if self._plan.gauge_2_on_base else bins.relative_m
            self._widen(seen_m - self._measurement.plate_m)
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
        before = self._measurement.excursion or Excursion(0.0, 0.0)
        low_m, high_m = float(np.fmin.reduce(gone_m)), float(np.fmax.reduce(gone_m))
        if low_m < before.low_m or high_m > before.high_m:
            self._measurement.excursion = Excursion(min(before.low_m, low_m), max(before.high_m, high_m))

    def _confirm(self, table_m: float, since_s: float, index: float) -> list[Transition]:
        measurement = self._measurement
        across_m = measurement.side * ((measurement.zero_m or 0.0) - table_m)
        if across_m > _OVERSHOOT * abs(measurement.pulled_m):
            measurement.release_confirmed = True
            measurement.release_index = self._release_before(
                self._noticed_at + _PARABOLA_S * self._plan.rate_hz
            )
            return [self._enter(PullbackState.RELEASED, measurement.release_index, self._remark)]
        if since_s > _CONFIRM_S:
            measurement.release_index = measurement.excursion = None
            return [Transition(PullbackState.PULLING, round(index), self._plan.note(LET_DOWN_NOTE))]
        return []

    def _after_a_period(self, index: float) -> list[Transition]:
        if self._state is PullbackState.RELEASED:
            return self._judge_stuck_plate(index)
        return self._look_for_tail() if self._state is PullbackState.SLIPPING else []

    def _judge_stuck_plate(self, index: float) -> list[Transition]:
        """No single average showed a slip: check whether their mean does."""
        if math.isnan(self._readings.relative.mean(_STUCK_S, index)):
            is_new, self._is_silence_said = not self._is_silence_said, True
            return [self._enter(self._state, index, self._plan.note(SILENT_PLATE_NOTE))] if is_new else []
        level = self._readings.relative.stationary(_STUCK_S, _STUCK_M)
        limit_m = _SLIP_NOISES * self._from.relative_error_m + _STUCK_M
        if level is not None and not abs(level.mean_m - self._from.relative_m) > limit_m:
            return [self._enter(PullbackState.NO_SLIP, index, self._plan.note(NO_SLIP_NOTE))]
        return [self._enter(PullbackState.SLIPPING, self._measurement.release_index or index)]

    def _look_for_tail(self) -> list[Transition]:
        level = self._readings.relative.stationary(_STUCK_S, _STUCK_M)
        if level is None:
            return []
        # A slip in the first quarter may have gone unseen: rather late than early.
        stuck_since = level.since + _STUCK_S * self._plan.rate_hz / 4
        self._measurement.slip_end_index = round(stuck_since)
        return [self._enter(PullbackState.TAIL, stuck_since)]

    def _look_for_rest(self, index: float, samples_per_bin: int) -> list[Transition]:
        if self._measurement.rest_index is not None:
            return []
        values_m = self._readings.table.latest(_REST_S)[:, 1]
        bin_noise_m = noise_m(values_m)
        off_m = values_m - values_m.sum() / len(values_m)
        moving_m = math.sqrt(max(0.0, float(off_m @ off_m) / len(off_m) - bin_noise_m**2))
        sample_noise_m = bin_noise_m * math.sqrt(samples_per_bin)
        if moving_m >= _REST_NOISES * sample_noise_m + _REST_M:
            return []
        self._measurement.rest_index = round(index - _REST_S * self._plan.rate_hz)
        if self._plan.duration_s is not None:
            return []
        return [Transition(PullbackState.CLOSING, round(index) + 1, end_reason=EndReason.REST)]

    def _release_before(self, last: float) -> int:
        first = last - _RELEASE_FIT_S * self._plan.rate_hz
        falling = self._readings.table.between(first, last).copy()
        falling[:, 1] = self._measurement.side * (self._from.table_m - falling[:, 1])
        return round(fit_parabola_start(falling))

    def _enter(self, state: PullbackState, index: float, note: Message = EMPTY) -> Transition:
        self._state = state
        return Transition(state, round(index), note, is_stored=bool(note))
