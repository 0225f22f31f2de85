"""Place and size of the window are restored, as far as they fit the screen."""

import pytest
from PySide6.QtCore import QPoint, QRect, QSize, Qt
from PySide6.QtGui import QGuiApplication, QScreen
from PySide6.QtWidgets import QApplication, QMainWindow, QSplitter, QTableWidget, QWidget
from pytestqt.qtbot import QtBot
from stage import FakeWorker, analysed
from window_desk import Desk

from app.presenters.identify.presenter import IdentifyPresenter
from app.presenters.identify.report import ReportPresenter
from app.presenters.runs.state import Column
from app.presenters.screens import Screen
from app.qt.identify.screen import IdentifyScreen
from app.qt.theme import Theme
from app.qt.window_geometry import WindowGeometry, persist_layout
from config.schema import WindowLayout


@pytest.fixture
def window(qtbot: QtBot) -> QMainWindow:
    made = QMainWindow()
    qtbot.addWidget(made)
    return made


def free() -> QRect:
    return QGuiApplication.primaryScreen().availableGeometry()


def test_place_and_size_come_back(window: QMainWindow) -> None:
    place = WindowLayout(10, 20, 500, 400, screen="runs")
    memory = WindowGeometry(place)
    memory.restore_window(window)
    assert memory.capture(window, "runs") == place
    assert memory.screen == "runs"


def test_a_window_of_a_screen_that_is_gone_comes_into_the_middle(window: QMainWindow) -> None:
    WindowGeometry(WindowLayout(9000, 9000, 500, 400)).restore_window(window)
    assert free().contains(window.frameGeometry())
    assert (window.width(), window.height()) == (500, 400)


@pytest.mark.parametrize(
    ("room", "is_maximized"),
    [
        ((1920, 1040), False),
        ((1280, 800), True),
        ((1024, 640), True),
        ((960, 540), True),
        ((800, 600), False),
    ],
)
def test_a_first_window_that_does_not_fit_with_its_frame_is_maximized(
    window: QMainWindow, monkeypatch: pytest.MonkeyPatch, room: tuple[int, int], is_maximized: bool
) -> None:
    monkeypatch.setattr(QScreen, "availableGeometry", lambda _: QRect(QPoint(), QSize(*room)))
    WindowGeometry(WindowLayout()).restore_window(window)
    assert window.isMaximized() is is_maximized
    inside = QSize(*room) - QSize(16, 39)
    assert window.size().boundedTo(inside) == window.size(), "when it is maximized no more"


def test_a_window_that_filled_the_screen_does_so_again(window: QMainWindow) -> None:
    memory = WindowGeometry(WindowLayout(10, 20, 500, 400, maximized=True))
    memory.restore_window(window)
    assert window.windowState() & Qt.WindowState.WindowMaximized
    assert memory.capture(window, "start").maximized


def made_parts() -> tuple[QWidget, QTableWidget, QSplitter]:
    page = QWidget()
    page.resize(800, 400)
    table = QTableWidget(0, 3, page)
    persist_layout(table.horizontalHeader(), "a table")
    splitter = QSplitter(page)
    splitter.resize(800, 100)
    for _ in range(2):
        splitter.addWidget(QWidget())
    persist_layout(splitter, "a splitter")
    return page, table, splitter


def test_columns_and_splitters_come_back_and_others_are_not_forgotten(
    window: QMainWindow, qtbot: QtBot
) -> None:
    page, table, _ = made_parts()
    window.setCentralWidget(page)
    table.setColumnWidth(1, 77)
    left = WindowGeometry(WindowLayout(widths={"not seen": (1, 2)})).capture(window, "runs")
    assert left.widths["not seen"] == (1, 2)
    assert left.widths["a table"][1] == 77
    again, table, splitter = made_parts()
    qtbot.addWidget(again)
    WindowGeometry(left.replace(widths={**left.widths, "a splitter": (600, 195)})).restore_parts(again)
    assert table.columnWidth(1) == 77
    assert splitter.sizes()[0] > 2 * splitter.sizes()[1]


def test_widths_of_another_number_of_columns_are_left_aside(qtbot: QtBot) -> None:
    page, table, _ = made_parts()
    qtbot.addWidget(page)
    before = table.columnWidth(0)
    WindowGeometry(WindowLayout(widths={"a table": (5, 5)})).restore_parts(page)
    assert table.columnWidth(0) == before


