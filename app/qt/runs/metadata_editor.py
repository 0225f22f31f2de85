"""Editor of the metadata of the selected runs."""

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QGridLayout, QLineEdit, QWidget

from app.presenters.runs.state import MetadataForm
from app.qt.widgets.text import label
from messages.i18n import N_, gettext

_FIELDS = {
    "series": (N_("Series"), N_("Series code, for example 1FFM0: it brings its pullback and plate mass")),
    "plate_mass_kg": (N_("Plate mass, kg"), N_("Mass of the upper plate with its weights")),
    "operator": (N_("Operator"), N_("Who recorded")),
    "note": (N_("Note"), N_("A remark kept with the run")),
}


class MetadataEditor(QWidget):
    """Fields that take effect when the focus leaves them, or on Enter; Escape restores the old text."""

    edited = Signal(str, str)

    def __init__(self) -> None:
        super().__init__()
        self._metadata: MetadataForm | None = None
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
            field.editingFinished.connect(lambda name=name: self._on_edited(name))
            grid.addWidget(title, line, 0)
            grid.addWidget(field, line, 1)

    def show_metadata(self, metadata: MetadataForm | None) -> None:
        self._metadata = metadata
        for name, field in self._fields.items():
            field.setEnabled(metadata is not None)
            field.setText("" if metadata is None else getattr(metadata, name))
            field.setPlaceholderText(
                gettext("several values") if metadata is not None and name in metadata.mixed else ""
            )
            field.setModified(False)
            field.setCursorPosition(0)  # the beginning of a long note in sight

    def _on_edited(self, name: str) -> None:
        field = self._fields[name]
        if self._metadata is not None and field.isModified():
            field.setModified(False)
            self.edited.emit(name, field.text())
