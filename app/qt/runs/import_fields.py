"""The fields of the import dialog, a column of them: what is asked often, and under a fold what is rare."""

from dataclasses import replace

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QLineEdit, QToolButton, QVBoxLayout, QWidget

from app.presenters.base import Chip, Tone
from app.presenters.conditions import CONDITION_FIELDS, CONDITION_TITLES
from app.presenters.runs.import_form import GAIN, ImportForm, TextFormat
from app.presenters.runs.import_presenter import ImportState
from app.qt.theme import TextRole
from app.qt.widgets.inputs import ComboBox, make_choice
from app.qt.widgets.layouts import make_form_grid
from app.qt.widgets.text import label, show_chip
from messages.i18n import N_, gettext

_NAMES_WIDTH = 124
_BOX_LETTERS = 12
_FIND_OUT = N_("find out")
_OF_READING = {
    "delimiter": {
        "": _FIND_OUT,
        ",": N_("comma"),
        ";": N_("semicolon"),
        "\t": N_("tab"),
        " ": N_("blanks"),
        "|": "|",
    },
    "decimal": {"": _FIND_OUT, ".": N_("point"), ",": N_("comma")},
    "header": {"": _FIND_OUT, "yes": N_("yes"), "no": N_("no")},
}
_CHOICES = {
    "time_unit": {"s": "s", "ms": "ms", "us": "µs"},
    "measures": {"relative": N_("plate against table"), "plate": N_("plate against base")},
    "quantity": {
        "displacement": N_("displacement"),
        "velocity": N_("velocity"),
        "acceleration": N_("acceleration"),
    },
    "unit": {"m": "m", "mm": "mm", "um": "µm", GAIN: N_("by a gain")},
}
_COLUMNS = ("time", "table", "second")
_TITLES = {
    "time": N_("Time"),
    "time_unit": N_("Unit of time"),
    "table": N_("Gauge 1, table"),
    "second": N_("Gauge 2"),
    "measures": N_("Gauge 2 measures"),
    "quantity": N_("Quantity"),
    "unit": N_("Unit"),
    "delimiter": N_("Between cells"),
    "decimal": N_("Decimal sign"),
    "header": N_("Names above"),
}
_TEXTS = {
    "gain": (N_("Gain"), N_("1, reading of one unit of a cell")),
    "offset": (N_("Offset"), N_("0, reading at a cell of 0")),
    "unit_name": (N_("Unit of the gain"), N_("m, unless something else: rad, V")),
    "series": (N_("Series"), N_("for example 1FFM0")),
    "plate_mass_kg": (N_("Plate mass, kg"), N_("as the series says")),
    "table_mass_kg": (N_("Table mass, kg"), N_("as of the stand")),
    "operator": (N_("Operator"), N_("who recorded")),
    "note": (N_("Note"), N_("kept with the run")),
    "gain_uncertainty": (N_("Uncertainty of the gain"), N_("not stated; 0.003 is 0.3 %")),
    "name": (N_("Name of the run"), N_("as of the file")),
    "skip": (N_("Lines skipped"), "0"),
    "from_s": (N_("From, s"), N_("the beginning")),
    "until_s": (N_("Until, s"), N_("the end")),
    "segment": (N_("Stretch"), N_("from 0, where times go back")),
    "temperature_c": (CONDITION_TITLES["temperature_c"], N_("not known")),
    "humidity_percent": (CONDITION_TITLES["humidity_percent"], N_("not known")),
    "plate_id": (CONDITION_TITLES["plate_id"], N_("which one")),
    "contact_id": (CONDITION_TITLES["contact_id"], N_("which pair of surfaces")),
    "surface_preparation": (CONDITION_TITLES["surface_preparation"], N_("how prepared")),
    "run_in_number": (CONDITION_TITLES["run_in_number"], N_("not known")),
    "other": (N_("Others"), N_("name=text; name=text")),
}
"""Title and hint; the hint says what holds if nothing is written."""
_OFTEN = {
    N_("Columns"): (
        "time", "time_unit", "table", "second", "measures", "quantity", "unit", "gain", "offset", "unit_name",
    ),
    N_("Test"): ("series", "plate_mass_kg", "table_mass_kg", "operator", "note"),
}  # fmt: skip
_RARE = {
    N_("Calibration and name"): ("gain_uncertainty", "name"),
    N_("Lines"): ("delimiter", "decimal", "header", "skip"),
    N_("Part"): ("from_s", "until_s", "segment"),
    N_("Conditions"): (*CONDITION_FIELDS, "other"),
}  # fmt: skip
_WITH_GAIN = ("gain", "offset", "unit_name")


