"""The selected runs: actions, their progress and outcome, and the editor of the metadata."""

from collections.abc import Callable
from functools import partial

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QFrame, QLineEdit, QPushButton, QSizePolicy, QWidget

from app.presenters.base import Chip, Progress, Tone
from app.presenters.runs.presenter import RunsPresenter
from app.presenters.runs.state import METADATA_FIELDS, MetadataForm, RunsState
from app.qt.widgets.inputs import ProgressBar, make_button
from app.qt.widgets.layouts import make_column, make_form_grid, make_row
from app.qt.widgets.shortcuts import add_shortcut, bind_button, set_button_hint
from app.qt.widgets.text import label, set_tool_tip, show_chip
from messages.i18n import gettext


class ActionBar(QFrame):
    """Buttons, the progress of work, and its outcome with details to unfold."""

    def __init__(
        self, presenter: RunsPresenter, ask_for_export: Callable[[], None], empty_trash: Callable[[], None]
    ) -> None:
        super().__init__()
        self.setProperty("role", "bar")
        self._open = _button(gettext("Open"), presenter.open_selected)
        self._analyse = _button(gettext("Analyse"), presenter.analyse)
        self._analyse_anew = partial(presenter.analyse, reanalyse=True)
        self._export = _button(gettext("Export…"), ask_for_export)
        self._trash = _button(gettext("Trash"), presenter.trash)
        self._restore = _button(gettext("Restore"), presenter.restore)
        self._empty = _button(gettext("Empty trash…"), empty_trash)
        set_tool_tip(self._empty, gettext("Delete all runs in the trash for ever"))
        self._undo = _button(gettext("Undo"), presenter.undo)
        self._message = label(wrap=True)
        self._details = _button(gettext("Details"), self._fold)
        self._bar = ProgressBar()
        self._bar.setFixedWidth(160)
        self._cancel = _button(gettext("Cancel"), presenter.cancel)
        set_tool_tip(self._cancel, gettext("Give up the work; what is done stays"))
        self._list = label(wrap=True)
        self._lay_out()

    def add_keys(self, screen: QWidget, table: QWidget) -> None:
        """Bind keys to the buttons; single letters only in the table, where nothing is typed."""
        in_table = {
            self._open: (("Return", "Enter"), gettext("Show the run on Identify")),
            self._analyse: (
                "R", gettext("Identify what is not up to date of the selected runs, and keep it")
            ),
            self._trash: ("Del", gettext("Put the selected runs aside; undo brings them back")),
            self._restore: ("Ins", gettext("Bring the selected runs back from the trash")),
        }  # fmt: skip
        for button, (keys, words) in in_table.items():
            bind_button(button, keys, words, table, focused=True)
        anew = gettext("Identify the selected runs anew, also those that are up to date")
        add_shortcut(table, "Shift+R", anew, self._analyse_anew, focused=True)
        bind_button(self._export, "Ctrl+E", gettext("Samples or coefficients for other programs"), screen)
        bind_button(self._undo, "Ctrl+Z", gettext("Take the last change back"), screen)

    def show_state(self, state: RunsState) -> None:
        for button in (self._analyse, self._export, self._trash):
            button.setVisible(not state.in_trash)
        for button in (self._restore, self._empty):
            button.setVisible(state.in_trash)
        for button in (self._open, self._trash, self._restore):
            button.setEnabled(bool(state.selected))
        self._empty.setEnabled(state.total > 0 and state.progress is None)
        for button in (self._analyse, self._export):
            button.setEnabled(state.metadata is not None)
        self._undo.setEnabled(bool(state.undo_text))
        undo = gettext("Take back: {what}", what=state.undo_text)
        set_button_hint(self._undo, undo if state.undo_text else gettext("Nothing to undo"))
        self._show_words(state.message, state.progress)
        self._details.setVisible(bool(state.details))
        self._list.setText("\n".join(state.details))
        if not state.details:
            self._list.hide()

    def _show_words(self, message: Chip, progress: Progress | None) -> None:
        if progress is not None:  # what other work has brought meanwhile stands beside it
            tone = message.tone if message.tone in (Tone.WARN, Tone.BAD) else Tone.PLAIN
            message = Chip(". ".join(filter(None, (progress.text, message.text))), tone)
        show_chip(self._message, message)
        self._message.show()  # an empty one still keeps the buttons at the left
        self._bar.show_progress(progress)
        self._cancel.setVisible(progress is not None)

    def _fold(self) -> None:
        self._list.setVisible(not self._list.isVisible())

    def _lay_out(self) -> None:
        work = (self._open, self._analyse, self._export, self._trash, self._restore, self._empty, self._undo)
        buttons = make_row(*work, spacing=8)
        line = make_row(buttons, (self._message, 1), self._details, self._bar, self._cancel, spacing=8)
        line.insertSpacing(1, 8)
        make_column(line, self._list, spacing=6, margins=(12, 8), of=self)


def _button(text: str, act: Callable[[], None]) -> QPushButton:
    button = make_button(text, act)
    button.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)
    return button


class MetadataEditor(QWidget):
    """Fields that take effect when the focus leaves them, or on Enter; Escape restores the old text."""

    edited = Signal(str, str)

    def __init__(self) -> None:
        super().__init__()
        self._metadata: MetadataForm | None = None
        self._fields = {name: QLineEdit() for name in METADATA_FIELDS}
        titles = [gettext(described.title) for described in METADATA_FIELDS.values()]
        grid = make_form_grid(zip(titles, self._fields.values(), strict=True))
        grid.setContentsMargins(12, 4, 12, 12)
        self.setLayout(grid)
        for name, field in self._fields.items():
            set_tool_tip(field, gettext(METADATA_FIELDS[name].hint))
            field.editingFinished.connect(lambda name=name: self._on_edited(name))

    def show_metadata(self, metadata: MetadataForm | None) -> None:
        self._metadata = metadata
        for name, field in self._fields.items():
            field.setEnabled(metadata is not None)
            field.setText("" if metadata is None else metadata.texts[name])
            is_mixed = metadata is not None and name in metadata.mixed
            field.setPlaceholderText(gettext("several values") if is_mixed else "")
            field.setModified(False)
            field.setCursorPosition(0)  # the beginning of a long note in sight

    def _on_edited(self, name: str) -> None:
        field = self._fields[name]
        if self._metadata is not None and field.isModified():
            field.setModified(False)
            self.edited.emit(name, field.text())
