"""The Identify screen: record against simulation, or words for what is missing."""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from looking import clipped_words, visible_words
from pointing import Hand
from PySide6.QtCore import Qt
from PySide6.QtGui import QGuiApplication
from PySide6.QtWidgets import QApplication, QPushButton
from pytestqt.qtbot import QtBot
from stage import END_S, RELEASED_S, Call, FakeWorker, analysed

from analysis.catalogue import CATALOGUE
from analysis.identification import Degree, Events, FittedModel, ModelSelection
from analysis.plate.friction import estimate_plate_friction
from analysis.plate.trends import FrictionBySlip, friction_by_slip
from analysis.preparation.free_decay import prepare
from analysis.quantities import BudgetLine, BudgetSource, Quantity, ResultWarning
from analysis.synthetic import Truth, simulate_record
from app.presenters.analysed_run import AnalysedRun, Channel, Kinematics, Objective
from app.presenters.base import Progress
from app.presenters.identify.presenter import IdentifyPresenter
from app.presenters.identify.report import ReportPresenter
from app.presenters.identify.state import ClassicalRow, Cursor, ManualFit, PlotLine, PlotTab
from app.qt.identify.screen import IdentifyScreen
from app.qt.theme import Theme
from app.qt.widgets.plots import Plot, PlotStack
from app.qt.widgets.selectable_rows import SelectableRows
from app.qt.widgets.shortcuts import list_shortcuts
from messages.message import message

RUN = str(analysed().path)


@cache
def by_slip() -> FrictionBySlip:
    record = simulate_record(Truth(friction_static=0.12, tilt_rad=1e-3))
    plate = estimate_plate_friction(record, prepare(record))
    assert plate is not None
    return friction_by_slip(plate, 1.0)


class Stage:
    """Screen and presenter, shown; counts what was asked of it."""

    def __init__(self, theme: Theme, qtbot: QtBot) -> None:
        self.asked = 0
        self.exported: list[str] = []
        self.worker, self.reports = FakeWorker(), FakeWorker()
        self.presenter = IdentifyPresenter(self.worker, ReportPresenter(self.reports))  # type: ignore[arg-type]
        self.screen = IdentifyScreen(theme, self.presenter, self._ask, self.exported.append)
        qtbot.addWidget(self.screen)
        self.screen.resize(1188, 800)
        self.presenter.attach(self.screen)
        self.screen.show()
        qtbot.waitExposed(self.screen)
        self.curves = self.screen._plots.curves

    def calls(self, name: str) -> list[Call]:
        return [call for call in self.worker.calls if call.name == name]

    @property
    def frictions(self) -> list[float]:
        """Simulations that were asked for."""
        return [call.arguments[1] for call in self.calls("simulate_friction")]

    def _ask(self) -> None:
        self.asked += 1

    def button(self, text: str) -> QPushButton:
        (found,) = [b for b in self.screen.findChildren(QPushButton) if b.text() == text and b.isVisible()]
        return found

    def words(self) -> str:
        return visible_words(self.screen)


@pytest.fixture
def stage(theme: Theme, qtbot: QtBot) -> Stage:
    return Stage(theme, qtbot)


def test_an_empty_screen_says_how_to_fill_it(stage: Stage, qtbot: QtBot) -> None:
    assert "Record a pullback, or open a recording." in stage.words()
    qtbot.mouseClick(stage.button("Open a recording"), Qt.MouseButton.LeftButton)
    assert stage.asked == 1


def test_work_is_shown_and_can_be_given_up(stage: Stage, qtbot: QtBot) -> None:
    stage.presenter.on_opening(RUN)
    stage.presenter.on_progress(RUN, Progress("Fitting coulomb", 0.4))
    assert "Fitting coulomb" in stage.words()
    qtbot.mouseClick(stage.button("Cancel"), Qt.MouseButton.LeftButton)
    assert stage.worker.cancelled == 1


def test_a_failure_stands_in_words(stage: Stage) -> None:
    stage.presenter.on_opening(RUN)
    stage.presenter.on_failed(RUN, "it is a text file. Use slipstand import")
    assert "■ it is a text file. Use slipstand import" in stage.words()


def test_a_run_is_drawn_with_all_that_was_found(stage: Stage) -> None:
    stage.presenter.on_opening(RUN)
    stage.presenter.on_analysed(analysed(), true_friction=0.1)
    words = stage.words()
    for expected in (
        "20260112_1FFM0_001.h5",
        "✓ Model fits",
        "True value 0.10000: found +0.30\u202f%",
        "0.10030",
        "± 0.048\u202fms",
        "coulomb+tilt",
        "✓ fits",
        "ruled out",
        "▲ The tail does not decay exponentially.",
    ):
        assert expected in words
    curves = stage.presenter.state.curves
    assert curves is not None
    time_s, residual_um = stage.curves._residuals[1].samples()
    np.testing.assert_array_equal(time_s, curves.time_s)
    assert np.nanstd(residual_um) == pytest.approx(20.0, rel=0.05)
    assert stage.curves._slips[0].spans == (pytest.approx((0.0, 2.5)),)
    assert stage.curves._noise.getRegion() == pytest.approx((-40.0, 40.0))
    spans = [plot.view.viewRange()[0] for plot in stage.curves._stack.plots]
    assert spans[0] == spans[1] == spans[2] == pytest.approx([-1.0, 9.999])


