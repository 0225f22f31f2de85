"""Decisions on runs on Record: keep, repeat, discard, restore; stored plan and form."""

from dataclasses import replace
from pathlib import Path

import msgspec
import pytest
from stage import FOLDER, RUN, FakeRecorder, FakeWorker, analysed, bench, ended, rows_between

from app.acquisition.messages import (
    Connected,
    EndReason,
    PullbackState,
    Reconnected,
    Reconnecting,
    RunStarted,
    StateChanged,
)
from app.presenters.analysed_run import AnalysedRun
from app.presenters.base import SimulationStarted, Tone
from app.presenters.record.presenter import RecordPresenter
from app.presenters.record.state import (
    Action,
    AnalysisFailed,
    Connecting,
    CountCompletedRuns,
    Cue,
    KeepRun,
    LoadedPlan,
    LoadPlan,
    MoveToTrash,
    NoteEdited,
    Notification,
    PlanEdited,
    RecordTask,
    RestoreFromTrash,
    RunForm,
    SavePlan,
    TaskDone,
)
from app.runs.metadata import Conditions
from app.runs.next_tests import NextTests, PlannedSeries
from config.schema import Settings

PLAN = (PlannedSeries("1FFM0", 2), PlannedSeries("1FFM1", 1))
TRASHED = "/recordings/.trash/20260112_1FFM0_001.h5"


class Desk:
    """A presenter whose worker a test answers for."""

    def __init__(self, tests: NextTests | None = None, done: tuple[tuple[str, str], ...] = ()) -> None:
        self.recorder = FakeRecorder()
        self.worker = FakeWorker()
        self.saved: list[NextTests] = []
        self.now_s = 0.0
        around = replace(bench(), clock=lambda: self.now_s)
        self.record = RecordPresenter(self.recorder, around, self.worker, "me")  # type: ignore[arg-type]
        self.record.dispatch(Connecting("COM7"))
        assert self.tasks() == [LoadPlan(str(bench().directory))]
        self.answer(LoadPlan(FOLDER), LoadedPlan(tests or NextTests(plan=PLAN), done))
        self.record.dispatch(Connected("GSV-8", "1.2", 1000.0, "/ring"))
        self.come_to(PullbackState.IDLE)
        self.tasks()
        self.saved.clear()

    def come_to(self, state: PullbackState, at_s: float = 0.0) -> None:
        self.record.dispatch(StateChanged(state, at_s))

    def tasks(self) -> list[RecordTask]:
        """Tasks since the last call; the plans among them are in `saved`."""
        asked = [call.arguments[0] for call in self.worker.calls]
        self.worker.calls.clear()
        self.saved += [task.tests for task in asked if isinstance(task, SavePlan)]
        return [task for task in asked if not isinstance(task, SavePlan)]

    def answer(self, task: RecordTask, answer: object) -> None:
        self.record.dispatch(TaskDone(task, answer))
        self.record.tick()

    def run(self, path: str = RUN, remaining: int = 0) -> None:
        """Record one, up to its end."""
        self.come_to(PullbackState.ZERO)
        before = self.record.state.status_bar.run.text
        self.come_to(PullbackState.TAIL)
        self.come_to(PullbackState.CLOSING)
        assert self.record.state.status_bar.run.text == before
        self.record.dispatch(msgspec.structs.replace(ended(path), remaining=remaining))
        if not remaining:
            self.come_to(PullbackState.IDLE)
        self.tasks()

    def connect(self, device: str, true_friction: float | None = None) -> None:
        """Connect another device instead, a simulated one if its friction is known."""
        self.record.dispatch(Notification.DISCONNECTED)
        self.record.dispatch(Connecting(device))
        if true_friction is not None:
            self.record.dispatch(SimulationStarted("1FFM0", true_friction))
        self.record.dispatch(Connected(device, "1.2", 1000.0, "/ring"))
        self.come_to(PullbackState.IDLE)

    def result(self, note: str = "") -> None:
        self.record.dispatch(Action.ARM)
        self.run()
        self.record.dispatch(found(note=note))


def found(path: str = RUN, note: str = "") -> AnalysedRun:
    return analysed(path, note=note)


