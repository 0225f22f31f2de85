"""View of the Simulated stand screen: options, faults on demand, true values."""

from functools import partial

from PySide6.QtWidgets import QFrame, QGridLayout, QLineEdit, QWidget

from app.presenters.stand_screen import StandForm, StandPresenter, StandState
from app.qt.theme import TextRole, set_property
from app.qt.widgets.inputs import ComboBox, make_button, show_default, show_texts
from app.qt.widgets.layouts import STRETCH, Item, make_column, make_row, make_scroll_area
from app.qt.widgets.shortcuts import bind_button
from app.qt.widgets.text import ValueGrid, label, plain_text, set_text_or_hide, set_tool_tip, show_chip
from app.simulated_stand.effects import LISTED
from app.simulated_stand.options import Gesture
from messages.i18n import N_, gettext

_FIELDS = {
    "friction": (
        N_("Friction f<sub>d</sub>"),
        N_("Coefficient of dynamic friction; empty: that of the series"),
    ),
    "tilt_mrad": (N_("Tilt, mrad"), N_("Of the stand, so that the plate slides more easily to one side")),
    "noise_um": (N_("Noise, µm"), N_("Standard deviation of both gauges")),
    "rate_hz": (N_("Rate, Hz"), N_("Samples a second")),
    "drop_percent": (N_("Lost bytes, %"), N_("Of the frames, as many lose a byte")),
    "flip_percent": (N_("Wrong bits, %"), N_("Of the frames, as many have a bit flipped")),
    "effects": (N_("Effects"), N_("What is not ideal, for example release-ramp=0.01 film=0.5. There are:")),
}
_FAULTS = {
    "stall": (N_("Stall"), N_("The device sends nothing, and goes on afterwards")),
    "unplug": (N_("Unplug"), N_("The port vanishes and comes back")),
    "power": (N_("Switch off"), N_("The device loses its power and begins anew")),
    "rubbish": (N_("Rubbish"), N_("Random bytes come instead of samples")),
    "jump": (N_("Clock leaps"), N_("The device's time leaps by so many seconds")),
    Gesture.EARLY: (N_("Let go early"), N_("The next pull is let go at a third of the pullback")),
}
_NOT_RUNNING = N_("Faults can be asked for while the simulated stand is connected.")


class StandScreen(QWidget):
    def __init__(self, presenter: StandPresenter) -> None:
        super().__init__()
        self._presenter = presenter
        self._series = ComboBox()
        self._fields = {name: QLineEdit() for name in _FIELDS}
        self._start = make_button(gettext("Start and connect"), presenter.start)
        self._message = label(wrap=True)
        self._seconds = QLineEdit()
        self._faults = {
            kind: make_button(gettext(text), partial(presenter.inject_fault, kind))
            for kind, (text, _) in _FAULTS.items()
        }
        self._words = label(muted=True, wrap=True)
        self._happened = label(wrap=True)
        self._truth = ValueGrid()
        hint = gettext("They appear here while the simulated stand runs.")
        self._no_truth = label(hint, muted=True, wrap=True)
        self._lay_out()
        self._connect()

    def show_state(self, state: StandState) -> None:
        if self._series.count() != len(state.all_series):
            self._series.addItems(state.all_series)
        self._series.setCurrentText(state.form.series)
        show_texts(self._fields, state.form)
        for name, field in self._fields.items():
            show_default(field, getattr(state.defaults, name) or gettext("none"))
        show_texts({"fault_duration_s": self._seconds}, state)
        set_property(self._start, "primary", "false" if state.is_running else "true")
        show_chip(self._message, state.message)
        for button in self._faults.values():
            button.setEnabled(state.is_running)
        set_text_or_hide(self._words, "" if state.is_running else gettext(_NOT_RUNNING))
        self._happened.setText("\n".join(state.disturbances))
        self._truth.show_values(state.truth)
        self._no_truth.setVisible(not state.truth)

    def _connect(self) -> None:
        presenter = self._presenter
        self._series.activated.connect(lambda _: presenter.set_form(self._read()))
        for field in self._fields.values():
            field.textEdited.connect(lambda _: presenter.set_form(self._read()))
        self._seconds.textEdited.connect(presenter.set_fault_duration)
        bind_button(self._start, "Ctrl+Return", gettext("Start it, instead of what is connected now"), self)
        for number, (kind, button) in enumerate(self._faults.items(), start=1):
            bind_button(button, f"Alt+{number}", gettext(_FAULTS[kind][1]), self)

    def _read(self) -> StandForm:
        texts = {name: field.text() for name, field in self._fields.items()}
        return StandForm(self._series.currentText(), **texts)

    def _lay_out(self) -> None:
        cards = [(make(), 1) for make in (self._settings_card, self._faults_card, self._truth_card)]
        make_row(*cards, spacing=8, margins=(8, 8), of=self)

    def _settings_card(self) -> QFrame:
        grid = QGridLayout()
        grid.setVerticalSpacing(8)
        grid.setHorizontalSpacing(12)
        _add(grid, 0, gettext("Series"), self._series, gettext("Brings pullback, masses, period and damping"))
        for line, (name, field) in enumerate(self._fields.items(), start=1):
            _add(grid, line, gettext(_FIELDS[name][0]), field, gettext(_FIELDS[name][1]))
        effects = self._fields["effects"]
        set_tool_tip(effects, "\n".join((effects.toolTip(), *LISTED)))
        hint = gettext("Empty a field for its usual value.")
        return _card(gettext("Set up the simulated stand"), hint, grid, self._start, self._message)

    def _faults_card(self) -> QFrame:
        grid = QGridLayout()
        grid.setHorizontalSpacing(12)
        seconds = gettext("Seconds; a leap of the clock may go back: -5")
        _add(grid, 0, gettext("Duration, s"), self._seconds, seconds)
        hint = gettext("See what the app does when something fails.")
        parts = (grid, *self._faults.values(), self._words, self._happened)
        return _card(gettext("Faults to try"), hint, *parts)

    def _truth_card(self) -> QFrame:
        title = gettext("True values")
        hint = gettext("To compare with what is found.")
        return _card(title, hint, self._no_truth, self._truth, name=title)


def _card(title: str, hint: str, *parts: Item, name: str = "") -> QFrame:
    """Make a card whose content scrolls in a low window; with a name, by keyboard."""
    card, inside = QFrame(), QWidget()
    card.setProperty("role", "card")
    heading = (label(title, TextRole.HEADING), label(hint, muted=True, wrap=True))
    make_column(*heading, *parts, STRETCH, spacing=12, margins=(16, 12), of=inside)
    make_column(make_scroll_area(inside, name=name), margins=(1, 1), of=card)
    return card


def _add(grid: QGridLayout, line: int, name: str, field: QWidget, hint: str) -> None:
    title = label(name)
    title.setBuddy(field)
    field.setAccessibleName(plain_text(name))
    set_tool_tip(field, hint)
    grid.addWidget(title, line, 0)
    grid.addWidget(field, line, 1)
    grid.setColumnStretch(1, 1)
