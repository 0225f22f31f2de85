"""The Record presenter: what it shows and allows, from connecting to the result."""

from dataclasses import replace

import numpy as np
import pytest
from stage import (
    END_S,
    RELEASED_S,
    RUN,
    STATES,
    FakeRecorder,
    FakeWorker,
    RecordingView,
    analysed,
    bench,
    ended,
    health,
    rows_between,
    standing,
)

from app.acquisition.messages import Connected, EndReason, PullbackState, RunStarted, StateChanged
from app.presenters.base import EMPTY_CHIP, Chip, Progress, SimulationStarted, Tone
from app.presenters.device_status import DeviceStatus
from app.presenters.record.presenter import RecordPresenter
from app.presenters.record.state import (
    Action,
    AnalysisFailed,
    AnalysisProgress,
    Connecting,
    Notification,
    RunForm,
    SeriesChosen,
    StepStatus,
)
from app.runs.metadata import Conditions
from drivers.samples import SampleStatus


@pytest.fixture
def recorder() -> FakeRecorder:
    return FakeRecorder()


def make(recorder: FakeRecorder) -> RecordPresenter:
    return RecordPresenter(recorder, bench(), FakeWorker(), "me")  # type: ignore[arg-type]


@pytest.fixture
def presenter(recorder: FakeRecorder) -> RecordPresenter:
    """Connected and at rest, with two seconds of samples."""
    made = make(recorder)
    made.dispatch(Connecting("/dev/ttyUSB0"))
    made.dispatch(Connected("GSV-8", "1.2", 1000.0, "/ring"))
    came_to(made, PullbackState.IDLE, 0.0)
    return made


def came_to(presenter: RecordPresenter, state: PullbackState, since_s: float) -> None:
    presenter.dispatch(StateChanged(state, since_s, "", standing(state)))


def feed(presenter: RecordPresenter, recorder: FakeRecorder, start_s: float, end_s: float) -> None:
    recorder.rows = rows_between(start_s, end_s)
    presenter.tick()


def run_until(presenter: RecordPresenter, recorder: FakeRecorder, state: PullbackState, end_s: float) -> None:
    """Arm, and play the made-up pullback until `state` has been reached and drawn at `end_s`."""
    presenter.dispatch(Action.ARM)
    played_s = 0.0
    for since_s, reached in STATES:
        feed(presenter, recorder, played_s, since_s)
        came_to(presenter, reached, since_s)
        played_s = since_s
        if reached is state:
            break
    feed(presenter, recorder, played_s, end_s)


def test_without_a_device_nothing_can_be_done(recorder: FakeRecorder) -> None:
    presenter = make(recorder)
    presenter.dispatch(Action.ARM)
    presenter.dispatch(Action.STOP)
    presenter.dispatch(Action.NEXT)
    assert recorder.armed == []
    assert presenter.state.allowed == frozenset()
    assert presenter.state.guidance.instruction == "Connect an amplifier"


def test_at_rest_arming_comes_next(presenter: RecordPresenter) -> None:
    assert presenter.state.allowed == {Action.ARM, Action.TARE}
    assert presenter.state.primary is Action.ARM
    assert presenter.state.guidance.instruction == "Arm when the stand is at rest"


def test_arming_hands_over_what_the_operator_chose(
    presenter: RecordPresenter, recorder: FakeRecorder
) -> None:
    presenter.dispatch(SeriesChosen("2SSM1"))
    presenter.dispatch(RunForm(operator="N. N.", note="third plate", temperature_c="21,5", run_in_number="7"))
    presenter.dispatch(Action.ARM)
    (run,) = recorder.armed
    assert (run.series, run.operator, run.note) == ("2SSM1", "N. N.", "third plate")
    assert run.directory == str(bench().directory)
    assert run.trigger == "pullback"
    assert run.conditions == Conditions(temperature_c=21.5, run_in_number=7)
    assert recorder.counts == [1]


def test_a_key_pressed_twice_arms_once(presenter: RecordPresenter, recorder: FakeRecorder) -> None:
    presenter.dispatch(Action.ARM)
    presenter.dispatch(Action.ARM)
    assert len(recorder.armed) == 1
    assert presenter.state.allowed == frozenset()


