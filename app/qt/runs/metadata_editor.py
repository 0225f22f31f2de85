"""What may be edited of the selected runs; an edit is kept beside the old value and can be undone."""

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QGridLayout, QLineEdit, QWidget

from app.presenters.runs.state import MetadataForm
from app.qt.widgets.text import label
from messages.i18n import N_, gettext

_FIELDS = {
    "series": (
        N_("Series"),
        N_("Series code, for example 1FFM0: it brings its pullback and plate mass"),
    ),
    "plate_mass_kg": (
        N_("Plate mass, kg"),
        N_("Mass of the upper plate with its weights"),
    ),
    "operator": (N_("Operator"), N_("Who recorded")),
    "note": (N_("Note"), N_("A remark kept with the run")),
}


class MetadataEditor(QWidget):
    """Fields that take effect when left, or on Enter; Escape gives the old text back."""

    edited = Signal(str, str)

    def __init__(self) -> None:
        super().__init__()
        self._facts: MetadataForm | None = None
        self._fields = {name: QLineEdit() for name in _FIELDS}
        grid = QGridLayout(self)
        grid.setContentsMargins(12, 4, 12, 12)
        grid.setHorizontalSpacing(12)
        grid.setVerticalSpacing(8)
        grid.setColumnStretch(1, 1)
        for line, (name, field) in enumerate(self._fields.items()):
            title = label(gettext(_FIELDS[name][0]))
            title.setBuddy(field)
            field.setAccessibleName(gettext(_FIELDS[name][0]))
            field.setToolTip(gettext(_FIELDS[name][1]))
            field.editingFinished.connect(lambda name=name: self._tell(name))
            grid.addWidget(title, line, 0)
            grid.addWidget(field, line, 1)

    def show_metadata(self, facts: MetadataForm | None) -> None:
        """Write what is known; None where nothing can be edited."""
        self._facts = facts
        for name, field in self._fields.items():
            field.setEnabled(facts is not None)
            field.setText("" if facts is None else getattr(facts, name))
            field.setPlaceholderText(
                gettext("several values") if facts is not None and name in facts.mixed else ""
            )
            field.setModified(False)
            field.setCursorPosition(0)  # the beginning of a long note in sight

    def _tell(self, name: str) -> None:
        field = self._fields[name]
        if self._facts is not None and field.isModified():
            field.setModified(False)
            self.edited.emit(name, field.text())
