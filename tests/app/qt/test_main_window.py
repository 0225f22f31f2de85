"""The window: screens built when first shown, keys, notices, and an end that leaves nothing behind."""

import subprocess
import sys
import threading
from collections.abc import Callable
from dataclasses import replace

import pytest
from looking import clipped_words, visible_words
from PySide6.QtCore import Qt
from PySide6.QtGui import QShortcut
from PySide6.QtWidgets import (
    QApplication,
    QComboBox,
    QFileDialog,
    QLabel,
    QPlainTextEdit,
)
from pytestqt.qtbot import QtBot
from stage import FOLDER, RUN, analysed
from window_desk import Desk

from app.acquisition.messages import Failed, PortSettings
from app.presenters.error_reports import ErrorReport
from app.presenters.navigator import ConnectForm
from app.presenters.record.state import Action
from app.presenters.screens import Screen
from app.qt.theme import DARK, LIGHT, Theme
from app.qt.widgets.shortcuts import HelpDialog
from config.schema import WindowLayout
from tests.waiting import PATIENCE_MS


def test_what_the_first_paint_needs_loads_nothing_heavy() -> None:
    code = (
        "import app.qt.main, app.qt.start_screen, sys;print(' '.join({m.split('.')[0] for m in sys.modules}))"
    )
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert not set(loaded.split()) & {"pyqtgraph", "matplotlib", "numba", "scipy", "serial"}


def test_the_simulated_stand_is_one_click_away(desk: Desk) -> None:
    desk.click("Try with the simulated stand")
    desk.qtbot.waitUntil(lambda: "Slipstand simulator" in desk.words(), timeout=PATIENCE_MS)
    assert desk.presenter.state.screen is Screen.RECORD
    desk.launcher.engines[0].play(1.0)
    desk.qtbot.waitUntil(lambda: desk.presenter.record.state.readings.table == "0.20", timeout=PATIENCE_MS)


def test_an_amplifier_is_connected_as_filled_in(desk: Desk) -> None:
    port, protocol = (
        box for box in desk.window.findChildren(QComboBox) if box.accessibleName() in ("Port", "Protocol")
    )
    port.setCurrentText("socket://127.0.0.1:7")
    protocol.setCurrentText("csv")
    protocol.activated.emit(1)
    desk.qtbot.keyClicks(desk.field("Baud"), "x")
    desk.click("Connect my amplifier")
    assert "■ Baud 'x' is not a number above 0: write one, or leave it empty" in desk.words()
    assert clipped_words(desk.window) == []
    desk.field("Baud").clear()
    desk.qtbot.keyClicks(desk.field("Baud"), "9600")
    desk.click("Connect my amplifier")
    desk.qtbot.waitUntil(lambda: bool(desk.launcher.ports), timeout=PATIENCE_MS)
    assert desk.launcher.ports == [
        PortSettings("socket://127.0.0.1:7", "csv", baud=9600, parity="N", stop_bits=1)
    ]


def test_ports_are_offered_and_the_usual_baud_is_shown(desk: Desk) -> None:
    port = next(box for box in desk.window.findChildren(QComboBox) if box.accessibleName() == "Port")
    assert [port.itemText(i) for i in range(port.count())] == ["COM7"]
    assert desk.field("Baud").placeholderText() == "460800"
    shown = [text.text() for text in desk.window.findChildren(QLabel) if text.isVisible()]
    assert "Not verified on hardware; its manual" in shown


def test_an_error_stands_above_the_screen_until_dismissed(desk: Desk) -> None:
    desk.presenter.open_port(PortSettings("COM7", "csv"))
    desk.qtbot.waitUntil(lambda: bool(desk.presenter.start.state.connected), timeout=PATIENCE_MS)
    desk.launcher.engines[0].say(Failed("COM7 is gone. Plug it in again"))
    desk.qtbot.waitUntil(lambda: "COM7 is gone. Plug it in again" in desk.words(), timeout=PATIENCE_MS)
    assert clipped_words(desk.window) == []
    assert QApplication.activeModalWidget() is None
    desk.click("Dismiss")
    assert "COM7 is gone" not in desk.words()


def test_unfinished_runs_are_asked_about_in_words_that_fit(desk: Desk) -> None:
    desk.presenter.ask_to_recover()
    assert "Later" not in desk.words(), "there are none"
    desk.unfinished = 3
    desk.presenter.ask_to_recover()
    assert "3 runs were cut short by a crash" in desk.words()
    assert clipped_words(desk.window) == []
    desk.click("Later")
    assert desk.presenter.state.notice is None
    desk.presenter.ask_to_recover()
    desk.click("Recover")
    assert "Recovering runs" in desk.words()
    assert [(call.name, call.arguments) for call in desk.worker.calls] == [("recover_runs", (FOLDER,))]