def test_series_operator_and_note_rest_while_a_run_is_recorded(
    presenter: RecordPresenter, recorder: FakeRecorder
) -> None:
    run_until(presenter, recorder, PullbackState.ZERO, 1.0)
    assert not presenter.state.choices.editable
    presenter.dispatch(SeriesChosen("3SSM3"))
    assert presenter.state.choices.series == "1FFM0"


@pytest.mark.parametrize(
    ("state", "end_s", "instruction", "step"),
    [
        (PullbackState.ZERO, 1.0, "Leave the stand alone", "Zero"),
        (PullbackState.PULLING, 3.0, "Pull the table back to 12.0\u202fmm", "Pull"),
        (PullbackState.HELD, 4.2, "Hold the table still", "Hold"),
        (PullbackState.ARMED, 4.5, "Let go", "Armed"),
        (PullbackState.RELEASED, RELEASED_S, "Hands off", "Slip"),
        (PullbackState.SLIPPING, 6.0, "Hands off", "Slip"),
        (PullbackState.TAIL, 8.0, "Hands off", "Tail"),
        (PullbackState.CLOSING, END_S, "Storing the run", "Store"),
    ],
)
def test_each_state_says_what_to_do_and_where_we_are(
    presenter: RecordPresenter,
    recorder: FakeRecorder,
    state: PullbackState,
    end_s: float,
    instruction: str,
    step: str,
) -> None:
    run_until(presenter, recorder, state, end_s)
    assert presenter.state.guidance.instruction == instruction
    (now,) = [s.name for s in presenter.state.guidance.steps if s.status is StepStatus.NOW]
    assert now == step
    recording = state is not PullbackState.CLOSING
    assert presenter.state.allowed == ({Action.STOP} if recording else frozenset())


def test_the_target_bar_follows_the_table_from_its_zero(
    presenter: RecordPresenter, recorder: FakeRecorder
) -> None:
    run_until(presenter, recorder, PullbackState.PULLING, 3.0)
    target = presenter.state.guidance.target
    assert target is not None
    assert target.target_mm == 12.0
    # Half pulled at 3 s, minus the mean of the last 50 ms of a pull of 6 mm/s; the zero of 0.2 mm is out.
    assert target.now_mm == pytest.approx(6.0 - 0.15, abs=0.01)
    assert not target.is_reached
    assert presenter.state.guidance.detail == "Now 5.8\u202fmm"
    assert presenter.state.readings.table == "5.85"


def test_the_target_is_reached_within_two_percent(presenter: RecordPresenter, recorder: FakeRecorder) -> None:
    run_until(presenter, recorder, PullbackState.HELD, 4.5)
    target = presenter.state.guidance.target
    assert target is not None
    assert target.is_reached


def test_before_release_the_last_ten_seconds_roll_by(
    presenter: RecordPresenter, recorder: FakeRecorder
) -> None:
    run_until(presenter, recorder, PullbackState.PULLING, 3.0)
    traces = presenter.state.traces
    assert traces.span == (-10.0, 0.0)
    assert traces.table.time_s[-1] == pytest.approx(-0.0, abs=0.002)
    assert traces.table.value[-1] == pytest.approx(6.0, abs=0.1)
    assert traces.marks.target_mm == pytest.approx((11.76, 12.24))
    assert traces.marks.release_s is None


def test_after_release_the_axis_begins_there_and_slip_is_shaded(
    presenter: RecordPresenter, recorder: FakeRecorder
) -> None:
    run_until(presenter, recorder, PullbackState.TAIL, 10.0)
    traces = presenter.state.traces
    assert traces.span == (-1.0, 8.0)
    assert traces.marks.release_s == 0.0
    assert traces.marks.before_release == (-1.0, 0.0)
    assert traces.marks.slip == pytest.approx((0.0, 2.5))
    assert traces.relative.value[-1] == pytest.approx(-10.0, abs=0.1)
    assert traces.table.time_s[0] == pytest.approx(-1.0, abs=0.01)


def test_a_slip_that_goes_on_is_shaded_until_now(presenter: RecordPresenter, recorder: FakeRecorder) -> None:
    run_until(presenter, recorder, PullbackState.SLIPPING, 6.0)
    slip = presenter.state.traces.marks.slip
    assert slip == pytest.approx((0.0, 1.0), abs=0.01)


