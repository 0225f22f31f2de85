"""The import dialog: what is filled in reaches the presenter, what becomes of it is drawn, all words fit."""

from collections.abc import Callable

import numpy as np
import pytest
from looking import clipped_words, visible_words
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QComboBox, QLineEdit, QPlainTextEdit, QPushButton, QToolButton, QWidget
from pytestqt.qtbot import QtBot
from stage import FakeWorker

from app.presenters.runs.import_presenter import ImportPresenter
from app.presenters.runs.state import ImportPreview, Overlay, SizeQuestion, Trace
from app.qt.runs.import_dialog import ImportDialog
from app.qt.theme import Theme
from app.runs.exchange.recognition import FilePreview, FileSurvey, ParseOptions
from messages.message import message

COLUMNS = FilePreview(
    ("t", "u1", "2"), ("t", "u1", "u1"), (("0", "1", "2"),), ParseOptions(";", ",", 0, True), "t", "u1", "",
    "relative", "s", "mm", units=("s", "mm", ""), numbers=(0, 1, 2),
)  # fmt: skip
FOUND = FileSurvey(("a logger", "t;u1;u1", "0;1;2"), "utf-16-le", COLUMNS)
TIME_S = np.linspace(0.0, 1.0, 50)
PREVIEW = ImportPreview(Overlay((Trace("a", TIME_S, TIME_S, None),), "time, s"), "50 samples, 1 s")


class Stage:
    def __init__(self, theme: Theme, qtbot: QtBot, survey: FileSurvey = FOUND) -> None:
        self.qtbot = qtbot
        self.worker = FakeWorker()
        self.asked = self.worker.calls
        self.presenter = ImportPresenter(self.worker, lambda _run: None)  # type: ignore[arg-type]
        self.owner = QWidget()
        qtbot.addWidget(self.owner)
        self.dialog = ImportDialog(theme, self.presenter, self.owner)
        self.presenter.attach(self.dialog)
        self.presenter.open(("/far/a.csv", "/far/b.csv"), "/runs", "Anna")
        self.dialog.show()
        self.answer(survey)
        if survey.preview:
            self.answer(PREVIEW)

    def answer(self, answer: object) -> None:
        self.asked[-1].done(answer)

    def set_form(self, **texts: str) -> None:
        self.presenter.set_form({**self.presenter.state.form, **texts})

    def find(self, kind: type, name: str) -> QWidget:
        (found,) = [part for part in self.dialog.findChildren(kind) if part.accessibleName() == name]
        return found

    def choose(self, name: str, words: str) -> None:
        box = self.find(QComboBox, name)
        assert isinstance(box, QComboBox)
        box.setCurrentText(words)
        box.activated.emit(box.currentIndex())

    def button(self, text: str) -> QPushButton:
        (found,) = [b for b in self.dialog.findChildren(QPushButton) if b.text() == text]
        return found


@pytest.fixture
def stage(theme: Theme, qtbot: QtBot) -> Stage:
    return Stage(theme, qtbot)


def test_the_file_is_shown_with_its_columns_and_first_lines(stage: Stage) -> None:
    words = visible_words(stage.dialog)
    for expected in ("Import a.csv", "1 more file", "50 samples, 1 s"):
        assert expected in words
    head = stage.find(QPlainTextEdit, "First lines of the file")
    assert isinstance(head, QPlainTextEdit)
    assert head.toPlainText().splitlines() == ["a logger", "t;u1;u1", "0;1;2"]
    assert "First lines of the file, read as UTF-16 LE" in words
    assert not stage.dialog.isModal()
    stage.dialog.resize(900, 600)
    stage.qtbot.wait(1)
    assert clipped_words(stage.dialog) == []


