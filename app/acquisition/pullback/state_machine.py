"""The pullback test as a state machine: samples in, transitions out; no clock, thread or file.

Re-centring, rest (zero), pulling, held, armed, released, slipping or not, tail (both plates together),
rest again. All times are sample indices, so that the machine works alike live, in a replay and in a test.
"""

import math

import numpy as np

from app.acquisition.messages import EndReason, PullbackState, StandPosition
from app.acquisition.pullback.averages import (
    BinAverager,
    BinAverages,
    RecentAverages,
    StationaryLevel,
    ZeroEstimator,
    ZeroLevel,
    mean_m,
    noise_m,
)
from app.acquisition.pullback.early_release import EarlyReleaseDetector
from app.acquisition.pullback.free_motion import FreeMotion, Hold, HoldReference
from app.acquisition.pullback.notes import (
    ALREADY_PULLED_NOTE,
    NO_READING_NOTE,
    NOT_HELD_NOTE,
    NOT_RECENTRED_NOTE,
    RESTLESS_NOTE,
    TIMEOUT_CAUSES,
    OperatorNote,
)
from app.acquisition.pullback.plan import AllowedPlateRange, PullbackMeasurement, PullbackPlan, Transition
from drivers.arrays import Floats
from messages.i18n import N_
from messages.message import EMPTY, Message, message

_TICK_S = 0.02  # interval of slow checks; the release is looked for at each bin
_CALM_TICKS = 10
"""Of so many checks one is made while the zero is known and nothing moves: a level is a mean over 0.3 s."""
_ZERO_S = 0.3  # length of a rest level: a longer one has less noise, but needs a calmer stand
_HOLD_S = 0.2  # time in which the table must stand still to count as held
_REFERENCE_S = 0.06
"""Length of the reference before a release: the mean has less noise the longer it is, but more creep."""
_STEADY_S = 0.3  # the table must be held for so long, without drift, to be armed
_DRIFT_S = 1.0
_DRIFT_M_PER_S = 50e-6  # fastest drift at which a zero is taken and a hold is armed
_DRIFT_LEEWAY = 2.0  # an armed hold may drift so much faster than one that is to be armed

# Fractions of the pullback:
_CREEP = 0.01  # moving less than this still counts as standing still
_PULL_NOTICED = 0.02  # shortest motion that is noticed as a pull, unless the noise needs more
_PULLED = 0.5  # above this the table counts as pulled back
_BACK = 0.5  # fraction of what is noticed as a pull: within it, the table is where it was before

_PULL_NOISES = 8.0
"""Standard deviations of the noise that a pull must exceed to be noticed: rare in a wait of minutes."""
_INSET = 0.02  # fraction of its allowed range by which the plate must be inside, once it had to be put back
_LEEWAY = 1.25  # a hold may deviate so much more from the target than when it was accepted, before it is lost
_HINT_AFTER_S = 2.0  # an operator who knows what to do is faster; a hint before that would flicker
_WARNING_S = 60.0  # time before the timeout at which the operator is warned; half of a short timeout
_SILENT_S = 0.5  # longer than any gap between two samples, at the slowest rate of any driver

_WAITING = (
    PullbackState.RECENTRE,
    PullbackState.ZERO,
    PullbackState.PULLING,
    PullbackState.HELD,
    PullbackState.ARMED,
)
_FREE = (PullbackState.RELEASED, PullbackState.SLIPPING, PullbackState.NO_SLIP, PullbackState.TAIL)


