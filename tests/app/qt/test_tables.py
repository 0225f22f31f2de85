"""Rows copied for a spreadsheet, and columns chosen, moved and remembered, by keys and mouse."""

import pytest
from PySide6.QtCore import QPoint, QRect, Qt
from PySide6.QtGui import QContextMenuEvent, QGuiApplication
from PySide6.QtWidgets import (
    QAbstractItemView,
    QApplication,
    QHeaderView,
    QMainWindow,
    QMenu,
    QTableWidget,
    QTableWidgetItem,
)
from pytestqt.qtbot import QtBot

from app.qt.theme import Theme
from app.qt.widgets.tables import (
    COPIED_ROLE,
    NAME_ROLE,
    TitleHeader,
    serve_table,
    show_columns,
    shown_columns,
)
from app.qt.window_geometry import WindowGeometry, persist_layout
from config.schema import WindowLayout

TITLES = {"run": "Run", "f": "f_d", "n": "n₁\n1/s", "note": "Note"}
ROWS = [
    ("001", ("0.1003", "0.0006"), "−0.12\u202f1", "dry"),
    ("002", ("0.1010", "0.0007"), "", "two\nlines\tand a tab"),
    ("003", ("0.0990", "0.0005"), "0.13", ""),
]


@pytest.fixture
def table(qtbot: QtBot) -> QTableWidget:
    made = QTableWidget(len(ROWS), len(TITLES))
    made.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
    for column, (name, title) in enumerate(TITLES.items()):
        head = QTableWidgetItem(title)
        head.setData(NAME_ROLE, name)
        made.setHorizontalHeaderItem(column, head)
    made.horizontalHeaderItem(1).setData(COPIED_ROLE, ["f_d", "u(f_d)"])
    for row, cells in enumerate(ROWS):
        for column, cell in enumerate(cells):
            item = QTableWidgetItem(cell if isinstance(cell, str) else " ± ".join(cell))
            if not isinstance(cell, str):
                item.setData(COPIED_ROLE, list(cell))
            made.setItem(row, column, item)
    serve_table(made, ("run", "f", "n"))
    qtbot.addWidget(made)
    made.resize(600, 300)
    made.show()
    qtbot.waitExposed(made)
    return made


def copied(table: QTableWidget, qtbot: QtBot) -> list[list[str]]:
    QGuiApplication.clipboard().clear()
    table.activateWindow()
    table.setFocus()
    qtbot.keyClick(table, Qt.Key.Key_C, Qt.KeyboardModifier.ControlModifier)
    return [line.split("\t") for line in QGuiApplication.clipboard().text().splitlines()]


def opened(table: QTableWidget, widget: QAbstractItemView | QHeaderView, at: QPoint) -> QMenu:
    event = QContextMenuEvent(QContextMenuEvent.Reason.Mouse, at, widget.viewport().mapToGlobal(at))
    QApplication.sendEvent(widget.viewport(), event)
    (menu,) = [menu for menu in table.findChildren(QMenu) if menu.isVisible()]
    menu.close()
    return menu


def choose(table: QTableWidget, text: str) -> None:
    menu = opened(table, table.horizontalHeader(), QPoint(5, 5))
    (action,) = [action for action in menu.actions() if action.text() == text]
    action.trigger()


def test_selected_rows_are_copied_with_titles_as_a_spreadsheet_takes_them(
    table: QTableWidget, qtbot: QtBot
) -> None:
    assert copied(table, qtbot) == []
    show_columns(table.horizontalHeader(), tuple(TITLES))
    table.selectRow(0)
    table.selectionModel().select(
        table.model().index(1, 0),
        table.selectionModel().SelectionFlag.Select | table.selectionModel().SelectionFlag.Rows,
    )
    assert copied(table, qtbot) == [
        ["Run", "f_d", "u(f_d)", "n₁ 1/s", "Note"],
        ["001", "0.1003", "0.0006", "-0.12 1", "dry"],
        ["002", "0.1010", "0.0007", "", "two lines and a tab"],
    ]


def test_columns_are_copied_as_they_stand(table: QTableWidget, qtbot: QtBot) -> None:
    show_columns(table.horizontalHeader(), ("n", "run"))
    table.selectRow(2)
    assert copied(table, qtbot) == [["n₁ 1/s", "Run"], ["0.13", "003"]]


