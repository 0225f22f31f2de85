"""A run from its end to the next one, as a value: awaited, shown, decided about, shown again."""

from collections.abc import Callable

import pytest
from stage import RUN, analysed, bench, ended, health, rows_between

from app.acquisition.messages import EndReason, LiveResult, LiveValue, PullbackState, StateChanged
from app.presenters.base import Chip, Progress, Tone
from app.presenters.record.ended_run import EndedRun
from app.presenters.record.guidance import ScreenStage
from app.presenters.record.live_display import LiveDisplay
from app.presenters.record.live_traces import LiveTraces
from app.presenters.record.next_runs import NextRuns
from app.presenters.record.pullback_session import PullbackSession
from app.presenters.record.reducer import EngineEventReducer, guidance_input, shown_plate_range
from app.presenters.record.run_decisions import RunDecisions
from app.presenters.record.state import LiveEstimate
from app.presenters.record.status_bar import StatusBarPresenter
from app.presenters.record.tasks import KeepRun, MoveToTrash, RecordTask, SavePlan
from messages.i18n import gettext

PULLBACK_M = 0.012


class Parts:
    """The parts of Record without their presenter."""

    def __init__(self) -> None:
        self.asked: list[RecordTask] = []
        self.bench = bench()
        self.course = PullbackSession()
        self.display = LiveDisplay(LiveTraces())
        self.heading = StatusBarPresenter(self.bench.gauges, self.bench.today, self.bench.clock)
        self.desk = NextRuns(
            self.bench.all_series, self.bench.directory, self.asked.append, lambda _choices, _plan: None
        )
        self.verdicts = RunDecisions(self.asked.append, "me")
        self.run = EndedRun(self.course, self.desk, self.verdicts, self.display)
        self.engine = EngineEventReducer(self.course, self.heading, self.display, self.run)

    def come_to(self, state: PullbackState) -> None:
        self.engine.on_event(StateChanged(state, 0.0))

    def decided(self) -> list[RecordTask]:
        return [task for task in self.asked if not isinstance(task, SavePlan)]


@pytest.fixture
def parts() -> Parts:
    """A run has ended, and the engine rests."""
    made = Parts()
    made.engine.start_over(PullbackState.CONNECTING, "COM7", PULLBACK_M)
    made.come_to(PullbackState.TAIL)
    made.engine.on_event(ended())
    made.come_to(PullbackState.IDLE)
    return made


def test_only_the_run_that_is_awaited_is_shown(parts: Parts) -> None:
    assert parts.run.progress == Progress("Identifying")
    parts.run.identifying("/elsewhere.h5", Progress("Fitting", 0.5))
    parts.run.identified(analysed("/elsewhere.h5"))
    assert (parts.run.result, parts.run.progress) == (None, Progress("Identifying"))
    parts.run.identified(analysed())
    assert parts.run.result is not None
    assert parts.run.progress is None
    assert parts.course.after_run is ScreenStage.DONE


def test_leaving_keeps_a_run_and_undo_shows_it_as_it_was(parts: Parts) -> None:
    parts.run.identified(analysed())
    result, traces = parts.run.result, parts.display.traces
    parts.run.close()
    assert parts.decided() == [KeepRun(RUN, "me", None, has_results=True)]
    assert parts.run.result is None
    assert parts.course.after_run is None
    parts.display.append(rows_between(0.0, 1.0), PULLBACK_M, None)
    assert parts.display.traces is not traces
    parts.run.undo()
    assert parts.run.result == result
    assert parts.display.traces is traces
    assert parts.course.after_run is ScreenStage.DONE


def test_a_run_passed_by_is_kept_once_it_is_identified(parts: Parts) -> None:
    parts.run.close()
    assert parts.decided() == []
    parts.run.identified(analysed())
    assert parts.decided() == [KeepRun(RUN, "me", None, has_results=True)]
    assert parts.run.result is None


def test_a_run_put_aside_stays_in_sight_until_it_is_left(parts: Parts) -> None:
    parts.run.identified(analysed())
    parts.run.move_to_trash()
    assert parts.run.result is not None
    parts.run.close()
    assert parts.decided() == [MoveToTrash(RUN, "me", None)]
    assert parts.run.result is None


