"""The series plan as a table: repeats, order, additions and removals, by keys too."""

import pytest
from looking import clipped_words, visible_words
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QApplication, QLineEdit, QPushButton, QTableWidget
from pytestqt.qtbot import QtBot
from test_record_decisions import Stage

from app.presenters.record.state import CountCompletedRuns, SavePlan
from app.qt.record.plan_dialog import PlanDialog
from app.qt.theme import Theme

ALT, CONTROL = Qt.KeyboardModifier.AltModifier, Qt.KeyboardModifier.ControlModifier


class Page:
    """The dialog over Record, opened by P; the plan has three series."""

    def __init__(self, theme: Theme, qtbot: QtBot) -> None:
        self.qtbot = qtbot
        self.stage = Stage(theme, qtbot)
        self.stage.press(Qt.Key.Key_P)
        (self.dialog,) = self.stage.screen.findChildren(PlanDialog)
        self.dialog.activateWindow()
        qtbot.waitUntil(self.dialog.isActiveWindow)
        self.table = self.dialog.findChildren(QTableWidget)[0]
        self.table.selectAll()
        qtbot.keyClick(self.table, Qt.Key.Key_Delete)
        self.add("1FFM0 x4, 1FFM1 x3, 2SSM0 x2")
        self.table.setFocus()

    def add(self, text: str) -> None:
        field = next(f for f in self.dialog.findChildren(QLineEdit) if f.accessibleName() == "Series to add")
        field.setFocus()
        self.qtbot.keyClicks(field, text)
        self.qtbot.keyClick(field, Qt.Key.Key_Return)

    def press(self, key: Qt.Key, modifier: Qt.KeyboardModifier = Qt.KeyboardModifier.NoModifier) -> None:
        self.qtbot.keyClick(QApplication.focusWidget(), key, modifier)

    @property
    def rows(self) -> list[str]:
        columns = range(self.table.columnCount())
        return [
            " ".join(self.table.item(row, column).text() for column in columns).strip()
            for row in range(self.table.rowCount())
        ]

    @property
    def plan(self) -> str:
        return self.stage.presenter.state.plan.text


@pytest.fixture
def page(theme: Theme, qtbot: QtBot) -> Page:
    return Page(theme, qtbot)


def test_the_plan_is_a_table_of_series_repeats_what_is_done_and_what_is_next(page: Page) -> None:
    assert page.rows == ["1FFM0 4 3", "1FFM1 3 1 next", "2SSM0 2 0"]
    assert "4 of 9 runs are there" in visible_words(page.dialog)
    assert not page.dialog.isModal()
    assert clipped_words(page.dialog) == []


def test_repeats_are_typed_and_those_that_cannot_be_are_refused(page: Page) -> None:
    no_plan = "is no part of a plan"
    page.table.setCurrentCell(0, 1)
    for text, said in (("3", ""), ("many", no_plan), ("many", no_plan), ("0", "1 to 999")):
        page.press(Qt.Key.Key_F2)
        editor = QApplication.focusWidget()
        assert isinstance(editor, QLineEdit)
        editor.selectAll()
        page.qtbot.keyClicks(editor, text)
        page.qtbot.keyClick(editor, Qt.Key.Key_Return)
        page.qtbot.waitUntil(page.table.hasFocus)
        assert said in visible_words(page.dialog)
        assert page.rows[0] == "1FFM0 3 3 full"


def test_a_series_moves_earlier_and_later_and_stays_selected(page: Page) -> None:
    page.table.selectRow(2)
    page.press(Qt.Key.Key_Up, ALT)
    page.press(Qt.Key.Key_Up, ALT)
    page.press(Qt.Key.Key_Up, ALT)
    assert page.plan == "2SSM0 x2, 1FFM0 x4, 1FFM1 x3"
    assert page.table.currentRow() == 0
    page.press(Qt.Key.Key_Down, ALT)
    assert page.plan == "1FFM0 x4, 2SSM0 x2, 1FFM1 x3"


def test_series_are_added_by_patterns_and_removed_by_del(page: Page) -> None:
    page.add("3SSM? x2")
    assert page.rows[3:] == [f"3SSM{mass} 2 0" for mass in range(4)]
    page.add("9FFM0")
    assert "9FFM0 is no series of this stand" in visible_words(page.dialog)
    page.table.setFocus()
    page.table.selectRow(0)
    page.press(Qt.Key.Key_Down, Qt.KeyboardModifier.ShiftModifier)
    page.press(Qt.Key.Key_Delete)
    assert page.plan.startswith("2SSM0 x2, 3SSM0 x2")
    assert page.table.currentRow() == 0


def test_changes_are_stored_at_once_and_undone_one_by_one(page: Page) -> None:
    page.stage.tasks()
    page.table.selectRow(0)
    page.press(Qt.Key.Key_Delete)
    page.press(Qt.Key.Key_Delete)
    assert page.rows == ["2SSM0 2 0 next"]
    asked = [call.arguments[0] for call in page.stage.files.calls]
    stored = [task for task in asked if isinstance(task, SavePlan)]
    assert [len(task.tests.plan) for task in stored] == [2, 1]
    page.press(Qt.Key.Key_Z, CONTROL)
    page.press(Qt.Key.Key_Z, CONTROL)
    assert page.plan == "1FFM0 x4, 1FFM1 x3, 2SSM0 x2"
    for _ in range(5):
        page.press(Qt.Key.Key_Z, CONTROL)
    assert page.plan.startswith("1FFM0 x3, 1FFM1 x3"), "the plan that was stored at first"
    undo = next(b for b in page.dialog.findChildren(QPushButton) if b.text() == "Undo")
    assert not undo.isEnabled()


def test_a_run_that_is_counted_meanwhile_leaves_a_cell_that_is_typed(page: Page) -> None:
    page.table.setCurrentCell(1, 1)
    page.press(Qt.Key.Key_F2)
    editor = QApplication.focusWidget()
    assert isinstance(editor, QLineEdit)
    page.qtbot.keyClicks(editor, "12")
    page.stage.answer(CountCompletedRuns("/recordings"), (("/a", "1FFM1"), ("/b", "1FFM1")))
    assert page.rows[1] == "1FFM1 3 2 next"
    assert (QApplication.focusWidget(), editor.text()) == (editor, "12")
