"""Reducer of the Record screen: a run from its end to the next one, live samples, and what both change."""

from dataclasses import replace

import msgspec
import pytest
from stage import RUN, analysed, bench, ended, health, rows_between, standing

from analysis.quantities import Quantity
from app.acquisition.messages import EndReason, LiveResult, PullbackState, StateChanged
from app.presenters.base import Chip, Progress, Tone
from app.presenters.record.live import LiveTraces, tare_chip
from app.presenters.record.model import RecordModel
from app.presenters.record.presenter import record_state
from app.presenters.record.reducer import Effect, reduce
from app.presenters.record.state import (
    Action,
    AnalysisFailed,
    AnalysisProgress,
    Connecting,
    KeepRun,
    LiveEstimate,
    MoveToTrash,
    Notification,
    RecordEvent,
    StepStatus,
)
from messages.i18n import ENGLISH, gettext, use_language
from messages.message import message

PULLBACK_M = 0.012


class Screen:
    """Model of the screen, and the effects so far."""

    def __init__(self) -> None:
        self.model = RecordModel.of_stand(bench(), "me")
        self.effects: list[Effect] = []

    def send(self, *events: RecordEvent) -> None:
        for event in events:
            self.model, effects = reduce(self.model, event)
            self.effects += effects

    def come_to(self, state: PullbackState) -> None:
        self.send(StateChanged(state, 0.0))

    def decided(self) -> list[Effect]:
        return [effect for effect in self.effects if isinstance(effect, KeepRun | MoveToTrash)]


@pytest.fixture
def screen() -> Screen:
    """A run has ended, and the engine rests."""
    made = Screen()
    made.send(Connecting("COM7"))
    made.come_to(PullbackState.TAIL)
    made.send(ended())
    made.come_to(PullbackState.IDLE)
    return made


def test_a_reduction_changes_no_model_but_its_own(screen: Screen) -> None:
    before = replace(screen.model)
    after, effects = reduce(screen.model, analysed())
    assert after.ended is not None
    assert after.ended.result is not None
    assert effects == ()
    for name in RecordModel.__slots__:
        assert getattr(screen.model, name) is getattr(before, name)


def test_only_the_run_that_is_awaited_is_shown(screen: Screen) -> None:
    screen.send(AnalysisProgress("/elsewhere.h5", Progress("Fitting", 0.5)))
    screen.send(analysed("/elsewhere.h5"))
    assert screen.model.ended is not None
    assert (screen.model.ended.result, screen.model.ended.progress) == (None, Progress("Identifying"))
    screen.send(analysed())
    assert screen.model.ended.result is not None
    assert screen.model.ended.progress is None


def test_going_on_keeps_a_run_and_undo_shows_it_as_it_was(screen: Screen) -> None:
    screen.send(analysed())
    assert screen.model.ended is not None
    result, traces = screen.model.ended.result, screen.model.live.traces
    screen.send(Action.NEXT)
    assert screen.decided() == [KeepRun(RUN, "me", None, has_results=True)]
    assert screen.model.ended is None
    screen.send(rows_between(0.0, 1.0))
    assert screen.model.live.traces is not traces
    screen.send(Action.UNDO)
    assert screen.model.ended is not None
    assert screen.model.ended.result == result
    assert screen.model.live.traces is traces


def test_a_run_that_the_operator_went_on_from_is_kept_once_it_is_identified(screen: Screen) -> None:
    screen.send(Action.NEXT)
    assert screen.decided() == []
    screen.send(analysed())
    assert screen.decided() == [KeepRun(RUN, "me", None, has_results=True)]
    assert screen.model.ended is None


def test_a_discarded_run_is_moved_to_the_trash_and_left(screen: Screen) -> None:
    screen.send(analysed(), Action.DISCARD)
    assert screen.decided() == [MoveToTrash(RUN, "me", None)]
    assert screen.model.ended is None


def test_a_run_without_a_file_is_shown_at_once(screen: Screen) -> None:
    screen.send(Action.NEXT, ended("", EndReason.DISK_FULL, "the disk is full"))
    assert screen.model.ended is not None
    assert screen.model.ended.result is not None
    assert screen.model.ended.result.warnings == ("The disk is full",)
    assert screen.model.ended.progress is None


