"""The menu of the program: reached by key, with About, documentation and log."""

from pathlib import Path

import pytest
from looking import clipped_words, visible_words
from PySide6.QtCore import Qt, qVersion
from PySide6.QtGui import QAction, QDesktopServices
from PySide6.QtWidgets import QApplication, QMenu, QPushButton
from window_desk import Desk

from app.log import FOLDER_VARIABLE
from app.qt.menu import AboutDialog
from app.version import version_text
from tests.waiting import PATIENCE_MS


def action(desk: Desk, text: str) -> QAction:
    menu = desk.window._menu.menu()
    (found,) = [entry for entry in menu.actions() if entry.text() == text]
    return found


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    addresses: list[str] = []
    monkeypatch.setattr(QDesktopServices, "openUrl", lambda url: addresses.append(url.toLocalFile()))
    return addresses


def test_the_menu_opens_by_key_and_its_entries_are_chosen_by_arrows(desk: Desk) -> None:
    texts: list[str] = []

    def choose() -> None:
        (menu,) = [
            part for part in QApplication.topLevelWidgets() if isinstance(part, QMenu) and part.isVisible()
        ]
        for key in (Qt.Key.Key_Down, Qt.Key.Key_Up, Qt.Key.Key_Escape):
            desk.qtbot.keyClick(menu, key)
            if menu.activeAction() is not None:
                texts.append(menu.activeAction().text())

    desk.window._menu.menu().aboutToShow.connect(lambda: desk.window._timer.singleShot(0, choose))
    desk.qtbot.keyClick(desk.window, Qt.Key.Key_F10)
    desk.qtbot.waitUntil(lambda: bool(texts), timeout=PATIENCE_MS)
    assert texts[:2] == ["Keys", "Quit"]


def test_about_names_version_licences_and_qt(desk: Desk) -> None:
    action(desk, "About Slipstand").trigger()
    (dialog,) = desk.window.findChildren(AboutDialog)
    desk.qtbot.wait(1)
    words = visible_words(dialog)
    for expected in (f"Slipstand {version_text()}", "Licence: MIT", f"Qt {qVersion()}", "numpy", "LGPL-3.0"):
        assert expected in words
    assert clipped_words(dialog) == []
    assert not dialog.isModal()
    (copy,) = [button for button in dialog.findChildren(QPushButton) if button.text() == "Copy versions"]
    copy.click()
    assert QApplication.clipboard().text().startswith(f"Slipstand {version_text()}\nPython ")
    dialog.close()


def test_documentation_and_log_are_opened(
    desk: Desk, opened: list[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv(FOLDER_VARIABLE, str(tmp_path))
    action(desk, "Documentation").trigger()
    action(desk, "Log file").trigger()
    (tmp_path / "window.log").write_text("it started")
    action(desk, "Log file").trigger()
    assert Path(opened[0]).parts[-2:] == ("docs", "README.md")
    assert [Path(path) for path in opened[1:]] == [tmp_path, tmp_path / "window.log"]


def test_the_title_names_device_and_state(desk: Desk) -> None:
    assert desk.window.windowTitle() == "Slipstand"
    desk.click("Try with the simulated stand")
    desk.qtbot.waitUntil(
        lambda: desk.window.windowTitle() == "Slipstand simulator \u2013 ready \u2013 Slipstand",
        timeout=PATIENCE_MS,
    )


def test_ctrl_q_closes_the_window(desk: Desk) -> None:
    desk.qtbot.keyClick(desk.window, Qt.Key.Key_Q, Qt.KeyboardModifier.ControlModifier)
    assert not desk.window.isVisible()