def test_the_vertical_axes_hold_everything_that_is_drawn(
    presenter: RecordPresenter, recorder: FakeRecorder
) -> None:
    run_until(presenter, recorder, PullbackState.TAIL, 12.0)
    traces = presenter.state.traces
    assert np.abs(traces.table.value).max() < traces.table_limit_mm
    assert np.abs(traces.relative.value).max() < traces.relative_limit_mm
    assert traces.table_limit_mm > 16.5, "the range of gauge 1 is near enough to be in view"


def finish(presenter: RecordPresenter, recorder: FakeRecorder) -> None:
    run_until(presenter, recorder, PullbackState.CLOSING, END_S)
    presenter.dispatch(ended())
    came_to(presenter, PullbackState.IDLE, END_S)


def test_after_the_end_the_traces_stand_and_the_result_is_awaited(
    presenter: RecordPresenter, recorder: FakeRecorder
) -> None:
    finish(presenter, recorder)
    feed(presenter, recorder, END_S, END_S + 3.0)
    frozen = presenter.state.traces
    assert frozen.span == (-1.0, pytest.approx(END_S - RELEASED_S)), "to the end of the record"
    assert presenter.state.traces.table.time_s[-1] <= END_S - RELEASED_S
    feed(presenter, recorder, END_S + 3.0, END_S + 4.0)
    assert presenter.state.traces.span == frozen.span
    assert presenter.state.guidance.instruction == "Finding friction"
    assert presenter.state.progress is not None
    presenter.dispatch(AnalysisProgress(RUN, Progress("Fitting coulomb", 0.4)))
    assert presenter.state.progress == Progress("Fitting coulomb", 0.4)


def test_the_result_takes_the_column_and_next_leaves_it(
    presenter: RecordPresenter, recorder: FakeRecorder
) -> None:
    finish(presenter, recorder)
    presenter.dispatch(analysed())
    result = presenter.state.result
    assert result is not None
    assert (result.headline.value, result.headline.uncertainty_text) == ("0.10030", "± 0.00064")
    assert presenter.state.progress is None
    assert presenter.state.allowed == {Action.NEXT, Action.ARM, Action.REPEAT, Action.DISCARD}
    assert presenter.state.primary is Action.NEXT
    assert all(step.status is StepStatus.DONE for step in presenter.state.guidance.steps)
    presenter.dispatch(Action.NEXT)
    assert presenter.state.result is None
    assert presenter.state.primary is Action.ARM
    feed(presenter, recorder, END_S, END_S + 1.0)
    assert presenter.state.traces.span == (-10.0, 0.0)


def test_the_next_run_may_be_armed_straight_from_the_result(
    presenter: RecordPresenter, recorder: FakeRecorder
) -> None:
    finish(presenter, recorder)
    presenter.dispatch(analysed())
    presenter.dispatch(Action.ARM)
    assert len(recorder.armed) == 2
    assert presenter.state.result is None


def test_a_result_that_comes_after_next_is_not_shown(
    presenter: RecordPresenter, recorder: FakeRecorder
) -> None:
    finish(presenter, recorder)
    presenter.dispatch(Action.NEXT)
    presenter.dispatch(analysed())
    assert presenter.state.result is None
    assert presenter.state.primary is Action.ARM


def test_a_run_without_a_result_says_why_and_where_it_is(
    presenter: RecordPresenter, recorder: FakeRecorder
) -> None:
    run_until(presenter, recorder, PullbackState.ZERO, 1.5)
    presenter.dispatch(Action.STOP)
    assert recorder.stopped == 1
    presenter.dispatch(ended(reason=EndReason.STOPPED))
    presenter.dispatch(AnalysisFailed(RUN, "no release in 1 s of record. Pull and release while recording"))
    result = presenter.state.result
    assert result is not None
    assert result.headline.value == "No result"
    assert result.model_status.tone is Tone.BAD
    assert result.warnings == ("No release in 1 s of record. Pull and release while recording",)
    assert (result.end_status.text, result.path) == ("Stopped by the operator", RUN)


