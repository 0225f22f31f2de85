"""The Start screen: last amplifier and recent runs at one click, and amplifiers found on the ports."""

from pathlib import Path

import pytest
from looking import clipped_words, visible_words
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QAbstractButton, QApplication, QPushButton
from pytestqt.qtbot import QtBot
from stage import FOLDER, Call
from window_desk import Desk

from app.acquisition.messages import PortSettings
from app.presenters.base import Chip, Tone
from app.presenters.gauges.state import PortCard
from app.presenters.navigator import ConnectForm
from app.presenters.screens import Screen
from app.qt.find_dialog import FindDialog
from app.qt.theme import Theme
from config.schema import RecentDevice, RecentUse
from tests.waiting import PATIENCE_MS

LAST = RecentDevice("ME GSV-8 S/N 12345678", "/dev/serial/by-id/usb-FTDI_FT232R_A9001-if00", "csv")
RUNS = tuple(str(Path(FOLDER, f"20260112T1015{number:02d}_1FFM0_{number:03d}.h5")) for number in range(6))


@pytest.fixture
def recent(request: pytest.FixtureRequest) -> RecentUse | None:
    return getattr(request, "param", RecentUse(LAST, RUNS))


def test_the_last_amplifier_is_connected_with_one_key(desk: Desk) -> None:
    assert f"{LAST.name} on {LAST.port}" in desk.words().replace("\u200b", "")
    desk.qtbot.keyClick(desk.window, Qt.Key.Key_A, Qt.KeyboardModifier.AltModifier)
    desk.qtbot.waitUntil(lambda: bool(desk.launcher.ports), timeout=PATIENCE_MS)
    assert desk.launcher.ports == [PortSettings(LAST.port, "csv", parity="N", stop_bits=1)]


def test_without_a_last_amplifier_nothing_offers_one(theme: Theme, qtbot: QtBot) -> None:
    made = Desk(theme, qtbot)
    assert "Connect again" not in made.words()
    assert "Recent runs" not in made.words()
    made.window.close()


def test_a_recent_run_is_opened_with_one_click(desk: Desk) -> None:
    desk.click("20260112T101503_1FFM0_003")
    assert desk.presenter.state.screen is Screen.IDENTIFY
    assert desk.worker.calls[-1].arguments == (RUNS[3],)
    desk.presenter.show_screen(Screen.START)
    assert desk.presenter.start.state.runs[0] == RUNS[3]


@pytest.mark.parametrize("size", [(1024, 640), (1280, 800), (1920, 1080)])
def test_all_words_fit(desk: Desk, size: tuple[int, int]) -> None:
    desk.window.resize(*size)
    QApplication.processEvents()
    assert clipped_words(desk.window) == []


def find(desk: Desk) -> tuple[FindDialog, Call]:
    desk.qtbot.keyClick(desk.window, Qt.Key.Key_F, Qt.KeyboardModifier.AltModifier)
    (dialog,) = desk.window.findChildren(FindDialog)
    assert dialog.isVisible()
    assert not dialog.isModal()
    probe = desk.presenter.gauges.ports._worker.calls[-1]  # type: ignore[attr-defined]
    assert (probe.name, probe.arguments) == ("probe_ports", (False, ""))
    return dialog, probe


def test_an_amplifier_that_is_found_is_connected_by_enter(desk: Desk) -> None:
    dialog, probe = find(desk)
    found = Chip("GSV-8 at 115200 baud 8N1", Tone.OK)
    held = "in use by minicom (process 812): close that program, and look again"
    probe.done(
        (
            PortCard("COM3", "FTDI", Chip("in use by another program", Tone.WARN), (held,)),
            PortCard("COM7", "FTDI", found, ("2 gauges",), ConnectForm("COM7", "gsv", "115200")),
        )
    )
    assert held in visible_words(dialog)
    assert clipped_words(dialog) == []
    (connect,) = [button for button in dialog.findChildren(QPushButton) if button.text() == "Connect"]
    assert dialog.focusWidget() is connect
    dialog.activateWindow()
    desk.qtbot.waitUntil(dialog.isActiveWindow)
    desk.qtbot.keyClick(connect, Qt.Key.Key_Return)
    assert not dialog.isVisible()
    assert desk.presenter.state.screen is Screen.RECORD
    desk.qtbot.waitUntil(lambda: bool(desk.launcher.ports), timeout=PATIENCE_MS)
    assert desk.launcher.ports == [PortSettings("COM7", "gsv", 115200, "N", 1)]