def test_residuals_are_scaled_by_what_was_fitted_and_the_rest_is_hatched(stage: Stage) -> None:
    run = analysed()
    moved = run.time_s > END_S - 2.0
    table = Channel(np.where(moved, 0.0, run.table.record_m), run.table.fit_m)
    events = replace(run.events, free_decay_end_s=END_S - 2.0)
    stage.presenter.on_opening(RUN)
    stage.presenter.on_analysed(replace(run, table=table, events=events))
    view = stage.curves._stack.plots[2].view
    low, high = view.viewRange()[1]
    assert -150.0 < low < -60.0 < 60.0 < high < 150.0
    view.show_ranges({1: (-5000.0, 5000.0)})
    assert view.viewRange()[1][0] < -1000.0, "what is hatched can be looked at"
    assert stage.curves._unused[0].spans == (pytest.approx((END_S - 2.0 - RELEASED_S, math.inf)),)
    assert "hatched" in stage.curves._stack.plots[0].title.text


def test_friction_by_slip_has_a_tab_with_what_it_says_of_the_paper(stage: Stage) -> None:
    stage.presenter.on_opening(RUN)
    stage.presenter.on_analysed(analysed())
    place = list(PlotTab).index(PlotTab.FRICTION)
    assert not stage.screen._tabs.isTabEnabled(place)
    stage.presenter.on_analysed(analysed(friction_by_slip=by_slip()))
    stage.screen._tabs.setCurrentIndex(place)
    assert "this run agrees with the paper that fd does not depend on velocity" in stage.words()
    page = stage.screen._plots.slips
    assert page.isVisible()
    titles = [stack.plots[0].title.text for stack in page._stacks]
    assert [unit for unit, title in zip(("100 mm/s", "mm", "s"), titles, strict=True) if unit in title]
    assert all("zero within 95 %" in title for title in titles)
    stage.presenter.on_opening(RUN)
    stage.presenter.on_analysed(analysed())
    assert stage.presenter.state.tab is PlotTab.DISPLACEMENT


def test_zooming_one_plot_zooms_all(stage: Stage) -> None:
    stage.presenter.on_opening(RUN)
    stage.presenter.on_analysed(analysed())
    plots = stage.curves._stack.plots
    plots[2].view.setXRange(1.0, 2.0, padding=0.0)
    QApplication.processEvents()
    assert [plot.view.viewRange()[0] for plot in plots] == [[1.0, 2.0]] * 3


def test_a_run_without_fit_second_gauge_or_release_is_drawn_too(stage: Stage) -> None:
    alone = Channel(analysed().table.record_m)
    bare = analysed(model=None, table=alone, relative=None, events=Events(), results={}, labels={})
    stage.presenter.on_opening(RUN)
    stage.presenter.on_analysed(analysed())
    stage.presenter.on_opening(RUN)
    stage.presenter.on_analysed(bare)
    assert len(stage.curves._records[1].samples()[0]) == 0
    assert not stage.curves._noise.isVisible()
    assert [plot.view.isVisible() for plot in stage.curves._stack.plots] == [True, False, False]
    assert "this run has no second gauge" in stage.curves._stack.plots[1].title.text
    stage.presenter.on_analysed(analysed())
    assert [plot.view.isVisible() for plot in stage.curves._stack.plots] == [True, True, True]
    stage.presenter.on_analysed(bare)
    assert "No motion to fit" in stage.words()


def test_the_pointer_reads_record_and_simulation(stage: Stage) -> None:
    stage.presenter.on_opening(RUN)
    stage.presenter.on_analysed(analysed())
    stage.curves._show_values(1.0)
    texts = [plot.readout.text for plot in stage.curves._stack.plots]
    assert "1.000\u202fs" in texts[0]
    assert texts[0].count("|") == 1
    assert "µm" in texts[2]


