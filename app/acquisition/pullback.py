"""The pullback test as a state machine: samples in, turns of events out; no clock, thread or file.

Rest (zero), pulling, held, release, slipping, tail (both plates together), rest again. All times are
sample indices, so that the machine does the same live, in a replay and in a test.
"""

import math
from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.acquisition.bins import Binning
from app.acquisition.messages import EndReason, PullbackState
from app.acquisition.steadiness import Level, Stretch, noise_m, parabola_start, still_level

FloatArray = NDArray[np.float64]

LET_DOWN_NOTE = "The table was let down, not released. Pull back again, hold still, and let go at once"
NOT_HELD_NOTE = "The table came back without being held still. Pull back again and hold it for a moment"
ALREADY_PULLED_NOTE = "The table was already pulled back when armed, so its zero before the pull is not known"

_TICK_S = 0.02
"""How often slow questions are asked; the release is looked for at each bin."""
_ZERO_S = 0.3
_ZERO_BEFORE_S = 1.0
"""The zero is taken this long before the pull is noticed: a smooth pull begins unnoticed."""
_ZEROS_KEPT_S = 3.0
_HOLD_S = 0.2
_REFERENCE_S = 0.06
_RELEASE_FIT_S = 0.04
_PARABOLA_S = 0.01
"""So long after a release was noticed, the table still falls by the square of time."""
_CONFIRM_S = 1.5
_STUCK_S = 0.6
"""Longer than a period: within one, the plates stick and slip again."""
_REST_S = 1.0

_USUAL_PULLBACK_M = 0.01
# Parts of the pullback:
_CREEP = 0.01
"""Moving less than this still counts as standing still, more in the moment of release does not."""
_PULL_NOTICED = 0.02
_PULLED = 0.5
_OVERSHOOT = 0.05

_PULL_NOISES = 8.0
_RELEASE_NOISES = 6.0
_REST_NOISES = 0.5
_STUCK_M = 5e-6
_REST_M = 1e-6


@dataclass(frozen=True, slots=True)
class PullbackPlan:
    """What is expected of one test.

    Attributes
    ----------
    rate_hz : float
        Samples a second.
    pullback_m : float or None
        Nominal pullback, of either sign (m); about 10 mm are expected where none is known.
    duration_s : float or None
        How long to go on after release; None until rest, or `enough_s`.
    trigger_timeout_s : float
        How long to wait for a release (s).
    enough_s : float
        Time after release at which waiting longer no longer pays (s).
    """

    rate_hz: float
    pullback_m: float | None = None
    duration_s: float | None = None
    trigger_timeout_s: float = math.inf
    enough_s: float = 20.0


@dataclass(frozen=True, slots=True)
class Turn:
    """The test came to a new state at sample `index`."""

    state: PullbackState
    index: int
    note: str = ""
    """What the operator must know, where something did not go as it should."""
    ended: EndReason | None = None


@dataclass(slots=True)
class PullbackFacts:
    """What was found, as sample indices and displacements (m); None where it was not."""

    zero_m: float | None = None
    held_m: float | None = None
    held_index: int | None = None
    release_index: int | None = None
    release_confirmed: bool = False
    """The table has swung through to the other side, which no hand that lets it down makes it do."""
    slip_end_index: int | None = None
    rest_index: int | None = None


