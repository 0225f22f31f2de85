"""View of the Settings screen: look, recording, and the files of the other settings."""

from collections.abc import Callable

from PySide6.QtCore import QUrl
from PySide6.QtGui import QDesktopServices
from PySide6.QtWidgets import QFrame, QGridLayout, QLineEdit, QPushButton, QWidget

from app.presenters.base import Chip, Tone
from app.presenters.settings_screen import (
    CHOICES,
    PersonalSettings,
    SettingsFile,
    SettingsPresenter,
    SettingsState,
)
from app.qt.theme import TextRole
from app.qt.widgets.inputs import (
    CheckBox,
    ComboBox,
    ask_for_folder,
    make_button,
    make_choice,
    show_default,
    show_texts,
)
from app.qt.widgets.layouts import (
    STRETCH,
    Item,
    clear,
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
    """Draws `SettingsState`; `edit_stand` opens the settings of the stand."""

    def __init__(self, presenter: SettingsPresenter, edit_stand: Callable[[], None] = lambda: None) -> None:
        super().__init__()
        self._presenter = presenter
        self._choices = {name: self._choice(name) for name in CHOICES}
        self._operator = QLineEdit()
        self._recordings = QLineEdit()
        show_default(self._recordings, presenter.personal.recordings)
        self._sounds = CheckBox(gettext("Sound at each state of a pullback"))
        self._simulated = CheckBox(gettext("Simulated runs count in the plan and on Campaign"))
        self._connects = CheckBox(gettext("Connect to the last amplifier at the start"))
        self._stand = make_button(gettext("Edit the stand…"), edit_stand)
        self._undo = make_button(gettext("Undo"), presenter.undo)
        self._files = QGridLayout()
        self._shown_files: tuple[SettingsFile, ...] = ()
        self._message = label(wrap=True)
        self._waits = label(wrap=True)
        self._lay_out()
        self._operator.editingFinished.connect(
            lambda: presenter.change(operator=self._operator.text().strip())
        )
        self._recordings.editingFinished.connect(self._write_folder)
        self._sounds.clicked.connect(lambda checked: presenter.change(sounds=checked))
        self._simulated.clicked.connect(lambda checked: presenter.change(count_simulated=checked))
        self._connects.clicked.connect(lambda checked: presenter.change(connect_at_start=checked))
        words = gettext("Masses, pullbacks, contacts and added masses of the stand")
        bind_button(self._stand, "Alt+E", words, self)
        bind_button(self._undo, "Ctrl+Z", gettext("Take the last change back"), self)

    def show_state(self, state: SettingsState) -> None:
        settings = state.settings
        if state.files != self._shown_files:
            self._shown_files = state.files
            self._show_files(state.files)
        for name, choice in self._choices.items():
            choice.setCurrentIndex(choice.findData(getattr(settings, name)))
        show_texts({"operator": self._operator, "recordings": self._recordings}, settings)
        self._sounds.setChecked(settings.sounds)
        self._simulated.setChecked(settings.count_simulated)
        self._connects.setChecked(settings.connect_at_start)
        self._undo.setEnabled(state.can_undo)
        show_chip(self._message, state.message)
        waits = gettext("Language, size, unit, folder and log change at the next start")
        show_chip(self._waits, Chip(waits if state.needs_restart else "", Tone.WARN))

    def _choice(self, name: str) -> ComboBox:
        choice = make_choice(CHOICES[name])
        choice.setMinimumWidth(200)
        choice.activated.connect(lambda _: self._presenter.change(**{name: choice.currentData()}))
        return choice

    def _choose_folder(self) -> None:
        title, start = gettext("Folder of the runs"), self._presenter.personal.recordings
        ask_for_folder(self, title, start, lambda path: self._presenter.change(recordings=path))

    def _write_folder(self) -> None:
        """Apply the typed folder; the field gets its old text back if it cannot be used."""
        self._presenter.change(recordings=self._recordings.text().strip())
        self._recordings.setText(self._presenter.state.settings.recordings)

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
            (gettext("Displacements in"), self._choices["displacement_unit"]),
        )
        return _card(gettext("Look"), "", make_form_grid(fields, wide=False))

    def _record_card(self) -> QFrame:
        self._operator.setPlaceholderText(gettext("written into each run"))
        folder = QWidget()
        browse = make_button(gettext("Browse…"), self._choose_folder)
        make_row((self._recordings, 1), browse, spacing=8, of=folder)
        fields = ((gettext("Operator"), self._operator), (gettext("Folder of the runs"), folder))
        grid = make_form_grid(fields)
        self._recordings.setAccessibleName(gettext("Folder of the runs"))
        in_use = label(_folder_words(self._presenter.personal), muted=True, wrap=True)
        switches = self._sounds, self._simulated, self._connects
        return _card(gettext("Recording"), "", grid, in_use, *switches)

    def _files_card(self) -> QFrame:
        hint = gettext("Stand and gauges are read when the window starts or a device is connected.")
        self._files.setHorizontalSpacing(12)
        self._files.setVerticalSpacing(8)
        self._files.setColumnStretch(1, 1)
        more = ((gettext("Stand"), self._stand), (gettext("Log"), self._choices["log_level"]))
        return _card(gettext("Files"), hint, self._files, make_form_grid(more, wide=False))

    def _show_files(self, files: tuple[SettingsFile, ...]) -> None:
        clear(self._files)
        for row, file in enumerate(files):
            self._files.addWidget(label(gettext(file.name)), row, 0)
            self._files.addWidget(label(break_path(file.path), muted=True, wrap=True), row, 1)
            self._files.addWidget(_open_button(file), row, 2)


def _card(title: str, hint: str, *parts: Item) -> QFrame:
    card, _ = make_card(title, hint, *parts)
    card.setMaximumWidth(_WIDTH)
    return card


def _open_button(file: SettingsFile) -> QPushButton:
    hint = gettext("Open {path} in the system's editor", path=file.path)
    url = QUrl.fromLocalFile(file.path)
    button = make_button(gettext("Open"), lambda: QDesktopServices.openUrl(url), hint)
    button.setAccessibleName(gettext("Open {name}", name=gettext(file.name)))
    return button


def _folder_words(personal: PersonalSettings) -> str:
    said = gettext("Runs are stored in {folder}", folder=break_path(personal.recordings))
    if not personal.override:
        return said
    return f"{said}. " + gettext("{variable} says so, whatever is chosen here", variable=personal.override)