def test_a_lost_connection_takes_no_result_away(presenter: RecordPresenter, recorder: FakeRecorder) -> None:
    run_until(presenter, recorder, PullbackState.TAIL, 9.0)
    presenter.dispatch(ended(reason=EndReason.DEVICE_LOST))
    presenter.dispatch(Notification.DISCONNECTED)
    assert presenter.state.guidance.instruction == "Finding friction"
    presenter.dispatch(analysed(ended="device-lost"))
    assert presenter.state.result is not None
    assert presenter.state.result.end_status.tone is Tone.BAD
    assert presenter.state.allowed == {Action.NEXT, Action.DISCARD}
    presenter.dispatch(Action.NEXT)
    assert presenter.state.guidance.instruction == "Connect an amplifier"
    assert presenter.state.allowed == frozenset()


def test_the_header_tells_rate_losses_and_disk(presenter: RecordPresenter) -> None:
    presenter.dispatch(health(missing=3, missing_estimated=1, damaged=2, free_disk_bytes=160_000_000))
    presenter.dispatch(RunStarted(RUN))
    header = presenter.state.status_bar
    assert header.device == Chip("GSV-8")
    assert header.rate == "1000.02\u202fHz"
    assert (header.lost_samples.text, header.lost_samples.tone) == ("Lost 6", Tone.WARN)
    assert "3 missing" in header.lost_samples.hint
    assert (header.disk.text, header.disk.tone) == ("Disk nearly full: 0.2\u202fGB free", Tone.BAD)


@pytest.mark.parametrize(
    ("free_bytes", "text"),
    [
        (210_000_000_000, "Disk 210\u202fGB free, 833\u202fh"),
        (3_000_000_000, "Disk 3.0\u202fGB free, 12\u202fh"),
    ],
)
def test_the_disk_tells_how_long_it_lasts(presenter: RecordPresenter, free_bytes: int, text: str) -> None:
    presenter.dispatch(health(free_disk_bytes=free_bytes, bytes_per_s=70_000.0))
    assert presenter.state.status_bar.disk.text == text


def test_a_disk_whose_space_is_not_known_is_not_called_full(presenter: RecordPresenter) -> None:
    presenter.dispatch(health(free_disk_bytes=None, bytes_per_s=70_000.0))
    assert presenter.state.status_bar.disk == EMPTY_CHIP


def test_what_a_lost_device_sent_last_is_grey_and_dated(
    presenter: RecordPresenter, recorder: FakeRecorder
) -> None:
    presenter.dispatch(health())
    feed(presenter, recorder, 0.0, 2.0)
    live = presenter.state
    assert Action.TARE in live.allowed
    presenter.dispatch(DeviceStatus("GSV-8", "14:03:21"))
    bar = presenter.state.status_bar
    assert bar.stopped_at == "14:03:21"
    assert [chip.text for chip in bar.gauges] == ["Gauge 1 ok", "Gauge 2 ok"]
    assert {chip.tone for chip in (bar.lost_samples, *bar.gauges)} == {Tone.STALE}
    assert bar.disk.tone is Tone.OK, "it is read from the disk"
    assert presenter.state.readings == replace(live.readings, stopped_at="14:03:21")
    assert presenter.state.traces.time_title == "time from 14:03:21, s"
    assert Action.TARE not in presenter.state.allowed, "nothing is read any more"
    presenter.tick()
    assert presenter.state.status_bar == bar
    presenter.dispatch(DeviceStatus("GSV-8"))
    feed(presenter, recorder, 2.0, 3.0)
    assert presenter.state.status_bar.stopped_at == presenter.state.readings.stopped_at == ""
    assert {chip.tone for chip in presenter.state.status_bar.gauges} == {Tone.OK}
    assert presenter.state.traces.time_title == "time from now, s"


def test_a_simulated_device_is_named_in_the_header_until_another_is_connected(
    recorder: FakeRecorder,
) -> None:
    presenter = make(recorder)
    presenter.dispatch(Connecting("COM7"))
    presenter.dispatch(Connected("slipstand-fw", "simulated-1", 1000.0, "/ring", simulated=True))
    assert presenter.state.status_bar.simulated.text == "SIMULATED"
    presenter.dispatch(Notification.DISCONNECTED)
    assert presenter.state.status_bar.simulated.text == ""
    presenter.dispatch(Connecting("COM7"))
    presenter.dispatch(Connected("GSV-8", "1.45", 1000.0, "/ring"))
    assert presenter.state.status_bar.simulated.text == ""