def test_choices_and_fields_are_read_anew(stage: Stage) -> None:
    second = stage.find(QComboBox, "Gauge 2")
    assert isinstance(second, QComboBox)
    second.setCurrentIndex(3)
    second.activated.emit(3)
    assert stage.asked[-1].name == "preview_import"
    assert stage.asked[-1].arguments[1]["second"] == "2"
    stage.answer(PREVIEW)
    assert not stage.find(QLineEdit, "Gain").isEnabled()
    stage.choose("Unit", "by a gain")
    stage.answer(PREVIEW)
    field = stage.find(QLineEdit, "Gain")
    assert field.isEnabled()
    stage.qtbot.keyClicks(field, "2")
    stage.qtbot.keyClick(field, Qt.Key.Key_Return)
    assert stage.presenter.state.form["gain"] == "2"
    assert stage.dialog.isVisible(), "Enter in a field is no decision"


def test_a_file_is_imported_and_the_next_comes(stage: Stage) -> None:
    stage.qtbot.mouseClick(stage.button("Import"), Qt.MouseButton.LeftButton)
    assert stage.asked[-1].name == "import_file"
    assert not stage.button("Import").isEnabled()
    stage.answer("/runs/a.h5")
    assert "Import b.csv" in visible_words(stage.dialog)
    stage.qtbot.mouseClick(stage.button("Leave out"), Qt.MouseButton.LeftButton)
    assert "No file is left to import" in visible_words(stage.dialog)


QUESTION = SizeQuestion("Gauge 1 moves by 24 m, more than its range of 33 mm. Is the file in mm?", "mm", "mm")


def test_an_unlikely_size_is_asked_about_and_the_likely_unit_stands_first(stage: Stage) -> None:
    stage.set_form(unit="m")
    stage.answer(ImportPreview(PREVIEW.overlay, "50 samples", QUESTION))
    assert "▲ Gauge 1 moves by 24 m, more than its range of 33 mm. Is the file in mm?" in visible_words(
        stage.dialog
    )
    assert not stage.button("Import").isEnabled()
    likely, right = stage.button("Read as mm"), stage.button("It is right")
    assert likely.x() < right.x()
    for width in (900, 1000):
        stage.dialog.resize(width, 592)
        stage.qtbot.wait(1)
        assert clipped_words(stage.dialog) == []
    stage.qtbot.mouseClick(likely, Qt.MouseButton.LeftButton)
    assert stage.presenter.state.form["unit"] == "mm"
    assert not likely.isVisible()
    stage.answer(PREVIEW)
    assert stage.button("Import").isEnabled()


@pytest.mark.parametrize(("key", "changes"), [("U", {"unit": "mm"}), ("Y", {"any_size": "yes"})])
def test_the_question_is_answered_by_keys(stage: Stage, key: str, changes: dict[str, str]) -> None:
    stage.set_form(unit="m")
    stage.answer(ImportPreview(PREVIEW.overlay, "50 samples", QUESTION))
    stage.dialog.activateWindow()
    stage.qtbot.waitUntil(stage.dialog.isActiveWindow)
    stage.qtbot.keyClick(stage.dialog, getattr(Qt.Key, f"Key_{key}"), Qt.KeyboardModifier.AltModifier)
    assert stage.asked[-1].arguments[1] == stage.presenter.state.form | changes
    assert stage.presenter.state.form["unit"] == changes.get("unit", "m")


def test_without_a_likely_unit_only_the_size_can_be_confirmed(stage: Stage) -> None:
    stage.set_form(unit="m")
    stage.answer(ImportPreview(PREVIEW.overlay, "50 samples", SizeQuestion("Is that right?")))
    assert stage.button("It is right").isVisible()
    assert not stage.button("Read as ").isVisible()


def test_lines_are_shown_where_no_columns_are_found(theme: Theme, qtbot: QtBot) -> None:
    stage = Stage(theme, qtbot, FileSurvey(("no table", "at all"), "cp1251", fault=message("no columns")))
    lines = stage.find(QPlainTextEdit, "First lines of the file")
    assert isinstance(lines, QPlainTextEdit)
    assert lines.toPlainText() == "no table\nat all"
    assert "First lines of the file, read as Windows-1251 (Cyrillic)" in visible_words(stage.dialog)
    assert stage.find(QComboBox, "Encoding").isEnabled()