def test_a_device_of_one_gauge_is_filled_in_and_not_connected(desk: Desk) -> None:
    dialog, probe = find(desk)
    form = ConnectForm("COM7", "csv")
    probe.done((PortCard("COM7", status=Chip("scale"), suggested_form=form, needs_second=True),))
    assert [b.text() for b in dialog.findChildren(QPushButton) if b.text().startswith("Connect")] == []
    (use,) = [button for button in dialog.findChildren(QPushButton) if button.text() == "Use this port"]
    desk.qtbot.mouseClick(use, Qt.MouseButton.LeftButton)
    assert not dialog.isVisible()
    assert desk.presenter.start.state.form == form


def test_enter_does_not_stop_a_look_that_has_begun(desk: Desk) -> None:
    dialog, _ = find(desk)
    dialog.activateWindow()
    desk.qtbot.waitUntil(dialog.isActiveWindow)
    assert not isinstance(dialog.focusWidget(), QAbstractButton)
    desk.qtbot.keyClick(dialog.focusWidget(), Qt.Key.Key_Return)
    assert desk.presenter.gauges.ports._worker.cancelled == 0  # type: ignore[attr-defined]
    assert dialog.isVisible()


def test_closing_the_dialog_stops_looking(desk: Desk) -> None:
    dialog, _ = find(desk)
    desk.qtbot.keyClick(dialog, Qt.Key.Key_Escape)
    assert desk.presenter.gauges.ports._worker.cancelled == 1  # type: ignore[attr-defined]


@pytest.mark.parametrize("key", [Qt.Key.Key_Return, Qt.Key.Key_Enter])
def test_enter_connects_as_the_coloured_button_says(desk: Desk, key: Qt.Key) -> None:
    assert desk.button("Connect again").property("primary") == "true"
    assert desk.button("Try with the simulated stand").property("primary") == "false"
    desk.qtbot.keyClick(desk.window, key)
    desk.qtbot.waitUntil(lambda: bool(desk.presenter.start.state.connected), timeout=PATIENCE_MS)
    desk.presenter.show_screen(Screen.START)
    assert desk.button("Connect again").property("primary") == "false"
    desk.qtbot.keyClick(desk.window, key)
    assert [port.url for port in desk.launcher.ports] == [LAST.port]


@pytest.mark.parametrize("recent", [None], indirect=True)
def test_enter_at_the_first_start_tries_the_simulated_stand(desk: Desk) -> None:
    desk.qtbot.waitUntil(desk.window.isActiveWindow)
    assert desk.button("Try with the simulated stand").property("primary") == "true"
    desk.qtbot.keyClick(desk.window, Qt.Key.Key_Return)
    desk.qtbot.waitUntil(lambda: bool(desk.presenter.start.state.connected), timeout=PATIENCE_MS)
    assert len(desk.launcher.simulations) == 1


def test_enter_in_a_field_connects_what_is_filled_in(desk: Desk) -> None:
    desk.field("Baud").setFocus()
    desk.qtbot.keyClicks(desk.field("Baud"), "9600")
    desk.qtbot.keyClick(desk.field("Baud"), Qt.Key.Key_Return)
    desk.qtbot.waitUntil(lambda: bool(desk.launcher.ports), timeout=PATIENCE_MS)
    assert [port.baud for port in desk.launcher.ports] == [9600]
    assert desk.launcher.simulations == []