def test_keeping_stores_what_was_found_and_counts_again() -> None:
    desk = Desk()
    desk.result()
    assert desk.record.state.decision == ""
    desk.record.dispatch(Action.NEXT)
    (task,) = desk.tasks()
    assert task == KeepRun(RUN, "me", None, has_results=True)
    assert (
        desk.record.state.status_message.text
        == "f<sub>d</sub> = 0.10030 ± 0.00064. Keeping 20260112_1FFM0_001"
    )
    desk.answer(task, RUN)
    assert desk.tasks() == [CountCompletedRuns(FOLDER)]
    assert (
        desk.record.state.status_message.text == "f<sub>d</sub> = 0.10030 ± 0.00064. Kept 20260112_1FFM0_001"
    )
    assert desk.record.state.decision is None


def test_a_new_note_goes_with_the_run_and_an_old_one_is_not_written_again() -> None:
    desk = Desk()
    desk.result(note="third plate")
    assert desk.record.state.decision == "third plate"
    desk.record.dispatch(NoteEdited("third plate, hand trembled"))
    desk.record.dispatch(Action.NEXT)
    (task,) = desk.tasks()
    assert isinstance(task, KeepRun)
    assert task.note == "third plate, hand trembled"


def test_discarding_moves_to_the_trash_and_back() -> None:
    desk = Desk()
    desk.result()
    desk.record.dispatch(Action.DISCARD)
    (task,) = desk.tasks()
    assert task == MoveToTrash(RUN, "me", None)
    assert desk.record.state.result is None
    assert len(desk.recorder.armed) == 1, "nothing is armed"
    desk.answer(task, TRASHED)
    assert desk.record.state.status_message.text == "Moved 20260112_1FFM0_001 to the trash"
    assert desk.record.state.undo == "Bring back 20260112_1FFM0_001"
    desk.tasks()
    desk.record.dispatch(Action.UNDO)
    assert desk.tasks() == [RestoreFromTrash(TRASHED)]
    assert desk.record.state.undo == ""
    desk.answer(RestoreFromTrash(TRASHED), "/recordings/20260112_1FFM0_001-2.h5")
    state = desk.record.state
    assert desk.tasks() == [CountCompletedRuns(FOLDER)], "nothing is decided yet"
    assert state.decision == ""
    assert state.result is not None
    assert state.result.path == "/recordings/20260112_1FFM0_001-2.h5"
    assert state.status_message.text == "Brought back 20260112_1FFM0_001-2"
    desk.record.dispatch(Action.NEXT)
    assert desk.tasks() == [KeepRun(state.result.path, "me", "", has_results=True)]


def test_what_was_kept_can_be_decided_about_again() -> None:
    desk = Desk(done=(("/recordings/x.h5", "1FFM0"),))
    desk.record.dispatch(RunForm(note="third plate"))
    desk.result()
    shown = desk.record.state
    desk.record.dispatch(NoteEdited("hand trembled"))
    desk.record.dispatch(Action.NEXT)
    assert desk.record.state.undo == "Decide again about 20260112_1FFM0_001"
    assert desk.record.state.choices.series == "1FFM1", "the plan has gone on"
    assert desk.record.state.plan.done == 2
    desk.answer(desk.tasks()[0], RUN)
    desk.answer(CountCompletedRuns(FOLDER), (("/recordings/x.h5", "1FFM0"), (RUN, "1FFM0")))
    desk.tasks()
    desk.record.dispatch(Action.UNDO)
    again = desk.record.state
    assert again.decision == "hand trembled"
    assert again.result == shown.result
    assert again.traces is shown.traces
    assert (again.allowed, again.status_bar.run.text) == (shown.allowed, shown.status_bar.run.text)
    assert (again.plan.done, again.choices.series) == (1, "1FFM0")
    assert again.undo == ""
    desk.recorder.rows = rows_between(0.0, 0.5)
    desk.record.tick()
    assert desk.record.state.traces is shown.traces, "what the stand does now is not this run"
    desk.record.dispatch(Action.DISCARD)
    assert MoveToTrash(RUN, "me", "hand trembled") in desk.tasks()


def test_a_run_on_its_way_to_the_trash_neither_counts_nor_is_asked_about() -> None:
    desk = Desk()
    desk.result()
    desk.record.dispatch(Action.NEXT)
    desk.record.dispatch(Action.UNDO)
    desk.record.dispatch(Action.DISCARD)
    assert desk.record.state.plan.done == 0
    assert desk.record.state.status_message.text == "Moving 20260112_1FFM0_001 to the trash"
    assert desk.record.state.undo == ""
    desk.record.dispatch(Action.UNDO)
    assert desk.record.state.result is None
    desk.answer(MoveToTrash(RUN, "me", ""), TRASHED)
    assert desk.record.state.undo == "Bring back 20260112_1FFM0_001"


