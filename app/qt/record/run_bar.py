"""The strip at the bottom of Record: series and plan, what is known of the next tests, the large buttons."""

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import (
    QFrame,
    QHBoxLayout,
    QLabel,
    QPushButton,
    QSizePolicy,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from app.presenters.record.state import Action, PlanState, RunChoices, RunForm
from app.qt.record.plan_strip import PlanStrip
from app.qt.record.run_form import RunFormFields
from app.qt.theme import TextRole, font, set_property
from app.qt.widgets.inputs import ComboBox
from app.qt.widgets.shortcuts import add_shortcut, bind_button, set_button_hint
from messages.i18n import N_, gettext

_BUTTONS = {
    Action.TARE: (
        N_("Tare"),
        "T",
        ("T",),
        N_("Read both gauges from here; calibration and runs stay"),
    ),
    Action.ARM: (N_("Arm"), "A", ("A",), N_("Record the next pullback")),
    Action.STOP: (N_("Stop"), "Esc", ("Esc",), N_("End the recording now and keep it")),
    Action.NEXT: (
        N_("Next"),
        "Enter",
        ("Return", "Enter"),
        N_("Make ready for the next run"),
    ),
}
_FOLD = N_("Operator, conditions, runs in a row, note")
_KEEP = (N_("Keep"), N_("Keep the run with what was found in it, and go on"))


class RunBar(QFrame):
    """Series, plan, fold; Tare, Arm, Stop, Keep."""

    acted = Signal(Action)
    series_chosen = Signal(str)
    filled = Signal(RunForm)
    plan_wanted = Signal()
    left_form = Signal()
    """The keyboard is wanted by the buttons again."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setProperty("role", "bar")
        self._series = ComboBox()
        self._series.setMinimumWidth(112)
        self._series.setAccessibleName(gettext("Series"))
        self._strip = PlanStrip()
        self._plan = QPushButton(gettext("Plan"))
        self._fold = QToolButton()
        self._summary = _Elided()
        self._form = RunFormFields()
        self._form.hide()
        self._buttons = {action: self._button(action) for action in _BUTTONS}
        self._shown = RunChoices("", ())
        self._lay_out()
        self._connect()

    def show_choices(self, choices: RunChoices, plan: PlanState) -> None:
        """Write what the next runs are."""
        self._shown = choices
        if self._series.count() != len(choices.all_series):
            self._series.addItems(choices.all_series)
        self._series.setCurrentText(choices.series)
        choosable = choices.editable and not choices.series_fixed
        self._series.setEnabled(choosable)
        hint = gettext("Series of the next run: pullback, contact, added mass")
        self._series.setToolTip(choices.series_hint or hint)
        self._strip.show_plan(plan, choices.series, choosable=choosable)
        self._plan.setText(
            gettext("Plan {done}/{planned}", done=plan.done, planned=plan.planned)
            if plan.planned
            else gettext("Plan")
        )
        self._form.show_form(choices.form, editable=choices.editable)
        self._show_summary()

    def show_actions(self, allowed: frozenset[Action], primary: Action | None, *, keeps: bool) -> None:
        """Enable what can be done, and bring out what comes next; `keeps` where a run waits for it."""
        for action, button in self._buttons.items():
            button.setEnabled(action in allowed)
            is_primary = action is primary and not keeps  # the button beside the result is, then
            set_property(button, "primary", "true" if is_primary else "false")
        text, key, _, words = _BUTTONS[Action.NEXT]
        text, words = _KEEP if keeps else (text, words)
        self._buttons[Action.NEXT].setText(f"{gettext(text)}   {key}")
        set_button_hint(self._buttons[Action.NEXT], gettext(words))

    def take_focus(self) -> None:
        """Focus the button that comes next, or else the first that can be pressed."""
        usable = [button for button in self._buttons.values() if button.isEnabled()]
        usable.sort(key=lambda button: button.property("primary") != "true")
        (usable[0] if usable else self).setFocus()

    def _show_summary(self) -> None:
        choices = self._shown
        unfolded = self._form.isVisibleTo(self)
        self._fold.setArrowType(Qt.ArrowType.DownArrow if unfolded else Qt.ArrowType.RightArrow)
        nothing = gettext(_FOLD)
        usual = nothing if unfolded else choices.summary or nothing
        self._summary.write(choices.form_error or usual, is_fault=bool(choices.form_error))

    def _toggle(self) -> None:
        self._form.setVisible(not self._form.isVisibleTo(self))
        if self._form.isVisibleTo(self):
            self._form.take_focus()
        else:
            self.left_form.emit()
        self._show_summary()

    def _button(self, action: Action) -> QPushButton:
        text, key, keys, words = _BUTTONS[action]
        button = QPushButton(f"{gettext(text)}   {key}")
        button.setProperty("scale", "large")
        button.setMinimumWidth(108)
        button.clicked.connect(lambda: self.acted.emit(action))
        bind_button(button, keys, gettext(words), self)
        return button

    def _connect(self) -> None:
        self._series.activated.connect(lambda _: self.series_chosen.emit(self._series.currentText()))
        self._strip.chosen.connect(self.series_chosen)
        self._plan.clicked.connect(self.plan_wanted)
        bind_button(self._plan, "P", gettext("Say which series to measure how often"), self)
        self._fold.setProperty("role", "fold")
        self._fold.setAccessibleName(gettext(_FOLD))
        self._fold.clicked.connect(self._toggle)
        bind_button(self._fold, "F2", gettext("What is known of the next tests"), self)
        self._form.filled.connect(self.filled)
        self._form.left.connect(self.left_form)
        add_shortcut(self, "S", gettext("Choose the series by the arrow keys"), self._series.setFocus)
        untare = gettext("Read both gauges by the calibration again")
        add_shortcut(self, "Shift+T", untare, lambda: self.acted.emit(Action.UNTARE))

    def _lay_out(self) -> None:
        first = QHBoxLayout()
        first.setSpacing(8)
        first.addWidget(self._series)
        first.addWidget(self._strip, 1)
        first.addWidget(self._plan)
        second = QHBoxLayout()
        second.setSpacing(4)
        second.addWidget(self._fold)
        second.addWidget(self._summary, 1)
        left = QVBoxLayout()
        left.setSpacing(4)
        left.addLayout(first)
        left.addLayout(second)
        row = QHBoxLayout()
        row.setSpacing(12)
        row.addLayout(left, 1)
        for button in self._buttons.values():
            row.addWidget(button)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(12, 8, 12, 8)
        layout.setSpacing(4)
        layout.addLayout(row)
        layout.addWidget(self._form)


class _Elided(QLabel):
    """A line that is cut short where it does not fit; the tool tip has the whole."""

    def __init__(self) -> None:
        super().__init__()
        self._text = ""
        self.setFont(font(TextRole.TEXT))
        self.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)

    def write(self, text: str, *, is_fault: bool) -> None:
        """Write a line."""
        self._text = text
        self.setToolTip(text)
        set_property(self, "tone", "bad" if is_fault else "plain")
        set_property(self, "role", "" if is_fault else "muted")
        self._fit()

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: N802
        """Show as much as fits."""
        super().resizeEvent(event)
        self._fit()

    def _fit(self) -> None:
        self.setText(self.fontMetrics().elidedText(self._text, Qt.TextElideMode.ElideRight, self.width()))
