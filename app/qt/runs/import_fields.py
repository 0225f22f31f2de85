"""Fields of the import dialog in a column; rare ones under a fold."""

from collections.abc import Mapping, Sequence

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QLineEdit, QToolButton, QVBoxLayout, QWidget

from app.presenters.base import Chip, Tone
from app.presenters.runs import import_form
from app.presenters.runs.import_form import FIELDS, GAIN, Field
from app.presenters.runs.import_presenter import ImportState
from app.qt.theme import TextRole
from app.qt.widgets.inputs import ComboBox, make_choice
from app.qt.widgets.layouts import make_column, make_form_grid
from app.qt.widgets.text import label, set_tool_tip, show_chip
from messages.i18n import gettext

_NAMES_WIDTH = 124
_BOX_LETTERS = 12


class ImportFields(QWidget):
    """Shows the form of an `ImportState`, and faults under the fields."""

    changed = Signal(dict)

    def __init__(self) -> None:
        super().__init__()
        self._shown = ImportState()
        self._boxes = {
            name: make_choice(field.choices) for name, field in FIELDS.items() if field.choices is not None
        }
        self._texts = {name: QLineEdit() for name, field in FIELDS.items() if field.choices is None}
        self._faults = {name: label(role=TextRole.LABEL, wrap=True) for name in FIELDS}
        self._fold = QToolButton()
        self._rare = QWidget()
        self._lay_out()
        for box in self._boxes.values():
            box.activated.connect(lambda _: self.fill())
        for field in self._texts.values():
            field.editingFinished.connect(self.fill)
        self._fold.clicked.connect(lambda _: self._unfold(unfolded=not self._rare.isVisibleTo(self)))

    def show_state(self, state: ImportState) -> None:
        old, self._shown = self._shown, state
        if (state.columns, state.column_labels) != (old.columns, old.column_labels):
            self._offer_columns(state)
        for name, box in self._boxes.items():
            box.setCurrentIndex(box.findData(state.form[name]))
        for name, field in self._texts.items():
            is_typed = field.hasFocus() and field.isModified() and state.path == old.path
            if field.text() != state.form[name] and not is_typed:
                field.setText(state.form[name])
        for name in ("delimiter", "decimal", "encoding"):
            self._boxes[name].setEnabled(state.is_text)
        for name in import_form.GAIN_FIELDS:
            self._texts[name].setEnabled(state.form["unit"] == GAIN)
        self._boxes["measures"].setEnabled(bool(state.form["second"]))
        if state.faults != old.faults:
            self._show_faults(state.faults)

    def fill(self) -> None:
        """Report what is typed and chosen."""
        chosen = {name: box.currentData() or "" for name, box in self._boxes.items()}
        self.changed.emit(chosen | {name: field.text() for name, field in self._texts.items()})

    def _show_faults(self, faults: dict[str, str]) -> None:
        for name, words in self._faults.items():
            show_chip(words, Chip(faults.get(name, ""), Tone.BAD))
        if any(field.name in faults for group in import_form.RARE_GROUPS.values() for field in group):
            self._unfold(unfolded=True)

    def _offer_columns(self, state: ImportState) -> None:
        for name in import_form.COLUMN_FIELDS:
            box = self._boxes[name]
            box.clear()
            if name in ("second", "date"):
                box.addItem(gettext("none"), "")
            elif name == "time":
                box.addItem(gettext("by the file or a rate"), "")
            for column, title in zip(state.columns, state.column_labels, strict=True):
                box.addItem(title, column)

    def _unfold(self, *, unfolded: bool) -> None:
        self._rare.setVisible(unfolded)
        self._fold.setArrowType(Qt.ArrowType.DownArrow if unfolded else Qt.ArrowType.RightArrow)

    def _lay_out(self) -> None:
        column = make_column(spacing=12, of=self)
        column.setContentsMargins(0, 0, 12, 0)
        self._add_groups(column, import_form.GROUPS)
        self._fold.setProperty("role", "fold")
        self._fold.setText(gettext("More"))
        self._fold.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextBesideIcon)
        set_tool_tip(self._fold, gettext("Lines, part, conditions, uncertainty and name"))
        column.addWidget(self._fold)
        self._add_groups(make_column(spacing=12, of=self._rare), import_form.RARE_GROUPS)
        column.addWidget(self._rare)
        column.addStretch(1)
        self._unfold(unfolded=False)
        for box in self._boxes.values():  # names of columns may be long
            box.setSizeAdjustPolicy(ComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon)
            box.setMinimumContentsLength(_BOX_LETTERS)
        self._show_faults({})
        for name, field in self._texts.items():
            field.setPlaceholderText(gettext(FIELDS[name].hint))

    def _add_groups(self, column: QVBoxLayout, groups: Mapping[str, Sequence[Field]]) -> None:
        widgets: dict[str, QWidget] = {**self._texts, **self._boxes}
        for title, fields in groups.items():
            column.addWidget(label(gettext(title), TextRole.HEADING))
            named = [(gettext(field.title), widgets[field.name]) for field in fields]
            grid = make_form_grid(named, below=[self._faults[field.name] for field in fields])
            grid.setColumnMinimumWidth(0, _NAMES_WIDTH)
            column.addLayout(grid)