def test_keeping_is_taken_back_before_it_is_done_too() -> None:
    desk = Desk()
    desk.result()
    desk.record.dispatch(Action.NEXT)
    (task,) = desk.tasks()
    desk.record.dispatch(Action.UNDO)
    desk.answer(task, RUN)
    assert desk.record.state.decision == ""
    assert desk.record.state.status_message.text == ""
    desk.record.dispatch(Action.NEXT)
    assert isinstance(desk.tasks()[-1], KeepRun)


def test_nothing_is_decided_again_while_the_next_run_is_recorded() -> None:
    desk = Desk()
    desk.result()
    desk.record.dispatch(Action.ARM)
    assert desk.record.state.undo == ""
    desk.record.dispatch(Action.UNDO)
    desk.come_to(PullbackState.ZERO)
    desk.record.dispatch(Action.UNDO)
    assert desk.record.state.result is None
    assert [type(task) for task in desk.tasks()] == [KeepRun]


def test_a_repeated_run_that_is_brought_back_meanwhile_is_kept() -> None:
    desk = Desk()
    desk.result()
    desk.record.dispatch(Action.REPEAT)
    desk.answer(desk.tasks()[0], TRASHED)
    desk.come_to(PullbackState.ZERO)
    desk.tasks()
    desk.record.dispatch(Action.UNDO)
    desk.answer(desk.tasks()[0], RUN)
    assert desk.record.state.result is None
    assert desk.tasks() == [KeepRun(RUN, "me", None, has_results=True), CountCompletedRuns(FOLDER)]
    assert desk.record.state.status_message.text == "Brought back 20260112_1FFM0_001: it counts again"


def test_a_run_that_could_not_be_moved_is_decided_about_again() -> None:
    desk = Desk()
    desk.result()
    desk.record.dispatch(Action.DISCARD)
    desk.worker.calls[0].fail("the disk is full. Free some space")
    assert desk.record.state.undo == "Decide again about 20260112_1FFM0_001"
    desk.record.dispatch(Action.UNDO)
    assert desk.record.state.decision == ""


def test_closing_waits_until_what_was_decided_is_stored() -> None:
    desk = Desk()
    desk.result()
    desk.record.dispatch(Action.NEXT)
    (call,) = [call for call in desk.worker.calls if isinstance(call.arguments[0], KeepRun)]
    desk.worker.is_busy = True

    def store() -> None:
        assert not desk.worker.closed
        desk.worker.is_busy = False
        call.done(RUN)

    desk.worker.poll = store  # type: ignore[method-assign]
    desk.record.close()
    assert desk.worker.closed
    assert not desk.worker.is_busy
    assert isinstance(desk.tasks()[-1], CountCompletedRuns)


def test_repeating_puts_aside_and_arms_the_same_series_once() -> None:
    desk = Desk()
    desk.record.dispatch(RunForm(count="3"))
    desk.tasks()
    desk.result()
    desk.record.dispatch(Action.REPEAT)
    assert desk.tasks()[0] == MoveToTrash(RUN, "me", None)
    assert [run.series for run in desk.recorder.armed] == ["1FFM0", "1FFM0"]
    assert desk.recorder.counts == [3, 1]


def test_arming_from_the_result_keeps_it() -> None:
    desk = Desk()
    desk.result()
    desk.record.dispatch(Action.ARM)
    assert isinstance(desk.tasks()[0], KeepRun)
    assert len(desk.recorder.armed) == 2


def test_another_series_is_not_armed_unseen() -> None:
    desk = Desk(done=(("/recordings/x.h5", "1FFM0"),))
    desk.result()
    desk.record.dispatch(Action.ARM)
    assert isinstance(desk.tasks()[0], KeepRun)
    assert len(desk.recorder.armed) == 1
    assert desk.record.state.choices.series == "1FFM1"
    assert desk.record.state.status_message.text == "1FFM0 is full: arm again for 1FFM1"
    desk.record.dispatch(Action.ARM)
    assert [run.series for run in desk.recorder.armed] == ["1FFM0", "1FFM1"]