def test_the_column_that_a_table_is_sorted_by_comes_back(window: QMainWindow, qtbot: QtBot) -> None:
    page, table, _ = made_parts()
    window.setCentralWidget(page)
    table.setSortingEnabled(True)
    table.sortByColumn(2, Qt.SortOrder.DescendingOrder)
    left = WindowGeometry(WindowLayout(sorted_by={"not seen": (0, False)})).capture(window, "runs")
    assert left.sorted_by == {"not seen": (0, False), "a table": (2, True)}
    again, table, _ = made_parts()
    qtbot.addWidget(again)
    WindowGeometry(left).restore_parts(again)
    titles = table.horizontalHeader()
    assert (titles.sortIndicatorSection(), titles.sortIndicatorOrder()) == (2, Qt.SortOrder.DescendingOrder)


@pytest.mark.parametrize("rubbish", [(3, True), (-1, True), (100_000_000_000, False)])
def test_a_column_that_is_no_more_sorts_nothing(qtbot: QtBot, rubbish: tuple[int, bool]) -> None:
    page, table, _ = made_parts()
    qtbot.addWidget(page)
    before = table.horizontalHeader().sortIndicatorSection()
    WindowGeometry(WindowLayout(sorted_by={"a table": rubbish, "a splitter": rubbish})).restore_parts(page)
    assert table.horizontalHeader().sortIndicatorSection() == before


@pytest.mark.parametrize("rubbish", [(0, 0), (-5, -5), (100_000, 0)])
def test_no_part_of_a_splitter_is_lost_by_rubbish(qtbot: QtBot, rubbish: tuple[int, int]) -> None:
    page, _, splitter = made_parts()
    qtbot.addWidget(page)
    splitter.setChildrenCollapsible(False)
    for number in range(2):
        splitter.widget(number).setMinimumWidth(50)
    WindowGeometry(WindowLayout(widths={"a splitter": rubbish})).restore_parts(page)
    page.show()
    assert min(splitter.sizes()) >= 50


@pytest.mark.parametrize("descending", [True, False])
def test_runs_are_listed_in_the_order_in_which_they_were_left(
    theme: Theme, qtbot: QtBot, *, descending: bool
) -> None:
    number = list(Column).index(Column.FRICTION)
    desk = Desk(theme, qtbot, WindowLayout(sorted_by={"runs": (number, descending)}))
    desk.presenter.show_screen(Screen.RUNS)
    state = desk.presenter.runs.state
    assert (state.sorted_by, state.descending) == (Column.FRICTION, descending)
    desk.window.close()


def test_a_splitter_that_was_not_shown_keeps_what_it_had(window: QMainWindow) -> None:
    page = QWidget()
    splitter = QSplitter(page)
    for _ in range(2):
        splitter.addWidget(QWidget())
    persist_layout(splitter, "a splitter")
    window.setCentralWidget(page)
    left = WindowGeometry(WindowLayout(widths={"a splitter": (600, 195)})).capture(window, "start")
    assert left.widths["a splitter"] == (600, 195)


def test_the_column_of_identify_is_as_wide_as_it_was_left(window: QMainWindow, theme: Theme) -> None:
    def shown(place: WindowLayout) -> tuple[WindowLayout, QSplitter]:
        presenter = IdentifyPresenter(FakeWorker(), ReportPresenter(FakeWorker()))
        screen = IdentifyScreen(theme, presenter, lambda: None)
        presenter.attach(screen)
        window.setCentralWidget(screen)
        window.resize(1280, 800)
        memory = WindowGeometry(place)
        memory.restore_parts(screen)
        window.show()
        presenter.on_opening(str(analysed().path))
        presenter.on_analysed(analysed())
        QApplication.processEvents()
        return memory, screen.findChildren(QSplitter)[0]

    memory, splitter = shown(WindowLayout())
    assert splitter.sizes()[1] == 384
    splitter.moveSplitter(splitter.handle(1).x() - 100, 1)
    left = memory.capture(window, "identify")
    assert left.widths["identify"][1] == 484
    assert shown(left)[1].sizes()[1] == 484