def with_scan() -> AnalysedRun:
    """The made-up pullback with what a handle needs."""
    friction = np.linspace(0.096, 0.104, 81)
    residual_m = 2e-5 * np.sqrt(1.0 + ((friction - 0.1003) / 0.0006) ** 2)
    line = np.linspace(0.0, 1.0, 200)
    return analysed(
        objective=Objective(friction, residual_m, 0.1003, (0.0990, 0.1016)),
        kinematics=Kinematics(4.8 + 10.0 * line, *(np.sin(9.0 * k * line) for k in range(1, 7))),
        budget=(
            BudgetLine(BudgetSource.GAUGE_1_GAIN, "friction_dynamic", 3e-4),
            BudgetLine(BudgetSource.NOISE, "friction_dynamic", 6e-4),
            BudgetLine(BudgetSource.GAUGE_1_GAIN, "period_s", 1e-3),
            BudgetLine(BudgetSource.GAUGE_2_GAIN, "friction_dynamic", float("nan")),
        ),
    )


def answer(stage: Stage) -> None:
    """What the worker would say to the latest wish."""
    call, friction = stage.calls("simulate_friction")[-1], stage.frictions[-1]
    line = PlotLine(np.array([0.0, 1.0, 2.0]), np.full(3, 1e3 * friction))
    call.done(ManualFit(friction, (line, line), (line, line)))


def test_the_handle_asks_for_one_simulation_at_a_time_and_ends_at_the_newest(stage: Stage) -> None:
    stage.presenter.on_opening(RUN)
    stage.presenter.on_analysed(with_scan())
    for friction in (0.1010, 0.1012, 0.1014, 0.2):
        stage.screen._scan.friction_set.emit(friction)
    assert stage.frictions == [0.1010]
    answer(stage)
    assert stage.frictions == [0.1010, pytest.approx(0.104)]
    answer(stage)
    assert "By hand: 0.10400" in stage.words()
    time_s, simulated_mm = stage.curves._hand_simulations[0].getData()
    np.testing.assert_allclose(time_s, [0.0, 1.0, 2.0])
    np.testing.assert_allclose(simulated_mm, 104.0)
    assert not stage.curves._simulations[0].isVisible()


def test_residuals_by_hand_are_in_view_until_the_handle_goes_back(stage: Stage) -> None:
    stage.presenter.on_opening(RUN)
    stage.presenter.on_analysed(with_scan())
    residual = stage.curves._stack.plots[-1]
    of_fit = residual.view.viewRange()[1]
    stage.screen._scan.friction_set.emit(0.104)
    answer(stage)  # residuals of 104 µm
    by_hand = residual.view.viewRange()[1]
    assert of_fit[1] < 104.0 < by_hand[1]
    stage.screen._scan.friction_set.emit(0.1001)
    answer(stage)
    assert residual.view.viewRange()[1] == by_hand, "it does not jump under a drag"
    stage.screen._scan.reset_requested.emit()
    assert residual.view.viewRange()[1] == pytest.approx(of_fit)


def test_keys_move_the_handle_and_take_it_back(stage: Stage, qtbot: QtBot) -> None:
    stage.presenter.on_opening(RUN)
    stage.presenter.on_analysed(with_scan())
    scan = stage.screen._scan
    qtbot.keyClick(scan, Qt.Key.Key_Right)
    qtbot.keyClick(scan, Qt.Key.Key_Right, Qt.KeyboardModifier.ShiftModifier)
    answer(stage)
    answer(stage)
    assert scan._handle.value() == pytest.approx(0.1003 + 0.008 * 11 / 400)
    qtbot.keyClick(scan, Qt.Key.Key_Home)
    assert scan._handle.value() == pytest.approx(0.1003)
    assert stage.curves._simulations[0].isVisible()
    assert not stage.curves._hand_simulations[0].isVisible()


def test_other_sides_of_the_motion_are_a_tab_away(stage: Stage) -> None:
    stage.presenter.on_opening(RUN)
    stage.presenter.on_analysed(with_scan())
    assert "The other tabs" not in stage.words()
    stage.screen._tabs.setCurrentIndex(1)
    assert stage.presenter.state.tab is PlotTab.VELOCITY
    assert "velocities" in stage.screen._plots.motions[PlotTab.VELOCITY]._stack.plots[0].title.text
    stage.screen._tabs.setCurrentIndex(3)
    assert "relative acceleration" in stage.screen._plots.motions[PlotTab.RELATIVE]._stack.plots[0].title.text
    stage.screen._tabs.setCurrentIndex(4)
    assert stage.screen._plots.motions[PlotTab.PHASE].isVisible()
    stage.presenter.on_opening(RUN)
    stage.presenter.on_analysed(analysed())
    assert not stage.screen._tabs.isTabEnabled(1)
    assert "The other tabs need the fitted motion" in stage.words()
    assert stage.screen._plots.curves.isVisible()


def test_the_budget_stands_largest_first_and_says_what_is_not_stated(stage: Stage) -> None:
    stage.presenter.on_opening(RUN)
    stage.presenter.on_analysed(with_scan())
    rows = stage.presenter.state.budget
    assert [(row.source, row.share) for row in rows] == [
        ("noise", 1.0),
        ("gauge 1 gain", pytest.approx(0.5)),
        ("gauge 2 gain", 0.0),
    ]
    assert [row.value for row in rows] == ["0.00060", "0.00030", "not stated"]
    assert "not stated" in stage.words()