def test_a_run_that_was_passed_by_is_kept_as_soon_as_it_is_identified() -> None:
    desk = Desk()
    desk.record.dispatch(Action.ARM)
    desk.run()
    desk.record.dispatch(Action.NEXT)
    assert desk.tasks() == []
    desk.record.dispatch(found())
    (task,) = desk.tasks()
    assert isinstance(task, KeepRun)
    assert task.has_results
    desk.answer(task, RUN)
    assert (
        desk.record.state.status_message.text == "f<sub>d</sub> = 0.10030 ± 0.00064. Kept 20260112_1FFM0_001"
    )
    assert desk.record.state.result is None


def test_of_runs_in_a_row_each_is_kept_and_the_last_is_asked_about() -> None:
    desk = Desk()
    desk.record.dispatch(RunForm(count="2", run_in_number="7"))
    desk.tasks()
    desk.record.dispatch(Action.ARM)
    assert desk.recorder.counts == [2]
    assert desk.record.state.status_bar.run.text == "1FFM0 run 1 of 2, 1 more by themselves"
    first, second = str(Path(FOLDER, "a.h5")), str(Path(FOLDER, "b.h5"))
    desk.run(first, remaining=1)
    assert desk.record.state.choices.form.run_in_number == "8"
    assert desk.record.state.status_bar.run.text.endswith(", 1 more by themselves")
    desk.come_to(PullbackState.ZERO)
    assert not desk.record.state.status_bar.run.text.endswith("by themselves")
    desk.record.dispatch(found(first))
    assert [type(task) for task in desk.tasks()] == [KeepRun]
    desk.run(second)
    desk.record.dispatch(found(second))
    assert desk.record.state.decision is not None
    assert desk.tasks() == []


def test_another_device_decides_nothing_about_a_run() -> None:
    desk = Desk()
    desk.result()
    shown = desk.record.state
    desk.connect("GSV-4")
    assert desk.tasks() == []
    state = desk.record.state
    assert (state.decision, state.result, state.plan.done) == ("", shown.result, 0)
    assert state.status_bar.device.text == "GSV-4"
    desk.recorder.rows = rows_between(0.0, 0.5)
    desk.record.tick()
    assert desk.record.state.traces is shown.traces, "what the other device reads is not this run"
    desk.record.dispatch(Action.ARM)
    assert len(desk.recorder.armed) == 1
    assert desk.record.state.status_message.text == "Decide about 20260112_1FFM0_001 first"
    desk.record.dispatch(Action.NEXT)
    assert [type(task) for task in desk.tasks()] == [KeepRun]
    assert desk.record.state.plan.done == 1
    desk.record.dispatch(Action.ARM)
    assert len(desk.recorder.armed) == 2


def test_a_run_that_is_not_identified_yet_is_asked_about_with_another_device_too() -> None:
    desk = Desk()
    desk.record.dispatch(Action.ARM)
    desk.run()
    desk.connect("Slipstand simulator", true_friction=0.2)
    desk.record.dispatch(found())
    state = desk.record.state
    assert desk.tasks() == []
    assert state.decision == ""
    assert state.result is not None
    assert state.result.comparison == "", "the truth of the stand that was connected later"
    assert Action.REPEAT not in state.allowed, "a simulated run would take its place"
    desk.record.dispatch(Action.DISCARD)
    assert desk.tasks() == [MoveToTrash(RUN, "me", None)]


def test_a_simulated_run_is_compared_with_its_own_truth_whatever_is_connected_next() -> None:
    desk = Desk()
    desk.connect("Slipstand simulator", true_friction=0.2)
    desk.record.dispatch(Action.ARM)
    desk.run()
    desk.connect("GSV-4")
    desk.record.dispatch(found())
    assert desk.record.state.result is not None
    assert desk.record.state.result.comparison.startswith("True value 0.20000")


def test_a_run_waits_for_its_decision_beyond_the_end_of_the_window() -> None:
    desk = Desk()
    desk.record.dispatch(Action.ARM)
    desk.come_to(PullbackState.RELEASED)
    desk.record.dispatch(RunStarted(RUN))
    desk.tasks()
    name = "20260112_1FFM0_001.h5"
    assert desk.saved[-1].undecided == (name,), "from its beginning, should the window be killed"
    desk.record.dispatch(ended())
    desk.come_to(PullbackState.IDLE)
    desk.record.dispatch(found())
    desk.record.dispatch(Action.NEXT)
    desk.tasks()
    assert desk.saved[-1].undecided == ()
    desk.record.dispatch(Action.UNDO)
    desk.tasks()
    assert desk.saved[-1].undecided == (name,)
    desk.record.dispatch(Action.DISCARD)
    desk.tasks()
    assert desk.saved[-1].undecided == ()