def test_a_run_without_a_file_is_shown_at_once(parts: Parts) -> None:
    parts.run.close()
    parts.engine.on_event(ended("", EndReason.DISK_FULL, "the disk is full"))
    assert parts.run.result is not None
    assert parts.run.result.warnings == ("The disk is full",)
    assert parts.run.progress is None


def test_a_recording_that_begins_leaves_the_run_before(parts: Parts) -> None:
    parts.run.identified(analysed())
    parts.come_to(PullbackState.ZERO)
    assert parts.run.result is None
    assert parts.decided() == [KeepRun(RUN, "me", None, has_results=True)]


def test_what_was_running_is_of_one_pull_alone(parts: Parts) -> None:
    parts.come_to(PullbackState.SLIPPING)
    parts.engine.on_event(LiveResult(6.0, period=LiveValue(0.31994, 3.1e-4, "s")))
    parts.come_to(PullbackState.TAIL)
    assert parts.course.live_estimate.rows
    parts.come_to(PullbackState.PULLING)
    assert parts.course.live_estimate == LiveEstimate()


def test_another_connection_takes_no_result_away(parts: Parts) -> None:
    parts.run.identified(analysed())
    parts.engine.start_over(None, "", PULLBACK_M)
    assert parts.run.result is not None
    parts.run.close()
    parts.engine.start_over(PullbackState.CONNECTING, "COM8", PULLBACK_M)
    assert parts.run.result is None
    assert parts.heading.status_bar.device.text == "COM8"


def test_health_changes_the_header_alone(parts: Parts) -> None:
    before = parts.course.engine, parts.course.after_run
    parts.engine.on_event(health())
    assert parts.heading.status_bar.rate == "1000.02\u202fHz"
    assert (parts.course.engine, parts.course.after_run) == before


def test_readings_are_read_ten_times_a_second_and_counted_from_the_tare() -> None:
    display = LiveDisplay(LiveTraces())
    assert display.append(rows_between(0.0, 1.5), PULLBACK_M, None)
    assert not display.append(rows_between(1.5, 1.55), PULLBACK_M, None)
    assert display.readings.origin == "by the calibration"
    assert float(display.readings.table) == pytest.approx(0.2, abs=0.011)
    display.tare()
    assert display.readings.origin == "from the tare"
    assert abs(float(display.readings.table.replace("−", "-"))) < 0.011
    display.start_over()
    assert display.readings.table == "–"


def test_a_stand_that_moves_is_not_tared_which_is_said_in_the_language_of_the_window(
    use_language: Callable[[str], None],
) -> None:
    use_language("ru")
    display = LiveDisplay(LiveTraces())
    display.append(rows_between(2.0, 4.0), PULLBACK_M, None)
    assert display.tare() == Chip(gettext("The stand moves: tare when it is at rest"), Tone.WARN)
    assert display.tare().text != "The stand moves: tare when it is at rest"


def test_the_situation_gathers_what_gauges_and_engine_say() -> None:
    parts = Parts()
    parts.engine.start_over(PullbackState.CONNECTING, "COM7", PULLBACK_M)
    assert guidance_input(parts.course, parts.bench, parts.display.live, "1FFM0").stage is (
        PullbackState.CONNECTING
    )
    parts.come_to(PullbackState.RECENTRE)
    parts.display.append(rows_between(8.0, 9.0), PULLBACK_M, None)
    situation = guidance_input(parts.course, parts.bench, parts.display.live, "1FFM0")
    assert situation.stage is PullbackState.RECENTRE
    assert situation.plate_m == pytest.approx(-0.010, abs=1e-4)
    assert (
        shown_plate_range(parts.course, parts.bench, "1FFM0")
        == parts.bench.allowed_plate_range("1FFM0")
        is not None
    )
    parts.come_to(PullbackState.ZERO)
    assert shown_plate_range(parts.course, parts.bench, "1FFM0") is None
