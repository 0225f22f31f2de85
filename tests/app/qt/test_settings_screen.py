"""The settings page: choices, folder and operator reach the presenter; all words fit."""

from pathlib import Path

import pytest
from looking import clipped_words, visible_words
from PySide6.QtCore import Qt
from PySide6.QtGui import QDesktopServices
from PySide6.QtWidgets import QCheckBox, QComboBox, QFileDialog, QLineEdit, QPushButton, QWidget
from pytestqt.qtbot import QtBot

from app.presenters.settings_screen import PersonalSettings, SettingsFile, SettingsPresenter
from app.qt.settings_screen import SettingsScreen
from config.files import load_stand
from config.schema import Settings


class Page:
    def __init__(self, qtbot: QtBot) -> None:
        self.qtbot = qtbot
        self.stand_file = "/etc/slipstand/stand.toml"
        personal = PersonalSettings(
            recordings="/recordings",
            override="SLIPSTAND_RECORDINGS",
            list_files=lambda: (SettingsFile("Stand", self.stand_file),),
        )
        self.presenter = SettingsPresenter(personal, lambda _: None)
        self.view = SettingsScreen(self.presenter)
        qtbot.addWidget(self.view)
        self.presenter.attach(self.view)
        self.view.show()

    @property
    def settings(self) -> Settings:
        return self.presenter.state.settings

    def find(self, kind: type, name: str) -> QWidget:
        (found,) = [
            part for part in self.view.findChildren(kind) if name in (part.accessibleName(), text(part))
        ]
        return found


def text(part: QWidget) -> str:
    return part.text() if isinstance(part, QPushButton | QCheckBox) else ""


@pytest.fixture
def page(qtbot: QtBot) -> Page:
    return Page(qtbot)


@pytest.mark.parametrize(
    ("name", "words", "field", "value"),
    [
        ("Theme", "Dark", "theme", "dark"),
        ("Language", "Русский", "language", "ru"),
        ("Size", "150\u202f%", "scale", 1.5),
    ],
)
def test_a_choice_holds(page: Page, name: str, words: str, field: str, value: object) -> None:
    box = page.find(QComboBox, name)
    assert isinstance(box, QComboBox)
    box.setCurrentText(words)
    box.activated.emit(box.currentIndex())
    assert getattr(page.settings, field) == value
    waits = "change at the next start" in visible_words(page.view)
    assert waits == (field != "theme")


def test_the_operator_is_taken_when_the_field_is_left_and_given_back_by_undo(page: Page) -> None:
    field = page.find(QLineEdit, "Operator")
    assert isinstance(field, QLineEdit)
    page.qtbot.keyClicks(field, "Anna ")
    assert page.settings.operator == ""
    page.qtbot.keyClick(field, Qt.Key.Key_Return)
    assert page.settings.operator == "Anna"
    page.qtbot.mouseClick(page.find(QPushButton, "Undo"), Qt.MouseButton.LeftButton)
    assert page.settings.operator == field.text() == ""


def test_sounds_are_switched(page: Page) -> None:
    box = page.find(QCheckBox, "Sound at each state of a pullback")
    page.qtbot.keyClick(box, Qt.Key.Key_Space)
    assert page.settings.sounds


def test_a_folder_is_chosen_or_refused_in_words(page: Page, tmp_path: Path) -> None:
    page.qtbot.mouseClick(page.find(QPushButton, "Browse…"), Qt.MouseButton.LeftButton)
    dialog = page.view.findChild(QFileDialog)
    assert dialog is not None
    dialog.fileSelected.emit(str(tmp_path))
    dialog.close()
    assert page.settings.recordings == str(tmp_path)
    field = page.find(QLineEdit, "Folder of the runs")
    assert isinstance(field, QLineEdit)
    field.setText("runs")
    page.qtbot.keyClick(field, Qt.Key.Key_Return)
    assert field.text() == str(tmp_path)
    assert "Folder runs is no full path" in visible_words(page.view)
    assert "SLIPSTAND_RECORDINGS says so" in visible_words(page.view)


def test_files_are_opened_by_the_system(page: Page, monkeypatch: pytest.MonkeyPatch) -> None:
    opened = []
    monkeypatch.setattr(QDesktopServices, "openUrl", opened.append)
    page.qtbot.mouseClick(page.find(QPushButton, "Open Stand"), Qt.MouseButton.LeftButton)
    assert [url.toLocalFile() for url in opened] == ["/etc/slipstand/stand.toml"]


def test_another_file_of_the_stand_is_the_one_that_is_opened(
    page: Page, monkeypatch: pytest.MonkeyPatch
) -> None:
    page.stand_file = "/home/me/stand.toml"
    page.presenter.on_stand(load_stand())
    page.qtbot.wait(1)
    opened: list[str] = []
    monkeypatch.setattr(QDesktopServices, "openUrl", lambda url: opened.append(url.toLocalFile()))
    page.qtbot.mouseClick(page.find(QPushButton, "Open Stand"), Qt.MouseButton.LeftButton)
    assert opened == ["/home/me/stand.toml"]
    assert "/home/me/stand.toml" in visible_words(page.view).replace("\u200b", "")


@pytest.mark.parametrize("size", [(932, 600), (1188, 760), (1828, 1040)])
def test_all_words_fit(page: Page, size: tuple[int, int]) -> None:
    page.view.resize(*size)
    page.qtbot.wait(1)
    assert clipped_words(page.view) == []