def test_the_budget_of_a_period_is_in_its_unit_to_the_digit_of_the_largest(stage: Stage) -> None:
    lines = (
        BudgetLine(BudgetSource.NOISE, "period_s", 6.7e-4),
        BudgetLine(BudgetSource.TIME_BASE, "period_s", 2.0e-6),
    )
    stage.presenter.on_opening(RUN)
    stage.presenter.on_analysed(analysed(budget=lines, kind="one-mass"))
    assert [row.value for row in stage.presenter.state.budget] == ["0.67\u202fms", "< 0.01\u202fms"]


@pytest.mark.parametrize("size", [(932, 640), (1188, 800), (1828, 1080)], ids=lambda size: f"{size[0]}")
def test_no_word_is_cut_off(stage: Stage, size: tuple[int, int]) -> None:
    stage.screen.resize(*size)
    for show in (
        lambda: stage.presenter.on_opening(RUN),
        lambda: stage.presenter.on_analysed(with_scan(), 0.1),
    ):
        show()
        QApplication.processEvents()
        assert clipped_words(stage.screen) == []


MARKS = {Degree.FRICTION: "▲", Degree.NONE: "■"}
EFFECTS = ("release-ramp", "second-mode", "stand-friction", "log-velocity")


def of_stand(degree: Degree = Degree.STAND) -> AnalysedRun:
    """A run of a stand with four effects, and all results that there are."""
    adequate = degree is Degree.STAND
    tried = (
        FittedModel("stribeck+tilt", 5e6, 6.2e-4, 0.11),
        FittedModel("coulomb+tilt", 10.0, 2.1e-5, 0.1003, EFFECTS),
    )
    warnings = (
        ResultWarning("release-ramp", message("the release took 11.006 ± 0.012 ms: use a sharper hook.")),
        ResultWarning("tilt-not-identified", message("the tilt is not identified.")),
    )
    model = ModelSelection("coulomb+tilt", adequate, 2.1e-5, 2e-5, tried, degree, EFFECTS, 0.0025)
    results = {row.name: Quantity.normal(-12.34567, 0.00123, "1") for row in CATALOGUE}
    shares = {source: 1e-3 / (1 + number) for number, source in enumerate(BudgetSource)}
    budget = tuple(BudgetLine(source, "friction_dynamic", share) for source, share in shares.items())
    return replace(with_scan(), model=model, results=results, warnings=warnings, budget=budget)


@pytest.mark.parametrize("language", ["en", "ru"])
@pytest.mark.parametrize("degree", list(Degree), ids=lambda degree: degree.value)
def test_no_word_of_a_stand_that_is_not_ideal_is_cut_off(
    stage: Stage, degree: Degree, language: str, use_language: Callable[[str], None]
) -> None:
    """Names of models and quantities once made the results wider than their column."""
    use_language(language)
    stage.presenter.on_opening(RUN)
    stage.presenter.on_analysed(of_stand(degree))
    found = ClassicalRow("f", "by the paper's method", "0.1000, 0.1288, 0.1300", "0.1000")
    stage.screen._results.show_classical((found,))
    for _ in range(3):  # the column first learns its height
        QApplication.processEvents()
    assert clipped_words(stage.screen) == []


@pytest.mark.parametrize("language", ["en", "ru"])
def test_every_tab_is_in_sight_in_the_usual_window(
    theme: Theme, qtbot: QtBot, language: str, use_language: Callable[[str], None]
) -> None:
    use_language(language)
    stage = Stage(theme, qtbot)
    stage.presenter.on_opening(RUN)
    stage.presenter.on_analysed(with_scan())
    QApplication.processEvents()
    tabs = stage.screen._tabs
    assert 0 < tabs.tabRect(tabs.count() - 1).right() <= tabs.width()


def test_a_stand_is_told_in_words_beside_its_law(stage: Stage, qtbot: QtBot) -> None:
    stage.presenter.on_opening(RUN)
    stage.presenter.on_analysed(of_stand())
    shown, other = stage.presenter.state.models
    assert (shown.law, shown.is_shown, other.effects) == ("coulomb+tilt", True, "")
    assert shown.effects.startswith("with a slow release, a second mode, ")
    words = stage.words()
    assert shown.effects in words
    assert "Model fits, with effects of the stand" in words
    assert "About the stand\n▲ The release took 11.006 ± 0.012 ms: use a sharper hook." in words
    assert "release-ramp" not in words
    qtbot.mouseClick(stage.button("stribeck+tilt"), Qt.MouseButton.LeftButton)
    assert stage.worker.calls[-1].arguments[0].model == "stribeck+tilt"


