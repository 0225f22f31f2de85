"""The fields of the import dialog, a column of them: what is asked often, and under a fold what is rare."""

from dataclasses import replace

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QLineEdit, QToolButton, QVBoxLayout, QWidget

from app.presenters.conditions import CONDITIONS, TITLES
from app.presenters.runs.import_form import GAIN, ImportForm, Reading
from app.presenters.runs.importing import ImportState
from app.presenters.screen import Chip, Tone
from app.presenters.words import mark, tr
from app.qt.theme import Type
from app.qt.widgets.choice import Choice
from app.qt.widgets.forms import form_grid
from app.qt.widgets.text import label, show_chip

_NAMES_WIDTH = 124
_BOX_LETTERS = 12
_FIND_OUT = mark("find out")
_OF_READING = {
    "delimiter": {
        "": _FIND_OUT,
        ",": mark("comma"),
        ";": mark("semicolon"),
        "\t": mark("tab"),
        " ": mark("blanks"),
        "|": "|",
    },
    "decimal": {"": _FIND_OUT, ".": mark("point"), ",": mark("comma")},
    "header": {"": _FIND_OUT, "yes": mark("yes"), "no": mark("no")},
}
_CHOICES = {
    "time_unit": {"s": "s", "ms": "ms", "us": "µs"},
    "measures": {"relative": mark("plate against table"), "plate": mark("plate against base")},
    "quantity": {
        "displacement": mark("displacement"),
        "velocity": mark("velocity"),
        "acceleration": mark("acceleration"),
    },
    "unit": {"m": "m", "mm": "mm", "um": "µm", GAIN: mark("by a gain")},
}
_COLUMNS = ("time", "table", "second")
_TITLES = {
    "time": mark("Time"),
    "time_unit": mark("Unit of time"),
    "table": mark("Gauge 1, table"),
    "second": mark("Gauge 2"),
    "measures": mark("Gauge 2 measures"),
    "quantity": mark("Quantity"),
    "unit": mark("Unit"),
    "delimiter": mark("Between cells"),
    "decimal": mark("Decimal sign"),
    "header": mark("Names above"),
}
_TEXTS = {
    "gain": (mark("Gain"), mark("1, reading of one unit of a cell")),
    "offset": (mark("Offset"), mark("0, reading at a cell of 0")),
    "unit_name": (mark("Unit of the gain"), mark("m, unless something else: rad, V")),
    "series": (mark("Series"), mark("for example 1FFM0")),
    "plate_mass_kg": (mark("Plate mass, kg"), mark("as the series says")),
    "table_mass_kg": (mark("Table mass, kg"), mark("as of the stand")),
    "operator": (mark("Operator"), mark("who recorded")),
    "note": (mark("Note"), mark("kept with the run")),
    "gain_uncertainty": (mark("Uncertainty of the gain"), mark("not stated; 0.003 is 0.3 %")),
    "name": (mark("Name of the run"), mark("as of the file")),
    "skip": (mark("Lines skipped"), "0"),
    "from_s": (mark("From, s"), mark("the beginning")),
    "until_s": (mark("Until, s"), mark("the end")),
    "segment": (mark("Stretch"), mark("from 0, where times go back")),
    "temperature_c": (TITLES["temperature_c"], mark("not known")),
    "humidity_percent": (TITLES["humidity_percent"], mark("not known")),
    "plate_id": (TITLES["plate_id"], mark("which one")),
    "contact_id": (TITLES["contact_id"], mark("which pair of surfaces")),
    "surface_preparation": (TITLES["surface_preparation"], mark("how prepared")),
    "run_in_number": (TITLES["run_in_number"], mark("not known")),
    "other": (mark("Others"), mark("name=text; name=text")),
}
"""Title and hint; the hint says what holds if nothing is written."""
_OFTEN = {
    mark("Columns"): (
        "time", "time_unit", "table", "second", "measures", "quantity", "unit", "gain", "offset", "unit_name",
    ),
    mark("Test"): ("series", "plate_mass_kg", "table_mass_kg", "operator", "note"),
}  # fmt: skip
_RARE = {
    mark("Calibration and name"): ("gain_uncertainty", "name"),
    mark("Lines"): ("delimiter", "decimal", "header", "skip"),
    mark("Part"): ("from_s", "until_s", "segment"),
    mark("Conditions"): (*CONDITIONS, "other"),
}  # fmt: skip
_WITH_GAIN = ("gain", "offset", "unit_name")


