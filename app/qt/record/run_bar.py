"""Bar at the bottom of Record: series and plan, form of the next runs, large buttons."""

from collections.abc import Callable

from PySide6.QtCore import Qt
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QFrame, QGridLayout, QPushButton, QSizePolicy, QToolButton, QWidget

from app.presenters.conditions import CONDITION_TITLES
from app.presenters.record.state import (
    Action,
    PlanState,
    RecordEvent,
    RunChoices,
    RunForm,
    SeriesChosen,
    SeriesProgress,
)
from app.qt.theme import TextRole, set_property
from app.qt.widgets.inputs import (
    ESCAPE_AND_ENTER,
    ComboBox,
    ShortcutSafeEdit,
    make_button,
    show_default,
    show_texts,
)
from app.qt.widgets.layouts import STRETCH, make_column, make_row
from app.qt.widgets.shortcuts import ENTER_KEYS, add_shortcut, bind_button, set_button_hint
from app.qt.widgets.text import ElidedLabel, button_text, label, set_tool_tip
from messages.i18n import N_, gettext, ngettext

_BUTTONS = {
    Action.TARE: (N_("Tare"), "T", N_("Read both gauges from here; calibration and runs stay")),
    Action.ARM: (N_("Arm"), "A", N_("Record the next pullback")),
    Action.STOP: (N_("Stop"), "Esc", N_("End the recording now and keep it; before the pull, disarm")),
    Action.NEXT: (N_("Next"), "Enter", N_("Make ready for the next run")),
}
"""Label, key and description of each action."""
_FOLD = N_("Operator, conditions, runs in a row, note")
_DISARM = (N_("Disarm"), N_("End without a run: the table has not been pulled back"))
_STRIP_SPACING = 4
_DEFAULTS = {"count": "1"}
"""Values of fields that are left empty; the other fields show an example or a hint."""
_FORM_FIELDS = {
    "operator": (N_("Operator"), N_("name")),
    "temperature_c": (CONDITION_TITLES["temperature_c"], N_("for example 21.5")),
    "humidity_percent": (CONDITION_TITLES["humidity_percent"], N_("for example 45")),
    "plate_id": (CONDITION_TITLES["plate_id"], N_("which one")),
    "contact_id": (CONDITION_TITLES["contact_id"], N_("which pair of surfaces")),
    "surface_preparation": (CONDITION_TITLES["surface_preparation"], N_("how prepared")),
    "run_in_number": (CONDITION_TITLES["run_in_number"], N_("counts up by itself")),
    "count": (N_("Runs in a row"), ""),
    "note": (N_("Note"), N_("kept with the next run")),
}
_FORM_COLUMNS = 5
_WIDE = {"note": 2}


