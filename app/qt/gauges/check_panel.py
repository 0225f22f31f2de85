"""A gauge checked against what is known: what it is tried with, what to do now, and the verdict."""

from dataclasses import replace

from PySide6.QtWidgets import QWidget

from app.presenters.gauges.check import CheckPresenter
from app.presenters.gauges.state import NAMES, CheckForm, CheckKind, CheckState
from app.qt.theme import TextRole
from app.qt.widgets.inputs import make_button, make_choice, make_fields, show_texts
from app.qt.widgets.layouts import STRETCH, make_column, make_form_grid, make_row, make_scroll_area
from app.qt.widgets.shortcuts import bind_button
from app.qt.widgets.text import ValueGrid, label, set_text_or_hide, show_chip, stopped_chip
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
        self._gauge = make_choice(dict(enumerate(NAMES)))
        self._kind = make_choice({kind: kind.value for kind in CheckKind})
        self._fields = make_fields(_FIELDS, self._fill)
        self._instruction = label(role=TextRole.HEADING, wrap=True)
        self._stopped = label(wrap=True)
        self._waiting = label(wrap=True)
        self._message = label(wrap=True)
        self._advance = make_button("", presenter.advance)
        self._advance.setProperty("primary", "true")
        self._cancel = make_button(gettext("Break off"), presenter.cancel)
        self._verdict = label(role=TextRole.HEADING, wrap=True)
        self._values = ValueGrid()
        self._warnings = label(muted=True, wrap=True)
        self._gauge.activated.connect(lambda _: self._fill())
        self._kind.activated.connect(lambda _: self._fill())
        for field in self._fields.values():
            field.returnPressed.connect(self._advance.click)
        rows = ((gettext(_FIELDS[name][0]), field) for name, field in self._fields.items())
        combos = ((gettext("Gauge to check"), self._gauge), (gettext("Tried with"), self._kind))
        how, buttons = label(gettext(_HOW), muted=True, wrap=True), (self._advance, self._cancel, STRETCH)
        head = (
            how,
            make_form_grid((*combos, *rows)),
            self._stopped,
            self._instruction,
            self._waiting,
            make_row(*buttons, spacing=8),
        )
        found = (self._message, self._verdict, self._values, self._warnings)
        page = QWidget()
        page.setMaximumWidth(_WIDTH)
        make_column(*head, *found, STRETCH, spacing=12, margins=(16, 8), of=page)
        make_column(make_scroll_area(page, name=gettext("Check of a gauge")), of=self)

    def show_state(self, state: CheckState) -> None:
        self._form = state.form
        self._gauge.setCurrentIndex(state.form.gauge)
        self._kind.setCurrentIndex(list(CheckKind).index(state.form.kind))
        show_texts(self._fields, state.form)
        for part in (self._gauge, self._kind, *self._fields.values()):
            part.setEnabled(not state.is_started)
        set_text_or_hide(self._instruction, state.instruction)
        show_chip(self._stopped, stopped_chip(state.stopped_at))
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
        bind_button(self._advance, "Ctrl+Return", gettext("Begin the check, or take the reading"), screen)

    def _fill(self) -> None:
        texts = {name: field.text() for name, field in self._fields.items()}
        gauge, kind = self._gauge.currentIndex(), self._kind.currentData()
        self._presenter.set_form(replace(self._form, gauge=gauge, kind=CheckKind(kind), **texts))