class ImportFields(QWidget):
    """Draws the `ImportForm` of an `ImportState`, and what is wrong with it under the fields."""

    filled = Signal(ImportForm)

    def __init__(self) -> None:
        super().__init__()
        self._shown = ImportState()
        self._columns = {name: Choice() for name in _COLUMNS}
        self._choices = {name: _choice(items) for name, items in _CHOICES.items()}
        self._of_reading = {name: _choice(items) for name, items in _OF_READING.items()}
        self._texts = {name: QLineEdit() for name in _TEXTS}
        self._faults = {name: label(role=Type.LABEL, wrap=True) for name in (*_TITLES, *_TEXTS)}
        self._fold = QToolButton()
        self._rare = QWidget()
        self._lay_out()
        self._connect()

    def show_state(self, state: ImportState) -> None:
        """Draw what differs."""
        old, self._shown = self._shown, state
        if (state.columns, state.titles) != (old.columns, old.titles):
            self._offer_columns(state)
        form, reading = state.form, state.form.reading
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
        """Tell what stands in the fields, the one that is being typed in too."""
        chosen = {name: box.currentData() or "" for name, box in self._boxes().items()}
        texts = {name: field.text() for name, field in self._texts.items()}
        of_reading = {name: chosen.pop(name) for name in _OF_READING}
        reading = Reading(**of_reading, skip=texts.pop("skip"))
        self.filled.emit(replace(ImportForm(), reading=reading, **chosen, **texts))

    def _show_faults(self, faults: dict[str, str]) -> None:
        for name, words in self._faults.items():
            show_chip(words, Chip(faults.get(name, ""), Tone.BAD))
        if any(name in faults for names in _RARE.values() for name in names):
            self._unfold(unfolded=True)

    def _offer_columns(self, state: ImportState) -> None:
        for name, box in self._columns.items():
            box.clear()
            if name == "second":
                box.addItem(tr("none"), "")
            for column, title in zip(state.columns, state.titles, strict=True):
                box.addItem(title, column)

    def _boxes(self) -> dict[str, Choice]:
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
        self._fold.setText(tr("More"))
        self._fold.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextBesideIcon)
        self._fold.setToolTip(tr("Lines, part, conditions, uncertainty and name"))
        column.addWidget(self._fold)
        rare = QVBoxLayout(self._rare)
        rare.setContentsMargins(0, 0, 0, 0)
        rare.setSpacing(12)
        self._add_groups(rare, _RARE)
        column.addWidget(self._rare)
        column.addStretch(1)
        self._unfold(unfolded=False)
        for box in self._boxes().values():  # names of columns may be long
            box.setSizeAdjustPolicy(Choice.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon)
            box.setMinimumContentsLength(_BOX_LETTERS)
        for name, field in self._texts.items():
            field.setPlaceholderText(tr(_TEXTS[name][1]))

    def _add_groups(self, column: QVBoxLayout, groups: dict[str, tuple[str, ...]]) -> None:
        for title, names in groups.items():
            column.addWidget(label(tr(title), Type.HEADING))
            fields = [(self._title(name), (self._texts | self._boxes())[name]) for name in names]
            grid = form_grid(fields, below=[self._faults[name] for name in names])
            grid.setColumnMinimumWidth(0, _NAMES_WIDTH)
            column.addLayout(grid)

    def _title(self, name: str) -> str:
        return tr(_TITLES[name] if name in _TITLES else _TEXTS[name][0])


def _choice(items: dict[str, str]) -> Choice:
    made = Choice()
    for value, words in items.items():
        made.addItem(tr(words), value)
    return made