def test_settings_that_are_taken_over_are_told(stage: Stage) -> None:
    stage.qtbot.mouseClick(stage.button("Import"), Qt.MouseButton.LeftButton)
    stage.answer("/runs/a.h5")
    stage.answer(FOUND)
    assert "Columns and units are those of a.csv: its settings are taken over" in visible_words(stage.dialog)


def test_the_dialog_is_within_the_screen(stage: Stage) -> None:
    screen = stage.dialog.screen().availableSize()
    assert stage.dialog.width() < screen.width()
    assert stage.dialog.height() < screen.height()
    fields = [stage.find(QComboBox, name) for name in ("Gauge 1, table", "Gauge 2")]
    assert fields[1].y() - fields[0].y() == 40, "room for faults that there are none of"


def test_closing_leaves_the_rest_out(stage: Stage) -> None:
    stage.qtbot.mouseClick(stage.button("Close"), Qt.MouseButton.LeftButton)
    assert not stage.dialog.isVisible()
    assert stage.presenter.state.path == ""


def unfold(stage: Stage) -> None:
    (fold,) = [button for button in stage.dialog.findChildren(QToolButton) if button.text() == "More"]
    stage.qtbot.mouseClick(fold, Qt.MouseButton.LeftButton)


def test_what_is_rare_is_under_a_fold_and_the_preview_stays(stage: Stage) -> None:
    field = stage.find(QLineEdit, "Temperature, °C")
    assert not field.isVisible()
    unfold(stage)
    assert field.isVisible()
    asked = len(stage.asked)
    stage.qtbot.keyClicks(field, "21,5")
    stage.qtbot.keyClick(field, Qt.Key.Key_Return)
    assert stage.presenter.state.form["temperature_c"] == "21,5"
    assert len(stage.asked) == asked, "the weather is read from no file"
    assert stage.button("Import").isEnabled()
    stage.dialog.resize(900, 600)
    stage.qtbot.wait(1)
    assert clipped_words(stage.dialog) == []
    unfold(stage)
    assert not field.isVisible()


def test_a_fault_is_said_under_its_field_even_in_the_fold(stage: Stage) -> None:
    stage.set_form(humidity_percent="120", plate_mass_kg="none")
    words = visible_words(stage.dialog)
    assert "120 cannot be. Give 0 to 100, or leave it out" in words
    assert "none is no number above 0" in words
    assert "Correct what is marked" in words
    assert not stage.button("Import").isEnabled()
    assert "50 samples, 1 s" in words, "the preview stays"
    stage.set_form(humidity_percent="12", plate_mass_kg="")
    assert "cannot be" not in visible_words(stage.dialog)
    assert stage.button("Import").isEnabled()


def test_what_is_being_typed_is_neither_lost_nor_left_out(stage: Stage) -> None:
    note = stage.find(QLineEdit, "Note")
    assert isinstance(note, QLineEdit)
    stage.dialog.activateWindow()
    note.setFocus()
    stage.qtbot.waitUntil(note.hasFocus)
    stage.qtbot.keyClicks(note, "wet")
    stage.set_form(table="t")
    stage.answer(PREVIEW)
    assert note.text() == "wet"
    stage.qtbot.keyClick(note, Qt.Key.Key_Return, Qt.KeyboardModifier.ControlModifier)
    assert stage.asked[-1].name == "import_file"
    assert stage.asked[-1].arguments[1]["note"] == "wet"
    stage.answer("/runs/a.h5")
    assert note.text() == "", "the next file has a note of its own"


def test_longer_words_of_another_language_fit_too(
    theme: Theme, qtbot: QtBot, use_language: Callable[[str], None]
) -> None:
    use_language("ru")
    stage = Stage(theme, qtbot)
    stage.set_form(humidity_percent="120", plate_mass_kg="-3")
    assert "120 не годится. Задайте от 0 до 100 или оставьте пустым" in visible_words(stage.dialog)
    stage.dialog.resize(900, 600)
    qtbot.wait(1)
    assert clipped_words(stage.dialog) == []