def test_the_usual_columns_are_shown_until_others_are_chosen_in_the_menu_of_the_titles(
    table: QTableWidget,
) -> None:
    header = table.horizontalHeader()
    assert shown_columns(header) == ("run", "f", "n")
    choose(table, "Note")
    choose(table, "f_d")
    assert shown_columns(header) == ("run", "n", "note")
    choose(table, "Usual columns")
    assert shown_columns(header) == ("run", "f", "n")


def test_the_last_column_stays(table: QTableWidget) -> None:
    show_columns(table.horizontalHeader(), ("note",))
    menu = opened(table, table, QPoint(5, 5))
    enabled = {action.text(): action.isEnabled() for action in menu.actions() if action.isCheckable()}
    assert [text for text, is_enabled in enabled.items() if not is_enabled] == ["Note"]
    assert not next(action for action in menu.actions() if action.text() == "Copy rows").isEnabled()


def test_symbols_of_titles_have_their_subscripts(theme: Theme, qtbot: QtBot) -> None:
    """The index of `f_d` is drawn below the line, that of `fd` on it."""
    table = QTableWidget(1, 2)
    qtbot.addWidget(table)
    table.setHorizontalHeaderLabels(["Run", "f_d"])
    table.setHorizontalHeader(TitleHeader(table))
    table.horizontalHeader().setDefaultAlignment(Qt.AlignmentFlag.AlignLeft)
    table.show()
    qtbot.waitExposed(table)
    assert height_of_title(table, "f_d") > height_of_title(table, "fd") > 0


def height_of_title(table: QTableWidget, title: str) -> int:
    """Height of what is written in the second title."""
    header = table.horizontalHeader()
    table.horizontalHeaderItem(1).setText(title)
    QApplication.processEvents()
    place = QRect(header.sectionViewportPosition(1) + 2, 0, 40, header.height() - 4)  # without the line below
    image = header.grab(place).toImage()
    ground, columns = image.pixel(0, 0), range(image.width())
    rows = [y for y in range(image.height()) if any(image.pixel(x, y) != ground for x in columns)]
    return rows[-1] - rows[0] + 1


def test_a_title_is_dragged_to_another_place(table: QTableWidget, qtbot: QtBot) -> None:
    header = table.horizontalHeader()
    port, y = header.viewport(), header.height() // 2
    start = QPoint(header.sectionViewportPosition(2) + 10, y)
    end = QPoint(header.sectionViewportPosition(0) + 5, y)
    qtbot.mousePress(port, Qt.MouseButton.LeftButton, pos=start)
    for part in (0.3, 0.7, 1.0):
        qtbot.mouseMove(port, start + (end - start) * part)
    qtbot.mouseRelease(port, Qt.MouseButton.LeftButton, pos=end)
    assert shown_columns(header) == ("n", "run", "f")


def test_columns_come_back_as_they_were_left(table: QTableWidget, qtbot: QtBot) -> None:
    header = table.horizontalHeader()
    persist_layout(header, "a table")
    show_columns(header, ("note", "f"))
    window = QMainWindow()
    qtbot.addWidget(window)
    window.setCentralWidget(table)
    left = WindowGeometry(WindowLayout(columns={"not seen": ("a",)})).capture(window, "runs")
    assert left.columns == {"not seen": ("a",), "a table": ("note", "f")}
    show_columns(header, tuple(TITLES))
    WindowGeometry(left).restore_parts(window)
    window.takeCentralWidget()
    assert shown_columns(header) == ("note", "f")
    assert table.columnWidth(0) == 0
    show_columns(header, ("run",))
    assert table.columnWidth(0) > 40, "a hidden column has no width to come back with"


@pytest.mark.parametrize("rubbish", [(), ("gone",), ("gone", "f")])
def test_names_of_columns_that_are_no_more_hide_none(table: QTableWidget, rubbish: tuple[str, ...]) -> None:
    header = table.horizontalHeader()
    persist_layout(header, "a table")
    WindowGeometry(WindowLayout(columns={"a table": rubbish})).restore_parts(table)
    assert shown_columns(header) == (("f",) if "f" in rubbish else ("run", "f", "n"))
