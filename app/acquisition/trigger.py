"""When a run begins and ends: by the pullback, or at once and by the clock."""

from dataclasses import replace
from typing import Protocol

from app.acquisition.calibration import Rows
from app.acquisition.history import History
from app.acquisition.messages import EndReason, PullbackState, RunSettings
from app.acquisition.pullback import PullbackFacts, PullbackPlan, PullbackTest, Turn

_CONTEXT_S = 1.0


class Trigger(Protocol):
    """Says from which sample to which a run goes."""

    @property
    def facts(self) -> PullbackFacts:
        """What was found of the pullback."""

    @property
    def start_index(self) -> int | None:
        """First sample to store; None before that is known."""

    @property
    def end(self) -> tuple[int, EndReason] | None:
        """Sample before which the run ends, and why; None before that is known."""

    @property
    def needs_nobody(self) -> bool:
        """Tell whether the run comes to its end without anybody at the stand."""

    def follow(self, rows: Rows) -> list[Turn]:
        """Take the samples that come next, from arming on; return the new states."""


class PullbackTrigger:
    """From `pretrigger_s` before the release, to the sample, until rest, enough or `duration_s` after it."""

    def __init__(self, settings: RunSettings, plan: PullbackPlan, armed_index: int, history: History) -> None:
        self._before = round(settings.pretrigger_s * plan.rate_hz)
        self._test = armed_test(
            replace(plan, duration_s=settings.duration_s, trigger_timeout_s=settings.trigger_timeout_s),
            armed_index,
            history,
        )
        self.end: tuple[int, EndReason] | None = None

    @property
    def facts(self) -> PullbackFacts:
        """What was found of the pullback."""
        return self._test.facts

    @property
    def start_index(self) -> int | None:
        """Known once the release is sure."""
        if not self.facts.release_confirmed or self.facts.release_index is None:
            return None
        return self.facts.release_index - self._before

    @property
    def needs_nobody(self) -> bool:
        """After the release."""
        return self.facts.release_confirmed

    def follow(self, rows: Rows) -> list[Turn]:
        """Take the samples that come next; return the new states."""
        turns = self._test.feed(rows.first_index, rows.table_m, rows.relative_m)
        for turn in turns:
            if turn.ended is not None:
                self.end = turn.index, turn.ended
        return [turn for turn in turns if turn.ended is None]


class NoTrigger:
    """From the first sample after arming for `duration_s`, or until told to stop; the states are told too."""

    def __init__(self, settings: RunSettings, plan: PullbackPlan, armed_index: int, history: History) -> None:
        self.start_index: int | None = armed_index
        self.end: tuple[int, EndReason] | None = None
        if settings.duration_s is not None:
            self.end = armed_index + round(settings.duration_s * plan.rate_hz), EndReason.DURATION
        self._test = armed_test(plan, armed_index, history)

    @property
    def facts(self) -> PullbackFacts:
        """What was found of the pullback."""
        return self._test.facts

    @property
    def needs_nobody(self) -> bool:
        """When it ends by the clock."""
        return self.end is not None

    def follow(self, rows: Rows) -> list[Turn]:
        """Take the samples that come next; return the new states."""
        turns = self._test.feed(rows.first_index, rows.table_m, rows.relative_m)
        return [turn for turn in turns if turn.ended is None]


def make_trigger(settings: RunSettings, plan: PullbackPlan, armed_index: int, history: History) -> Trigger:
    """The trigger that the settings ask for."""
    kind = NoTrigger if settings.trigger == "none" else PullbackTrigger
    return kind(settings, plan, armed_index, history)


def armed_test(plan: PullbackPlan, armed_index: int, history: History) -> PullbackTest:
    """A test that knows the second before it was armed, unless the table was not at rest then."""
    test = PullbackTest(plan, armed_index)
    earliest = armed_index - round(_CONTEXT_S * plan.rate_hz)
    for chunk in history.chunks():
        for rows in chunk.rows:
            before = rows.between(earliest, armed_index)
            if len(before):
                test.feed(before.first_index, before.table_m, before.relative_m)
    return test if test.state is PullbackState.ZERO else PullbackTest(plan, armed_index)
