"""When a run begins and ends: by the pullback, or at once and by the clock."""

from dataclasses import replace

from app.acquisition.messages import EndReason, PullbackState, RunSettings, StandPosition
from app.acquisition.pullback.plan import PullbackMeasurement, PullbackPlan, Transition
from app.acquisition.pullback.state_machine import PullbackStateMachine
from app.acquisition.stream.live_stream import ReadHistory
from app.runs.blocks import CalibratedBlock
from messages.i18n import N_
from messages.message import EMPTY, Message, message

_CONTEXT_S = 1.0  # time before arming in which a rest counts for the zero
_SEEN_WITHOUT_TRIGGER = (
    PullbackState.RELEASED,
    PullbackState.SLIPPING,
    PullbackState.NO_SLIP,
    PullbackState.TAIL,
)


class Trigger:
    """Decides from which sample to which a run goes.

    `pullback` records from `pretrigger_s` before the release until rest, enough or `duration_s` after it.
    `none` records from arming for `duration_s`, or until stopped: a release is only reported.
    """

    def __init__(
        self, settings: RunSettings, plan: PullbackPlan, armed_index: int, history: ReadHistory
    ) -> None:
        self._is_untriggered = settings.trigger == "none"
        self._armed_index = armed_index
        self._pretrigger = round(settings.pretrigger_s * plan.rate_hz)
        self.note = EMPTY  # remark before the run begins
        self.end: tuple[int, EndReason] | None = None
        """Sample before which the run ends, and why; None before that is known."""
        if not self._is_untriggered:
            plan = replace(
                plan,
                duration_s=settings.duration_s,
                trigger_timeout_s=settings.trigger_timeout_s,
                tolerance_m=settings.pullback_tolerance_m,
                pretrigger_s=settings.pretrigger_s,
                first_index=history.first_index,
            )
            self.note = _no_room_note(plan)
        elif settings.duration_s is not None:
            self.end = armed_index + round(settings.duration_s * plan.rate_hz), EndReason.DURATION
        self._test = _armed_test(plan, armed_index, history)

    @property
    def measurement(self) -> PullbackMeasurement:
        return self._test.measurement

    @property
    def state(self) -> PullbackState:
        return PullbackState.RECORDING if self._is_untriggered else self._test.state

    @property
    def position(self) -> StandPosition:
        return StandPosition(keeps_run=True) if self._is_untriggered else self._test.position

    @property
    def start_index(self) -> int | None:
        if self._is_untriggered:
            return self._armed_index
        if not self.measurement.release_confirmed or self.measurement.release_index is None:
            return None
        return self.measurement.release_index - self._pretrigger

    @property
    def is_unattended(self) -> bool:
        """Tell whether the run comes to its end without anybody at the stand."""
        return self.end is not None if self._is_untriggered else self.measurement.release_confirmed

    @property
    def awaits_release(self) -> bool:
        """Tell whether a release that somebody waits for may come at any moment, or be confirmed."""
        return not self._is_untriggered and self._test.awaits_release

    @property
    def is_at_rest(self) -> bool:
        """Tell whether nothing has happened yet that would be worth keeping."""
        return not self._is_untriggered and self.is_table_at_rest

    @property
    def is_table_at_rest(self) -> bool:
        """Tell whether the table has not been pulled back yet, nor released."""
        return self._test.is_at_rest

    def add_samples(self, rows: CalibratedBlock) -> list[Transition]:
        """Take the samples that come next, from arming on; return the new states. The last one sets `end`."""
        transitions = self._test.add_samples(rows.first_index, rows.table_m, rows.relative_m)
        if self._is_untriggered:
            return [replace(one, note=EMPTY) for one in transitions if one.state in _SEEN_WITHOUT_TRIGGER]
        for one in transitions:
            if one.end_reason is not None:
                self.end = one.index, one.end_reason
        return transitions


def _no_room_note(plan: PullbackPlan) -> Message:
    """Remark on a gauge 2 whose range is too short for the slip, wherever the plate stands; else empty."""
    if plan.plate_range is None or plan.plate_range.exists:
        return EMPTY
    template = N_("The slip may leave the range of gauge 2 (±{range_mm:g} mm) wherever the plate stands")
    return message(template, range_mm=1e3 * (plan.relative_range_m or 0.0))


def _armed_test(plan: PullbackPlan, armed_index: int, history: ReadHistory) -> PullbackStateMachine:
    """Create a test that knows the second before it was armed, unless the table was not at rest then."""
    test = PullbackStateMachine(plan, armed_index)
    earliest = armed_index - round(_CONTEXT_S * plan.rate_hz)
    for read in history.reads():
        for rows in read.rows:
            before = rows.between(earliest, armed_index)
            if len(before):
                test.add_samples(before.first_index, before.table_m, before.relative_m)
    return test if test.is_at_rest else PullbackStateMachine(plan, armed_index)