@pytest.mark.parametrize(
    ("degree", "status", "verdict"),
    [
        (
            Degree.FRICTION,
            "Model does not fit, but f_d holds",
            "(0.25 % of the swing is left), but f_d holds",
        ),
        (Degree.NONE, "Model does not fit", "(0.25 % of the swing is left): f_d cannot be told"),
    ],
)
def test_a_model_that_fails_says_how_far(stage: Stage, degree: Degree, status: str, verdict: str) -> None:
    stage.presenter.on_opening(RUN)
    stage.presenter.on_analysed(of_stand(degree))
    words = stage.words().replace("fd", "f_d")
    assert f"\n{MARKS[degree]} {status}\n" in words
    assert verdict in words


def test_an_ideal_stand_has_nothing_about_it(stage: Stage) -> None:
    stage.presenter.on_opening(RUN)
    stage.presenter.on_analysed(analysed())
    assert "Model fits" in stage.words()
    assert "About the stand" not in stage.words()
    assert "effects" not in stage.words()


def test_the_scan_of_a_model_that_fails_stays_readable(stage: Stage) -> None:
    """Its far ends once made the minimum a flat line."""
    scan = Objective(np.array([0.01, 0.1, 0.2]), np.array([0.15, 2e-4, 0.09]), 0.1, (0.08, 0.12))
    stage.presenter.on_opening(RUN)
    stage.presenter.on_analysed(analysed(objective=scan))
    (plot,) = stage.screen._scan._stack.plots
    assert plot.view.viewRange()[1][1] < 2500.0


def test_a_click_on_a_law_asks_for_its_curves(stage: Stage, qtbot: QtBot) -> None:
    stage.presenter.on_opening(RUN)
    stage.presenter.on_analysed(with_scan())
    qtbot.mouseClick(stage.button("coulomb"), Qt.MouseButton.LeftButton)
    assert "Fitting coulomb" in stage.words()


def test_classical_figures_come_in_beside_the_results(stage: Stage, qtbot: QtBot) -> None:
    stage.presenter.on_opening(RUN)
    stage.presenter.on_analysed(with_scan())
    assert "Classical figures" not in stage.words()
    (call,) = stage.calls("estimate_classical")
    call.done((ClassicalRow("f<sub>d</sub>", "by the paper's method", "0.101", "0.100"),))
    qtbot.waitUntil(lambda: "Classical figures" in stage.words())
    assert "by the paper's method" in stage.words()
    qtbot.waitUntil(lambda: clipped_words(stage.screen) == [])


def test_cursors_come_by_key_move_by_keys_and_are_read(stage: Stage, qtbot: QtBot) -> None:
    stage.presenter.on_opening(RUN)
    stage.presenter.on_analysed(with_scan())
    qtbot.keyClick(stage.screen, Qt.Key.Key_C)
    before = stage.presenter.state.cursors
    assert before is not None
    assert stage.screen._readings.isVisible()
    qtbot.keyClick(stage.curves, Qt.Key.Key_A)
    qtbot.keyClick(stage.curves, Qt.Key.Key_Right, Qt.KeyboardModifier.ShiftModifier)
    after = stage.presenter.state.cursors
    assert after is not None
    assert after.a_s == pytest.approx(before.a_s + 0.010)
    line = stage.curves.cursors._lines[after.active][2]
    assert line.value() == pytest.approx(after.a_s)
    line.setValue(2.0)
    line.sigDragged.emit(line)
    assert stage.presenter.state.cursors is not None
    assert stage.presenter.state.cursors.a_s == pytest.approx(2.0)
    qtbot.keyClick(stage.screen, Qt.Key.Key_C)
    assert not stage.screen._readings.isVisible()


def test_cursors_stand_at_the_same_times_on_every_tab_and_are_read_in_its_units(
    stage: Stage, qtbot: QtBot
) -> None:
    stage.presenter.on_opening(RUN)
    stage.presenter.on_analysed(with_scan())
    qtbot.keyClick(stage.screen, Qt.Key.Key_C)
    at_s = stage.presenter.state.cursors
    assert at_s is not None
    motions = stage.screen._plots.motions
    pages = (motions[PlotTab.VELOCITY], motions[PlotTab.ACCELERATION], motions[PlotTab.RELATIVE])
    for index, (page, unit) in enumerate(zip(pages, ("mm/s", "m/s²", "m/s²"), strict=True), start=1):
        stage.screen._tabs.setCurrentIndex(index)
        for line in page.cursors._lines[Cursor.B]:
            assert (line.isVisible(), line.value()) == (True, pytest.approx(at_s.b_s))
        assert f"\u202f{unit}" in stage.words()
    line = motions[PlotTab.RELATIVE].cursors._lines[Cursor.A][1]
    line.setValue(3.0)
    line.sigDragged.emit(line)
    qtbot.keyClick(stage.screen._plots, Qt.Key.Key_Left)
    cursors = stage.presenter.state.cursors
    assert cursors is not None
    assert cursors.a_s == pytest.approx(2.999)
    assert cursors.cells[0][1] in stage.screen._plots.focusProxy().accessibleDescription()
    stage.screen._tabs.setCurrentIndex(0)
    assert stage.curves.cursors._lines[Cursor.A][0].value() == pytest.approx(2.999)
    assert clipped_words(stage.screen) == []


