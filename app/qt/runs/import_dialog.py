"""The import dialog: columns, units and lines of a foreign file, and a preview of the run."""

from pathlib import Path

from PySide6.QtCore import QSize, Qt
from PySide6.QtWidgets import QDialog, QPushButton, QWidget

from app.presenters.base import Chip, Tone
from app.presenters.runs.import_presenter import ImportPresenter, ImportState
from app.presenters.runs.state import SizeQuestion
from app.qt.runs.import_fields import ImportFields
from app.qt.runs.preview import RunsPreview
from app.qt.theme import TextRole, Theme
from app.qt.widgets.inputs import make_button, make_primary_button, make_text_view
from app.qt.widgets.layouts import make_column, make_row, make_scroll_area
from app.qt.widgets.shortcuts import bind_button
from app.qt.widgets.text import label, set_text_or_hide, show_chip
from messages.i18n import gettext, ngettext

_COLUMN_WIDTH = 384
_LINES_HEIGHT = 132
_SIZE = QSize(1000, 660)
_FRAME = QSize(16, 48)  # that the window system draws around it


class ImportDialog(QDialog):
    """Draws `ImportState`. It does not block the window."""

    def __init__(self, theme: Theme, presenter: ImportPresenter, parent: QWidget) -> None:
        super().__init__(parent)
        self._presenter = presenter
        self._shown = ImportState()
        self._title = label(role=TextRole.HEADING)
        self._waiting = label(muted=True)
        self._taken_over = label(muted=True, wrap=True)
        self._question = _SizeQuestionBar(presenter)
        self._fields = ImportFields()
        self._fields.changed.connect(presenter.set_form)
        self._preview = RunsPreview(theme)
        self._words = label(wrap=True)
        self._caption = label(role=TextRole.LABEL, muted=True)
        self._lines = make_text_view(gettext("First lines of the file"))
        self._lines.setFixedHeight(_LINES_HEIGHT)
        self._message = label(wrap=True)
        self._import = make_primary_button(gettext("Import"))
        self._import.clicked.connect(lambda _checked: self._import_file())
        self._skip = make_button(gettext("Leave out"), presenter.skip_file)
        self._import_all = make_button(gettext("Import all"), self._import_likewise)
        bind_button(
            self._import_all,
            "Ctrl+Shift+Return",
            gettext("Make runs of this file and all that wait, alike"),
            self,
        )
        bind_button(
            self._import, "Ctrl+Return", gettext("Make a run of the file, and go on with the next"), self
        )
        bind_button(self._skip, "Alt+L", gettext("Leave this file out, and go on with the next"), self)
        self._lay_out(make_button(gettext("Close"), self.reject))

    def show_state(self, state: ImportState) -> None:
        old, self._shown = self._shown, state
        name = Path(state.path).name
        self._title.setText(
            gettext("Import {name}", name=name) if name else gettext("No file is left to import")
        )
        more = ngettext("{count} more file", "{count} more files", state.pending)
        self._waiting.setText(more if state.pending else "")
        self._fields.show_state(state)
        if state.overlay is not old.overlay:
            self._preview.show_overlay(state.overlay)
        self._words.setText(state.summary)
        set_text_or_hide(self._taken_over, state.taken_over)
        self._question.show_question(state.question)
        if (state.first_lines, state.results) != (old.first_lines, old.results):
            self._lines.setPlainText(state.results or state.first_lines)
        self._caption.setText(_caption(state))
        show_chip(self._message, Chip(state.busy) if state.busy else state.message)
        self._message.show()  # an empty one still keeps the buttons at the right
        self._import.setEnabled(state.can_import)
        self._import_all.setEnabled(state.can_import and bool(state.pending))
        self._skip.setEnabled(bool(state.path))

    def reject(self) -> None:
        self._presenter.close()
        super().reject()

    def _import_file(self) -> None:
        self._fields.fill()  # by its key the button takes no focus from a field
        self._presenter.import_file()

    def _import_likewise(self) -> None:
        self._fields.fill()
        self._presenter.import_all()

    def _lay_out(self, close: QPushButton) -> None:
        self.setWindowTitle(gettext("Import"))
        self.resize(_SIZE.boundedTo(self.screen().availableSize() - _FRAME))
        left = make_scroll_area(self._fields, is_column=False)
        left.setFixedWidth(_COLUMN_WIDTH)
        right = make_column(
            self._question, (self._preview, 1), self._words, self._caption, self._lines, spacing=8
        )
        buttons = make_row((self._message, 1), spacing=8)
        for button in (self._import, self._import_all, self._skip, close):
            button.setAutoDefault(False)  # Enter in a field takes the field
            buttons.addWidget(button, 0, Qt.AlignmentFlag.AlignBottom)
        top = make_row((self._title, 1), self._waiting)
        middle = make_row(left, (right, 1), spacing=16)
        make_column(top, self._taken_over, (middle, 1), buttons, spacing=12, margins=(16, 16), of=self)


class _SizeQuestionBar(QWidget):
    """Asks whether displacements of an unlikely size are right; the likely answer stands first."""

    def __init__(self, presenter: ImportPresenter) -> None:
        super().__init__()
        self._text = label(wrap=True)
        self._unit = make_button("", lambda: presenter.answer(is_right=False), primary=True)
        right = make_button(gettext("It is right"), lambda: presenter.answer(is_right=True))
        bind_button(self._unit, "Alt+U", gettext("Read the displacements in the unit that is likely"), self)
        bind_button(right, "Alt+Y", gettext("Take the displacements as they are"), self)
        for button in (self._unit, right):
            button.setAutoDefault(False)
        row = make_row((self._text, 1), self._unit, right, spacing=8, of=self)
        row.setContentsMargins(0, 0, 0, 0)
        self.setAccessibleName(gettext("Question"))

    def show_question(self, question: SizeQuestion | None) -> None:
        self.setVisible(question is not None)
        if question is not None:
            show_chip(self._text, Chip(question.text, Tone.WARN))
            self._unit.setText(gettext("Read as {unit}", unit=question.symbol))
            self._unit.setVisible(bool(question.unit))
            self._unit.setEnabled(bool(question.unit))


def _caption(state: ImportState) -> str:
    if state.results:
        return gettext("Imported")
    if state.encoding:
        return gettext("First lines of the file, read as {encoding}", encoding=state.encoding)
    return gettext("First lines of the file")
