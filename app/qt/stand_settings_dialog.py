"""Dialog of the settings of the stand. It does not block the window."""

from PySide6.QtCore import QSize, Qt, Signal
from PySide6.QtWidgets import (
    QAbstractItemView,
    QDialog,
    QHeaderView,
    QLineEdit,
    QTableWidget,
    QTableWidgetItem,
    QWidget,
)

from app.presenters.base import Chip
from app.presenters.stand_settings import (
    NUMBERS,
    Rows,
    StandSettingsForm,
    StandSettingsPresenter,
    StandSettingsState,
)
from app.qt.theme import TextRole
from app.qt.widgets.inputs import make_button
from app.qt.widgets.layouts import STRETCH, make_column, make_form_grid, make_row, make_scroll_area
from app.qt.widgets.shortcuts import bind_button
from app.qt.widgets.text import label, show_chip
from messages.i18n import N_, gettext

_SIZE = 880, 720
_TABLES = {
    "pullbacks": (N_("Pullbacks"), N_("Pullback, mm")),
    "contacts": (N_("Contacts"), N_("Surfaces that slide on each other")),
    "added_masses": (N_("Added masses"), N_("Added mass, kg")),
}
"""Fields of the form that are tables: title, and title of the second column."""
_HINT = N_(
    "A series code is pullback, contact and added mass: 1FFM0. What is saved holds for runs from the next"
    " connection on; recorded runs keep their own."
)


class StandSettingsDialog(QDialog):
    """Draws `StandSettingsState`."""

    def __init__(self, presenter: StandSettingsPresenter, parent: QWidget) -> None:
        super().__init__(parent)
        self._presenter = presenter
        self._name = QLineEdit()
        self._numbers = {name: QLineEdit() for name in NUMBERS}
        self._tables = {name: _Rows(*map(gettext, titles)) for name, titles in _TABLES.items()}
        self._message = label(wrap=True)
        self._save = make_button(gettext("Save"), self._on_save, primary=True)
        self._save.setDefault(True)
        self._undo = make_button(gettext("Undo"), presenter.undo)
        self._reset = make_button(
            gettext("Reset"), presenter.reset, gettext("Show the stand as it is stored")
        )
        self._close = make_button(gettext("Close"), self.close)
        self._lay_out()
        bind_button(self._save, "Ctrl+S", gettext("Check the stand, and save it"), self)
        bind_button(self._undo, "Ctrl+Z", gettext("Save the stand as it was before"), self)
        for field in (self._name, *self._numbers.values()):
            field.textEdited.connect(self._on_edited)
        for table in self._tables.values():
            table.edited.connect(self._on_edited)

    def show_state(self, state: StandSettingsState) -> None:
        form = state.form
        for field, text in zip(
            (self._name, *self._numbers.values()), (form.name, *form.numbers), strict=True
        ):
            if field.text() != text:
                field.setText(text)
                field.setCursorPosition(0)  # the beginning of a long name in sight
        for name, table in self._tables.items():
            table.show_rows(getattr(form, name))
        show_chip(self._message, state.message)
        if not state.message.text:
            show_chip(self._message, Chip(gettext("Not saved yet") if state.is_changed else ""))
        self._save.setEnabled(state.is_changed)
        self._reset.setEnabled(state.is_changed)
        self._undo.setEnabled(state.can_undo)

    def _on_save(self) -> None:
        self._save.setFocus()  # takes over a cell that is being typed
        self._presenter.save()

    def _on_edited(self) -> None:
        numbers = tuple(field.text() for field in self._numbers.values())
        rows = {name: table.rows() for name, table in self._tables.items()}
        self._presenter.set_form(StandSettingsForm(self._name.text(), numbers, **rows))

    def _lay_out(self) -> None:
        fields = [(gettext("Name"), self._name)]
        fields += [(gettext(NUMBERS[name]), field) for name, field in self._numbers.items()]
        left, page = QWidget(), QWidget()
        make_column(make_form_grid(fields), STRETCH, of=left)
        tables = make_column(*((table, 1) for table in self._tables.values()), spacing=8)
        make_row((left, 1), (tables, 1), spacing=24, margins=(2, 2), of=page)
        make_column(
            label(gettext("Stand"), TextRole.HEADING),
            label(gettext(_HINT), muted=True, wrap=True),
            (make_scroll_area(page, is_column=False), 1),
            self._message,
            make_row(self._undo, self._reset, STRETCH, self._close, self._save, spacing=8),
            spacing=12,
            margins=(16, 16),
            of=self,
        )
        self.setWindowTitle(gettext("Stand"))
        self.resize(QSize(*_SIZE).boundedTo(self.screen().availableSize()))


class _Rows(QWidget):
    """A table of codes and values that are typed, with buttons that add and remove rows."""

    edited = Signal()

    def __init__(self, title: str, value_title: str) -> None:
        super().__init__()
        self._table = QTableWidget(0, 2)
        self._table.setHorizontalHeaderLabels([gettext("Code"), value_title])
        self._table.setAccessibleName(title)
        titles = self._table.horizontalHeader()
        titles.setDefaultAlignment(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter)
        self._table.verticalHeader().hide()
        self._table.setTabKeyNavigation(False)
        self._table.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
        titles.setSectionResizeMode(1, QHeaderView.ResizeMode.Stretch)
        self._table.itemChanged.connect(lambda _: self.edited.emit())
        add = make_button("+", self._add)
        remove = make_button("\u2212", self._remove)
        for button, words, key in (
            (add, gettext("Add a row to {table}", table=title), "Ins"),
            (remove, gettext("Remove the row from {table}", table=title), "Del"),
        ):
            button.setAccessibleName(words)
            bind_button(button, key, words, self._table, focused=True)
        head = make_row(label(title, TextRole.STRONG), STRETCH, add, remove, spacing=4)
        make_column(head, (self._table, 1), spacing=4, of=self)

    def rows(self) -> Rows:
        def text(row: int, column: int) -> str:
            item = self._table.item(row, column)
            return "" if item is None else item.text()

        return tuple((text(row, 0), text(row, 1)) for row in range(self._table.rowCount()))

    def show_rows(self, rows: Rows) -> None:
        if rows == self.rows():
            return
        self._table.blockSignals(True)
        self._table.setRowCount(len(rows))
        for row, texts in enumerate(rows):
            for column, text in enumerate(texts):
                self._table.setItem(row, column, QTableWidgetItem(text))
        self._table.blockSignals(False)

    def _add(self) -> None:
        row = self._table.rowCount()
        self._table.setRowCount(row + 1)
        self._table.setCurrentCell(row, 0)
        self._table.setFocus()
        self._table.edit(self._table.currentIndex())
        self.edited.emit()

    def _remove(self) -> None:
        if self._table.currentRow() >= 0:
            self._table.removeRow(self._table.currentRow())
            self.edited.emit()