class PullbackStateMachine:
    """Follows one test to its end; it needs every sample. Those before `armed_index` are context."""

    def __init__(self, plan: PullbackPlan, armed_index: int = 0) -> None:
        self.state = PullbackState.ZERO
        self.measurement = PullbackMeasurement()
        self._plan = plan
        self._room: AllowedPlateRange | None = plan.plate_range
        self._binning = BinAverager(plan.rate_hz)
        bins_per_s = plan.rate_hz / self._binning.samples_per_bin
        self._bins_per_tick = max(1, round(_TICK_S * bins_per_s))
        self._bins_to_release = 2 if bins_per_s > 200.0 else 1
        self._bins = 0
        self._readings = RecentAverages(plan.rate_hz, self._binning.samples_per_bin)
        self._rest = ZeroEstimator(plan.rate_hz)
        self._noise_m = 0.0
        self._is_pulled = False
        self._moved_at = 0.0
        self._hold: Hold | None = None
        self._free: FreeMotion | None = None
        self._farthest_m = 0.0
        self._early_release = EarlyReleaseDetector(plan.nominal_m, plan.rate_hz)
        self._early_release_m: float | None = None
        self._timeout_index = armed_index + self._span(plan.trigger_timeout_s)
        self._warning_s = min(_WARNING_S, 0.5 * plan.trigger_timeout_s)
        self._entered_at = self._last_reading = float(armed_index)
        self._hinted: set[int] = set()
        self._filled_index = plan.first_index + self._span(plan.pretrigger_s)
        self._transitions: list[Transition] = []

    @property
    def is_at_rest(self) -> bool:
        """Tell whether the table has not been pulled back yet, nor released."""
        return self.state in _WAITING[:3] and not self._is_pulled

    @property
    def awaits_release(self) -> bool:
        """Tell whether the table is held, or has left its hold and is to swing through."""
        return self._hold is not None and not self.measurement.release_confirmed

    @property
    def position(self) -> StandPosition:
        facts, must_move = self.measurement, self.state is PullbackState.RECENTRE
        return StandPosition(
            pullback_m=self._plan.target_m,
            tolerance_m=self._plan.hold_tolerance_m,
            table_zero_m=facts.zero_m,
            relative_zero_m=facts.relative_zero_m,
            held_m=facts.held_m,
            side=self._plan.side if facts.held_m is None else round(facts.side),
            plate_m=facts.plate_m,
            plate_wanted_m=self._room.best_m if must_move and self._room else None,
            early_release_m=self._early_release_m,
            keeps_run=not self.is_at_rest,
        )

    def add_samples(self, first_index: int, table_m: Floats, relative_m: Floats) -> list[Transition]:
        """Take consecutive samples (n,), NaN where there is no reading; return the transitions in order."""
        bins, seen = self._binning.add(first_index, table_m, relative_m), 0
        while seen < len(bins):
            until_tick = self._bins_between_checks - self._bins % self._bins_between_checks
            some = bins[seen : seen + until_tick]
            if not self._is_quiet(some):
                some = some[:1]
            self._on_bins(some)
            seen += len(some)
        self._keep_time(first_index + len(table_m))
        transitions, self._transitions = self._transitions, []
        return transitions

    @property
    def _bins_between_checks(self) -> int:
        is_calm = self.is_at_rest and self.state is PullbackState.PULLING and self._rest.is_known
        return self._bins_per_tick * (_CALM_TICKS if is_calm else 1)

    def _is_quiet(self, bins: BinAverages) -> bool:
        """Tell whether only the check at a tick is left of bins: taken in one piece they cost less."""
        if self._free is not None and self.state in _FREE:
            return self._free.is_settled
        if self.is_at_rest:
            return self._rest.farthest_m(bins.table_m) <= self._limit_at_rest_m()
        if self.state in _WAITING and self._hold is not None:
            return self._hold.contains(bins.table_m)
        return True

    def _on_bins(self, bins: BinAverages) -> None:
        self._readings.add(bins)
        self._bins += len(bins)
        is_tick = self._bins % self._bins_between_checks == 0
        index = bins.center[-1].item()
        self._last_reading = index
        if self._free is not None and self.state in _FREE:
            self._on_free(self._free, bins, is_tick)
        elif self.is_at_rest:
            self._on_rest(index, bins.table_m, is_tick)
        elif self.state in _WAITING:
            self._on_pulled(index, bins.table_m, is_tick)

    # --- at rest ---

    def _limit_at_rest_m(self) -> float:
        if self.state is PullbackState.RECENTRE:  # the hand that moves the plate moves the table
            return _PULLED * self._plan.nominal_m
        return self._noticed_m()

    def _on_rest(self, index: float, table_m: Floats, is_tick: bool) -> None:
        if self._rest.farthest_m(table_m) > self._limit_at_rest_m():
            self._begin_pull(index)
        elif is_tick and (level := self._still(_ZERO_S)) is not None:
            self._add_rest(index, level)

    def _add_rest(self, index: float, level: StationaryLevel) -> None:
        if self._readings.table.drift_m_per_s(_ZERO_S, _DRIFT_M_PER_S, level.noise_m):
            return
        is_first = not self._rest.has_levels and self.measurement.zero_m is None
        if is_first and abs(level.mean_m) > _PULLED * self._plan.nominal_m:
            self._is_pulled = True
            self._enter(PullbackState.PULLING, index, ALREADY_PULLED_NOTE, is_stored=True)
            return
        relative_m = self._readings.relative.mean(_ZERO_S, index)
        if not math.isnan(relative_m) and self._is_plate_moving():
            self._rest.reset()
            return
        self._rest.add(ZeroLevel(level.since, level.mean_m, relative_m))
        if self._rest.is_known:
            self._set_zero(self._rest.latest)
            self._check_plate(index)

    def _is_plate_moving(self) -> bool:
        return self._readings.relative.stationary(_ZERO_S, _CREEP * self._plan.nominal_m) is None

    def _check_plate(self, index: float) -> None:
        room, plate_m = self._room, math.nan if self.measurement.plate_m is None else self.measurement.plate_m
        is_recentring = self.state is PullbackState.RECENTRE
        if room is not None and room.exists:
            inset_m = _INSET * (room.high_m - room.low_m) if is_recentring else 0.0
            if not room.fits(plate_m, inset_m):
                if not is_recentring:
                    self._enter(PullbackState.RECENTRE, index)
                return
        if is_recentring:
            self._rest.reset()
            self._enter(PullbackState.ZERO, index)
        elif self.state is PullbackState.ZERO:
            self._enter(PullbackState.PULLING, index)

    def _set_zero(self, zero: ZeroLevel) -> None:
        self.measurement.zero_m = zero.table_m
        has_relative = not math.isnan(zero.relative_m)
        self.measurement.relative_zero_m = zero.relative_m if has_relative else None
        on_base_m = zero.table_m if self._plan.gauge_2_on_base else 0.0
        self.measurement.plate_m = zero.relative_m + on_base_m if has_relative else None

    def _begin_pull(self, index: float) -> None:
        self._set_zero(self._rest.level_before(index, self._noticed_m()))
        self._is_pulled = True
        self._moved_at = index
        self._early_release.reset()
        if self.state is PullbackState.RECENTRE:
            self._enter(PullbackState.PULLING, index, NOT_RECENTRED_NOTE, is_stored=True)
        elif self.state is PullbackState.ZERO:
            self._enter(PullbackState.PULLING, index)

    # --- pulled back ---

    def _on_pulled(self, index: float, table_m: Floats, is_tick: bool) -> None:
        self._farthest_m = max(self._farthest_m, np.abs(table_m - self._zero_m()).max().item())
        if self._hold is not None and self._hold.detect_release(table_m[-1].item()):
            self._release(self._hold, index)
        elif is_tick and not (self._hold is not None and self._hold.is_leaving):
            self._check_hold(index)
            self._look_for_early_release(index)

    def _look_for_early_release(self, index: float) -> None:
        table_m = self._readings.table.mean(_TICK_S, index)
        released_m = self._early_release.update(index, table_m - self._zero_m())
        if released_m is None or not self._is_pulled:
            return
        self._early_release_m = released_m
        self._hold = None
        self._farthest_m = 0.0
        self._moved_at = index
        self._enter(PullbackState.ZERO, index)

    def _check_hold(self, index: float) -> None:
        level = self._still(_HOLD_S)
        if level is None:
            self._lose_hold(index)
        elif level.since >= self._moved_at:
            pulled_m = abs(level.mean_m - self._zero_m())
            if pulled_m > _PULLED * self._plan.nominal_m:
                self._keep_hold(index, level)
            elif pulled_m < _BACK * self._noticed_m():
                self._on_returned(index)

    def _lose_hold(self, index: float) -> None:
        self._hold = None
        if self.state in (PullbackState.HELD, PullbackState.ARMED):
            self._moved_at = index
            self._enter(PullbackState.PULLING, index)

    def _keep_hold(self, index: float, level: StationaryLevel) -> None:
        facts = self.measurement
        facts.held_m = level.mean_m
        if self._hold is None:
            self._hold = Hold(level, facts.side, abs(facts.pulled_m), self._bins_to_release)
        self._hold.update(level, self._reference(index))
        facts.held_index = round(self._hold.since)
        state = self._state_of(self._hold, index)
        if state is not self.state:
            is_held_first = state is PullbackState.HELD and self.state is PullbackState.PULLING
            self._enter(state, self._hold.since if is_held_first else index)

    def _state_of(self, hold: Hold, index: float) -> PullbackState:
        """State of a hold: PULLING until it is far enough, ARMED when it is steady and long enough."""
        if abs(self._off_m()) > self._plan.hold_tolerance_m * self._leeway():
            return PullbackState.PULLING
        is_settled = index - hold.start >= self._span(_STEADY_S) and index >= self._filled_index
        is_ready = is_settled and not self._hold_drift_m_per_s(hold, index)
        return PullbackState.ARMED if is_ready else PullbackState.HELD

    def _hold_drift_m_per_s(self, hold: Hold, index: float) -> float:
        """Drift of a hold, 0 if small; the longer it lasts, the less is hidden in the noise."""
        is_long = index - hold.start > self._span(_DRIFT_S + _STEADY_S)
        bound_m_per_s = _DRIFT_M_PER_S * (_DRIFT_LEEWAY if self.state is PullbackState.ARMED else 1.0)
        return self._readings.table.drift_m_per_s(_DRIFT_S if is_long else _STEADY_S, bound_m_per_s)

    def _leeway(self) -> float:
        return 1.0 if self.state is PullbackState.PULLING else _LEEWAY

    def _off_m(self) -> float:
        wanted_m = self._plan.target_m
        return 0.0 if wanted_m is None else abs(self.measurement.pulled_m) - wanted_m

    def _on_returned(self, index: float) -> None:
        is_said = self._early_release_m is not None
        was_pulled = self._farthest_m > _PULLED * self._plan.nominal_m and not is_said
        self._is_pulled = False
        self._hold = None
        self._farthest_m = 0.0
        self._rest.reset()
        if was_pulled:
            self._enter(PullbackState.ZERO, index, self._plan.note(NOT_HELD_NOTE))

    def _release(self, hold: Hold, index: float) -> None:
        remark = self._remark(hold, index)
        self._free = FreeMotion(self._plan, self._readings, self.measurement, hold, index, remark)
        self._enter(PullbackState.RELEASED, self.measurement.release_index or index)

    def _remark(self, hold: Hold, index: float) -> Message:
        if self.state is PullbackState.ARMED:
            return EMPTY
        if self.state is PullbackState.PULLING and self._plan.target_m is not None:
            return message(
                "Released from {pulled_mm:.2f} mm instead of {planned_mm:g} mm",
                pulled_mm=1e3 * abs(self.measurement.pulled_m),
                planned_mm=1e3 * self._plan.target_m,
            )
        template = N_("Released before it was armed, {held_s:.1f} s after the pull")
        held = message(template, held_s=(index - hold.since) / self._plan.rate_hz)
        return self._plan.note(OperatorNote(held, message("Hold still until it says armed")))

    # --- released ---

    def _on_free(self, free: FreeMotion, bins: BinAverages, is_tick: bool) -> None:
        for transition in free.update(bins, self._binning.samples_per_bin, is_tick):
            if transition.state is PullbackState.PULLING:
                self._hold = self._free = None
                self._moved_at = bins.center[-1].item()
                self._farthest_m = 0.0  # the note says that the table was let down; no second one
                self._early_release.reset()
            self._add(transition)

    # --- in any state ---

    def _keep_time(self, end_index: int) -> None:
        """End the test at the sample at which a time is over; before that, show what it waits for."""
        if self.measurement.release_confirmed and self.measurement.release_index is not None:
            wanted_s, reason = self._plan.duration_s, EndReason.DURATION
            if wanted_s is None:
                wanted_s, reason = self._plan.enough_s, EndReason.ENOUGH
            last_index = self.measurement.release_index + round(self._span(wanted_s))
            if end_index >= last_index and self.state is not PullbackState.CLOSING:
                self._add(Transition(PullbackState.CLOSING, last_index, end_reason=reason))
        elif self.state in _WAITING:
            self._keep_waiting(end_index)

    def _keep_waiting(self, end_index: int) -> None:
        if end_index >= self._timeout_index:
            note = message(
                "no release within {timeout_s:g} s: {cause}",
                timeout_s=self._plan.trigger_timeout_s,
                cause=self._plan.note(TIMEOUT_CAUSES[self.state]),
            )
            reason = EndReason.TRIGGER_TIMEOUT
            self._add(Transition(PullbackState.CLOSING, round(self._timeout_index), note, True, reason))
            return
        is_late = end_index >= self._timeout_index - self._span(self._warning_s)
        warning = message("No release yet: the run ends without one in {left_s:g} s", left_s=self._warning_s)
        for kind, hint in enumerate((self._hint(end_index), warning if is_late else EMPTY)):
            if hint and kind not in self._hinted:
                self._hinted.add(kind)
                self._transitions.append(Transition(self.state, end_index, hint))

    def _hint(self, now: float) -> Message:
        if now - self._entered_at < self._span(_HINT_AFTER_S):
            return EMPTY
        if self.state is PullbackState.ZERO:
            is_silent = now - self._last_reading > self._span(_SILENT_S)
            return self._plan.note(NO_READING_NOTE if is_silent else RESTLESS_NOTE)
        if self.state is PullbackState.HELD:
            return self._plan.note(self._hold_note(now))
        return EMPTY

    def _hold_note(self, now: float) -> OperatorNote:
        """Why a hold is not armed."""
        drift_m_per_s = self._readings.table.drift_m_per_s(_DRIFT_S, _DRIFT_M_PER_S)
        if drift_m_per_s or now >= self._filled_index:
            template = N_("The table drifts by {drift_mm_per_s:.2f} mm/s")
            drift = message(template, drift_mm_per_s=1e3 * abs(drift_m_per_s))
            return OperatorNote(drift, message("Hold it still"))
        template = N_("The {pretrigger_s:g} s that are kept from before the release are not there yet")
        missing = message(template, pretrigger_s=self._plan.pretrigger_s)
        return OperatorNote(missing, message("Go on holding"))

    def _enter(
        self, state: PullbackState, index: float, note: Message = EMPTY, *, is_stored: bool = False
    ) -> None:
        self._add(Transition(state, round(index), note, is_stored))

    def _add(self, transition: Transition) -> None:
        if transition.state is not self.state:
            self.state = transition.state
            if self.state is not PullbackState.ZERO:
                self._early_release_m = None
            self._entered_at = transition.index
            self._hinted.clear()
        self._transitions.append(transition)

    def _still(self, duration_s: float) -> StationaryLevel | None:
        level = self._readings.table.stationary(duration_s, _CREEP * self._plan.nominal_m)
        if level is not None:
            self._noise_m = level.noise_m
        return level

    def _reference(self, index: float) -> HoldReference:
        noise = noise_m(self._readings.relative.latest(_HOLD_S)[:, 1])
        relative_m = self._readings.relative.mean(_REFERENCE_S, index)
        count = max(1, len(self._readings.relative.latest(_REFERENCE_S)))
        table_m = mean_m(self._readings.table.latest(_REFERENCE_S))
        return HoldReference(table_m, relative_m, noise, noise / math.sqrt(count))

    def _span(self, duration_s: float) -> float:
        return duration_s * self._plan.rate_hz

    def _noticed_m(self) -> float:
        return max(_PULL_NOISES * self._noise_m, _PULL_NOTICED * self._plan.nominal_m)

    def _zero_m(self) -> float:
        return self.measurement.zero_m or 0.0
