"""View of the Settings screen: look, recording, and the files of the other settings."""

from collections.abc import Mapping
from typing import Any

from PySide6.QtCore import QUrl
from PySide6.QtGui import QDesktopServices
from PySide6.QtWidgets import QFrame, QGridLayout, QLineEdit, QPushButton, QWidget

from app.presenters.base import Chip, Tone
from app.presenters.settings_screen import (
    LANGUAGES,
    LOG_LEVELS,
    SCALES,
    THEMES,
    SettingsFile,
    SettingsPresenter,
    SettingsState,
)
from app.qt.theme import TextRole
from app.qt.widgets.inputs import CheckBox, ComboBox, ask_for_folder, make_choice, show_texts
from app.qt.widgets.layouts import (
    STRETCH,
    Item,
    make_card,
    make_column,
    make_form_grid,
    make_row,
    make_scroll_area,
)
from app.qt.widgets.shortcuts import bind_button
from app.qt.widgets.text import break_path, label, show_chip
from messages.i18n import gettext

_WIDTH = 760


class SettingsScreen(QWidget):
    def __init__(self, presenter: SettingsPresenter) -> None:
        super().__init__()
        self._presenter = presenter
        self._state = SettingsState()
        scales = {scale: f"{scale:.0%}" for scale in SCALES}
        choices: dict[str, Mapping[Any, str]] = {
            "theme": THEMES,
            "language": LANGUAGES,
            "scale": scales,
            "log_level": LOG_LEVELS,
        }
        self._choices = {name: _choice(presenter, name, items) for name, items in choices.items()}
        self._operator = QLineEdit()
        self._recordings = QLineEdit()
        self._browse = QPushButton(gettext("Browse…"))
        self._in_use = label(muted=True, wrap=True)
        self._sounds = CheckBox(gettext("Sound at each state of a pullback"))
        self._undo = QPushButton(gettext("Undo"))
        self._message = label(wrap=True)
        self._waits = label(wrap=True)
        self._files = QGridLayout()
        self._lay_out()
        self._connect()

    def show_state(self, state: SettingsState) -> None:
        old, self._state = self._state, state
        settings = state.settings
        for name, choice in self._choices.items():
            choice.setCurrentIndex(choice.findData(getattr(settings, name)))
        show_texts({"operator": self._operator, "recordings": self._recordings}, settings)
        self._recordings.setPlaceholderText(state.recordings)
        self._sounds.setChecked(settings.sounds)
        self._undo.setEnabled(state.can_undo)
        self._in_use.setText(_folder_words(state))
        show_chip(self._message, state.message)
        waits = gettext("Language, size, folder and log change at the next start")
        show_chip(self._waits, Chip(waits if state.needs_restart else "", Tone.WARN))
        if state.files != old.files:
            self._list_files(state.files)

    def _list_files(self, files: tuple[SettingsFile, ...]) -> None:
        for row, file in enumerate(files):
            name = gettext(file.name)
            button = QPushButton(gettext("Open"))
            button.setToolTip(gettext("Open {path} in the system's editor", path=file.path))
            button.setAccessibleName(gettext("Open {name}", name=name))
            url = QUrl.fromLocalFile(file.path)
            button.clicked.connect(lambda _checked, url=url: QDesktopServices.openUrl(url))
            self._files.addWidget(label(name), row, 0)
            self._files.addWidget(label(break_path(file.path), muted=True, wrap=True), row, 1)
            self._files.addWidget(button, row, 2)

    def _choose_folder(self) -> None:
        title, start = gettext("Folder of the runs"), self._state.recordings
        ask_for_folder(self, title, start, lambda path: self._presenter.change(recordings=path))

    def _write_folder(self) -> None:
        """Apply the typed folder; the field gets its old text back if it cannot be used."""
        self._presenter.change(recordings=self._recordings.text().strip())
        self._recordings.setText(self._state.settings.recordings)

    def _connect(self) -> None:
        operator = self._operator
        operator.editingFinished.connect(lambda: self._presenter.change(operator=operator.text().strip()))
        self._recordings.editingFinished.connect(self._write_folder)
        self._browse.clicked.connect(lambda _checked: self._choose_folder())
        self._sounds.clicked.connect(lambda checked: self._presenter.change(sounds=checked))
        self._undo.clicked.connect(lambda _checked: self._presenter.undo())
        bind_button(self._undo, "Ctrl+Z", gettext("Take the last change back"), self)

    def _lay_out(self) -> None:
        page = QWidget()
        said = make_column(self._message, self._waits, spacing=6)
        undo = make_column(self._undo, STRETCH)
        make_column(
            label(gettext("Settings"), TextRole.HEADING),
            self._look_card(),
            self._record_card(),
            self._files_card(),
            make_row(undo, (said, 1), spacing=12),
            STRETCH,
            spacing=16,
            margins=(24, 24),
            of=page,
        )
        make_column(make_scroll_area(page, is_column=False), of=self)

    def _look_card(self) -> QFrame:
        fields = (
            (gettext("Theme"), self._choices["theme"]),
            (gettext("Language"), self._choices["language"]),
            (gettext("Size"), self._choices["scale"]),
        )
        return _card(gettext("Look"), "", make_form_grid(fields, wide=False))

    def _record_card(self) -> QFrame:
        self._operator.setPlaceholderText(gettext("written into each run"))
        folder = QWidget()
        make_row((self._recordings, 1), self._browse, spacing=8, of=folder)
        fields = ((gettext("Operator"), self._operator), (gettext("Folder of the runs"), folder))
        grid = make_form_grid(fields)
        self._recordings.setAccessibleName(gettext("Folder of the runs"))
        return _card(gettext("Recording"), "", grid, self._in_use, self._sounds)

    def _files_card(self) -> QFrame:
        hint = gettext("Stand and gauges are read when the window starts or a device is connected.")
        self._files.setHorizontalSpacing(12)
        self._files.setVerticalSpacing(8)
        self._files.setColumnStretch(1, 1)
        log = make_form_grid(((gettext("Log"), self._choices["log_level"]),), wide=False)
        return _card(gettext("Files"), hint, self._files, log)


def _card(title: str, hint: str, *parts: Item) -> QFrame:
    card, _ = make_card(title, hint, *parts)
    card.setMaximumWidth(_WIDTH)
    return card


def _choice(presenter: SettingsPresenter, name: str, items: Mapping[Any, str]) -> ComboBox:
    """Make a combo box that changes the setting `name`; `items` are its values and their texts."""
    made = make_choice(items)
    made.setMinimumWidth(200)
    made.activated.connect(lambda _: presenter.change(**{name: made.currentData()}))
    return made


def _folder_words(state: SettingsState) -> str:
    said = gettext("Runs are stored in {folder}", folder=break_path(state.recordings))
    if not state.override:
        return said
    return f"{said}. " + gettext("{variable} says so, whatever is chosen here", variable=state.override)
