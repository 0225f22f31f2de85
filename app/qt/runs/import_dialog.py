"""The import dialog: columns, units and lines of a foreign file, and beside them what becomes of it."""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from PySide6.QtCore import Qt
from PySide6.QtGui import QFontDatabase
from PySide6.QtWidgets import (
    QDialog,
    QHBoxLayout,
    QLineEdit,
    QPlainTextEdit,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from app.presenters.runs.import_tasks import GAIN, ImportForm, Reading
from app.presenters.runs.importing import ImportPresenter, ImportState, waiting_words
from app.presenters.screen import Chip
from app.presenters.words import mark, tr
from app.qt.runs.preview import RunsPreview
from app.qt.theme import Theme, Type
from app.qt.widgets.choice import Choice
from app.qt.widgets.forms import form_grid
from app.qt.widgets.keys import give_key
from app.qt.widgets.scrolling import scrolling
from app.qt.widgets.text import label, show_chip

_COLUMN_WIDTH = 384
_NAMES_WIDTH = 116
_HEAD_HEIGHT = 132
_FIND_OUT = mark("find out")
_DELIMITERS = {
    "": _FIND_OUT,
    ",": mark("comma"),
    ";": mark("semicolon"),
    "\t": mark("tab"),
    " ": mark("blanks"),
    "|": "|",
}
_DECIMALS = {"": _FIND_OUT, ".": mark("point"), ",": mark("comma")}
_HEADERS = {"": _FIND_OUT, "yes": mark("yes"), "no": mark("no")}
_MEASURES = {"relative": mark("plate against table"), "plate": mark("plate against base")}
_TIMES = {"s": "s", "ms": "ms", "us": "µs"}
_UNITS = {"m": "m", "mm": "mm", "um": "µm", GAIN: mark("by a gain")}
_QUANTITIES = {
    "displacement": mark("displacement"),
    "velocity": mark("velocity"),
    "acceleration": mark("acceleration"),
}
_WITH_GAIN = ("gain", "offset", "unit_name")
_TEXTS = {
    "gain": (mark("Gain"), mark("reading of one unit of a cell")),
    "offset": (mark("Offset"), mark("reading at a cell of 0")),
    "unit_name": (mark("Unit of the gain"), mark("m, unless something else: rad, V")),
    "from_s": (mark("From, s"), mark("the beginning")),
    "until_s": (mark("Until, s"), mark("the end")),
    "segment": (mark("Stretch"), mark("from 0, where times go back")),
    "series": (mark("Series"), mark("for example 1FFM0")),
    "plate_mass_kg": (mark("Plate mass, kg"), mark("as the series says")),
    "table_mass_kg": (mark("Table mass, kg"), mark("as of the stand")),
    "operator": (mark("Operator"), mark("who recorded")),
    "note": (mark("Note"), mark("kept with the run")),
}


class ImportDialog(QDialog):
    """Draws `ImportState`. It stays beside the window and stops nothing."""

    def __init__(self, theme: Theme, presenter: ImportPresenter, parent: QWidget) -> None:
        super().__init__(parent)
        self._presenter = presenter
        self._shown = ImportState()
        self._title = label(role=Type.HEADING)
        self._waiting = label(muted=True)
        self._delimiter, self._decimal, self._header = (
            _choice(items) for items in (_DELIMITERS, _DECIMALS, _HEADERS)
        )
        self._skip = QLineEdit()
        self._skip.setPlaceholderText("0")
        self._columns = {name: Choice() for name in ("time", "table", "second")}
        self._choices = {
            "time_unit": _choice(_TIMES),
            "measures": _choice(_MEASURES),
            "quantity": _choice(_QUANTITIES),
            "unit": _choice(_UNITS),
        }
        self._texts = {name: QLineEdit() for name in _TEXTS}
        self._preview = RunsPreview(theme)
        self._words = label(wrap=True)
        self._head = QPlainTextEdit()
        self._message = label(wrap=True)
        self._import = QPushButton(tr("Import"))
        self._leave = QPushButton(tr("Leave out"))
        self._close = QPushButton(tr("Close"))
        self._lay_out()
        self._connect()

    def show_state(self, state: ImportState) -> None:
        """Draw what differs."""
        old, self._shown = self._shown, state
        name = Path(state.path).name
        self._title.setText(tr("Import {name}", name=name) if name else tr("No file is left to import"))
        self._waiting.setText(waiting_words(state))
        if (state.columns, state.titles) != (old.columns, old.titles):
            self._offer_columns(state)
        self._show_form(state)
        if state.overlay is not old.overlay:
            self._preview.show_overlay(state.overlay)
        self._words.setText(state.words)
        if state.head != old.head:
            self._head.setPlainText(state.head)
        show_chip(self._message, Chip(state.busy) if state.busy else state.message)
        self._message.show()  # an empty one still keeps the buttons at the right
        self._import.setEnabled(state.can_import)
        self._leave.setEnabled(bool(state.path))

    def reject(self) -> None:
        """Close, by whatever means, and leave out what was not imported."""
        self._presenter.close()
        super().reject()

    def _offer_columns(self, state: ImportState) -> None:
        for name, box in self._columns.items():
            box.clear()
            if name == "second":
                box.addItem(tr("none"), "")
            for column, title in zip(state.columns, state.titles, strict=True):
                box.addItem(title, column)

    def _show_form(self, state: ImportState) -> None:
        form, reading = state.form, state.form.reading
        for box, value in (
            (self._delimiter, reading.delimiter),
            (self._decimal, reading.decimal),
            (self._header, reading.header),
            *((box, getattr(form, name)) for name, box in (self._columns | self._choices).items()),
        ):
            box.setCurrentIndex(box.findData(value))
        for field, text in (
            (self._skip, reading.skip),
            *((field, getattr(form, name)) for name, field in self._texts.items()),
        ):
            if field.text() != text:
                field.setText(text)
        for box in (self._delimiter, self._decimal):
            box.setEnabled(state.is_text)
        for name in _WITH_GAIN:
            self._texts[name].setEnabled(form.unit == GAIN)
        self._choices["measures"].setEnabled(bool(form.second))

    def _fill(self) -> None:
        reading = Reading(
            self._delimiter.currentData() or "",
            self._decimal.currentData() or "",
            self._skip.text(),
            self._header.currentData() or "",
        )
        filled = {name: box.currentData() or "" for name, box in (self._columns | self._choices).items()}
        texts = {name: field.text() for name, field in self._texts.items()}
        self._presenter.fill(replace(ImportForm(), reading=reading, **filled, **texts))

    def _connect(self) -> None:
        boxes = (
            self._delimiter,
            self._decimal,
            self._header,
            *self._columns.values(),
            *self._choices.values(),
        )
        for box in boxes:
            box.activated.connect(lambda _: self._fill())
        for field in (self._skip, *self._texts.values()):
            field.editingFinished.connect(self._fill)
        self._import.clicked.connect(lambda _checked: self._presenter.import_file())
        self._leave.clicked.connect(lambda _checked: self._presenter.skip_file())
        self._close.clicked.connect(self.reject)
        give_key(self._import, "Ctrl+Return", tr("Make a run of the file, and go on with the next"), self)
        give_key(self._leave, "Alt+L", tr("Leave this file out, and go on with the next"), self)

    def _lay_out(self) -> None:
        self.setWindowTitle(tr("Import"))
        self.resize(1000, 660)
        top = QHBoxLayout()
        top.addWidget(self._title, 1)
        top.addWidget(self._waiting)
        middle = QHBoxLayout()
        middle.setSpacing(16)
        left = scrolling(self._form(), is_column=False)
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
        layout = QVBoxLayout(self)
        layout.setContentsMargins(16, 16, 16, 16)
        layout.setSpacing(12)
        layout.addLayout(top)
        layout.addLayout(middle, 1)
        layout.addLayout(buttons)

    def _right(self) -> QVBoxLayout:
        self._head.setReadOnly(True)
        self._head.setFont(QFontDatabase.systemFont(QFontDatabase.SystemFont.FixedFont))
        self._head.setLineWrapMode(QPlainTextEdit.LineWrapMode.NoWrap)
        self._head.setTabChangesFocus(True)
        self._head.setFixedHeight(_HEAD_HEIGHT)
        self._head.setAccessibleName(tr("First lines of the file"))
        right = QVBoxLayout()
        right.setSpacing(8)
        right.addWidget(self._preview, 1)
        right.addWidget(self._words)
        right.addWidget(label(tr("First lines of the file"), Type.LABEL, muted=True))
        right.addWidget(self._head)
        return right

    def _form(self) -> QWidget:
        page = QWidget()
        column = QVBoxLayout(page)
        column.setContentsMargins(0, 0, 12, 0)
        column.setSpacing(12)
        for title, fields in self._groups():
            column.addWidget(label(title, Type.HEADING))
            grid = form_grid(fields)
            grid.setColumnMinimumWidth(0, _NAMES_WIDTH)
            column.addLayout(grid)
        column.addStretch(1)
        for name, field in self._texts.items():
            field.setPlaceholderText(tr(_TEXTS[name][1]))
        return page

    def _groups(self) -> Iterable[tuple[str, list[tuple[str, QWidget]]]]:
        def texts(*names: str) -> list[tuple[str, QWidget]]:
            return [(tr(_TEXTS[name][0]), self._texts[name]) for name in names]

        columns, choices = self._columns, self._choices
        yield tr("Columns"), [
            (tr("Time"), columns["time"]), (tr("Unit of time"), choices["time_unit"]),
            (tr("Gauge 1, table"), columns["table"]), (tr("Gauge 2"), columns["second"]),
            (tr("Gauge 2 measures"), choices["measures"]), (tr("Quantity"), choices["quantity"]),
            (tr("Unit"), choices["unit"]), *texts(*_WITH_GAIN),
        ]  # fmt: skip
        yield tr("Test"), texts("series", "plate_mass_kg", "table_mass_kg", "operator", "note")
        yield tr("Lines"), [
            (tr("Between cells"), self._delimiter), (tr("Decimal sign"), self._decimal),
            (tr("Names above"), self._header), (tr("Lines skipped"), self._skip),
        ]  # fmt: skip
        yield tr("Part"), texts("from_s", "until_s", "segment")


def _choice(items: dict[str, str]) -> Choice:
    made = Choice()
    for value, words in items.items():
        made.addItem(tr(words), value)
    return made
