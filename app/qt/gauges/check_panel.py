"""A gauge checked against what is known: what it is tried with, what to do now, and the verdict."""

from dataclasses import replace

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QHBoxLayout, QLineEdit, QPushButton, QVBoxLayout, QWidget

from app.presenters.gauges.cards import NAMES
from app.presenters.gauges.state import CheckForm, CheckKind, CheckState, GaugesEvents
from app.qt.gauges.value_grid import ValueGrid
from app.qt.theme import TextRole
from app.qt.widgets.inputs import ComboBox
from app.qt.widgets.layouts import make_form_grid, make_scroll_area
from app.qt.widgets.shortcuts import bind_button
from app.qt.widgets.text import label, show_chip
from messages.i18n import N_, gettext

_HOW = N_(
    "Before a test: move a gauge by a known displacement, or switch its shunt resistor on. It passes if it "
    "is no further off than its calibration, the displacement and the readings allow; runs carry the verdict."
)
_FIELDS = {
    "known": (N_("Known"), N_("with its sign, for example 10")),
    "uncertainty": (N_("Its uncertainty"), N_("in the same unit")),
    "reference": (N_("Reference"), N_("dial gauge, gauge block or resistor")),
    "checked_by": (N_("Checked by"), N_("your name")),
}
_NOT_STARTED, _STARTED = N_("Begin the check"), N_("Take the reading")
_WIDTH = 640


class CheckPanel(QWidget):
    """Draws `CheckState`."""

    def __init__(self, events: GaugesEvents) -> None:
        super().__init__()
        self._events = events
        self._form = CheckForm()
        self._gauge = ComboBox()
        self._gauge.addItems([gettext(name) for name in NAMES])
        self._tried = ComboBox()
        for tried in CheckKind:
            self._tried.addItem(gettext(tried.value), tried)
        self._fields = {name: QLineEdit() for name in _FIELDS}
        self._instruction = label(role=TextRole.HEADING, wrap=True)
        self._waiting = label(wrap=True)
        self._message = label(wrap=True)
        self._go_on = QPushButton()
        self._leave = QPushButton(gettext("Break off"))
        self._verdict = label(role=TextRole.HEADING, wrap=True)
        self._facts = ValueGrid()
        self._cautions = label(muted=True, wrap=True)
        self._lay_out()
        self._connect()

    def show_state(self, state: CheckState) -> None:
        """Draw what differs."""
        self._form = state.form
        self._gauge.setCurrentIndex(state.form.gauge)
        self._tried.setCurrentIndex(list(CheckKind).index(state.form.kind))
        for name, field in self._fields.items():
            if field.text() != getattr(state.form, name):
                field.setText(getattr(state.form, name))
        for part in (self._gauge, self._tried, *self._fields.values()):
            part.setEnabled(not state.is_started)
        for shown, text in ((self._instruction, state.instruction), (self._waiting, state.reading_status)):
            shown.setText(text)
            shown.setVisible(bool(text))
        self._go_on.setText(gettext(_STARTED if state.is_started else _NOT_STARTED))
        self._go_on.setEnabled(not state.reading_status and (bool(state.instruction) or not state.is_started))
        self._leave.setVisible(state.is_started)
        show_chip(self._message, state.message)
        show_chip(self._verdict, state.outcome)
        self._facts.show_values(state.values)
        self._cautions.setText("\n".join(state.warnings))
        self._cautions.setVisible(bool(state.warnings))

    def add_keys(self, screen: QWidget) -> None:
        """Let keys do what the buttons do, as long as the screen is shown."""
        bind_button(self._go_on, "Ctrl+Return", gettext("Begin the check, or take the reading"), screen)

    def _fill(self) -> None:
        texts = {name: field.text() for name, field in self._fields.items()}
        gauge, tried = self._gauge.currentIndex(), self._tried.currentData()
        self._events.set_check_form(replace(self._form, gauge=gauge, kind=CheckKind(tried), **texts))

    def _connect(self) -> None:
        self._gauge.activated.connect(lambda _: self._fill())
        self._tried.activated.connect(lambda _: self._fill())
        for field in self._fields.values():
            field.textEdited.connect(lambda _: self._fill())
            field.returnPressed.connect(self._go_on.click)
        self._go_on.clicked.connect(lambda _checked: self._events.advance_check())
        self._leave.clicked.connect(lambda _checked: self._events.cancel_check())

    def _lay_out(self) -> None:
        page = QWidget()
        page.setMaximumWidth(_WIDTH)
        column = QVBoxLayout(page)
        column.setContentsMargins(16, 8, 16, 8)
        column.setSpacing(12)
        column.addWidget(label(gettext(_HOW), muted=True, wrap=True))
        column.addLayout(make_form_grid(self._named_fields()))
        column.addWidget(self._instruction)
        column.addWidget(self._waiting)
        buttons = QHBoxLayout()
        buttons.setSpacing(8)
        self._go_on.setProperty("primary", "true")
        for button in (self._go_on, self._leave):
            buttons.addWidget(button, 0, Qt.AlignmentFlag.AlignLeft)
        buttons.addStretch(1)
        column.addLayout(buttons)
        for part in (self._message, self._verdict, self._facts, self._cautions):
            column.addWidget(part)
        column.addStretch(1)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addWidget(make_scroll_area(page, name=gettext("Check of a gauge")))

    def _named_fields(self) -> list[tuple[str, QWidget]]:
        for name, field in self._fields.items():
            field.setPlaceholderText(gettext(_FIELDS[name][1]))
        written = [(gettext(_FIELDS[name][0]), field) for name, field in self._fields.items()]
        return [(gettext("Gauge to check"), self._gauge), (gettext("Tried with"), self._tried), *written]
