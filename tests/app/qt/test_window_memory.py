"""How the window was left comes back, as far as it still fits."""

import pytest
from PySide6.QtCore import QRect, Qt
from PySide6.QtGui import QGuiApplication
from PySide6.QtWidgets import QMainWindow, QSplitter, QTableWidget, QWidget
from pytestqt.qtbot import QtBot

from app.qt.memory import Memory, remember
from config.schema import WindowPlace


@pytest.fixture
def window(qtbot: QtBot) -> QMainWindow:
    made = QMainWindow()
    qtbot.addWidget(made)
    return made


def free() -> QRect:
    return QGuiApplication.primaryScreen().availableGeometry()


def test_place_and_size_come_back(window: QMainWindow) -> None:
    place = WindowPlace(10, 20, 500, 400, screen="runs")
    memory = Memory(place)
    memory.restore_window(window)
    assert memory.of(window, "runs") == place
    assert memory.screen == "runs"


def test_a_window_of_a_screen_that_is_gone_comes_into_the_middle(window: QMainWindow) -> None:
    Memory(WindowPlace(9000, 9000, 500, 400)).restore_window(window)
    assert free().contains(window.frameGeometry())
    assert (window.width(), window.height()) == (500, 400)


def test_a_window_is_no_larger_than_the_screen(window: QMainWindow) -> None:
    Memory(WindowPlace(0, 0, 99_000, 99_000)).restore_window(window)
    assert window.size() == free().size()


def test_without_a_memory_it_has_its_usual_size(window: QMainWindow) -> None:
    Memory(WindowPlace()).restore_window(window)
    assert (window.width(), window.height()) == (min(1280, free().width()), min(800, free().height()))


def test_a_window_that_filled_the_screen_does_so_again(window: QMainWindow) -> None:
    memory = Memory(WindowPlace(10, 20, 500, 400, maximized=True))
    memory.restore_window(window)
    assert window.windowState() & Qt.WindowState.WindowMaximized
    assert memory.of(window, "start").maximized


def made_parts() -> tuple[QWidget, QTableWidget, QSplitter]:
    page = QWidget()
    page.resize(800, 400)
    table = QTableWidget(0, 3, page)
    remember(table.horizontalHeader(), "a table")
    splitter = QSplitter(page)
    splitter.resize(800, 100)
    for _ in range(2):
        splitter.addWidget(QWidget())
    remember(splitter, "a splitter")
    return page, table, splitter


def test_columns_and_splitters_come_back_and_others_are_not_forgotten(
    window: QMainWindow, qtbot: QtBot
) -> None:
    page, table, _ = made_parts()
    window.setCentralWidget(page)
    table.setColumnWidth(1, 77)
    left = Memory(WindowPlace(widths={"not seen": (1, 2)})).of(window, "runs")
    assert left.widths["not seen"] == (1, 2)
    assert left.widths["a table"][1] == 77
    again, table, splitter = made_parts()
    qtbot.addWidget(again)
    Memory(left.replace(widths={**left.widths, "a splitter": (600, 195)})).restore_parts(again)
    assert table.columnWidth(1) == 77
    assert splitter.sizes()[0] > 2 * splitter.sizes()[1]


def test_widths_of_another_number_of_columns_are_left_aside(qtbot: QtBot) -> None:
    page, table, _ = made_parts()
    qtbot.addWidget(page)
    before = table.columnWidth(0)
    Memory(WindowPlace(widths={"a table": (5, 5)})).restore_parts(page)
    assert table.columnWidth(0) == before
