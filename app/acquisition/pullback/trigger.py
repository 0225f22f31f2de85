"""When a run begins and ends: by the pullback, or at once and by the clock."""

from dataclasses import replace

from app.acquisition.messages import EndReason, PullbackState, RunSettings, StandPosition
from app.acquisition.pullback.operator_messages import no_room_note
from app.acquisition.pullback.plan import PullbackMeasurement, PullbackPlan, Transition
from app.acquisition.pullback.state_machine import PullbackStateMachine
from app.acquisition.stream.live_stream import ReadHistory
from app.runs.blocks import CalibratedBlock
from messages.message import EMPTY

_CONTEXT_S = 1.0
"""Time before arming in which a rest counts for the zero."""
_SEEN_WITHOUT_TRIGGER = (
    PullbackState.RELEASED,
    PullbackState.SLIPPING,
    PullbackState.NO_SLIP,
    PullbackState.TAIL,
)


class Trigger:
    """Decides from which sample to which a run goes. This one records without waiting for a release.

    It starts with the first sample after arming and ends after `duration_s`, or when stopped. A release is
    reported like any other; nothing is asked of the operator.
    """

    def __init__(
        self, settings: RunSettings, plan: PullbackPlan, armed_index: int, history: ReadHistory
    ) -> None:
        self._test = armed_test(plan, armed_index, history)
        self._armed_index = armed_index
        self.note = EMPTY
        """Remark before the run begins."""
        self.end: tuple[int, EndReason] | None = None
        """Sample before which the run ends, and why; None before that is known."""
        if settings.duration_s is not None:
            self.end = armed_index + round(settings.duration_s * plan.rate_hz), EndReason.DURATION

    @property
    def measurement(self) -> PullbackMeasurement:
        return self._test.measurement

    @property
    def state(self) -> PullbackState:
        return PullbackState.RECORDING

    @property
    def position(self) -> StandPosition:
        return StandPosition()

    @property
    def start_index(self) -> int | None:
        """First sample to store; None before that is known."""
        return self._armed_index

    @property
    def is_unattended(self) -> bool:
        """Tell whether the run comes to its end without anybody at the stand."""
        return self.end is not None

    @property
    def awaits_release(self) -> bool:
        """Tell whether a release that somebody waits for may come at any moment, or be confirmed."""
        return False

    @property
    def is_at_rest(self) -> bool:
        """Tell whether nothing has happened yet that would be worth keeping."""
        return False

    def add_samples(self, rows: CalibratedBlock) -> list[Transition]:
        """Take the samples that come next, from arming on; return the new states."""
        transitions = self._test.add_samples(rows.first_index, rows.table_m, rows.relative_m)
        return [replace(one, note=EMPTY) for one in transitions if one.state in _SEEN_WITHOUT_TRIGGER]


class PullbackTrigger(Trigger):
    """From `pretrigger_s` before the release, to the sample, until rest, enough or `duration_s` after it."""

    def __init__(
        self, settings: RunSettings, plan: PullbackPlan, armed_index: int, history: ReadHistory
    ) -> None:
        plan = replace(
            plan,
            duration_s=settings.duration_s,
            trigger_timeout_s=settings.trigger_timeout_s,
            tolerance_m=settings.pullback_tolerance_m,
            pretrigger_s=settings.pretrigger_s,
            first_index=history.first_index,
        )
        super().__init__(settings, plan, armed_index, history)
        self._pretrigger = round(settings.pretrigger_s * plan.rate_hz)
        self.note = no_room_note(plan)
        self.end = None

    @property
    def state(self) -> PullbackState:
        return self._test.state

    @property
    def position(self) -> StandPosition:
        return self._test.position

    @property
    def start_index(self) -> int | None:
        if not self.measurement.release_confirmed or self.measurement.release_index is None:
            return None
        return self.measurement.release_index - self._pretrigger

    @property
    def is_unattended(self) -> bool:
        return self.measurement.release_confirmed

    @property
    def awaits_release(self) -> bool:
        return self._test.awaits_release

    @property
    def is_at_rest(self) -> bool:
        return self._test.is_at_rest

    def add_samples(self, rows: CalibratedBlock) -> list[Transition]:
        """Take the samples that come next; return the new states. The last one sets `end`."""
        transitions = self._test.add_samples(rows.first_index, rows.table_m, rows.relative_m)
        for one in transitions:
            if one.end_reason is not None:
                self.end = one.index, one.end_reason
        return transitions


def create_trigger(
    settings: RunSettings, plan: PullbackPlan, armed_index: int, history: ReadHistory
) -> Trigger:
    """Create the trigger that the settings ask for."""
    kind = Trigger if settings.trigger == "none" else PullbackTrigger
    return kind(settings, plan, armed_index, history)


def armed_test(plan: PullbackPlan, armed_index: int, history: ReadHistory) -> PullbackStateMachine:
    """Create a test that knows the second before it was armed, unless the table was not at rest then."""
    test = PullbackStateMachine(plan, armed_index)
    earliest = armed_index - round(_CONTEXT_S * plan.rate_hz)
    for chunk in history.reads():
        for rows in chunk.rows:
            before = rows.between(earliest, armed_index)
            if len(before):
                test.add_samples(before.first_index, before.table_m, before.relative_m)
    return test if test.is_at_rest else PullbackStateMachine(plan, armed_index)
