"""The Identify presenter: curves, laws side by side, cursors, manual fit, and incomplete runs."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from stage import Call, FakeWorker, analysed

from analysis.classical_estimates import ClassicalEstimates
from analysis.identification import Events
from analysis.quantities import ResultWarning
from app.presenters.analysed_run import AnalysisTask, Channel, Objective
from app.presenters.base import Progress, Tone
from app.presenters.identify.plot_data import measured_lines
from app.presenters.identify.presenter import IdentifyPresenter
from app.presenters.identify.report import ReportPresenter
from app.presenters.identify.result_tables import classical_rows
from app.presenters.identify.state import Cursor, ManualFit, PlotLine, Span
from messages.message import message

RUN = str(analysed().path)
LINE = PlotLine(np.array([0.0, 1.0]), np.array([12.0, 10.0]))
FIT = ManualFit(0.101, (LINE,), (LINE,))
CLASSICAL = ClassicalEstimates(0.3201, 0.0391, 0.0004, 20, np.empty(0), (0.09, 0.1002, 0.14), 0.101)


class Stage:
    """Presenter and fake worker."""

    def __init__(self) -> None:
        self.worker = FakeWorker()
        self.presenter = IdentifyPresenter(self.worker, ReportPresenter(FakeWorker()))  # type: ignore[arg-type]
        self.presenter.on_opening(RUN)

    def show(self, **changes: Any) -> None:
        self.presenter.on_analysed(analysed(**changes))

    def asked(self, name: str) -> list[Call]:
        return [call for call in self.worker.calls if call.name == name]


def with_scan() -> dict[str, Any]:
    friction = np.linspace(0.096, 0.104, 81)
    residual_m = 2e-5 * np.sqrt(1.0 + ((friction - 0.1003) / 0.0006) ** 2)
    return {"objective": Objective(friction, residual_m, 0.1003, (0.0990, 0.1016))}


@pytest.fixture
def stage() -> Stage:
    return Stage()


def test_curves_begin_at_release_with_slip_marked_and_residual_in_micrometres(stage: Stage) -> None:
    run = analysed()
    stage.presenter.on_analysed(run)
    curves = stage.presenter.state.curves
    assert curves is not None
    assert curves.time_s[0] == pytest.approx(-4.0)
    assert curves.slips == (pytest.approx((0.0, 2.5)),)
    assert curves.noise == pytest.approx(20.0)
    table, relative = curves.channels
    assert relative.residual is not None
    assert np.std(relative.residual) == pytest.approx(20.0, rel=0.05)
    np.testing.assert_allclose(table.record, 1e3 * run.table.record_m)


def test_readings_that_are_no_length_keep_their_unit(stage: Stage) -> None:
    run = replace(analysed(), unit="V", relative=None)
    stage.presenter.on_analysed(run)
    curves = stage.presenter.state.curves
    assert curves is not None
    record, residual = measured_lines(curves)
    assert (record.unit, residual.unit) == ("V", "V")
    np.testing.assert_array_equal(record.values, run.table.record_m)
    np.testing.assert_array_equal(residual.values, run.table.residual_m)
    largest = np.nanmax(np.abs(run.table.record_m))
    assert 10.0**-record.decimals <= 1e-3 * largest


def test_slips_are_those_of_the_fitted_motion_where_there_is_one(stage: Stage) -> None:
    stage.show(slips=((5.0, 5.1), (5.2, 5.3)))
    assert stage.presenter.state.curves is not None
    expected = (pytest.approx((0.0, 0.1)), pytest.approx((0.2, 0.3)))
    assert stage.presenter.state.curves.slips == expected


def test_slip_to_the_end_is_marked_to_the_end_and_none_where_nothing_slips(stage: Stage) -> None:
    stage.show(events=Events(5.0, None, None))
    assert stage.presenter.state.curves is not None
    assert stage.presenter.state.curves.slips == (pytest.approx((0.0, 9.999)),)
    stage.show(results={})
    assert stage.presenter.state.curves.slips == ()


def test_a_record_without_release_is_drawn_from_its_start(stage: Stage) -> None:
    stage.show(events=Events(), model=None, relative=None)
    curves = stage.presenter.state.curves
    assert curves is not None
    assert (curves.time_s[0], curves.slips, curves.noise, len(curves.channels)) == (0.0, (), None, 1)


def test_laws_stand_by_likelihood_each_with_its_verdict(stage: Stage) -> None:
    stage.show()
    rows = stage.presenter.state.models
    assert [(row.name, row.ratio, row.status.text, row.is_shown) for row in rows] == [
        ("coulomb+tilt", "1.05", "fits", True),
        ("coulomb", "2.05", "ruled out", False),
    ]


def test_a_click_shows_another_law_beside_the_same_rows_and_back(stage: Stage) -> None:
    stage.show(**with_scan())
    stage.presenter.select_model("coulomb")
    (asked,) = stage.asked("run_analysis")
    assert asked.arguments == (AnalysisTask(RUN, "coulomb"),)
    assert stage.presenter.state.progress == Progress("Fitting coulomb")
    model = analysed().model
    assert model is not None
    plain = replace(model, name="coulomb", adequate=False, tried=model.tried[:1])
    asked.done(analysed(model=plain, **with_scan()))
    state = stage.presenter.state
    assert [(row.name, row.is_shown) for row in state.models] == [("coulomb+tilt", False), ("coulomb", True)]
    assert state.model_note.text == "Shown: coulomb. The likeliest law is coulomb+tilt."
    assert state.result is not None
    assert state.result.model_status.tone is Tone.BAD
    stage.presenter.set_friction(0.1)
    assert stage.asked("simulate_friction")[-1].arguments[0].model == "coulomb"
    stage.presenter.select_model("coulomb+tilt")
    assert stage.presenter.state.model_note.text == ""
    assert len(stage.asked("run_analysis")) == 1


def test_a_law_that_cannot_be_fitted_leaves_the_screen_and_says_why(stage: Stage) -> None:
    stage.show()
    stage.presenter.select_model("coulomb")
    stage.asked("run_analysis")[0].fail("it cannot be. Choose another")
    state = stage.presenter.state
    assert state.curves is not None
    assert (state.progress, state.failure) == (None, "")
    assert state.model_note.text == "coulomb: it cannot be. Choose another"


def test_what_fails_as_two_masses_is_offered_as_one(stage: Stage) -> None:
    stage.presenter.on_failed(RUN, "no second mass")
    assert stage.presenter.state.alternative_kind == "one-mass"
    stage.presenter.analyse_as_alternative()
    (asked,) = stage.asked("run_analysis")
    assert asked.arguments == (AnalysisTask(RUN, kind="one-mass"),)
    asked.done(analysed(kind="one-mass", relative=None))
    state = stage.presenter.state
    assert (state.alternative_kind, state.models, state.failure) == ("two-mass", (), "")
    assert state.result is not None
    assert state.result.headline.symbol == "T"
    assert "One mass swings freely" in state.no_scan_reason
    assert stage.asked("estimate_classical") == []


def test_classical_figures_stand_beside_the_fitted_ones(stage: Stage) -> None:
    stage.show(**with_scan())
    (asked,) = stage.asked("estimate_classical")
    asked.done(classical_rows(analysed().results, CLASSICAL))
    rows = stage.presenter.state.classical
    assert [(row.name, row.classical, row.fitted) for row in rows] == [
        ("period", "320.100\u202fms", "319.942\u202fms"),
        ("damping", "0.1221\u00a01/s", "0.1203\u00a01/s"),
        ("by the paper's method", "0.101", "0.100"),
        ("from u<sub>s</sub> alone", "0.0900, 0.1002, 0.1400", "0.1003"),
    ]


def test_what_a_record_lacks_is_said(stage: Stage) -> None:
    run = analysed()
    broken = run.table.record_m.copy()
    broken[:700] = np.nan
    stage.show(table=Channel(broken), relative=None, model=None, results={})
    state = stage.presenter.state
    assert state.missing_data.text == "5.0\u202f% of the readings are missing: the curves are broken there."
    assert state.curves is not None
    assert state.curves.no_relative_reason == "this run has no second gauge"
    assert stage.presenter.state.no_scan_reason.startswith("Nothing slipped")


def test_the_hand_is_simulated_as_finely_as_it_is_drawn_and_anew_when_zoomed(stage: Stage) -> None:
    stage.show(**with_scan())
    stage.presenter.set_visible_span(-1.0, 2.0, 400)
    stage.presenter.set_friction(0.101)
    (asked,) = stage.asked("simulate_friction")
    assert asked.arguments == (AnalysisTask(RUN), 0.101, Span(-1.0, 2.0, 400, 5.0))
    asked.done(FIT)
    assert stage.presenter.state.manual_fit is FIT
    text = stage.presenter.state.manual_fit_text
    assert text.startswith("By hand: 0.10100, +0.70\u202f% from the fit; residual 31")
    stage.presenter.set_visible_span(0.0, 1.0, 400)
    assert [call.arguments[2].start_s for call in stage.asked("simulate_friction")] == [-1.0, 0.0]


def test_answers_are_looked_for_as_long_as_one_is_awaited(stage: Stage) -> None:
    stage.show(**with_scan())
    assert stage.presenter.poll() is False
    stage.presenter.set_friction(0.101)
    assert stage.presenter.poll() is True
    stage.asked("simulate_friction")[0].fail("no")
    assert stage.presenter.poll() is False


def test_an_answer_for_another_run_is_not_shown(stage: Stage) -> None:
    stage.show(**with_scan())
    stage.presenter.set_friction(0.101)
    (asked,) = stage.asked("simulate_friction")
    stage.presenter.on_opening("/recordings/b.h5")
    asked.done(FIT)
    assert stage.presenter.state.manual_fit is None


def test_cursors_read_both_gauges_and_count_periods(stage: Stage) -> None:
    stage.show()
    stage.presenter.toggle_cursors()
    stage.presenter.move_cursor(Cursor.A, 0.0004)
    stage.presenter.move_cursor(Cursor.B, 3.2)
    cursors = stage.presenter.state.cursors
    assert cursors is not None
    run = analysed()
    assert run.relative is not None
    table_mm = run.table.record_m[[4000, 7200]] * 1e3
    assert [row[1] for row in cursors.cells] == ["0.0000\u202fs", "3.2000\u202fs", "3.2000\u202fs"]
    assert cursors.cells[0][2] == f"{table_mm[0]:.3f}\u202fmm"
    assert cursors.cells[2][2] == f"{table_mm[1] - table_mm[0]:.3f}\u202fmm".replace("-", "\u2212")
    assert cursors.period == "10 periods of 320.00\u202fms each"
    stage.presenter.toggle_cursors()
    assert stage.presenter.state.cursors is None


def test_keys_move_the_cursor_that_was_chosen_by_readings_and_not_beyond_the_record(stage: Stage) -> None:
    stage.show()
    stage.presenter.toggle_cursors()
    stage.presenter.move_cursor(Cursor.A, 1.0)
    stage.presenter.move_cursor(Cursor.B, 1.45)
    stage.presenter.step_cursor(10)
    assert stage.presenter.state.cursors is not None
    assert stage.presenter.state.cursors.b_s == pytest.approx(1.46)
    assert stage.presenter.state.cursors.period == "1/(B \u2212 A) = 2.174\u202fHz"
    stage.presenter.activate_cursor(Cursor.A)
    stage.presenter.step_cursor(-100_000)
    assert (stage.presenter.state.cursors.a_s, stage.presenter.state.cursors.active) == (-4.0, Cursor.A)


def test_only_the_run_that_was_asked_for_is_shown(stage: Stage) -> None:
    presenter, other = stage.presenter, "/recordings/other.h5"
    presenter.on_progress(other, Progress("Fitting", 0.5))
    presenter.on_failed(other, "no")
    presenter.on_analysed(analysed(path=other))
    assert presenter.state.curves is None
    assert presenter.state.progress == Progress("Reading the run")
    presenter.on_failed(RUN, "it is no run. Choose another")
    assert presenter.state.failure == "it is no run. Choose another"
    assert presenter.state.progress is None


def test_opening_another_run_takes_the_old_one_away(stage: Stage) -> None:
    stage.show()
    stage.presenter.on_opening("/recordings/b.h5")
    assert stage.presenter.state.curves is None
    assert stage.presenter.state.title == "b.h5"


def test_cancelling_is_possible_only_while_something_goes_on(stage: Stage) -> None:
    stage.presenter.cancel()
    stage.show()
    stage.presenter.cancel()
    assert stage.worker.cancelled == 1


def test_a_caution_of_the_analysis_reaches_the_screen(stage: Stage) -> None:
    stage.show(warnings=(ResultWarning("tilt-not-identified", message("tilt and f_d act alike.")),))
    assert stage.presenter.state.result is not None
    assert stage.presenter.state.result.warnings == ("Tilt and f_d act alike. Level the plane.",)