def test_runs_left_without_a_decision_are_named_and_stay_so_until_they_are_decided_about() -> None:
    desk = Desk(NextTests(plan=PLAN, undecided=("20260111_1FFM0_007.h5",)))
    text = desk.record.state.status_message.text
    assert text.startswith("20260111_1FFM0_007 still waits for a decision, and does not count")
    desk.result()
    desk.record.dispatch(Action.NEXT)
    desk.tasks()
    assert desk.saved[-1].undecided == ("20260111_1FFM0_007.h5",)


def test_a_stop_before_the_pull_leaves_nothing_to_decide() -> None:
    desk = Desk()
    desk.record.dispatch(RunForm(note="third plate", run_in_number="4"))
    desk.record.dispatch(Action.ARM)
    desk.come_to(PullbackState.ZERO)
    assert desk.record.state.disarms
    desk.record.dispatch(Action.STOP)
    desk.record.dispatch(ended("", EndReason.STOPPED))
    desk.come_to(PullbackState.IDLE)
    desk.tasks()
    state = desk.record.state
    assert (state.result, state.decision, state.undo) == (None, None, "")
    assert state.status_message.text == "Disarmed. Nothing was recorded"
    assert state.guidance.instruction == "Arm when the stand is at rest"
    assert (state.choices.form.note, state.choices.form.run_in_number) == ("third plate", "4")
    assert not state.disarms
    assert not any(tests.undecided for tests in desk.saved)


def test_a_run_without_a_result_can_be_put_aside_too() -> None:
    desk = Desk()
    desk.record.dispatch(Action.ARM)
    desk.run()
    desk.record.dispatch(AnalysisFailed(RUN, "no release"))
    assert {Action.NEXT, Action.REPEAT, Action.DISCARD} <= desk.record.state.allowed
    desk.record.dispatch(Action.NEXT)
    (task,) = desk.tasks()
    assert isinstance(task, KeepRun)
    assert not task.has_results


def test_what_could_not_be_done_is_said() -> None:
    desk = Desk()
    desk.result()
    desk.record.dispatch(Action.NEXT)
    desk.worker.calls[0].fail("the disk is full. Free some space")
    assert desk.record.state.status_message.tone is Tone.BAD
    assert desk.record.state.status_message.text == "The disk is full. Free some space"


def test_the_plan_counts_and_the_next_series_is_chosen_when_one_is_full() -> None:
    desk = Desk(done=(("/recordings/x.h5", "1FFM0"),))
    assert [one.dots for one in desk.record.state.plan.progress] == ["●○", "○"]
    assert desk.record.state.status_bar.run.text == "1FFM0 run 2 of 2"
    desk.result()
    assert desk.record.state.status_bar.run.text == "1FFM0 run 2 of 2"
    desk.record.dispatch(Action.NEXT)
    done = (("/recordings/x.h5", "1FFM0"), (RUN, "1FFM0"))
    desk.answer(CountCompletedRuns(FOLDER), done)
    assert [one.dots for one in desk.record.state.plan.progress] == ["●●", "○"]
    assert desk.record.state.choices.series == "1FFM1"
    assert desk.record.state.status_bar.run.text == "1FFM1 run 1 of 1"


def test_a_run_that_is_not_decided_about_does_not_count_yet() -> None:
    desk = Desk()
    desk.result()
    desk.answer(CountCompletedRuns(FOLDER), ((RUN, "1FFM0"),))
    assert desk.record.state.plan.done == 0
    desk.record.dispatch(Action.NEXT)
    assert desk.record.state.plan.done == 1


def test_the_simulated_stand_keeps_its_series_whatever_the_plan_says() -> None:
    desk = Desk()
    desk.record.dispatch(SimulationStarted("3SSM0", 0.2))
    desk.answer(CountCompletedRuns(FOLDER), ())
    assert desk.record.state.choices.series == "3SSM0"


def test_a_plan_is_kept_and_what_is_none_is_said() -> None:
    desk = Desk(NextTests())
    desk.record.dispatch(PlanEdited("9ZZ x3"))
    assert desk.record.state.plan.error.startswith("9ZZ is no series of this stand")
    assert desk.tasks() == desk.saved == []
    desk.record.dispatch(PlanEdited("2SSM1 x2"))
    desk.tasks()
    assert [tests.plan for tests in desk.saved] == [(PlannedSeries("2SSM1", 2),)]
    assert desk.record.state.choices.series == "2SSM1"
    assert desk.record.state.plan.error == ""


