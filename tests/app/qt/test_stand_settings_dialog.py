"""The dialog of the stand: opened from Settings, edited by keys, its changes known to every screen."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from looking import clipped_words, visible_words
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QApplication, QLineEdit, QPushButton, QTableWidget
from pytestqt.qtbot import QtBot
from window_desk import Desk

from app.presenters.base import NoticeAction
from app.presenters.screens import Screen
from app.qt.stand_settings_dialog import StandSettingsDialog
from app.qt.theme import Theme
from config.files import load_stand
from tests.waiting import PATIENCE_MS


class Stage:
    """The dialog over a window on fakes."""

    def __init__(self, theme: Theme, qtbot: QtBot) -> None:
        self.qtbot = qtbot
        self.desk = Desk(theme, qtbot)
        self.desk.presenter.show_screen(Screen.SETTINGS)
        self.desk.window.activateWindow()
        qtbot.waitUntil(self.desk.window.isActiveWindow)
        qtbot.keyClick(self.desk.window, Qt.Key.Key_E, Qt.KeyboardModifier.AltModifier)
        (self.dialog,) = self.desk.window.findChildren(StandSettingsDialog)
        self.dialog.activateWindow()
        qtbot.waitUntil(self.dialog.isActiveWindow)

    def field(self, name: str) -> QLineEdit:
        return next(f for f in self.dialog.findChildren(QLineEdit) if f.accessibleName() == name)

    def table(self, name: str) -> QTableWidget:
        (found,) = [t for t in self.dialog.findChildren(QTableWidget) if t.accessibleName() == name]
        return found

    def button(self, text: str) -> QPushButton:
        (found,) = [b for b in self.dialog.findChildren(QPushButton) if b.text() == text]
        return found

    def type(self, field: QLineEdit, text: str) -> None:
        field.selectAll()
        self.qtbot.keyClicks(field, text)

    def editor(self) -> QLineEdit:
        """Field of the cell that is being typed."""
        focused = QApplication.focusWidget()
        assert isinstance(focused, QLineEdit)
        return focused

    def words(self) -> str:
        return visible_words(self.dialog)


@pytest.fixture
def stage(theme: Theme, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Stage]:
    monkeypatch.setenv("SLIPSTAND_CONFIG", str(tmp_path))
    made = Stage(theme, qtbot)
    yield made
    made.desk.window.close()


def test_a_mass_is_typed_and_saved_with_enter(stage: Stage) -> None:
    assert not stage.button("Save").isEnabled()
    mass = stage.field("Mass of the plate, kg")
    stage.type(mass, "-3")
    assert "Not saved yet" in stage.words()
    stage.qtbot.keyClick(mass, Qt.Key.Key_Return)
    assert "plate_mass_kg = -3.0 must be a finite number above 0" in stage.words()
    assert clipped_words(stage.dialog) == []
    stage.type(mass, "22.5")
    stage.qtbot.keyClick(mass, Qt.Key.Key_Return)
    assert load_stand().plate_mass_kg == 22.5
    stage.qtbot.keyClick(stage.dialog, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    assert load_stand().plate_mass_kg == 22.4
    assert mass.text() == "22.4"


def test_a_pullback_is_added_and_another_removed_by_keys(stage: Stage) -> None:
    table = stage.table("Pullbacks")
    table.setFocus()
    table.setCurrentCell(2, 0)
    stage.qtbot.keyClick(table, Qt.Key.Key_Delete)
    stage.qtbot.keyClick(table, Qt.Key.Key_Insert)
    stage.qtbot.keyClicks(stage.editor(), "4")
    stage.qtbot.keyClick(stage.editor(), Qt.Key.Key_Return)
    stage.qtbot.waitUntil(table.hasFocus)
    stage.qtbot.keyClick(table, Qt.Key.Key_Right)
    stage.qtbot.keyClick(table, Qt.Key.Key_F2)
    stage.qtbot.keyClicks(stage.editor(), "4.5")
    stage.qtbot.keyClick(stage.editor(), Qt.Key.Key_S, Qt.KeyboardModifier.ControlModifier)
    assert load_stand().pullbacks_m == {"1": 0.012, "2": 0.009, "4": 0.0045}
    window = stage.desk.presenter
    assert window.runs.state.all_series == window.record.state.choices.all_series == load_stand().all_series
    assert [row.code for row in window.campaign.state.summary.rows] == list(load_stand().all_series)
    for screen in Screen:
        window.show_screen(screen)
    combos = [window.record.state.choices.series, "4FFM0"]
    assert set(combos) <= set(load_stand().all_series)


def test_a_connected_device_is_to_be_connected_again(stage: Stage) -> None:
    window = stage.desk.presenter
    window.start.start_simulation()
    stage.qtbot.waitUntil(lambda: bool(window.start.state.connected), timeout=PATIENCE_MS)
    stage.type(stage.field("Name"), "Stand 2")
    stage.qtbot.keyClick(stage.dialog, Qt.Key.Key_S, Qt.KeyboardModifier.ControlModifier)
    assert window.state.notice is not None
    assert window.state.notice.action is NoticeAction.RECONNECT


@pytest.mark.parametrize("size", [(880, 560), (760, 480)])
def test_all_words_fit(stage: Stage, size: tuple[int, int]) -> None:
    stage.dialog.resize(*size)
    QApplication.processEvents()
    assert clipped_words(stage.dialog) == []
