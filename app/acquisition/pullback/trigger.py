"""When a run begins and ends: by the pullback, or at once and by the clock."""

from dataclasses import replace
from typing import Protocol

from app.acquisition.messages import EndReason, PullbackState, RunSettings, StandPosition
from app.acquisition.pullback.operator_messages import no_room_note
from app.acquisition.pullback.plan import PullbackMeasurement, PullbackPlan, Transition
from app.acquisition.pullback.state_machine import PullbackStateMachine
from app.acquisition.stream.live_stream import ReadHistory
from app.runs.blocks import CalibratedBlock
from messages.message import EMPTY, Message

_CONTEXT_S = 1.0
_SEEN_WITHOUT_TRIGGER = (
    PullbackState.RELEASED,
    PullbackState.SLIPPING,
    PullbackState.NO_SLIP,
    PullbackState.TAIL,
)


class Trigger(Protocol):
    """Says from which sample to which a run goes."""

    @property
    def measurement(self) -> PullbackMeasurement:
        """What was found of the pullback."""

    @property
    def state(self) -> PullbackState:
        """Where the run stands."""

    @property
    def position(self) -> StandPosition:
        """Where table and plate stand."""

    @property
    def note(self) -> Message:
        """What there is to say beforehand."""

    @property
    def start_index(self) -> int | None:
        """First sample to store; None before that is known."""

    @property
    def end(self) -> tuple[int, EndReason] | None:
        """Sample before which the run ends, and why; None before that is known."""

    @property
    def is_unattended(self) -> bool:
        """Tell whether the run comes to its end without anybody at the stand."""

    @property
    def awaits_release(self) -> bool:
        """Tell whether a release that somebody waits for may come at any moment, or be confirmed."""

    @property
    def is_at_rest(self) -> bool:
        """Tell whether nothing has happened yet that would be worth keeping."""

    def add_samples(self, rows: CalibratedBlock) -> list[Transition]:
        """Take the samples that come next, from arming on; return the new states."""


class PullbackTrigger:
    """From `pretrigger_s` before the release, to the sample, until rest, enough or `duration_s` after it."""

    def __init__(
        self, settings: RunSettings, plan: PullbackPlan, armed_index: int, history: ReadHistory
    ) -> None:
        self._before = round(settings.pretrigger_s * plan.rate_hz)
        waits = replace(
            plan,
            duration_s=settings.duration_s,
            trigger_timeout_s=settings.trigger_timeout_s,
            tolerance_m=settings.pullback_tolerance_m,
            pretrigger_s=settings.pretrigger_s,
            first_index=history.first_index,
        )
        self._test = armed_test(waits, armed_index, history)
        self.note = no_room_note(waits)
        self.end: tuple[int, EndReason] | None = None

    @property
    def measurement(self) -> PullbackMeasurement:
        """What was found of the pullback."""
        return self._test.measurement

    @property
    def state(self) -> PullbackState:
        """Where the test stands."""
        return self._test.state

    @property
    def position(self) -> StandPosition:
        """Where table and plate stand."""
        return self._test.position

    @property
    def start_index(self) -> int | None:
        """Known once the release is sure."""
        if not self.measurement.release_confirmed or self.measurement.release_index is None:
            return None
        return self.measurement.release_index - self._before

    @property
    def is_unattended(self) -> bool:
        """After the release."""
        return self.measurement.release_confirmed

    @property
    def awaits_release(self) -> bool:
        """From the hold on until the release is sure."""
        return self._test.awaits_release

    @property
    def is_at_rest(self) -> bool:
        """Before the pull."""
        return self._test.is_at_rest

    def add_samples(self, rows: CalibratedBlock) -> list[Transition]:
        """Take the samples that come next; return the new states. The end itself is told by `end`."""
        turns = self._test.add_samples(rows.first_index, rows.table_m, rows.relative_m)
        for turn in turns:
            if turn.end_reason is not None:
                self.end = turn.index, turn.end_reason
        return turns


class NoTrigger:
    """From the first sample after arming for `duration_s`, or until told to stop.

    A release in it is told like any other; nothing is asked of the operator.
    """

    def __init__(
        self, settings: RunSettings, plan: PullbackPlan, armed_index: int, history: ReadHistory
    ) -> None:
        self.state = PullbackState.RECORDING
        self.position = StandPosition()
        self.note = EMPTY
        self.is_at_rest = self.awaits_release = False
        self.start_index: int | None = armed_index
        self.end: tuple[int, EndReason] | None = None
        if settings.duration_s is not None:
            self.end = armed_index + round(settings.duration_s * plan.rate_hz), EndReason.DURATION
        self._test = armed_test(plan, armed_index, history)

    @property
    def measurement(self) -> PullbackMeasurement:
        """What was found of the pullback."""
        return self._test.measurement

    @property
    def is_unattended(self) -> bool:
        """When it ends by the clock."""
        return self.end is not None

    def add_samples(self, rows: CalibratedBlock) -> list[Transition]:
        """Take the samples that come next; return the new states."""
        turns = self._test.add_samples(rows.first_index, rows.table_m, rows.relative_m)
        return [replace(turn, note=EMPTY) for turn in turns if turn.state in _SEEN_WITHOUT_TRIGGER]


def create_trigger(
    settings: RunSettings, plan: PullbackPlan, armed_index: int, history: ReadHistory
) -> Trigger:
    """The trigger that the settings ask for."""
    kind = NoTrigger if settings.trigger == "none" else PullbackTrigger
    return kind(settings, plan, armed_index, history)


def armed_test(plan: PullbackPlan, armed_index: int, history: ReadHistory) -> PullbackStateMachine:
    """A test that knows the second before it was armed, unless the table was not at rest then."""
    test = PullbackStateMachine(plan, armed_index)
    earliest = armed_index - round(_CONTEXT_S * plan.rate_hz)
    for chunk in history.reads():
        for rows in chunk.rows:
            before = rows.between(earliest, armed_index)
            if len(before):
                test.add_samples(before.first_index, before.table_m, before.relative_m)
    return test if test.is_at_rest else PullbackStateMachine(plan, armed_index)
