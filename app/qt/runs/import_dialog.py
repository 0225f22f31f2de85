"""The import dialog: columns, units and lines of a foreign file, and beside them what becomes of it."""

from pathlib import Path

from PySide6.QtCore import Qt
from PySide6.QtGui import QFontDatabase
from PySide6.QtWidgets import QDialog, QHBoxLayout, QPlainTextEdit, QPushButton, QVBoxLayout, QWidget

from app.presenters.base import Chip
from app.presenters.runs.import_presenter import ImportPresenter, ImportState, pending_text
from app.qt.runs.import_fields import ImportFields
from app.qt.runs.preview import RunsPreview
from app.qt.theme import TextRole, Theme
from app.qt.widgets.layouts import make_column, make_scroll_area
from app.qt.widgets.shortcuts import bind_button
from app.qt.widgets.text import label, show_chip
from messages.i18n import gettext

_COLUMN_WIDTH = 384
_HEAD_HEIGHT = 132


class ImportDialog(QDialog):
    """Draws `ImportState`. It stays beside the window and stops nothing."""

    def __init__(self, theme: Theme, presenter: ImportPresenter, parent: QWidget) -> None:
        super().__init__(parent)
        self._presenter = presenter
        self._shown = ImportState()
        self._title = label(role=TextRole.HEADING)
        self._waiting = label(muted=True)
        self._fields = ImportFields()
        self._preview = RunsPreview(theme)
        self._words = label(wrap=True)
        self._head = QPlainTextEdit()
        self._message = label(wrap=True)
        self._import = QPushButton(gettext("Import"))
        self._leave = QPushButton(gettext("Leave out"))
        self._close = QPushButton(gettext("Close"))
        self._lay_out()
        self._connect()

    def show_state(self, state: ImportState) -> None:
        old, self._shown = self._shown, state
        name = Path(state.path).name
        self._title.setText(
            gettext("Import {name}", name=name) if name else gettext("No file is left to import")
        )
        self._waiting.setText(pending_text(state))
        self._fields.show_state(state)
        if state.overlay is not old.overlay:
            self._preview.show_overlay(state.overlay)
        self._words.setText(state.summary)
        if state.first_rows != old.first_rows:
            self._head.setPlainText(state.first_rows)
        show_chip(self._message, Chip(state.busy) if state.busy else state.message)
        self._message.show()  # an empty one still keeps the buttons at the right
        self._import.setEnabled(state.can_import)
        self._leave.setEnabled(bool(state.path))

    def reject(self) -> None:
        self._presenter.close()
        super().reject()

    def _connect(self) -> None:
        self._fields.changed.connect(self._presenter.set_form)
        self._import.clicked.connect(lambda _checked: self._take())
        self._leave.clicked.connect(lambda _checked: self._presenter.skip_file())
        self._close.clicked.connect(self.reject)
        bind_button(
            self._import, "Ctrl+Return", gettext("Make a run of the file, and go on with the next"), self
        )
        bind_button(self._leave, "Alt+L", gettext("Leave this file out, and go on with the next"), self)

    def _take(self) -> None:
        self._fields.fill()  # by its key the button takes no focus from a field
        self._presenter.import_file()

    def _lay_out(self) -> None:
        self.setWindowTitle(gettext("Import"))
        self.resize(1000, 660)
        top = QHBoxLayout()
        top.addWidget(self._title, 1)
        top.addWidget(self._waiting)
        middle = QHBoxLayout()
        middle.setSpacing(16)
        left = make_scroll_area(self._fields, is_column=False)
        left.setFixedWidth(_COLUMN_WIDTH)
        middle.addWidget(left)
        middle.addLayout(self._right(), 1)
        buttons = QHBoxLayout()
        buttons.setSpacing(8)
        buttons.addWidget(self._message, 1)
        for button in (self._import, self._leave, self._close):
            button.setAutoDefault(False)  # Enter in a field takes the field
            buttons.addWidget(button, 0, Qt.AlignmentFlag.AlignBottom)
        self._import.setProperty("primary", "true")
        make_column(top, (middle, 1), buttons, spacing=12, margins=(16, 16), of=self)

    def _right(self) -> QVBoxLayout:
        self._head.setReadOnly(True)
        self._head.setFont(QFontDatabase.systemFont(QFontDatabase.SystemFont.FixedFont))
        self._head.setLineWrapMode(QPlainTextEdit.LineWrapMode.NoWrap)
        self._head.setTabChangesFocus(True)
        self._head.setFixedHeight(_HEAD_HEIGHT)
        self._head.setAccessibleName(gettext("First lines of the file"))
        return make_column(
            (self._preview, 1),
            self._words,
            label(gettext("First lines of the file"), TextRole.LABEL, muted=True),
            self._head,
            spacing=8,
        )