def test_a_recording_that_begins_leaves_the_run_before(screen: Screen) -> None:
    screen.send(analysed())
    screen.come_to(PullbackState.ZERO)
    assert screen.model.ended is None
    assert screen.decided() == [KeepRun(RUN, "me", None, has_results=True)]


def test_the_live_estimate_is_of_one_pull_only(screen: Screen) -> None:
    screen.come_to(PullbackState.SLIPPING)
    screen.send(LiveResult(6.0, period=Quantity.normal(0.31994, 3.1e-4, "s")))
    screen.come_to(PullbackState.TAIL)
    assert screen.model.session.live_estimate.rows
    screen.come_to(PullbackState.PULLING)
    assert screen.model.session.live_estimate == LiveEstimate()


def test_another_connection_takes_no_result_away(screen: Screen) -> None:
    screen.send(analysed(), Notification.DISCONNECTED)
    assert screen.model.ended is not None
    screen.send(Action.NEXT, Connecting("COM8"))
    assert screen.model.ended is None
    assert screen.model.status_bar.device.text == "COM8"


def test_health_changes_the_status_bar_alone(screen: Screen) -> None:
    before = screen.model
    screen.model = replace(before, stand=replace(before.stand, clock=lambda: before.session.heard_s))
    screen.send(health())
    assert screen.model.status_bar.rate == "1000.02\u202fHz"
    assert (screen.model.session, screen.model.ended) == (before.session, before.ended)


def test_readings_are_taken_ten_times_a_second_and_counted_from_the_tare() -> None:
    live = LiveTraces().with_rows(rows_between(0.0, 1.5), PULLBACK_M, None)
    assert live.with_rows(rows_between(1.5, 1.55), PULLBACK_M, None).read_s == live.read_s
    assert live.readings.origin == "by the calibration"
    assert float(live.readings.table) == pytest.approx(0.2, abs=0.011)
    tared = live.tared()
    assert tared is not None
    assert tared.readings.origin == "from the tare"
    assert abs(float(tared.readings.table.replace("−", "-"))) < 0.011
    assert tared.reconnected(bench().gauges).readings.table == "–"


def test_a_stand_that_moves_is_not_tared_which_is_said_in_the_language_of_the_window() -> None:
    live = LiveTraces().with_rows(rows_between(2.0, 4.0), PULLBACK_M, None)
    try:
        use_language("ru")
        chip = tare_chip(live.tared())
        assert chip == Chip(gettext("The stand moves: tare when it is at rest"), Tone.WARN)
        assert chip.text != "The stand moves: tare when it is at rest"
    finally:
        use_language(ENGLISH)


def test_the_situation_holds_what_gauges_and_engine_report() -> None:
    screen = Screen()
    screen.send(Connecting("COM7"))
    screen.come_to(PullbackState.RECENTRE)
    screen.send(rows_between(8.0, 9.0))
    situation = screen.model.situation(PullbackState.RECENTRE)
    assert situation.plate_m == pytest.approx(-0.010, abs=1e-4)
    allowed = bench().allowed_plate_range("1FFM0")
    assert screen.model.shown_plate_range == situation.plate_range == allowed is not None
    screen.come_to(PullbackState.ZERO)
    assert screen.model.shown_plate_range is None


@pytest.mark.parametrize("state", [None, *PullbackState])
def test_every_state_stands_somewhere_in_the_stepper(state: PullbackState | None) -> None:
    screen = Screen()
    if state is not None:
        screen.send(Connecting("COM7"), StateChanged(state, 0.0))
    steps = record_state(screen.model).guidance.steps
    during = state not in (None, PullbackState.CONNECTING, PullbackState.IDLE)
    assert any(step.status is not StepStatus.AHEAD for step in steps) == during


def test_a_note_is_a_warning_and_a_lost_reading_hides_the_target() -> None:
    screen = Screen()
    screen.send(Connecting("COM7"))
    screen.send(StateChanged(PullbackState.HELD, 1.0, "It drifts", standing(PullbackState.HELD)))
    guidance = record_state(screen.model).guidance
    assert (guidance.detail, guidance.tone, guidance.target) == ("It drifts", Tone.WARN, None)
    screen.send(rows_between(4.0, 4.4))
    target = record_state(screen.model).guidance.target
    assert target is not None
    assert (target.target_mm, target.now_mm) == pytest.approx((12.0, 12.0), abs=0.02)
    assert target.is_reached