class RunBar(QFrame):
    """Series, plan and form of the next runs; Tare, Arm, Stop, Next.

    Next is hidden while a run waits for a decision. Its key keeps the run then, as `DecisionPanel` says.

    `leave_form` gives the keyboard focus back to the buttons.
    """

    def __init__(
        self,
        dispatch: Callable[[RecordEvent], None],
        edit_plan: Callable[[], None],
        leave_form: Callable[[], None],
    ) -> None:
        super().__init__()
        self._dispatch = dispatch
        self._leave_form = leave_form
        self.setProperty("role", "bar")
        self._series = ComboBox()
        self._series.setMinimumWidth(112)
        self._series.setAccessibleName(gettext("Series"))
        self._strip = PlanStrip(self._choose_series)
        self._plan = make_button(gettext("Plan"), edit_plan)
        self._fold = QToolButton()
        self._summary = ElidedLabel()
        self._form = RunFormFields(dispatch, leave_form)
        self._form.hide()
        self._buttons = {action: self._button(action) for action in _BUTTONS}
        self._shown = RunChoices("", ())
        self._lay_out()
        self._connect()

    def show_choices(self, choices: RunChoices, plan: PlanState) -> None:
        if choices.all_series != self._shown.all_series:
            self._series.clear()
            self._series.addItems(choices.all_series)
        self._shown = choices
        self._series.setCurrentText(choices.series)
        choosable = choices.editable and not choices.series_fixed
        self._series.setEnabled(choosable)
        hint = gettext("Series of the next run: pullback, contact, added mass")
        set_tool_tip(self._series, choices.series_hint or hint)
        self._strip.show_plan(plan, choices.series, choosable=choosable)
        planned = gettext("Plan {done}/{planned}", done=plan.done, planned=plan.planned)
        self._plan.setText(planned if plan.planned else gettext("Plan"))
        self._form.show_form(choices.form, editable=choices.editable)
        self._show_summary()

    def show_actions(self, allowed: frozenset[Action], primary: Action | None, *, keeps: bool) -> None:
        """Enable the allowed actions and emphasize the primary one; `keeps` while a decision is pending."""
        for action, button in self._buttons.items():
            button.setEnabled(action in allowed)
            set_property(button, "primary", "true" if action is primary else "false")
        self._buttons[Action.NEXT].setVisible(not keeps)

    def show_stop(self, disarms: bool) -> None:
        """Say whether Stop keeps a run or none."""
        text, key, description = _BUTTONS[Action.STOP]
        text, description = _DISARM if disarms else (text, description)
        self._buttons[Action.STOP].setText(f"{gettext(text)}   {key}")
        set_button_hint(self._buttons[Action.STOP], gettext(description))

    def _show_summary(self) -> None:
        choices = self._shown
        unfolded = self._form.isVisibleTo(self)
        self._fold.setArrowType(Qt.ArrowType.DownArrow if unfolded else Qt.ArrowType.RightArrow)
        summary = gettext(_FOLD) if unfolded else choices.summary or gettext(_FOLD)
        self._summary.set_line(choices.form_error or summary, is_error=bool(choices.form_error))

    def _toggle(self) -> None:
        self._form.setVisible(not self._form.isVisibleTo(self))
        if self._form.isVisibleTo(self):
            self._form.take_focus()
        else:
            self._leave_form()
        self._show_summary()

    def _button(self, action: Action) -> QPushButton:
        text, key, description = _BUTTONS[action]
        button = make_button(f"{gettext(text)}   {key}", lambda: self._dispatch(action), large=True)
        button.setMinimumWidth(108)
        policy = button.sizePolicy()
        policy.setRetainSizeWhenHidden(True)  # so that no other button comes under the pointer
        button.setSizePolicy(policy)
        if key == "Enter":
            bind_button(button, ENTER_KEYS, gettext(description), self, act=self._press_primary)
        else:
            bind_button(button, key, gettext(description), self)
        return button

    def _press_primary(self) -> None:
        """Press Keep or Next, or Arm where that is the usual next action."""
        following, arm = self._buttons[Action.NEXT], self._buttons[Action.ARM]
        (arm if arm.property("primary") == "true" else following).click()

    def _choose_series(self, series: str) -> None:
        self._dispatch(SeriesChosen(series))

    def _connect(self) -> None:
        self._series.activated.connect(lambda _: self._choose_series(self._series.currentText()))
        bind_button(self._plan, "P", gettext("Say which series to measure how often"), self)
        self._fold.setProperty("role", "fold")
        self._fold.setAccessibleName(gettext(_FOLD))
        self._fold.clicked.connect(self._toggle)
        bind_button(self._fold, "F2", gettext("What is known of the next tests"), self)
        add_shortcut(self, "S", gettext("Choose the series by the arrow keys"), self._series.setFocus)
        untare = gettext("Read both gauges by the calibration again")
        add_shortcut(self, "Shift+T", untare, lambda: self._dispatch(Action.UNTARE))

    def _lay_out(self) -> None:
        series = make_row(self._series, (self._strip, 1), self._plan, spacing=8)
        summary = make_row(self._fold, (self._summary, 1), spacing=4)
        left = make_column(series, summary, spacing=4)
        row = make_row((left, 1), *self._buttons.values(), spacing=12)
        make_column(row, self._form, spacing=4, margins=(12, 8), of=self)