def test_an_overload_is_said_while_it_lasts_and_a_second_longer(
    presenter: RecordPresenter, recorder: FakeRecorder
) -> None:
    recorder.rows = rows_between(0.0, 0.5, status=int(SampleStatus.OVERLOAD_RELATIVE))
    presenter.tick()
    assert [chip.text for chip in presenter.state.status_bar.gauges] == ["Gauge 1 ok", "Gauge 2 overload"]
    feed(presenter, recorder, 0.5, 1.0)
    assert presenter.state.status_bar.gauges[1].tone is Tone.BAD
    feed(presenter, recorder, 1.0, 2.0)
    assert presenter.state.status_bar.gauges[1].tone is Tone.OK


def test_a_plate_too_far_off_must_be_re_centred(presenter: RecordPresenter, recorder: FakeRecorder) -> None:
    rows = rows_between(8.0, 9.0)  # the plate rests 10 mm off: 33 mm of range minus 1.5 x 12 mm leave 15 mm
    recorder.rows = rows
    presenter.tick()
    assert presenter.state.guidance.instruction == "Arm when the stand is at rest"
    rows.relative_m[:] -= 0.006
    rows.time_s[:] += 1.0
    recorder.rows = rows
    presenter.tick()
    assert presenter.state.guidance.instruction == "Push the plate back by 16.0\u202fmm"
    assert presenter.state.guidance.tone is Tone.WARN
    assert "ntil gauge 2 reads 0.0\u202fmm; now −16.0\u202fmm" in presenter.state.guidance.detail
    assert Action.ARM in presenter.state.allowed, "the operator decides"


def test_the_simulated_stand_asks_for_nothing_and_knows_the_truth(
    presenter: RecordPresenter, recorder: FakeRecorder
) -> None:
    presenter.dispatch(SimulationStarted("3SSM0", 0.2))
    assert presenter.state.guidance.instruction == "Arm at any time"
    assert presenter.state.choices.series_fixed
    presenter.dispatch(SeriesChosen("1FFM0"))
    assert presenter.state.choices.series == "3SSM0"
    run_until(presenter, recorder, PullbackState.PULLING, 3.0)
    assert presenter.state.guidance.instruction == "The stand pulls back to 12.0\u202fmm"
    came_to(presenter, PullbackState.TAIL, 7.5)
    presenter.dispatch(ended())
    presenter.dispatch(analysed())
    assert presenter.state.result is not None
    assert presenter.state.result.comparison == "True value 0.20000: found −49.85\u202f%"


def test_the_truth_of_a_simulated_stand_is_not_held_against_a_real_one(
    presenter: RecordPresenter, recorder: FakeRecorder
) -> None:
    presenter.dispatch(SimulationStarted("1FFM0", 0.2))
    presenter.dispatch(Notification.DISCONNECTED)
    presenter.dispatch(Connecting("COM7"))
    came_to(presenter, PullbackState.IDLE, 0.0)
    assert presenter.state.guidance.instruction == "Arm when the stand is at rest"
    finish(presenter, recorder)
    presenter.dispatch(analysed())
    assert presenter.state.result is not None
    assert presenter.state.result.comparison == ""


def test_absent_samples_leave_a_dash_and_a_gap(presenter: RecordPresenter, recorder: FakeRecorder) -> None:
    rows = rows_between(0.0, 1.0)
    rows.table_m[:] = np.nan
    recorder.rows = rows
    presenter.tick()
    assert presenter.state.readings.table == "–"
    assert presenter.state.readings.relative != "–"
    assert presenter.state.traces.table.has_gaps


def test_a_new_connection_forgets_the_old_samples(presenter: RecordPresenter, recorder: FakeRecorder) -> None:
    feed(presenter, recorder, 8.0, 10.0)
    presenter.dispatch(Connecting("COM7"))
    assert presenter.state.status_bar.device.text == "COM7"
    assert len(presenter.state.traces.table.value) == 0
    feed(presenter, recorder, 0.0, 1.0)  # its time begins at 0 again
    assert len(presenter.state.traces.table.value) > 100