def test_the_phase_plane_marks_both_moments_as_points(stage: Stage, qtbot: QtBot) -> None:
    stage.presenter.on_opening(RUN)
    stage.presenter.on_analysed(with_scan())
    stage.screen._tabs.setCurrentIndex(4)
    qtbot.keyClick(stage.screen, Qt.Key.Key_C)
    cursors = stage.presenter.state.cursors
    assert cursors is not None
    points = stage.screen._plots.motions[PlotTab.PHASE].cursors._points[Cursor.B]
    placed = [[float(values[0]) for values in point._mark.getData()] for point in points]
    assert [*placed[0], *placed[1]] == pytest.approx(list(cursors.values[1]))
    assert all(point._letter.isVisible() for point in points)
    stage.presenter.move_cursor(Cursor.B, -1.0)  # before the motion, which begins at -0.2 s
    assert not any(point._letter.isVisible() for point in points)
    qtbot.keyClick(stage.screen, Qt.Key.Key_C)
    assert not stage.screen._readings.isVisible()


def test_the_keys_of_the_cursors_are_told_once_for_all_tabs(stage: Stage) -> None:
    told = [key.key for key in list_shortcuts(stage.screen)]
    assert sorted(told) == sorted(["C", "Ctrl+E", "Ctrl+P", "← → A B", "← →", "+ − ← → ↑ ↓ Y Home"])
    assert stage.screen._cursors.toolTip().endswith("(C)")


def test_cursors_stay_at_their_moments_when_times_are_counted_from_elsewhere(stage: Stage) -> None:
    stage.presenter.on_opening(RUN)
    stage.presenter.on_analysed(with_scan())
    stage.presenter.toggle_cursors()
    before = stage.presenter.state.cursors
    stage.presenter.on_analysed(analysed(events=Events(), results={}))
    after = stage.presenter.state.cursors
    assert before is not None
    assert after is not None
    assert (after.a_s, after.b_s) == pytest.approx((before.a_s + 4.0, before.b_s + 4.0))


@pytest.mark.parametrize("side", PlotTab)
def test_in_a_small_window_nothing_is_cut_off_on_any_tab(stage: Stage, side: PlotTab) -> None:
    stage.screen.resize(932, 640)
    stage.presenter.on_opening(RUN)
    stage.presenter.on_analysed(replace(with_scan(), friction_by_slip=by_slip()))
    stage.presenter.toggle_cursors()
    stage.presenter.set_tab(side)
    QApplication.processEvents()
    assert clipped_words(stage.screen) == []
    stacks = [stack for stack in stage.screen.findChildren(PlotStack) if stack.isVisible()]
    assert [plot for stack in stacks for plot in stack.plots if _right_of(plot) > stack.width()] == []


def _right_of(plot: Plot) -> float:
    return float(plot.view.sceneBoundingRect().right())


def test_cursors_come_into_sight_where_a_tab_is_zoomed(stage: Stage, qtbot: QtBot) -> None:
    stage.presenter.on_opening(RUN)
    stage.presenter.on_analysed(with_scan())
    stage.screen._tabs.setCurrentIndex(1)
    stage.screen._plots.motions[PlotTab.VELOCITY]._stack.set_time_range(6.0, 8.0)
    qtbot.keyClick(stage.screen, Qt.Key.Key_C)
    cursors = stage.presenter.state.cursors
    assert cursors is not None
    assert (cursors.a_s, cursors.b_s) == pytest.approx((6.5, 7.0))


def test_what_was_found_can_be_scrolled_by_keys_and_has_a_name(stage: Stage, qtbot: QtBot) -> None:
    stage.screen.resize(932, 500)
    stage.presenter.on_opening(RUN)
    stage.presenter.on_analysed(with_scan())
    column = stage.screen._column
    assert column.accessibleName()
    assert column.focusPolicy() & Qt.FocusPolicy.TabFocus
    QApplication.processEvents()
    qtbot.keyClick(column, Qt.Key.Key_PageDown)
    assert column.verticalScrollBar().value() > 0


def test_a_run_without_slip_says_why_there_is_no_handle(stage: Stage) -> None:
    stage.presenter.on_opening(RUN)
    stage.presenter.on_analysed(analysed(results={}, model=None))
    assert "Nothing slipped" in stage.words()
    assert not stage.screen._scan.isVisible()


