"""The keyboard rules of the window: Enter presses what has the focus, and the focus never moves by itself."""

import pytest
from PySide6.QtCore import QEvent, QObject, Qt
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QApplication, QDialog, QLineEdit, QPushButton, QToolButton, QWidget
from stage import END_S, RUN, analysed
from test_identify_screen import with_scan
from window_desk import Desk

from app.presenters.base import Chip, Notice, Tone
from app.presenters.gauges.state import PortCard
from app.presenters.navigator import ConnectForm
from app.presenters.record.state import Action, MoveToTrash
from app.presenters.screens import Screen
from tests.waiting import PATIENCE_MS


def focused() -> QWidget:
    found = QApplication.focusWidget()
    assert found is not None
    return found


def press(desk: Desk, key: Qt.Key) -> None:
    desk.qtbot.keyClick(focused(), key)


def record(desk: Desk) -> None:
    """Connect the simulated stand, and record a run up to its result."""
    desk.click("Try with the simulated stand")
    desk.qtbot.waitUntil(lambda: bool(desk.presenter.start.state.connected), timeout=PATIENCE_MS)
    press(desk, Qt.Key.Key_A)
    desk.launcher.engines[0].play(END_S + 0.1)
    desk.qtbot.waitUntil(lambda: bool(desk.worker.calls), timeout=PATIENCE_MS)
    desk.worker.calls[-1].done(analysed())
    desk.qtbot.waitUntil(lambda: desk.presenter.record.state.decision is not None, timeout=PATIENCE_MS)


@pytest.mark.parametrize("key", [Qt.Key.Key_Return, Qt.Key.Key_Enter])
@pytest.mark.parametrize("screen", Screen)
def test_enter_presses_each_button_of_each_screen(desk: Desk, screen: Screen, key: Qt.Key) -> None:
    desk.presenter.show_screen(screen)
    QApplication.processEvents()
    buttons: list[QPushButton | QToolButton] = [
        *desk.window.findChildren(QPushButton),
        *desk.window.findChildren(QToolButton),
    ]
    pressed: list[QWidget] = []
    for button in buttons:
        if button.isVisible() and button.isEnabled() and button.menu() is None:
            button.blockSignals(True)  # what a button does is tested elsewhere
            button.setFocus()
            pressed.clear()
            was_checked = button.isChecked()
            button.setCheckable(True)
            button.setAutoExclusive(False)
            button.setChecked(False)
            desk.qtbot.keyClick(focused(), key)
            assert button.isChecked(), f"Enter did not press {button.text()!r}"
            button.setChecked(was_checked)


@pytest.mark.parametrize("screen", Screen)
def test_a_screen_that_opens_has_the_focus_on_no_button_and_no_field(desk: Desk, screen: Screen) -> None:
    for other in Screen:
        if other is not screen:
            desk.presenter.show_screen(other)
            desk.presenter.show_screen(screen)
            assert not isinstance(focused(), QPushButton | QToolButton | QLineEdit)


def test_keys_of_record_work_after_a_notice_was_dismissed(desk: Desk) -> None:
    record(desk)
    desk.presenter._update(notice=Notice("Something came up"))
    desk.click("Dismiss")
    press(desk, Qt.Key.Key_D)
    files = desk.presenter.record._files
    assert any(isinstance(call.arguments[0], MoveToTrash) for call in files.calls)  # type: ignore[attr-defined]


def test_the_focus_does_not_pass_on_from_a_button_that_is_disabled_or_hidden(desk: Desk) -> None:
    desk.presenter.show_screen(Screen.RECORD)
    for vanish in (QWidget.hide, lambda button: button.setEnabled(False)):
        button = desk.button("Plan")
        button.setFocus()
        vanish(button)
        assert focused() is desk.window.home()
        button.setEnabled(True)
        button.show()


def test_neither_arm_nor_stop_has_the_focus_while_a_run_is_recorded(desk: Desk) -> None:
    desk.click("Try with the simulated stand")
    desk.qtbot.waitUntil(lambda: bool(desk.presenter.start.state.connected), timeout=PATIENCE_MS)
    desk.button("Arm   A").setFocus()
    press(desk, Qt.Key.Key_Return)
    desk.launcher.engines[0].play(3.0)
    desk.qtbot.waitUntil(lambda: desk.presenter.record.is_recording, timeout=PATIENCE_MS)
    assert focused() is desk.window.home()
    press(desk, Qt.Key.Key_Space)
    press(desk, Qt.Key.Key_Return)
    assert desk.presenter.record.is_recording


class ShownWindows(QObject):
    """Keeps the widgets that were shown as windows."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def eventFilter(self, shown: QObject, event: QEvent) -> bool:  # noqa: N802
        if event.type() == QEvent.Type.Show and isinstance(shown, QWidget) and shown.isWindow():
            self.found.append(type(shown).__name__)
        return False


def test_no_part_of_a_screen_is_a_window_for_a_moment_which_would_take_the_focus(desk: Desk) -> None:
    application, windows = QApplication.instance(), ShownWindows()
    assert application is not None
    for screen in Screen:
        desk.presenter.show_screen(screen)
    application.installEventFilter(windows)
    desk.presenter.open_run(RUN)
    desk.worker.calls[-1].done(with_scan())
    card = PortCard("COM7", "FTDI", Chip("GSV-8", Tone.OK), suggested_form=ConnectForm("COM7", "gsv"))
    desk.presenter.gauges.ports._update(ports=(card,))
    QApplication.processEvents()
    application.removeEventFilter(windows)
    assert windows.found == []
    assert desk.window.isActiveWindow()
    assert focused() is desk.window.home()


def test_enter_arms_where_arming_comes_next_and_a_key_held_down_does_not(desk: Desk) -> None:
    desk.click("Try with the simulated stand")
    desk.qtbot.waitUntil(lambda: desk.presenter.record.state.primary is Action.ARM, timeout=PATIENCE_MS)
    held = QKeyEvent(QEvent.Type.KeyPress, Qt.Key.Key_Return, Qt.KeyboardModifier.NoModifier, "", True)
    QApplication.sendEvent(focused(), held)
    assert Action.ARM in desk.presenter.record.state.allowed
    press(desk, Qt.Key.Key_Return)
    assert Action.ARM not in desk.presenter.record.state.allowed


def test_a_button_disabled_behind_a_dialog_passes_its_focus_to_no_other(desk: Desk) -> None:
    button = desk.button("Open a recording")
    button.setFocus()
    dialog = QDialog(desk.window)
    dialog.show()
    dialog.activateWindow()
    desk.qtbot.waitUntil(dialog.isActiveWindow)
    button.setEnabled(False)
    dialog.close()
    desk.window.activateWindow()
    desk.qtbot.waitUntil(desk.window.isActiveWindow)
    assert desk.window.focusWidget() is desk.window.home()
