"""The Identify screen: record against simulation, or words for what is missing."""

import numpy as np
import pytest
from looking import clipped_words, visible_words
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QApplication, QPushButton
from pytestqt.qtbot import QtBot
from stage import analysed

from analysis.identification import Events
from app.presenters.identify.presenter import IdentifyPresenter
from app.presenters.screen import Progress
from app.qt.identify.screen import IdentifyScreen
from app.qt.theme import Theme

RUN = str(analysed().path)


class Stage:
    """Screen and presenter, shown; counts what was asked of it."""

    def __init__(self, theme: Theme, qtbot: QtBot) -> None:
        self.cancelled = 0
        self.asked = 0
        self.presenter = IdentifyPresenter(self._cancel)
        self.screen = IdentifyScreen(theme, self.presenter, self._ask)
        qtbot.addWidget(self.screen)
        self.screen.resize(1188, 800)
        self.presenter.attach(self.screen)
        self.screen.show()
        qtbot.waitExposed(self.screen)
        self.curves = self.screen._curves

    def _cancel(self) -> None:
        self.cancelled += 1

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
    stage.presenter.opening(RUN)
    stage.presenter.working(RUN, Progress("Fitting coulomb", 0.4))
    assert "Fitting coulomb" in stage.words()
    qtbot.mouseClick(stage.button("Cancel"), Qt.MouseButton.LeftButton)
    assert stage.cancelled == 1


def test_a_failure_stands_in_words(stage: Stage) -> None:
    stage.presenter.opening(RUN)
    stage.presenter.show_failure(RUN, "it is a text file. Use slipstand import")
    assert "■ it is a text file. Use slipstand import" in stage.words()


def test_a_run_is_drawn_with_all_that_was_found(stage: Stage) -> None:
    stage.presenter.opening(RUN)
    stage.presenter.show_run(analysed(), true_friction=0.1)
    words = stage.words()
    for expected in (
        "20260112_1FFM0_001.h5",
        "✓ Model fits",
        "True value 0.10000: found +0.30\u202f%",
        "0.10030",
        "± 0.048\u202fms",
        "coulomb+tilt",
        "+110",
        "▲ The tail does not decay exponentially.",
    ):
        assert expected in words
    curves = stage.presenter.state.curves
    assert curves is not None
    time_s, residual_um = stage.curves._residuals[1].getOriginalDataset()
    np.testing.assert_array_equal(time_s, curves.time_s)
    assert np.nanstd(residual_um) == pytest.approx(20.0, rel=0.05)
    assert stage.curves._slips[0].getRegion() == pytest.approx((0.0, 2.5))
    assert stage.curves._noise.getRegion() == pytest.approx((-40.0, 40.0))
    spans = [plot.view.viewRange()[0] for plot in stage.curves._stack.plots]
    assert spans[0] == spans[1] == spans[2] == pytest.approx([-1.0, 9.999])


def test_zooming_one_plot_zooms_all(stage: Stage) -> None:
    stage.presenter.opening(RUN)
    stage.presenter.show_run(analysed())
    plots = stage.curves._stack.plots
    plots[2].view.setXRange(1.0, 2.0, padding=0.0)
    QApplication.processEvents()
    assert [plot.view.viewRange()[0] for plot in plots] == [[1.0, 2.0]] * 3


def test_a_run_without_fit_second_gauge_or_release_is_drawn_too(stage: Stage) -> None:
    bare = analysed(model=None, relative=None, events=Events(), results={}, labels={})
    stage.presenter.opening(RUN)
    stage.presenter.show_run(analysed())
    stage.presenter.opening(RUN)
    stage.presenter.show_run(bare)
    assert stage.curves._records[1].getOriginalDataset()[0] is None
    assert not stage.curves._noise.isVisible()
    assert "No motion to fit" in stage.words()


def test_the_pointer_reads_record_and_simulation(stage: Stage) -> None:
    stage.presenter.opening(RUN)
    stage.presenter.show_run(analysed())
    stage.curves._read_out(1.0)
    texts = [plot.readout.text for plot in stage.curves._stack.plots]
    assert "1.000\u202fs" in texts[0]
    assert texts[0].count("|") == 1
    assert "µm" in texts[2]


@pytest.mark.parametrize("size", [(932, 640), (1188, 800), (1828, 1080)], ids=lambda size: f"{size[0]}")
def test_no_word_is_cut_off(stage: Stage, size: tuple[int, int]) -> None:
    stage.screen.resize(*size)
    for show in (lambda: stage.presenter.opening(RUN), lambda: stage.presenter.show_run(analysed(), 0.1)):
        show()
        QApplication.processEvents()
        assert clipped_words(stage.screen) == []
