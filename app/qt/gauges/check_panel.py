"""A gauge checked against what is known: what it is tried with, what to do now, and the verdict."""

from dataclasses import replace

from PySide6.QtWidgets import QLineEdit, QWidget

from app.presenters.gauges.check import CheckPresenter
from app.presenters.gauges.state import NAMES, CheckForm, CheckKind, CheckState
from app.qt.gauges.value_grid import ValueGrid
from app.qt.theme import TextRole
from app.qt.widgets.inputs import ComboBox, make_button, make_choice, show_texts
from app.qt.widgets.layouts import STRETCH, make_column, make_form_grid, make_row, make_scroll_area
from app.qt.widgets.shortcuts import bind_button
from app.qt.widgets.text import label, set_text_or_hide, show_chip
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

    def __init__(self, presenter: CheckPresenter) -> None:
        super().__init__()
        self._presenter = presenter
        self._form = CheckForm()
        self._gauge = ComboBox()
        self._gauge.addItems([gettext(name) for name in NAMES])
        self._kind = make_choice({kind: kind.value for kind in CheckKind})
        self._fields = {name: QLineEdit() for name in _FIELDS}
        self._instruction = label(role=TextRole.HEADING, wrap=True)
        self._waiting = label(wrap=True)
        self._message = label(wrap=True)
        self._advance = make_button("", presenter.advance)
        self._cancel = make_button(gettext("Break off"), presenter.cancel)
        self._verdict = label(role=TextRole.HEADING, wrap=True)
        self._values = ValueGrid()
        self._warnings = label(muted=True, wrap=True)
        self._lay_out()
        self._connect()

    def show_state(self, state: CheckState) -> None:
        self._form = state.form
        self._gauge.setCurrentIndex(state.form.gauge)
        self._kind.setCurrentIndex(list(CheckKind).index(state.form.kind))
        show_texts(self._fields, state.form)
        for part in (self._gauge, self._kind, *self._fields.values()):
            part.setEnabled(not state.is_started)
        set_text_or_hide(self._instruction, state.instruction)
        set_text_or_hide(self._waiting, state.reading_status)
        self._advance.setText(gettext(_STARTED if state.is_started else _NOT_STARTED))
        is_due = bool(state.instruction) or not state.is_started
        self._advance.setEnabled(is_due and not state.reading_status)
        self._cancel.setVisible(state.is_started)
        show_chip(self._message, state.message)
        show_chip(self._verdict, state.outcome)
        self._values.show_values(state.values)
        set_text_or_hide(self._warnings, "\n".join(state.warnings))

    def add_keys(self, screen: QWidget) -> None:
        """Let keys do what the buttons do, as long as the screen is shown."""
        bind_button(self._advance, "Ctrl+Return", gettext("Begin the check, or take the reading"), screen)

    def _fill(self) -> None:
        texts = {name: field.text() for name, field in self._fields.items()}
        gauge, kind = self._gauge.currentIndex(), self._kind.currentData()
        self._presenter.set_form(replace(self._form, gauge=gauge, kind=CheckKind(kind), **texts))

    def _connect(self) -> None:
        self._gauge.activated.connect(lambda _: self._fill())
        self._kind.activated.connect(lambda _: self._fill())
        for field in self._fields.values():
            field.textEdited.connect(lambda _: self._fill())
            field.returnPressed.connect(self._advance.click)

    def _lay_out(self) -> None:
        page = QWidget()
        page.setMaximumWidth(_WIDTH)
        self._advance.setProperty("primary", "true")
        make_column(
            label(gettext(_HOW), muted=True, wrap=True),
            make_form_grid(self._named_fields()),
            self._instruction,
            self._waiting,
            make_row(self._advance, self._cancel, STRETCH, spacing=8),
            self._message,
            self._verdict,
            self._values,
            self._warnings,
            STRETCH,
            spacing=12,
            margins=(16, 8),
            of=page,
        )
        make_column(make_scroll_area(page, name=gettext("Check of a gauge")), of=self)

    def _named_fields(self) -> list[tuple[str, QWidget]]:
        for name, field in self._fields.items():
            field.setPlaceholderText(gettext(_FIELDS[name][1]))
        written = [(gettext(_FIELDS[name][0]), field) for name, field in self._fields.items()]
        return [(gettext("Gauge to check"), self._gauge), (gettext("Tried with"), self._kind), *written]