def test_screens_are_reached_by_keys_and_built_when_first_shown(desk: Desk) -> None:
    assert list(desk.window._screens) == [Screen.START]
    desk.press_number_of(Screen.IDENTIFY)
    assert desk.presenter.state.screen is Screen.IDENTIFY
    desk.press_number_of(Screen.RECORD)
    assert desk.presenter.state.screen is Screen.RECORD
    desk.click("Connect")
    assert desk.presenter.state.screen is Screen.START


def test_a_recording_is_chosen_in_a_dialog_that_blocks_nothing(desk: Desk) -> None:
    desk.qtbot.keyClick(desk.window, Qt.Key.Key_O, Qt.KeyboardModifier.ControlModifier)
    dialog = desk.window.findChild(QFileDialog)
    assert dialog is not None
    dialog.fileSelected.emit(RUN)
    dialog.close()
    desk.worker.calls[-1].done(analysed())
    desk.qtbot.waitUntil(lambda: "Friction laws" in desk.words(), timeout=PATIENCE_MS)
    assert desk.presenter.state.screen is Screen.IDENTIFY


def test_closing_ends_engine_stand_and_worker(desk: Desk) -> None:
    desk.click("Try with the simulated stand")
    desk.qtbot.waitUntil(lambda: bool(desk.presenter.start.state.connected), timeout=PATIENCE_MS)
    desk.window.close()
    assert desk.launcher.engines[0].closed
    assert desk.launcher.simulations[0].stopped
    assert desk.worker.closed
    assert not desk.window._timer.isActive()


def test_tab_goes_through_the_start_page_in_reading_order(desk: Desk) -> None:
    desk.window.activateWindow()
    desk.button("Try with the simulated stand").setFocus()
    names = []
    for _ in range(8):
        desk.qtbot.keyClick(QApplication.focusWidget(), Qt.Key.Key_Tab)
        focused = QApplication.focusWidget()
        names.append(focused.accessibleName() or focused.text())
    assert names == [
        "Find my amplifier", "Port", "Protocol", "Baud", "Rate, Hz", "More settings", "Connect my amplifier",
        "Open a recording",
    ]  # fmt: skip


def test_what_a_port_suggests_is_filled_in(desk: Desk) -> None:
    desk.presenter.show_screen(Screen.GAUGES)
    form = ConnectForm("COM7", "csv", "57600", "80", "E", "1", "columns=table,relative", "COM8")
    desk.presenter.fill_connection(form)
    assert desk.presenter.state.screen is Screen.START
    assert desk.field("Settings").text() == "columns=table,relative"
    desk.qtbot.keyClicks(desk.field("Port of gauge 2"), "1")
    assert desk.presenter.start.state.form == replace(form, relative_port="COM81"), "nothing got lost"
    QApplication.processEvents()
    assert clipped_words(desk.window) == []


def test_a_fault_of_the_program_is_shown_with_its_details_folded(desk: Desk) -> None:
    desk.faults.report(ErrorReport("Slipstand itself failed", "Traceback\n  in nowhere"))
    desk.qtbot.waitUntil(lambda: "Slipstand itself failed" in desk.words(), timeout=PATIENCE_MS)
    (details,) = [f for f in desk.window.findChildren(QPlainTextEdit) if f.accessibleName() == "Details"]
    assert not details.isVisible()
    assert clipped_words(desk.window) == []
    desk.click("Details")
    assert details.isVisible()
    assert "in nowhere" in details.toPlainText()
    desk.click("Copy")
    assert QApplication.clipboard().text() == "Slipstand itself failed\nTraceback\n  in nowhere"
    desk.click("Hide details")
    assert not details.isVisible()
    desk.click("Dismiss")
    assert "Slipstand itself failed" not in desk.words()


def test_an_exception_in_a_slot_is_said_and_the_window_goes_on(
    desk: Desk, monkeypatch: pytest.MonkeyPatch, qtbot: QtBot
) -> None:
    monkeypatch.setattr(sys, "excepthook", sys.excepthook)
    monkeypatch.setattr(threading, "excepthook", threading.excepthook)
    with qtbot.captureExceptions():
        desk.faults.install_hooks()
        desk.button("More settings").clicked.connect(lambda: {}["nothing"])
        desk.click("More settings")
        desk.qtbot.waitUntil(lambda: "KeyError: 'nothing'" in desk.words(), timeout=PATIENCE_MS)
    desk.press_number_of(Screen.STAND)
    assert desk.presenter.state.screen is Screen.STAND