class PlanStrip(QWidget):
    """Series plan on one line: as many series around the chosen one as fit. A click chooses a series."""

    def __init__(self, choose: Callable[[str], object]) -> None:
        super().__init__()
        self._choose = choose
        self._progress: tuple[SeriesProgress, ...] = ()
        self._series = ""
        self._buttons: list[QPushButton] = []
        self._empty = label(gettext("No series is planned yet"), muted=True)
        self._more = label(muted=True)
        self._layout = make_row(self._empty, self._more, STRETCH, spacing=_STRIP_SPACING, of=self)
        self.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)
        self.setAccessibleName(gettext("Series plan"))

    def show_plan(self, plan: PlanState, series: str, *, choosable: bool) -> None:
        self._progress, self._series = plan.progress, series
        while len(self._buttons) < len(plan.progress):
            self._add_button()
        for button, one in zip(self._buttons, plan.progress, strict=False):
            button.setText(button_text(f"{one.series}  {one.dots}"))
            set_tool_tip(button, one.description)
            button.setAccessibleName(one.description)
            button.setEnabled(choosable)
            state = "now" if one.series == series else "full" if one.is_full else "ahead"
            set_property(button, "state", state)
        self._arrange()

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: N802
        super().resizeEvent(event)
        self._arrange()

    def _arrange(self) -> None:
        first, end = self._fitting()
        for number, button in enumerate(self._buttons):
            button.setVisible(first <= number < end)
        hidden = len(self._progress) - (end - first)
        self._more.setText(f"+{hidden}")
        more = ngettext("One more series is planned", "{count} more series are planned", hidden)
        set_tool_tip(self._more, more)
        self._more.setVisible(hidden > 0)
        self._empty.setVisible(not self._progress and self._empty.sizeHint().width() <= self.width())

    def _fitting(self) -> tuple[int, int]:
        """First and end index of the series that fit: one before the chosen one, it, and those after it."""
        buttons = self._buttons[: len(self._progress)]
        widths = [button.sizeHint().width() + _STRIP_SPACING for button in buttons]
        names = [one.series for one in self._progress]
        chosen = names.index(self._series) if self._series in names else 0
        room = self.width() + _STRIP_SPACING
        if sum(widths) > room:
            room -= self._more.fontMetrics().horizontalAdvance("+999") + _STRIP_SPACING
        first, end, left = chosen, chosen, room
        for number in (chosen, chosen - 1, *range(chosen + 1, len(names)), *range(chosen - 2, -1, -1)):
            if not 0 <= number < len(names):
                continue
            left -= widths[number]
            if left < 0:
                break
            first, end = min(first, number), max(end, number + 1)
        return first, end

    def _add_button(self) -> None:
        made = make_button("", lambda: self._choose(made.text().split()[0]))
        made.setProperty("role", "plan")
        self._buttons.append(made)
        self._layout.insertWidget(self._layout.count() - 2, made)


class RunFormFields(QWidget):
    def __init__(self, edit: Callable[[RunForm], None], leave: Callable[[], None]) -> None:
        super().__init__()
        self._edit = edit
        self._fields = {name: ShortcutSafeEdit(ESCAPE_AND_ENTER) for name in _FORM_FIELDS}
        grid = QGridLayout(self)
        grid.setContentsMargins(0, 4, 0, 0)
        grid.setHorizontalSpacing(12)
        grid.setVerticalSpacing(8)
        for number, (name, field) in enumerate(self._fields.items()):
            title_text, hint = _FORM_FIELDS[name]
            field.setAccessibleName(gettext(title_text))
            field.setPlaceholderText(gettext(hint) if hint else "")
            if name in _DEFAULTS:
                show_default(field, _DEFAULTS[name])
            field.textEdited.connect(self._emit_form)
            field.left.connect(leave)
            title = label(gettext(title_text), TextRole.LABEL, muted=True)
            title.setBuddy(field)
            titled = make_column(title, field, spacing=4)
            row, column = divmod(number, _FORM_COLUMNS)
            grid.addLayout(titled, row, column, 1, _WIDE.get(name, 1))
        for column in range(_FORM_COLUMNS):
            grid.setColumnStretch(column, 1)

    def show_form(self, form: RunForm, *, editable: bool) -> None:
        show_texts(self._fields, form)
        for field in self._fields.values():
            field.setEnabled(editable)

    def take_focus(self) -> None:
        next(iter(self._fields.values())).setFocus()

    def _emit_form(self) -> None:
        self._edit(RunForm(**{name: field.text() for name, field in self._fields.items()}))