class PullbackTest:
    """Follows one test to its end; feed it every sample.

    Parameters
    ----------
    plan : PullbackPlan
    armed_index : int
        Sample from which on a release is waited for; what is fed from before is context.
    """

    def __init__(self, plan: PullbackPlan, armed_index: int = 0) -> None:
        self.state = PullbackState.ZERO
        self.facts = PullbackFacts()
        self._plan = plan
        self._pullback_m = abs(plan.pullback_m or _USUAL_PULLBACK_M)
        self._binning = Binning(plan.rate_hz)
        bins_per_s = plan.rate_hz / self._binning.samples_per_bin
        self._bins_per_tick = max(1, round(_TICK_S * bins_per_s))
        self._bins_to_release = 2 if bins_per_s > 200.0 else 1
        self._bins = 0
        spacing = self._binning.samples_per_bin
        self._table = Stretch(self._span(_REST_S), spacing)
        self._relative = Stretch(self._span(_STUCK_S), spacing)
        self._zeros: deque[Level] = deque(maxlen=round(_ZEROS_KEPT_S / _TICK_S))
        self._references: deque[float] = deque(maxlen=2)
        self._reference_m = 0.0
        self._noticed_at = 0.0
        self._noise_m = 0.0
        self._turned_at = 0.0
        self._beyond = 0
        self._armed_index = armed_index
        self._turns: list[Turn] = []

    @property
    def has_ended(self) -> bool:
        """Tell whether nothing more is awaited."""
        return self.state is PullbackState.CLOSING

    def feed(self, first_index: int, table_m: FloatArray, relative_m: FloatArray) -> list[Turn]:
        """Take consecutive samples (n,) from `first_index` on, NaN where there is no reading.

        Returns
        -------
        list of Turn
            What happened, in order. The index of the last one, CLOSING, is where the run ends.
        """
        bins = self._binning.add(first_index, table_m, relative_m)
        for index, table, relative in zip(
            bins.middle.tolist(), bins.table_m.tolist(), bins.relative_m.tolist(), strict=True
        ):
            self._see(index, table, relative)
        self._keep_time(first_index + len(table_m))
        turns, self._turns = self._turns, []
        return turns

    def _see(self, index: float, table_m: float, relative_m: float) -> None:
        self._table.add(index, table_m)
        if not math.isnan(relative_m):
            self._relative.add(index, relative_m)
        self._bins += 1
        is_tick = self._bins % self._bins_per_tick == 0
        match self.state:
            case PullbackState.ZERO:
                self._see_zero(index, table_m, is_tick)
            case PullbackState.PULLING if is_tick:
                self._see_pulling(index)
            case PullbackState.HELD:
                self._see_held(index, table_m, is_tick)
            case PullbackState.SLIPPING | PullbackState.TAIL:
                self._see_free(index, table_m, is_tick)

    def _see_zero(self, index: float, table_m: float, is_tick: bool) -> None:
        if self._zeros and abs(table_m - self._zeros[-1].mean_m) > self._noticed_m():
            self.facts.zero_m = self._zero_before(index)
            self._turn(PullbackState.PULLING, index)
        elif is_tick and (level := self._standing_still(_ZERO_S)):
            if not self._zeros and abs(level.mean_m) > _PULLED * self._pullback_m:
                self._hold(level, ALREADY_PULLED_NOTE)
            else:
                self._zeros.append(level)

    def _see_pulling(self, index: float) -> None:
        level = self._standing_still(_HOLD_S)
        if level is None or level.since < self._turned_at:
            return
        pulled_m = abs(level.mean_m - self._zero_m())
        if pulled_m > _PULLED * self._pullback_m:
            self._hold(level)
        elif pulled_m < self._noticed_m():
            self._zeros.clear()
            self._turn(PullbackState.ZERO, index, NOT_HELD_NOTE)

    def _see_held(self, index: float, table_m: float, is_tick: bool) -> None:
        if self._references:
            gone_m = self._side() * (self._references[0] - table_m)
            limit_m = max(_RELEASE_NOISES * self._noise_m, _CREEP * abs(self._pulled_m()))
            self._beyond = self._beyond + 1 if gone_m > limit_m else 0
        if self._beyond >= self._bins_to_release:
            self._release(index)
        elif is_tick and not self._beyond:
            self._watch_hold(index)

    def _watch_hold(self, index: float) -> None:
        level = self._standing_still(_HOLD_S)
        if level is None:
            self._turn(PullbackState.PULLING, index)
        else:
            self.facts.held_m = level.mean_m
            self._references.append(float(self._latest(_REFERENCE_S)[:, 1].mean()))

    def _see_free(self, index: float, table_m: float, is_tick: bool) -> None:
        since = index - (self.facts.release_index or 0)
        if not self.facts.release_confirmed:
            self._confirm(index, table_m, since)
        elif is_tick:
            if self.state is PullbackState.SLIPPING and since > self._span(_STUCK_S):
                self._look_for_tail()
            if since > self._span(_REST_S):
                self._look_for_rest(index)

    def _confirm(self, index: float, table_m: float, since: float) -> None:
        across_m = self._side() * (self._zero_m() - table_m)
        if across_m > _OVERSHOOT * abs(self._pulled_m()):
            self.facts.release_confirmed = True
            self.facts.release_index = self._release_before(self._noticed_at + self._span(_PARABOLA_S))
        elif since > self._span(_CONFIRM_S):
            self.facts.release_index = None
            self._turn(PullbackState.PULLING, index, LET_DOWN_NOTE)

    def _look_for_tail(self) -> None:
        span = self._span(_STUCK_S)
        level = still_level(self._relative.latest(span), span, _STUCK_M)
        if level is not None:
            # A slip in the first quarter may have gone unseen: rather late than early.
            stuck_since = level.since + span / 4
            self.facts.slip_end_index = round(stuck_since)
            self._turn(PullbackState.TAIL, stuck_since)

    def _look_for_rest(self, index: float) -> None:
        values_m = self._latest(_REST_S)[:, 1]
        bin_noise_m = noise_m(values_m)
        moving_m = math.sqrt(max(0.0, float(values_m.var()) - bin_noise_m**2))
        sample_noise_m = bin_noise_m * math.sqrt(self._binning.samples_per_bin)
        if moving_m < _REST_NOISES * sample_noise_m + _REST_M and self.facts.rest_index is None:
            self.facts.rest_index = round(index - self._span(_REST_S))
            if self._plan.duration_s is None:
                self._end(EndReason.REST, round(index) + 1)

    def _hold(self, level: Level, note: str = "") -> None:
        self.facts.held_m = level.mean_m
        self.facts.held_index = round(level.since)
        self._references.clear()
        self._beyond = 0
        self._turn(PullbackState.HELD, level.since, note)

    def _release(self, index: float) -> None:
        self._reference_m = self._references[0]
        self._noticed_at = index
        self.facts.release_index = self._release_before(index)
        self._turn(PullbackState.SLIPPING, self.facts.release_index)

    def _release_before(self, last: float) -> int:
        """Sample at which the table left its hold, from readings until `last`."""
        falling = self._table.between(last - self._span(_RELEASE_FIT_S), last).copy()
        falling[:, 1] = self._side() * (self._reference_m - falling[:, 1])
        return round(parabola_start(falling))

    def _keep_time(self, end_index: int) -> None:
        """End the test where a time is over, at the very sample."""
        if self.facts.release_confirmed and self.facts.release_index is not None:
            wanted_s, reason = self._plan.duration_s, EndReason.DURATION
            if wanted_s is None:
                wanted_s, reason = self._plan.enough_s, EndReason.ENOUGH
            last_index = self.facts.release_index + round(wanted_s * self._plan.rate_hz)
        elif self.facts.release_index is None and math.isfinite(self._plan.trigger_timeout_s):
            reason = EndReason.TRIGGER_TIMEOUT
            last_index = self._armed_index + round(self._plan.trigger_timeout_s * self._plan.rate_hz)
        else:
            return
        if end_index >= last_index:
            self._end(reason, last_index)

    def _end(self, reason: EndReason, index: int) -> None:
        if not self.has_ended:
            self._turn(PullbackState.CLOSING, index, ended=reason)

    def _turn(
        self, state: PullbackState, index: float, note: str = "", ended: EndReason | None = None
    ) -> None:
        self.state = state
        self._turned_at = index
        self._turns.append(Turn(state, round(index), note, ended))

    def _zero_before(self, index: float) -> float:
        """Level (m) of the table a second before `index`, or as long before as is known."""
        latest = index - self._span(_ZERO_BEFORE_S + _ZERO_S)
        before = [level for level in self._zeros if level.since <= latest]
        chosen = before[-1] if before else self._zeros[0]
        return chosen.mean_m

    def _standing_still(self, duration_s: float) -> Level | None:
        span = self._span(duration_s)
        level = still_level(self._table.latest(span), span, _CREEP * self._pullback_m)
        if level is not None:
            self._noise_m = level.noise_m
        return level

    def _latest(self, duration_s: float) -> FloatArray:
        return self._table.latest(self._span(duration_s))

    def _span(self, duration_s: float) -> float:
        return duration_s * self._plan.rate_hz

    def _noticed_m(self) -> float:
        return max(_PULL_NOISES * self._noise_m, _PULL_NOTICED * self._pullback_m)

    def _zero_m(self) -> float:
        return self.facts.zero_m or 0.0

    def _pulled_m(self) -> float:
        return (self.facts.held_m or 0.0) - self._zero_m()

    def _side(self) -> float:
        return math.copysign(1.0, self._pulled_m())