class ImportFields(QWidget):
    """Draws the `ImportForm` of an `ImportState`, and what is wrong with it under the fields."""

    changed = Signal(ImportForm)

    def __init__(self) -> None:
        super().__init__()
        self._shown = ImportState()
        self._columns = {name: ComboBox() for name in _COLUMNS}
        self._choices = {name: make_choice(items) for name, items in _CHOICES.items()}
        self._of_reading = {name: make_choice(items) for name, items in _OF_READING.items()}
        self._texts = {name: QLineEdit() for name in _TEXTS}
        self._faults = {name: label(role=TextRole.LABEL, wrap=True) for name in (*_TITLES, *_TEXTS)}
        self._fold = QToolButton()
        self._rare = QWidget()
        self._lay_out()
        self._connect()

    def show_state(self, state: ImportState) -> None:
        old, self._shown = self._shown, state
        if (state.columns, state.column_labels) != (old.columns, old.column_labels):
            self._offer_columns(state)
        form, reading = state.form, state.form.text_format
        for name, box in self._boxes().items():
            box.setCurrentIndex(box.findData(getattr(reading if name in _OF_READING else form, name)))
        for name, field in self._texts.items():
            text = reading.skip if name == "skip" else getattr(form, name)
            is_typed = field.hasFocus() and field.isModified() and state.path == old.path
            if field.text() != text and not is_typed:
                field.setText(text)
        for name in ("delimiter", "decimal"):
            self._of_reading[name].setEnabled(state.is_text)
        for name in _WITH_GAIN:
            self._texts[name].setEnabled(form.unit == GAIN)
        self._choices["measures"].setEnabled(bool(form.second))
        if state.faults != old.faults:
            self._show_faults(state.faults)

    def fill(self) -> None:
        chosen = {name: box.currentData() or "" for name, box in self._boxes().items()}
        texts = {name: field.text() for name, field in self._texts.items()}
        of_reading = {name: chosen.pop(name) for name in _OF_READING}
        reading = TextFormat(**of_reading, skip=texts.pop("skip"))
        self.changed.emit(replace(ImportForm(), text_format=reading, **chosen, **texts))

    def _show_faults(self, faults: dict[str, str]) -> None:
        for name, words in self._faults.items():
            show_chip(words, Chip(faults.get(name, ""), Tone.BAD))
        if any(name in faults for names in _RARE.values() for name in names):
            self._unfold(unfolded=True)

    def _offer_columns(self, state: ImportState) -> None:
        for name, box in self._columns.items():
            box.clear()
            if name == "second":
                box.addItem(gettext("none"), "")
            for column, title in zip(state.columns, state.column_labels, strict=True):
                box.addItem(title, column)

    def _boxes(self) -> dict[str, ComboBox]:
        return self._columns | self._choices | self._of_reading

    def _connect(self) -> None:
        for box in self._boxes().values():
            box.activated.connect(lambda _: self.fill())
        for field in self._texts.values():
            field.editingFinished.connect(self.fill)
        self._fold.clicked.connect(lambda _: self._unfold(unfolded=not self._rare.isVisibleTo(self)))

    def _unfold(self, *, unfolded: bool) -> None:
        self._rare.setVisible(unfolded)
        self._fold.setArrowType(Qt.ArrowType.DownArrow if unfolded else Qt.ArrowType.RightArrow)

    def _lay_out(self) -> None:
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 12, 0)
        column.setSpacing(12)
        self._add_groups(column, _OFTEN)
        self._fold.setProperty("role", "fold")
        self._fold.setText(gettext("More"))
        self._fold.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextBesideIcon)
        self._fold.setToolTip(gettext("Lines, part, conditions, uncertainty and name"))
        column.addWidget(self._fold)
        rare = QVBoxLayout(self._rare)
        rare.setContentsMargins(0, 0, 0, 0)
        rare.setSpacing(12)
        self._add_groups(rare, _RARE)
        column.addWidget(self._rare)
        column.addStretch(1)
        self._unfold(unfolded=False)
        for box in self._boxes().values():  # names of columns may be long
            box.setSizeAdjustPolicy(ComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon)
            box.setMinimumContentsLength(_BOX_LETTERS)
        for name, field in self._texts.items():
            field.setPlaceholderText(gettext(_TEXTS[name][1]))

    def _add_groups(self, column: QVBoxLayout, groups: dict[str, tuple[str, ...]]) -> None:
        for title, names in groups.items():
            column.addWidget(label(gettext(title), TextRole.HEADING))
            fields = [(self._title(name), (self._texts | self._boxes())[name]) for name in names]
            grid = make_form_grid(fields, below=[self._faults[name] for name in names])
            grid.setColumnMinimumWidth(0, _NAMES_WIDTH)
            column.addLayout(grid)

    def _title(self, name: str) -> str:
        return gettext(_TITLES[name] if name in _TITLES else _TEXTS[name][0])