def ticked(screen: Screen) -> list[str]:
    steps = record_state(screen.model).guidance.steps
    return [step.name for step in steps if step.status is StepStatus.DONE]


def go(screen: Screen, *states: PullbackState) -> None:
    for state in states:
        screen.send(StateChanged(state, 0.0, position=standing(state)))


@pytest.mark.parametrize(
    ("states", "names"),
    [
        ([PullbackState.RELEASED, PullbackState.NO_SLIP], ["Zero", "Pull", "Tail"]),
        (
            [PullbackState.HELD, PullbackState.RELEASED, PullbackState.SLIPPING],
            ["Zero", "Pull", "Hold", "Slip"],
        ),
        ([PullbackState.HELD, PullbackState.PULLING], ["Zero"]),
        ([PullbackState.HELD, PullbackState.ARMED], ["Zero", "Pull", "Hold", "Armed"]),
    ],
)
def test_a_stopped_run_has_those_steps_ticked_that_happened(
    states: list[PullbackState], names: list[str]
) -> None:
    screen = Screen()
    screen.send(Connecting("COM7"))
    go(screen, PullbackState.ZERO, PullbackState.PULLING, *states, PullbackState.CLOSING)
    assert ticked(screen) == names
    screen.send(ended(reason=EndReason.STOPPED))
    go(screen, PullbackState.IDLE)
    assert ticked(screen) == [*names, "Store"]
    screen.send(AnalysisFailed(RUN, message("no release")))
    assert ticked(screen) == [*names, "Store"], "there is no result"


def test_a_zero_that_was_not_taken_is_not_ticked() -> None:
    screen = Screen()
    screen.send(Connecting("COM7"))
    for state in (PullbackState.ZERO, PullbackState.PULLING, PullbackState.HELD):
        screen.send(StateChanged(state, 0.0))
    assert ticked(screen) == ["Pull"]


def test_steps_of_an_early_release_are_taken_back() -> None:
    screen = Screen()
    screen.send(Connecting("COM7"))
    go(screen, PullbackState.ZERO, PullbackState.PULLING)
    assert ticked(screen) == ["Zero"]
    early = msgspec.structs.replace(standing(PullbackState.PULLING), early_release_m=0.004)
    screen.send(StateChanged(PullbackState.ZERO, 1.0, position=early))
    guidance = record_state(screen.model).guidance
    assert ticked(screen) == []
    assert (guidance.instruction, guidance.detail, guidance.tone) == (
        "Let go too early, at 4.0\u202fmm",
        "Put the plate back and pull again.",
        Tone.WARN,
    )


def test_the_band_to_hold_in_does_not_jump_with_the_noise() -> None:
    live = LiveTraces().on_state(PullbackState.PULLING, 1.0, standing(PullbackState.PULLING))
    seen = set()
    for start in range(10, 20):  # at rest: the noise has either sign
        live = live.with_rows(rows_between(0.1 * start, 0.1 * (start + 1)), PULLBACK_M, None)
        seen.add(live.traces.marks.target_mm)
    assert seen == {None}, "the side of the pull is not known yet"
    live = live.with_rows(rows_between(2.0, 3.0), PULLBACK_M, None)
    assert live.traces.marks.target_mm == pytest.approx((11.76, 12.24))


def test_the_band_is_at_the_side_of_the_last_pull_until_the_table_goes_to_the_other() -> None:
    position = msgspec.structs.replace(standing(PullbackState.PULLING), side=-1)
    live = LiveTraces().on_state(PullbackState.PULLING, 1.0, position)
    live = live.with_rows(rows_between(1.0, 2.0), PULLBACK_M, None)
    assert live.traces.marks.target_mm == pytest.approx((-12.24, -11.76))
    live = live.with_rows(rows_between(2.0, 3.0), PULLBACK_M, None)
    assert live.traces.marks.target_mm == pytest.approx((11.76, 12.24))
