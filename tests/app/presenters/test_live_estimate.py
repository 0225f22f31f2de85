"""Running values while a run is recorded."""

from stage import FakeRecorder, FakeWorker, bench

from analysis.quantities import Quantity
from app.acquisition.messages import LiveResult, PullbackState, StateChanged
from app.presenters.record.live import live_estimate
from app.presenters.record.presenter import RecordPresenter
from app.presenters.record.state import LiveEstimate

PERIOD = Quantity.normal(0.31994, 3.1e-4, "s")
DAMPING = Quantity.normal(0.121, 0.0042, "1/s")
FRICTION = Quantity.normal(0.1003, 0.0009, "1")
KNOWN = LiveResult(6.0, friction_dynamic=FRICTION, period=PERIOD, damping_n1=DAMPING, law="coulomb")


def test_rows_are_those_of_a_result_in_the_order_of_the_paper() -> None:
    rows = live_estimate(KNOWN).rows
    assert [row.symbol for row in rows] == ["T", "n<sub>1</sub>", "f<sub>d</sub>"]
    assert [row.value for row in rows] == ["319.94", "0.1210", "0.10030"]
    assert [row.uncertainty_text for row in rows] == ["± 0.31\u202fms", "± 0.0042\u00a01/s", "± 0.00090"]


def test_what_is_not_known_yet_is_not_shown() -> None:
    assert live_estimate(LiveResult(1.0)) == LiveEstimate()
    (row,) = live_estimate(LiveResult(2.0, period=PERIOD)).rows
    assert row.symbol == "T"


def test_friction_comes_from_the_plate_alone_before_the_joint_fit_gives_it() -> None:
    (row,) = live_estimate(LiveResult(2.0, friction_dynamic_plate=FRICTION)).rows
    assert row.name == "dynamic friction, from the plate alone"
    assert (row.value, row.uncertainty_text) == ("0.10030", "± 0.00090")


def test_a_first_guess_is_not_shown() -> None:
    guess = Quantity.normal(0.002, 0.046, "s")
    (row,) = live_estimate(LiveResult(2.0, period=guess, friction_dynamic=FRICTION)).rows
    assert row.symbol == "f<sub>d</sub>"


def test_when_to_stop_is_said_with_what_is_still_gained_by_waiting() -> None:
    def noted(*narrowing: str) -> str:
        return live_estimate(
            LiveResult(9.0, friction_dynamic=FRICTION, narrowing=narrowing, may_stop=True)
        ).note

    assert noted("damping_n1_per_s").endswith("you may stop; it still narrows n<sub>1</sub>")
    assert noted().endswith("you may stop")
    assert live_estimate(KNOWN).note == ""


def test_an_end_of_the_live_identification_is_said() -> None:
    assert live_estimate(LiveResult(3.0, message="it ended")) == LiveEstimate(note="It ended")


def test_the_next_run_begins_without_the_values_of_the_last() -> None:
    presenter = RecordPresenter(FakeRecorder(), bench(), FakeWorker(), "me")  # type: ignore[arg-type]
    presenter.dispatch(KNOWN)
    assert len(presenter.state.live_estimate.rows) == 3
    presenter.dispatch(StateChanged(PullbackState.TAIL, 7.0))
    assert len(presenter.state.live_estimate.rows) == 3
    presenter.dispatch(StateChanged(PullbackState.ZERO, 20.0))
    assert presenter.state.live_estimate == LiveEstimate()