def test_what_is_being_started_is_said_until_the_engine_speaks(presenter: RecordPresenter) -> None:
    presenter.dispatch(Connecting("Simulated stand", "Starting the simulated stand"))
    assert presenter.state.guidance.detail == "Starting the simulated stand"
    came_to(presenter, PullbackState.CONNECTING, 0.0)
    assert presenter.state.guidance.instruction == "Waiting for samples"


def test_a_table_that_was_let_down_is_said_and_pulled_again(
    presenter: RecordPresenter, recorder: FakeRecorder
) -> None:
    run_until(presenter, recorder, PullbackState.SLIPPING, 6.0)
    assert presenter.state.traces.marks.release_s == 0.0
    presenter.dispatch(StateChanged(PullbackState.PULLING, 6.0, "The table was let down, not released"))
    feed(presenter, recorder, 6.0, 6.5)
    assert presenter.state.guidance.detail.endswith("mm. The table was let down, not released")
    assert presenter.state.guidance.tone is Tone.WARN
    assert presenter.state.traces.marks.release_s is None
    assert presenter.state.traces.marks.slip is None
    came_to(presenter, PullbackState.HELD, 7.0)
    assert presenter.state.guidance.tone is Tone.PLAIN


def test_a_run_of_which_nothing_was_kept_says_why(presenter: RecordPresenter, recorder: FakeRecorder) -> None:
    run_until(presenter, recorder, PullbackState.ZERO, 1.0)
    presenter.dispatch(ended("", EndReason.DISK_FULL, "the disk is full. Free some space"))
    result = presenter.state.result
    assert result is not None
    assert result.headline.value == "No result"
    assert result.warnings == ("The disk is full. Free some space",)


def test_a_view_sees_each_change_and_nothing_twice(recorder: FakeRecorder) -> None:
    presenter = make(recorder)
    view = RecordingView()
    presenter.attach(view)
    presenter.dispatch(RunForm(note="a"))
    presenter.dispatch(RunForm(note="a"))
    presenter.tick()
    assert len(view.states) == 2
    assert view.states[-1] is presenter.state


def test_a_state_that_is_told_again_marks_nothing_anew(
    presenter: RecordPresenter, recorder: FakeRecorder
) -> None:
    run_until(presenter, recorder, PullbackState.SLIPPING, 6.0)
    note = "the device was away and is back"
    presenter.dispatch(StateChanged(PullbackState.SLIPPING, 5.8, note, standing(PullbackState.SLIPPING)))
    feed(presenter, recorder, 6.0, 6.5)
    assert presenter.state.traces.marks.slip == pytest.approx((0.0, 1.5), abs=0.01)
    assert presenter.state.guidance.detail == "The device was away and is back"


def test_what_is_noted_at_rest_is_news_and_no_instruction(
    presenter: RecordPresenter, recorder: FakeRecorder
) -> None:
    note = "the device sends 704.62 samples a second instead of 2000"
    presenter.dispatch(StateChanged(PullbackState.IDLE, 1.0, note))
    state = presenter.state
    assert (state.guidance.instruction, state.guidance.detail, state.guidance.tone) == (
        "Arm when the stand is at rest",
        "Nothing is being recorded.",
        Tone.PLAIN,
    )
    assert state.status_message == Chip("The device sends 704.62 samples a second instead of 2000", Tone.WARN)
    feed(presenter, recorder, 0.0, 1.5)
    presenter.dispatch(Action.TARE)
    assert presenter.state.status_message.text.startswith("Tared by ")
    assert presenter.state.status_message.text.endswith(
        ". The device sends 704.62 samples a second instead of 2000"
    )
    presenter.dispatch(Action.ARM)
    presenter.dispatch(StateChanged(PullbackState.PULLING, 11.0, note, standing(PullbackState.PULLING)))
    assert presenter.state.guidance.tone is Tone.WARN
    assert presenter.state.guidance.detail.endswith("instead of 2000")
    assert "704.62" not in presenter.state.status_message.text