def plots_of(stage: Stage) -> PlotStack:
    QApplication.processEvents()
    return stage.curves._stack


def test_a_zoomed_part_stays_under_another_law_and_goes_with_another_run(stage: Stage) -> None:
    stage.presenter.on_opening(RUN)
    stage.presenter.on_analysed(with_scan())
    hand = Hand(plots_of(stage))
    hand.wheel(6, hand.place(0.5, 0.5))
    hand.wheel(2, hand.place(0.5, 0.5), Qt.KeyboardModifier.ControlModifier)
    zoomed = [plot.view.viewRange() for plot in stage.curves._stack.plots]
    stage.presenter.on_analysed(replace(with_scan(), budget=()))
    assert [plot.view.viewRange() for plot in stage.curves._stack.plots] == zoomed
    shorter = analysed(
        time_s=analysed().time_s[:9000],
        table=Channel(analysed().table.record_m[:9000]),
        relative=None,
        model=None,
    )
    stage.presenter.on_opening(RUN)
    stage.presenter.on_analysed(shorter)
    assert stage.curves.span() == (pytest.approx(-1.0), pytest.approx(4.999))


def test_one_cannot_go_beyond_the_ends_of_the_record(stage: Stage) -> None:
    stage.presenter.on_opening(RUN)
    stage.presenter.on_analysed(with_scan())
    hand = Hand(plots_of(stage))
    hand.wheel(-9, hand.place(0.5, 0.5))
    curves = stage.presenter.state.curves
    assert curves is not None
    assert stage.curves.span() == pytest.approx((curves.time_s[0], curves.time_s[-1]))
    hand.double_click(hand.place(0.5, 0.5))
    assert stage.curves.span() == pytest.approx((-1.0, curves.time_s[-1]))


def test_arrows_move_the_plot_until_there_are_cursors(stage: Stage, qtbot: QtBot) -> None:
    stage.presenter.on_opening(RUN)
    stage.presenter.on_analysed(with_scan())
    stack = plots_of(stage)
    qtbot.keyClick(stack, Qt.Key.Key_Plus)
    before = stage.curves.span()
    qtbot.keyClick(stack, Qt.Key.Key_Right)
    assert stage.curves.span()[0] > before[0]
    moved = stage.curves.span()
    stage.presenter.toggle_cursors()
    cursors = stage.presenter.state.cursors
    qtbot.keyClick(stack, Qt.Key.Key_Right)
    assert stage.curves.span() == moved
    assert stage.presenter.state.cursors != cursors
    qtbot.keyClick(stack, Qt.Key.Key_Home)
    assert stage.curves.span()[0] == pytest.approx(-1.0)


def test_the_keys_of_the_handle_are_left_to_it(stage: Stage, qtbot: QtBot) -> None:
    stage.presenter.on_opening(RUN)
    stage.presenter.on_analysed(with_scan())
    scan = stage.screen._scan
    qtbot.keyClick(scan._stack, Qt.Key.Key_Right)
    answer(stage)
    assert scan._handle.value() > 0.1003
    qtbot.keyClick(scan._stack, Qt.Key.Key_Home)
    assert scan._handle.value() == pytest.approx(0.1003)
    qtbot.keyClick(scan._stack, Qt.Key.Key_Plus)
    start, end = scan._stack.time_range()
    assert end - start == pytest.approx(0.8 * 0.008)


@pytest.mark.parametrize("side", PlotTab)
def test_the_wheel_zooms_and_a_double_click_resets_every_plot(stage: Stage, side: PlotTab) -> None:
    stage.presenter.on_opening(RUN)
    stage.presenter.on_analysed(replace(with_scan(), friction_by_slip=by_slip()))
    stage.presenter.set_tab(side)
    QApplication.processEvents()
    stacks = [stack for stack in stage.screen.findChildren(PlotStack) if stack.isVisible()]
    for stack in stacks:
        hand, whole = Hand(stack), stack.plots[-1].view.viewRange()
        at = hand.place(0.5, 0.5, len(stack.plots) - 1)
        hand.wheel(2, at)
        hand.wheel(2, at, Qt.KeyboardModifier.ControlModifier)
        for (low, high), (start, end) in zip(stack.plots[-1].view.viewRange(), whole, strict=True):
            assert high - low == pytest.approx(0.64 * (end - start))
        hand.double_click(at)
        np.testing.assert_allclose(stack.plots[-1].view.viewRange(), whole)
        assert stack.curves_in_view(), "there is something to save as a table"
        assert stack.accessibleName()