def test_f1_lists_the_keys_of_the_screen_and_of_the_window(desk: Desk) -> None:
    desk.press_number_of(Screen.RUNS)
    desk.qtbot.keyClick(desk.window, Qt.Key.Key_F1)
    (shown,) = desk.window.findChildren(HelpDialog)
    desk.qtbot.wait(1)
    words = visible_words(shown)
    assert clipped_words(shown) == []
    for expected in ("On Runs", "Ctrl+E", "Everywhere", "Ctrl+,\nSettings", "F1"):
        assert expected in words, words
    assert "Return" not in words, "the key is marked Enter"
    assert not shown.isModal()
    shown.close()


def test_no_key_goes_without_words(desk: Desk) -> None:
    for screen in Screen:
        desk.presenter.show_screen(screen)
        for shortcut in desk.window.findChildren(QShortcut):
            same = [key for key in shortcut.parent().findChildren(QShortcut) if key.whatsThis()]
            assert same, f"{shortcut.key().toString()} on {screen} is not told on F1: use add_key or give_key"


def test_the_theme_follows_the_settings(desk: Desk, theme: Theme) -> None:
    desk.presenter.settings.change(theme="dark")
    assert theme.tokens is DARK
    desk.presenter.settings.change(theme="light")
    assert theme.tokens is LIGHT


def test_the_last_screen_is_shown_again_unless_it_is_gone(theme: Theme, qtbot: QtBot) -> None:
    for left, shown in (("gauges", Screen.GAUGES), ("cinema", Screen.START)):
        desk = Desk(theme, qtbot, WindowLayout(screen=left))
        desk.window.show_last_screen()
        assert desk.presenter.state.screen is shown
        desk.window.close()


def test_the_window_tells_how_it_is_left(desk: Desk) -> None:
    places: list[WindowLayout] = []
    desk.window.closed.connect(places.append)
    desk.presenter.show_screen(Screen.RUNS)
    desk.window.close()
    assert places[0].screen == "runs"
    assert len(places[0].widths["runs"]) == 14


@pytest.mark.parametrize("width", [1024, 1280])
def test_the_window_speaks_russian(
    theme: Theme, qtbot: QtBot, use_language: Callable[[str], None], width: int
) -> None:
    use_language("ru")
    desk = Desk(theme, qtbot)
    desk.window.resize(width, 800)
    expected = {
        Screen.START: "Попробовать на модели",
        Screen.RECORD: "Подключите усилитель",
        Screen.IDENTIFY: "Здесь запись сравнивается с расчётом",
        Screen.RUNS: "Просмотр папки",
        Screen.GAUGES: "Датчик 1, стол",
        Screen.STAND: "Настройка модели стенда",
        Screen.SETTINGS: "Папка записей",
    }
    for screen, words in expected.items():
        desk.presenter.show_screen(screen)
        QApplication.processEvents()
        assert words in desk.words()
        assert clipped_words(desk.window) == []
    desk.window.close()


def test_closing_the_window_in_a_recording_asks_and_the_safe_answer_has_the_focus(desk: Desk) -> None:
    desk.click("Try with the simulated stand")
    desk.qtbot.waitUntil(lambda: bool(desk.presenter.start.state.connected), timeout=PATIENCE_MS)
    desk.presenter.record.dispatch(Action.ARM)
    desk.launcher.engines[0].play(6.0)
    desk.qtbot.waitUntil(lambda: desk.presenter.record.is_recording, timeout=PATIENCE_MS)
    desk.window.activateWindow()
    before = QApplication.focusWidget()
    desk.window.close()
    assert desk.window.isVisible()
    assert "Closing the window" in desk.words()
    assert clipped_words(desk.window._notice) == []
    assert desk.button("Go on recording").hasFocus()
    desk.qtbot.keyClick(desk.button("Go on recording"), Qt.Key.Key_Space)
    assert QApplication.focusWidget() is before
    assert desk.window.isVisible()
    desk.window.close()
    desk.click("Close the window")
    desk.qtbot.waitUntil(lambda: not desk.window.isVisible(), timeout=PATIENCE_MS)
    assert desk.launcher.engines[0].closed


def test_no_key_on_start_lets_the_simulator_take_the_place_of_an_amplifier(desk: Desk) -> None:
    desk.presenter.open_port(PortSettings("COM7", "csv"))
    desk.qtbot.waitUntil(lambda: bool(desk.presenter.start.state.connected), timeout=PATIENCE_MS)
    desk.presenter.show_screen(Screen.START)
    desk.window.activateWindow()
    assert not desk.button("Try with the simulated stand").hasFocus()
    desk.button("Try with the simulated stand").setFocus()
    desk.qtbot.keyClick(desk.button("Try with the simulated stand"), Qt.Key.Key_Space)
    assert "The simulated stand would take its place" in desk.words()
    assert clipped_words(desk.window) == []
    assert desk.button("Keep the amplifier").hasFocus()
    desk.qtbot.keyClick(desk.button("Keep the amplifier"), Qt.Key.Key_Space)
    assert desk.presenter.start.state.connected
    assert desk.launcher.simulations == []
