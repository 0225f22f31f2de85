"""The fold of the run bar: who records, how many in a row, and the circumstances that are kept with a run."""

from dataclasses import asdict

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QGridLayout, QVBoxLayout, QWidget

from app.presenters.conditions import CONDITION_TITLES
from app.presenters.record.state import RunForm
from app.qt.theme import TextRole
from app.qt.widgets.inputs import ESCAPE_AND_ENTER, ShortcutSafeEdit
from app.qt.widgets.text import label
from messages.i18n import N_, gettext

_FIELDS = {
    "operator": (N_("Operator"), N_("name")),
    "temperature_c": (CONDITION_TITLES["temperature_c"], "21.5"),
    "humidity_percent": (CONDITION_TITLES["humidity_percent"], "45"),
    "plate_id": (CONDITION_TITLES["plate_id"], N_("which one")),
    "contact_id": (CONDITION_TITLES["contact_id"], N_("which pair of surfaces")),
    "surface_preparation": (CONDITION_TITLES["surface_preparation"], N_("how prepared")),
    "run_in_number": (CONDITION_TITLES["run_in_number"], N_("counts up by itself")),
    "count": (N_("Runs in a row"), "1"),
    "note": (N_("Note"), N_("kept with the next run")),
}
_COLUMNS = 5
_WIDE = {"note": 2}


class RunFormFields(QWidget):
    """Draws a `RunForm`."""

    filled = Signal(RunForm)
    left = Signal()
    """The keyboard is wanted by the buttons again."""

    def __init__(self) -> None:
        super().__init__()
        self._fields = {name: ShortcutSafeEdit(ESCAPE_AND_ENTER) for name in _FIELDS}
        grid = QGridLayout(self)
        grid.setContentsMargins(0, 4, 0, 0)
        grid.setHorizontalSpacing(12)
        grid.setVerticalSpacing(8)
        for number, (name, field) in enumerate(self._fields.items()):
            title, hint = _FIELDS[name]
            field.setPlaceholderText(gettext(hint))
            field.textEdited.connect(self._tell)
            field.left.connect(self.left)
            grid.addLayout(
                _named(gettext(title), field), number // _COLUMNS, number % _COLUMNS, 1, _WIDE.get(name, 1)
            )
        for column in range(_COLUMNS):
            grid.setColumnStretch(column, 1)

    def show_form(self, form: RunForm, *, editable: bool) -> None:
        """Write a form."""
        for name, text in asdict(form).items():
            field = self._fields[name]
            field.setEnabled(editable)
            if field.text() != text:
                field.setText(text)

    def take_focus(self) -> None:
        """Begin with the first field."""
        next(iter(self._fields.values())).setFocus()

    def _tell(self) -> None:
        self.filled.emit(RunForm(**{name: field.text() for name, field in self._fields.items()}))


def _named(name: str, field: QWidget) -> QVBoxLayout:
    column = QVBoxLayout()
    column.setSpacing(4)
    title = label(name, TextRole.LABEL, muted=True)
    title.setBuddy(field)
    field.setAccessibleName(name)
    column.addWidget(title)
    column.addWidget(field)
    return column