def test_what_was_known_of_the_last_tests_is_there_again() -> None:
    kept = NextTests(
        series="2FFM1",
        operator="N. N.",
        conditions=Conditions(temperature_c=21.5, plate_id="P1", run_in_number=4, other={"lamp": "on"}),
    )
    desk = Desk(kept)
    choices = desk.record.state.choices
    assert choices.series == "2FFM1"
    assert choices.form == RunForm("N. N.", "", "1", "21.5", "", "P1", "", "", "4")
    assert choices.summary == "N. N. · 21.5\u202f°C · plate P1 · run-in 4"
    desk.record.dispatch(Action.ARM)
    assert desk.recorder.armed[0].conditions == kept.conditions


def test_the_note_is_of_one_run_and_the_surfaces_are_run_in_once_more() -> None:
    desk = Desk()
    desk.record.dispatch(RunForm(note="new pads", run_in_number="4"))
    desk.record.dispatch(Action.ARM)
    desk.run()
    form = desk.record.state.choices.form
    assert (form.note, form.run_in_number) == ("", "5")


@pytest.mark.parametrize(
    ("form", "words"),
    [
        (RunForm(temperature_c="warm"), "Temperature in °C = 'warm' is not a number"),
        (RunForm(humidity_percent="140"), "Humidity in % = 140 cannot be"),
        (RunForm(count="0"), "Runs in a row = '0' is no whole number from 1 to 999"),
    ],
)
def test_what_cannot_be_is_said_and_nothing_is_recorded_with_it(form: RunForm, words: str) -> None:
    desk = Desk()
    desk.record.dispatch(form)
    assert desk.record.state.choices.form_error.startswith(words)
    assert desk.tasks() == []
    desk.record.dispatch(Action.ARM)
    assert desk.recorder.armed == []
    assert desk.record.state.status_message.tone is Tone.BAD


def test_a_file_that_cannot_be_read_is_never_written_over() -> None:
    desk = Desk()
    fresh = RecordPresenter(desk.recorder, bench(), desk.worker, "me")  # type: ignore[arg-type]
    fresh.dispatch(Notification.SCREEN_ENTERED)
    (call,) = desk.worker.calls
    desk.worker.calls.clear()
    call.fail("next-tests.json: cannot be used. Mend it")
    assert desk.tasks() == [CountCompletedRuns(FOLDER)]
    assert fresh.state.status_message.text == "next-tests.json: cannot be used. Mend it"
    fresh.dispatch(PlanEdited("1FFM0 x2"))
    assert desk.tasks() == []


def test_runs_are_counted_anew_when_the_screen_is_shown_again() -> None:
    desk = Desk()
    desk.record.enter()
    assert desk.tasks() == [CountCompletedRuns(FOLDER)]


def test_tare_shows_from_here_and_changes_nothing_that_is_stored() -> None:
    desk = Desk()
    desk.recorder.rows = rows_between(0.0, 1.5)
    desk.record.tick()
    assert desk.record.state.readings.table == "0.20"
    desk.record.dispatch(Action.TARE)
    assert desk.record.state.readings.table == "0.00"
    assert desk.record.state.readings.origin == "from the tare"
    assert desk.record.state.status_message.text == "Tared by 0.20\u202fmm and 0.00\u202fmm"
    desk.recorder.rows = rows_between(1.5, 1.6)
    desk.record.tick()
    marks = desk.record.state.traces.marks
    range_mm = 1e3 * (bench().gauges.table.range_m or 0.0)
    assert marks.table_range_mm == pytest.approx((-range_mm - 0.2, range_mm - 0.2), abs=1e-3)
    desk.record.dispatch(Action.UNTARE)
    assert desk.record.state.readings.table == "0.20"


def test_a_stand_that_moves_is_not_tared() -> None:
    desk = Desk()
    desk.recorder.rows = rows_between(2.0, 3.5)
    desk.record.tick()
    before = desk.record.state.readings.table
    desk.record.dispatch(Action.TARE)
    assert desk.record.state.status_message.text == "The stand moves: tare when it is at rest"
    assert desk.record.state.readings.table == before


