"""The Campaign screen: Table 1 as it fills, the figure, and what leads on from there."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pyqtgraph as pg
import pytest
from campaign_stage import ALL_SERIES, FOLDER, found, path_of, runs_with_a_mode
from looking import clipped_words, visible_words
from pointing import Hand
from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QGuiApplication, QTextDocument, QTextDocumentFragment
from PySide6.QtWidgets import QApplication, QFileDialog, QMenu, QPushButton, QTableWidget
from pytestqt.qtbot import QtBot
from stage import Call, FakeWorker

from app.presenters.base import Progress
from app.presenters.campaign.presenter import CampaignPresenter
from app.presenters.campaign.state import CampaignScope, Product
from app.qt.campaign.friction_plot import FrictionPlot
from app.qt.campaign.screen import CampaignScreen
from app.qt.theme import Theme


class Stage:
    """Screen and presenter with a fake worker, shown."""

    def __init__(self, theme: Theme, qtbot: QtBot) -> None:
        self.worker = FakeWorker()
        self.went: list[tuple[str, ...]] = []
        self.presenter = CampaignPresenter(self.worker, FOLDER, ALL_SERIES, "me", self)  # type: ignore[arg-type]
        self.screen = CampaignScreen(theme, self.presenter)
        qtbot.addWidget(self.screen)
        self.screen.resize(1188, 800)
        self.presenter.attach(self.screen)
        self.screen.show()
        qtbot.waitExposed(self.screen)
        self.presenter.refresh()

    def show_runs(self, folder: str, series: str) -> None:
        self.went.append((folder, series))

    def open_run(self, path: str) -> None:
        self.went.append((path,))

    def count_simulated(self, counted: bool) -> None:
        self.went.append(counted)

    def show_record(self) -> None:
        self.went.append(("record",))

    @property
    def last(self) -> Call:
        return self.worker.calls[-1]

    def asked(self) -> tuple[Any, ...]:
        return (self.last.name, *self.last.arguments)

    def gathered(self, answer: Any = None) -> None:
        self.last.done(answer or found())
        QApplication.processEvents()

    def button(self, text: str) -> QPushButton:
        named = [b for b in self.screen.findChildren(QPushButton) if b.text() == text and b.isVisible()]
        return named[0]

    def words(self) -> str:
        return visible_words(self.screen)


@pytest.fixture
def stage(theme: Theme, qtbot: QtBot) -> Stage:
    return Stage(theme, qtbot)


def test_what_goes_on_is_shown_before_anything_is_claimed_to_be_missing(stage: Stage) -> None:
    assert f"Looking through {FOLDER}." in stage.words().replace("\u200b", "")
    stage.last.progress(Progress("3 of 9 runs", 0.3))
    assert "3 of 9 runs" in stage.words()
    assert not [b for b in stage.screen.findChildren(QPushButton) if b.text() == "Record" and b.isVisible()]


def test_what_was_given_up_is_not_called_empty(stage: Stage) -> None:
    stage.last.cancel()
    assert "have not been gathered. Refresh (F5) looks for them." in stage.words()
    assert "There are no runs" not in stage.words()


def test_an_empty_folder_says_what_will_be_here_and_how_to_get_it(stage: Stage, qtbot: QtBot) -> None:
    stage.gathered(found([]))
    assert "There are no runs in" not in stage.words()  # a run that failed is there
    stage.presenter.refresh()
    stage.gathered(found([], failures=()))
    assert "There are no runs in" in stage.words()
    qtbot.mouseClick(stage.button("Make the synthetic campaign"), Qt.MouseButton.LeftButton)
    assert stage.asked() == ("simulate", FOLDER)
    qtbot.waitUntil(lambda: clipped_words(stage.screen) == [])


def test_a_campaign_is_drawn(stage: Stage) -> None:
    stage.gathered()
    table = stage.screen._table
    assert stage.screen._stack.currentIndex() == 0
    assert [table.item(line, 0).text() for line in range(table.rowCount())] == ["1FFM0", "1FFM1", "1SSM0"]
    assert "1 series has no run yet: 1SSM1" in stage.words()
    assert table.horizontalHeaderItem(8).text() == "f_d\n"
    assert table.item(0, 8).text() == stage.presenter.state.summary.rows[0].cells[7].value
    assert "3 runs" in table.item(0, 0).toolTip()
    for expected in ("Campaign: 9 runs in 3 series", "1SSM1", "Contact", "found", "torn.h5: It is no run."):
        assert expected in stage.words()
    assert "FF" in stage.screen._plot._stack.accessibleName()


def test_the_title_of_the_figure_shows_no_markup(stage: Stage) -> None:
    stage.gathered()
    (figure,) = stage.screen.findChildren(FrictionPlot)
    (plot,) = figure._stack.plots
    shown = QTextDocumentFragment.fromHtml(plot.title.text).toPlainText()
    assert shown.split() == ["friction", "by", "contact", "▨", "static", "fs", "■", "dynamic", "fd"]


@pytest.mark.parametrize("scheme", [Qt.ColorScheme.Light, Qt.ColorScheme.Dark])
def test_the_swatches_of_the_figure_have_the_colours_of_its_bars(
    stage: Stage, theme: Theme, scheme: Qt.ColorScheme
) -> None:
    stage.gathered()
    theme.fix(scheme)
    (figure,) = stage.screen.findChildren(FrictionPlot)
    (plot,) = figure._stack.plots
    (bar,) = {item.opts["pen"].color().name() for item in figure._items if isinstance(item, pg.BarGraphItem)}
    points = [item.opts for item in figure._items if isinstance(item, pg.ScatterPlotItem)]
    (bound,) = {drawn["brush"].color().name() for drawn in points if drawn["symbol"] == "t1"}
    document = QTextDocument()
    document.setHtml(plot.title.text)
    for swatch, ink in (("▨", bound), ("■", bar)):
        assert document.find(swatch).charFormat().foreground().color().name() == ink


def test_simulated_runs_are_named_and_chosen_by_a_switch(stage: Stage) -> None:
    stage.gathered()
    switch = stage.screen._count_simulated
    assert not switch.isVisible()
    assert "SIMULATED" not in stage.words()
    stage.gathered(replace(found(), simulated_count=9, simulated_counts=True))
    assert "SIMULATED" in stage.words()
    assert not switch.isVisible(), "there is nothing to choose from"
    stage.gathered(replace(found(), simulated_count=4, is_mixed=True))
    assert "SIMULATED" not in stage.words()
    assert (switch.isVisible(), switch.isChecked(), switch.text()) == (True, False, "4 simulated runs")
    switch.click()
    assert stage.went == [True]
    stage.gathered(replace(found(), simulated_count=4, is_mixed=True, simulated_counts=True))
    assert "SIMULATED and recorded" in stage.words()
    assert switch.isChecked()


def test_the_figure_is_zoomed_reset_and_saved_as_numbers(stage: Stage) -> None:
    stage.gathered()
    stack = stage.screen._plot._stack
    hand, whole = Hand(stack), stack.plots[0].view.viewRange()
    hand.wheel(3, hand.place(0.5, 0.5), Qt.KeyboardModifier.ControlModifier)
    assert stack.plots[0].view.viewRange()[1] != whole[1]
    hand.move(hand.place(0.5, 0.5))
    assert stack.plots[0].readout.text
    hand.double_click(hand.place(0.5, 0.5))
    assert stack.plots[0].view.viewRange() == whole
    columns = stack.table()
    assert [column.title for column in columns] == [
        f"{symbol}{end}"
        for symbol in ("f_s", "f_d")
        for end in ("", ", lower end of 95 %", ", upper end of 95 %")
    ]
    (bars, *_) = stage.presenter.state.summary.contacts
    assert bars.dynamic is not None
    assert (columns[3].x[0], columns[3].y[0]) == (bars.contact, bars.dynamic.value)


def test_effects_of_the_stand_have_a_block(stage: Stage) -> None:
    stage.gathered()
    assert "Effects of the stand" not in stage.words()
    stage.gathered(found(runs_with_a_mode()))
    assert "Effects of the stand" in stage.words()
    assert "2 of 2 runs: a second mode" in stage.words()


def test_enter_on_a_row_leads_to_its_runs(stage: Stage, qtbot: QtBot) -> None:
    stage.gathered()
    stage.screen._table.setFocus()
    stage.screen._table.selectRow(1)
    QApplication.processEvents()
    assert "Runs of 1FFM1" in stage.words()
    qtbot.keyClick(stage.screen._table, Qt.Key.Key_Return)
    assert stage.went == [(FOLDER, "1FFM1")]


def test_a_run_is_left_out_by_button_with_the_reason_that_was_typed(stage: Stage, qtbot: QtBot) -> None:
    stage.gathered()
    stage.screen._table.selectRow(0)
    QApplication.processEvents()
    qtbot.mouseClick(stage.button("Leave out"), Qt.MouseButton.LeftButton)
    assert "Say why the run is left out" in stage.words()
    qtbot.keyClicks(stage.screen._chosen._reason, "touched")
    qtbot.mouseClick(stage.button("Leave out"), Qt.MouseButton.LeftButton)
    path = path_of("1FFM0", 1)
    assert stage.asked() == ("exclude_run", CampaignScope(FOLDER, ALL_SERIES), path, "touched", "me")
    stage.gathered(found(excluded={path: "touched"}))
    assert stage.button("Take in").isVisible()
    assert "1FFM0_001.h5: Touched" in stage.words()
    assert stage.screen._chosen._reason.text() == ""
    assert stage.screen._table.selectedItems()[0].text() == "1FFM0"
    stage.screen.activateWindow()
    qtbot.waitUntil(stage.screen._table.hasFocus)
    qtbot.keyClick(stage.screen, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    assert stage.asked() == ("undo_exclusion", CampaignScope(FOLDER, ALL_SERIES), path, "me")


@pytest.mark.parametrize("size", [(932, 640), (1188, 800), (1828, 1080)], ids=lambda size: f"{size[0]}")
def test_no_word_is_cut_off(stage: Stage, size: tuple[int, int], qtbot: QtBot) -> None:
    stage.screen.resize(*size)
    stage.gathered(found(unsaved=3))
    stage.screen._table.selectRow(0)
    qtbot.waitUntil(lambda: clipped_words(stage.screen) == [])


def test_friction_of_the_plate_alone_is_hidden_until_it_is_chosen(stage: Stage) -> None:
    table = stage.screen._table
    (column,) = [place for place in range(table.columnCount()) if table.isColumnHidden(place)]
    assert table.horizontalHeaderItem(column).text().startswith("f_dp")
    choose_in_menu(table, "f_dp: ")
    header = table.horizontalHeader()
    assert not table.isColumnHidden(column)
    shown = sum(header.sectionSize(place) for place in range(table.columnCount()))
    assert shown == pytest.approx(table.viewport().width(), abs=table.columnCount())


def choose_in_menu(table: QTableWidget, text: str) -> None:
    table.horizontalHeader().customContextMenuRequested.emit(QPoint(5, 5))
    (menu,) = [menu for menu in table.findChildren(QMenu) if menu.isVisible()]
    (action,) = [action for action in menu.actions() if action.text().startswith(text)]
    menu.close()
    action.trigger()


def test_rows_of_the_table_are_copied_with_uncertainties_in_columns_of_their_own(stage: Stage) -> None:
    stage.gathered()
    table = stage.screen._table
    table.selectRow(0)
    choose_in_menu(table, "Copy rows")
    titles, row = (line.split("\t") for line in QGuiApplication.clipboard().text().splitlines())
    cells = dict(zip(titles, row, strict=True))
    first = stage.presenter.state.summary.rows[0]
    assert cells["series"] == first.label == "1FFM0"
    assert (cells["f_d"], cells["u(f_d)"]) == (first.cells[7].value, first.cells[7].uncertainty[2:])
    assert float(cells["T, ms"]) > 0.0


def test_a_table_is_proposed_by_one_suffix_and_follows_the_format(stage: Stage) -> None:
    """Windows appends a filter's first suffix: `table-1.xlsx.csv` was written by one filter of all."""
    stage.gathered()
    stage.screen._ask_for_target(Product.TABLE)
    dialog = stage.screen.findChild(QFileDialog)
    assert dialog is not None

    def proposed() -> tuple[str, str, str]:
        return dialog.selectedNameFilter(), dialog.defaultSuffix(), Path(dialog.selectedFiles()[0]).name

    assert proposed() == ("XLSX (*.xlsx)", "xlsx", "table-1.xlsx")
    dialog.selectNameFilter("CSV (*.csv)")
    dialog.filterSelected.emit("CSV (*.csv)")
    assert proposed() == ("CSV (*.csv)", "csv", "table-1.csv")
    dialog.close()