def test_curves_are_saved_by_the_name_of_the_run_with_names_and_units(stage: Stage) -> None:
    stage.presenter.on_opening(RUN)
    stage.presenter.on_analysed(analysed())
    stack = plots_of(stage)
    assert stack.export_name == "20260112_1FFM0_001 displacement"
    assert [curve.title for curve in stack.curves_in_view()] == [
        "table displacement, record, mm",
        "table displacement, simulation, mm",
        "relative displacement, record, mm",
        "relative displacement, simulation, mm",
        "table displacement, residual, µm",
        "relative displacement, residual, µm",
    ]
    assert {curve.x_title for curve in stack.curves_in_view()} == {"time from release, s"}


def rows_of(stage: Stage, name: str) -> SelectableRows:
    for _ in range(3):  # the column first learns its height
        QApplication.processEvents()
    (found,) = [rows for rows in stage.screen.findChildren(SelectableRows) if rows.accessibleName() == name]
    return found


def copied_lines() -> list[list[str]]:
    return [line.split("\t") for line in QGuiApplication.clipboard().text().splitlines()]


def test_results_are_selected_by_mouse_and_keys_and_copied_with_uncertainty_and_unit(
    stage: Stage, qtbot: QtBot
) -> None:
    stage.presenter.on_opening(RUN)
    stage.presenter.on_analysed(with_scan())
    rows = rows_of(stage, "Results")
    qtbot.mouseClick(rows, Qt.MouseButton.LeftButton, pos=rows._place(1).center())
    assert rows.selected == (1,)
    qtbot.keyClick(rows, Qt.Key.Key_C, Qt.KeyboardModifier.ControlModifier)
    period = stage.presenter.state.rows[1]
    assert copied_lines() == [
        ["symbol", "quantity", "value", "u", "unit"],
        ["T", period.name, "319.942", "0.048", "ms"],
    ]
    qtbot.keyClick(rows, Qt.Key.Key_Up)
    qtbot.keyClick(rows, Qt.Key.Key_Down, Qt.KeyboardModifier.ShiftModifier)
    assert rows.selected == (0, 1)
    assert "319.942; 0.048; ms" in rows.accessibleDescription()
    place = rows._place(0).center()
    qtbot.mouseClick(rows, Qt.MouseButton.LeftButton, Qt.KeyboardModifier.ControlModifier, place)
    assert rows.selected == (1,)
    qtbot.keyClick(rows, Qt.Key.Key_A, Qt.KeyboardModifier.ControlModifier)
    qtbot.keyClick(rows, Qt.Key.Key_C, Qt.KeyboardModifier.ControlModifier)
    lines = copied_lines()
    assert [line[0] for line in lines[1:3]] == ["f_d", "T"]
    assert len(lines) == 1 + len(stage.presenter.state.rows)


def test_laws_classical_figures_and_budget_are_copied_too(stage: Stage, qtbot: QtBot) -> None:
    stage.presenter.on_opening(RUN)
    stage.presenter.on_analysed(of_stand())
    stage.screen._results.show_classical(
        (ClassicalRow("f<sub>d</sub>", "from u<sub>s</sub> alone", "0.1000, 0.1288", "0.1000"),)
    )
    copied = {}
    for name in ("Friction laws", "Classical figures", "Uncertainty of fd"):
        rows = rows_of(stage, name)
        rows.select_all()
        qtbot.keyClick(rows, Qt.Key.Key_C, Qt.KeyboardModifier.ControlModifier)
        copied[name] = copied_lines()
    shown = stage.presenter.state.models[0]
    assert copied["Friction laws"][1] == [
        shown.law,
        shown.effects,
        shown.friction,
        shown.ratio,
        shown.status.text,
    ]
    assert copied["Classical figures"][1] == ["f_d", "from us alone", "0.1000, 0.1288", "0.1000"]
    assert [line[1] for line in copied["Uncertainty of fd"][1:]] == [
        row.value for row in stage.presenter.state.budget
    ]
    law = rows_of(stage, "Friction laws")
    assert law._place(0).height() > law._place(1).height(), "the line of its effects belongs to a law"


@pytest.mark.parametrize("language", ["en", "ru"])
@pytest.mark.parametrize("friction", [Quantity.normal(-0.1003, 6.4e-12, "1"), None])
def test_the_main_result_fits_the_column_in_a_window_of_1280(
    theme: Theme,
    qtbot: QtBot,
    friction: Quantity | None,
    language: str,
    use_language: Callable[[str], None],
) -> None:
    use_language(language)
    stage = Stage(theme, qtbot)
    stage.presenter.on_opening(RUN)
    results = {row.name: Quantity.normal(-12.3456789, 1.23e-9, row.unit) for row in CATALOGUE}
    del results["friction_dynamic"]
    stage.presenter.on_analysed(
        replace(with_scan(), results=results | ({"friction_dynamic": friction} if friction else {}))
    )
    for _ in range(3):
        QApplication.processEvents()
    assert clipped_words(stage.screen) == []