def test_nothing_is_tared_while_a_run_is_recorded() -> None:
    desk = Desk()
    desk.come_to(PullbackState.ZERO)
    assert Action.TARE not in desk.record.state.allowed
    desk.recorder.rows = rows_between(0.0, 1.5)
    desk.record.tick()
    desk.record.dispatch(Action.TARE)
    assert desk.record.state.readings.origin != "from the tare"


def test_a_lost_device_is_said_with_what_to_do_until_it_is_back() -> None:
    desk = Desk()
    desk.come_to(PullbackState.TAIL)
    desk.record.dispatch(Reconnecting("the device at COM7 is gone"))
    state = desk.record.state
    assert state.guidance.instruction == "Plug the device in again"
    assert state.guidance.detail == "The device at COM7 is gone. The run goes on when it is back."
    assert state.guidance.tone is Tone.BAD
    assert (state.status_bar.device.text, state.status_bar.device.tone) == ("GSV-8 lost", Tone.BAD)
    desk.record.dispatch(Reconnected(1.2, "the device was away and is back"))
    assert desk.record.state.guidance.instruction == "Hands off"
    assert desk.record.state.status_bar.device.text == "GSV-8"


def test_an_engine_that_says_nothing_is_noticed() -> None:
    desk = Desk()
    desk.now_s += 1.5
    desk.record.tick()
    assert desk.record.state.status_bar.device.text == "GSV-8"
    desk.now_s += 3.0
    desk.record.tick()
    assert desk.record.state.status_bar.device.text == "engine silent for 4\u202fs"
    desk.come_to(PullbackState.IDLE)
    desk.record.tick()
    assert desk.record.state.status_bar.device.text == "GSV-8"


def test_states_are_heard_only_by_who_wants_to() -> None:
    desk = Desk()
    desk.come_to(PullbackState.ARMED)
    assert desk.record.state.cue is None
    desk.record.dispatch(Settings(sounds=True, operator="N. N."))
    assert desk.record.state.cue is Cue.LET_GO
    desk.come_to(PullbackState.RELEASED)
    assert desk.record.state.cue is Cue.RELEASED
    desk.come_to(PullbackState.IDLE)
    assert desk.record.state.choices.form.operator == "N. N."


# --- simulated runs in the plan ---


def simulated_desk(*, counts: bool) -> Desk:
    desk = Desk()
    desk.record.dispatch(Settings(count_simulated=counts))
    desk.record.dispatch(Connecting("Simulated stand"))
    desk.record.dispatch(SimulationStarted("1FFM0", 0.1))
    desk.record.dispatch(Connected("slipstand-fw", "simulated-1", 1000.0, "/ring"))
    desk.come_to(PullbackState.IDLE)
    desk.tasks()
    return desk


@pytest.mark.parametrize(("counts", "done"), [(False, 0), (True, 1)])
def test_a_simulated_run_fills_the_plan_only_if_it_was_chosen(counts: bool, done: int) -> None:
    desk = simulated_desk(counts=counts)
    shown = "1FFM0 run 1 of 2" if counts else "1FFM0, not counted in the plan"
    assert desk.record.state.status_bar.run.text == shown
    desk.result()
    desk.record.dispatch(Action.NEXT)
    assert desk.record.state.plan.done == done
    assert desk.tasks()[0] == KeepRun(RUN, "me", None, has_results=True), "it is kept in any case"


def test_the_choice_is_remembered_and_counts_the_folder_again() -> None:
    desk = Desk()
    assert not desk.record.state.plan.counts_simulated
    desk.record.dispatch(Settings(count_simulated=True))
    assert desk.tasks() == [CountCompletedRuns(FOLDER, counts_simulated=True)]
    desk.answer(CountCompletedRuns(FOLDER, counts_simulated=True), ((RUN, "1FFM0"),))
    assert desk.record.state.plan.counts_simulated
    assert desk.record.state.plan.done == 1
    desk.record.dispatch(Settings(count_simulated=True, sounds=True))
    assert desk.tasks() == [], "nothing else was changed"


def test_the_plan_is_loaded_with_what_was_chosen_before() -> None:
    worker = FakeWorker()
    record = RecordPresenter(FakeRecorder(), bench(), worker, "me")  # type: ignore[arg-type]
    record.dispatch(Settings(count_simulated=True))
    record.enter()
    (call,) = worker.calls
    assert call.arguments == (LoadPlan(FOLDER, counts_simulated=True),)
