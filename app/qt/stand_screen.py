"""The Simulated stand screen: its settings, faults on demand, and what is true of it."""

from PySide6.QtWidgets import (
    QFrame,
    QGridLayout,
    QHBoxLayout,
    QLineEdit,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from app.presenters.stand_screen import StandForm, StandPresenter, StandState
from app.qt.gauges.value_grid import ValueGrid
from app.qt.theme import TextRole, set_property
from app.qt.widgets.inputs import ComboBox
from app.qt.widgets.layouts import make_scroll_area
from app.qt.widgets.shortcuts import bind_button
from app.qt.widgets.text import label, plain_text, show_chip
from messages.i18n import N_, gettext

_FIELDS = {
    "friction": (
        N_("Friction f<sub>d</sub>"),
        N_("Coefficient of dynamic friction; empty: that of the series"),
    ),
    "tilt_mrad": (
        N_("Tilt, mrad"),
        N_("Of the stand, so that the plate slides more easily to one side"),
    ),
    "noise_um": (N_("Noise, µm"), N_("Standard deviation of both gauges")),
    "rate_hz": (N_("Rate, Hz"), N_("Samples a second")),
    "drop_percent": (N_("Lost bytes, %"), N_("Of the frames, as many lose a byte")),
    "flip_percent": (
        N_("Wrong bits, %"),
        N_("Of the frames, as many have a bit flipped"),
    ),
}
_FAULTS = {
    "stall": (N_("Stall"), N_("The device sends nothing, and goes on afterwards")),
    "unplug": (N_("Unplug"), N_("The port vanishes and comes back")),
    "power": (N_("Switch off"), N_("The device loses its power and begins anew")),
    "rubbish": (N_("Rubbish"), N_("Random bytes come instead of samples")),
    "jump": (N_("Clock leaps"), N_("The device's time leaps by so many seconds")),
}
_NOT_RUNNING = N_("Faults can be asked for while the simulated stand is connected.")


class StandScreen(QWidget):
    """Draws `StandState`."""

    def __init__(self, presenter: StandPresenter) -> None:
        super().__init__()
        self._presenter = presenter
        self._series = ComboBox()
        self._fields = {name: QLineEdit() for name in _FIELDS}
        self._start = QPushButton(gettext("Start and connect"))
        self._message = label(wrap=True)
        self._seconds = QLineEdit()
        self._faults = {kind: QPushButton(gettext(text)) for kind, (text, _) in _FAULTS.items()}
        self._words = label(muted=True, wrap=True)
        self._happened = label(wrap=True)
        self._truth = ValueGrid()
        self._no_truth = label(
            gettext("They appear here while the simulated stand runs."), muted=True, wrap=True
        )
        self._lay_out()
        self._connect()

    def show_state(self, state: StandState) -> None:
        """Draw the screen."""
        if self._series.count() != len(state.all_series):
            self._series.addItems(state.all_series)
        self._series.setCurrentText(state.form.series)
        for name, field in self._fields.items():
            if field.text() != getattr(state.form, name):
                field.setText(getattr(state.form, name))
            field.setPlaceholderText(getattr(state.defaults, name))
        if self._seconds.text() != state.fault_duration_s:
            self._seconds.setText(state.fault_duration_s)
        set_property(self._start, "primary", "false" if state.is_running else "true")
        show_chip(self._message, state.message)
        for button in self._faults.values():
            button.setEnabled(state.is_running)
        self._words.setText("" if state.is_running else gettext(_NOT_RUNNING))
        self._words.setVisible(not state.is_running)
        self._happened.setText("\n".join(state.disturbances))
        self._truth.show_values(state.truth)
        self._no_truth.setVisible(not state.truth)

    def _connect(self) -> None:
        presenter = self._presenter
        self._series.activated.connect(lambda _: presenter.set_form(self._read()))
        for field in self._fields.values():
            field.textEdited.connect(lambda _: presenter.set_form(self._read()))
        self._start.clicked.connect(lambda _: presenter.start())
        self._seconds.textEdited.connect(presenter.set_fault_duration)
        bind_button(self._start, "Ctrl+Return", gettext("Start it, instead of what is connected now"), self)
        for number, (kind, button) in enumerate(self._faults.items(), start=1):
            button.clicked.connect(lambda _checked, kind=kind: presenter.inject_fault(kind))
            bind_button(button, f"Alt+{number}", gettext(_FAULTS[kind][1]), self)

    def _read(self) -> StandForm:
        texts = {name: field.text() for name, field in self._fields.items()}
        return StandForm(self._series.currentText(), **texts)

    def _lay_out(self) -> None:
        row = QHBoxLayout(self)
        row.setContentsMargins(8, 8, 8, 8)
        row.setSpacing(8)
        for make in (self._settings_card, self._faults_card, self._truth_card):
            row.addWidget(make(), 1)

    def _settings_card(self) -> QFrame:
        card, layout = _card(gettext("Set up the stand"), gettext("An empty field means the value in grey."))
        grid = QGridLayout()
        grid.setVerticalSpacing(8)
        grid.setHorizontalSpacing(12)
        _add(grid, 0, gettext("Series"), self._series, gettext("Brings pullback, masses, period and damping"))
        for line, (name, field) in enumerate(self._fields.items(), start=1):
            _add(grid, line, gettext(_FIELDS[name][0]), field, gettext(_FIELDS[name][1]))
        layout.addLayout(grid)
        layout.addWidget(self._start)
        layout.addWidget(self._message)
        layout.addStretch(1)
        return card

    def _faults_card(self) -> QFrame:
        card, layout = _card(gettext("Faults to try"), gettext("See what the app does when something fails."))
        grid = QGridLayout()
        grid.setHorizontalSpacing(12)
        _add(
            grid,
            0,
            gettext("Duration, s"),
            self._seconds,
            gettext("Seconds; a leap of the clock may go back: -5"),
        )
        layout.addLayout(grid)
        for button in self._faults.values():
            layout.addWidget(button)
        layout.addWidget(self._words)
        layout.addWidget(self._happened)
        layout.addStretch(1)
        return card

    def _truth_card(self) -> QFrame:
        title = gettext("True values")
        card, layout = _card(title, gettext("To compare with what is found."), name=title)
        layout.addWidget(self._no_truth)
        layout.addWidget(self._truth)
        layout.addStretch(1)
        return card


def _card(title: str, words: str, name: str = "") -> tuple[QFrame, QVBoxLayout]:
    """A card whose content scrolls where the window is low; with a name, by keyboard."""
    card, inside = QFrame(), QWidget()
    card.setProperty("role", "card")
    outside = QVBoxLayout(card)
    outside.setContentsMargins(1, 1, 1, 1)
    outside.addWidget(make_scroll_area(inside, name=name))
    layout = QVBoxLayout(inside)
    layout.setContentsMargins(16, 12, 16, 12)
    layout.setSpacing(12)
    layout.addWidget(label(title, TextRole.HEADING))
    layout.addWidget(label(words, muted=True, wrap=True))
    return card, layout


def _add(grid: QGridLayout, line: int, name: str, field: QWidget, hint: str) -> None:
    title = label(name)
    title.setBuddy(field)
    field.setAccessibleName(plain_text(name))
    field.setToolTip(hint)
    grid.addWidget(title, line, 0)
    grid.addWidget(field, line, 1)
    grid.setColumnStretch(1, 1)
