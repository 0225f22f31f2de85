"""Panels of the right column: guidance while recording, result and decision after a run."""

import math
from collections.abc import Callable

from PySide6.QtCore import QRectF, QSize, Qt
from PySide6.QtGui import QPainter, QPaintEvent, QResizeEvent
from PySide6.QtWidgets import QFrame, QGridLayout, QLabel, QPushButton, QSizePolicy, QWidget

from analysis.catalogue import MILLIMETRE, displacement_unit
from app.presenters.base import Chip, Progress, Tone
from app.presenters.number_text import format_displacement
from app.presenters.record import state as record
from app.presenters.record.state import Action, NoteEdited, StepStatus
from app.presenters.results import Result
from app.qt.theme import TextRole, Theme, colour, set_property
from app.qt.widgets.inputs import ProgressBar, ShortcutSafeEdit, make_button
from app.qt.widgets.layouts import STRETCH, make_column, make_row
from app.qt.widgets.shortcuts import add_shortcut, bind_button
from app.qt.widgets.text import (
    ValueLabel,
    break_path,
    label,
    padded,
    set_text_or_hide,
    set_tool_tip,
    show_chip,
)
from messages.i18n import N_, gettext

_ESTIMATES_MAX = 3
_RESULT_ROWS_MAX = 4
_WARNINGS_MAX = 6
_BAR_HEIGHT = 40
_DONE_MARK = "✓"
_STEP_SPACING = 4
_BAR_RADIUS = 6.0


class GuidancePanel(QWidget):
    def __init__(self, theme: Theme, connect_device: Callable[[], object]) -> None:
        super().__init__()
        self._connect = make_button(gettext("Connect"), connect_device, large=True, primary=True)
        self._instruction = label(role=TextRole.INSTRUCTION, wrap=True)
        self._detail = label(role=TextRole.HEADING, wrap=True)
        self._instruction.setAlignment(Qt.AlignmentFlag.AlignTop)
        self._detail.setAlignment(Qt.AlignmentFlag.AlignTop)
        self._target = TargetBar(theme)
        self._stepper = Stepper()
        self._progress = ProgressBar()
        self._progress_text = label(muted=True)
        self._estimates = _value_labels(_ESTIMATES_MAX)
        self._note = label(muted=True, wrap=True)
        self._readings = (
            _Reading(f"u<sub>1</sub>, {displacement_unit().symbol}", "1"),
            _Reading(f"u<sub>2</sub> − u<sub>1</sub>, {displacement_unit().symbol}", "2"),
        )
        self._origin = label(role=TextRole.LABEL, muted=True)
        make_column(
            self._stepper,  # at the top: instructions of different length do not move it
            self._instruction,
            self._detail,
            self._target,
            self._progress_text,
            self._progress,
            self._connect,
            STRETCH,
            *self._estimates,
            self._note,
            STRETCH,
            make_row(*((reading, 1) for reading in self._readings), spacing=16),
            self._origin,
            spacing=12,
            margins=(16, 16),
            of=self,
        )

    def show_guidance(self, guidance: record.GuidanceState) -> None:
        self._instruction.setText(guidance.instruction)
        self._detail.setText(guidance.detail)
        for widget, lines in ((self._instruction, 1), (self._detail, 2)):
            set_property(widget, "tone", guidance.tone.value)
            _reserve_height(widget, lines if guidance.target is not None else 0)
        self._target.show_target(guidance.target)
        self._stepper.show_steps(guidance.steps)

    def show_connected(self, connected: bool) -> None:
        self._connect.setVisible(not connected)

    def show_progress(self, progress: Progress | None) -> None:
        set_text_or_hide(self._progress_text, progress.text if progress else "")
        self._progress.show_progress(progress)

    def show_live_estimate(self, estimate: record.LiveEstimate) -> None:
        for target, row in zip(self._estimates, padded(estimate.rows, _ESTIMATES_MAX, None), strict=True):
            target.show_row(row)
        set_text_or_hide(self._note, estimate.note)

    def show_readings(self, readings: record.LiveReadings) -> None:
        for target, text in zip(self._readings, (readings.table, readings.relative), strict=True):
            target.value.setText(text)
            set_property(target.value, "tone", "stale" if readings.stopped_at else "plain")
        at = gettext("at {time}", time=readings.stopped_at) if readings.stopped_at else ""
        self._origin.setText(", ".join(filter(None, (at, readings.origin))))


def _value_labels(count: int) -> list[ValueLabel]:
    return [ValueLabel(TextRole.NUMBER, TextRole.HEADING, named=True) for _ in range(count)]


class _Reading(QWidget):
    def __init__(self, name: str, channel: str) -> None:
        super().__init__()
        self.value = label(role=TextRole.NUMBER)
        self.value.setProperty("channel", channel)
        make_column(label(name, TextRole.LABEL, muted=True), self.value, of=self)


def _reserve_height(target: QLabel, lines_min: int) -> None:
    """Keep the largest height so far, so that a shorter text moves nothing; `lines_min` = 0 resets it."""
    line = target.fontMetrics().lineSpacing() + 1  # text that can be selected rounds each line up
    needed = max(target.heightForWidth(target.width()), lines_min * line)
    target.setMinimumHeight(max(needed, target.minimumHeight()) if lines_min else 0)


class Stepper(QWidget):
    """Steps of a test in a row, or in two where a row has no room for all of them with their marks."""

    def __init__(self) -> None:
        super().__init__()
        self._labels: list[QLabel] = []
        self._names: tuple[str, ...] = ()
        self._columns = 0
        self._layout = QGridLayout(self)
        self._layout.setContentsMargins(0, 0, 0, 0)
        self._layout.setHorizontalSpacing(_STEP_SPACING)
        self._layout.setVerticalSpacing(0)

    def show_steps(self, steps: tuple[record.Step, ...]) -> None:
        while len(self._labels) < len(steps):
            self._add_label()
        for target, step in zip(self._labels, steps, strict=True):
            target.setText(f"{_DONE_MARK if step.status is StepStatus.DONE else ''}{step.name}")
            set_property(target, "step", step.status.value)
        self._names = tuple(step.name for step in steps)
        self._arrange()
        now = next((step.name for step in steps if step.status is StepStatus.NOW), gettext("none"))
        self.setAccessibleName(gettext("Step: {name}", name=now))

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: N802
        super().resizeEvent(event)
        self._arrange()

    def minimumSizeHint(self) -> QSize:  # noqa: N802
        return QSize(0, super().minimumSizeHint().height())

    def _add_label(self) -> None:
        made = label(role=TextRole.LABEL)
        made.setAlignment(Qt.AlignmentFlag.AlignCenter)
        made.setMinimumHeight(24)
        self._labels.append(made)

    def _arrange(self) -> None:
        width = sum(
            target.fontMetrics().horizontalAdvance(_DONE_MARK + name) + _STEP_SPACING
            for target, name in zip(self._labels, self._names, strict=True)
        )
        columns = len(self._names) if width <= self.width() else math.ceil(len(self._names) / 2)
        if columns == self._columns:
            return
        self._columns = columns
        for place, target in enumerate(self._labels):
            self._layout.addWidget(target, *divmod(place, columns))
            self._layout.setColumnStretch(place, int(place < columns))


class TargetBar(QWidget):
    """Bar from zero to beyond the target; green once the target is reached."""

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self._target: record.PullbackTarget | None = None
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        theme.changed.connect(self.update)

    def sizeHint(self) -> QSize:  # noqa: N802
        return QSize(240, _BAR_HEIGHT)

    def show_target(self, target: record.PullbackTarget | None) -> None:
        self.setVisible(target is not None)
        if target == self._target:
            return
        self._target = target
        if target is not None:
            self.setAccessibleName(
                gettext(
                    "Pulled {now} of {target}",
                    now=format_displacement(target.now_mm / MILLIMETRE.scale),
                    target=format_displacement(target.target_mm / MILLIMETRE.scale),
                )
            )
        self.update()

    def paintEvent(self, _event: QPaintEvent) -> None:  # noqa: N802
        if self._target is None:
            return
        tokens = self._theme.tokens
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setPen(Qt.PenStyle.NoPen)
        background = QRectF(self.rect()).adjusted(0.0, 6.0, 0.0, -6.0)
        painter.setBrush(colour(tokens.line))
        painter.drawRoundedRect(background, _BAR_RADIUS, _BAR_RADIUS)
        painter.setClipRect(QRectF(0.0, 0.0, self._x(self._target.now_mm), self.height()))
        painter.setBrush(colour(tokens.ok if self._target.is_reached else tokens.accent))
        painter.drawRoundedRect(background, _BAR_RADIUS, _BAR_RADIUS)
        painter.setClipping(False)
        painter.setBrush(colour(tokens.text))
        painter.drawRect(QRectF(self._x(self._target.target_mm) - 1.5, 0.0, 3.0, self.height()))
        painter.end()

    def _x(self, value_mm: float) -> float:
        full_mm = self._target.full_mm if self._target else 1.0
        return min(max(value_mm / full_mm, 0.0), 1.0) * self.width()


class ResultPanel(QWidget):
    """Result of a run: main quantity, verdict on the model, further quantities, warnings, path."""

    def __init__(self) -> None:
        super().__init__()
        self._name = label(role=TextRole.HEADING, wrap=True)
        self._headline = ValueLabel(TextRole.INSTRUCTION, TextRole.NUMBER)
        self._comparison = label(muted=True, wrap=True)
        self._model_status = label(role=TextRole.HEADING, wrap=True)
        self._fit = label(muted=True, wrap=True)
        self._rows = _value_labels(_RESULT_ROWS_MAX)
        self._end_status = label(wrap=True)
        self._warnings = [label(wrap=True) for _ in range(_WARNINGS_MAX)]
        self._path = label(role=TextRole.LABEL, muted=True, wrap=True)
        make_column(
            make_column(self._name, self._headline, self._comparison, spacing=8),
            make_column(self._model_status, self._fit, spacing=8),
            make_column(*self._rows, *self._warnings, spacing=8),
            STRETCH,
            make_column(self._end_status, self._path, spacing=8),
            spacing=12,
            margins=(16, 16),
            of=self,
        )

    def show_result(self, result: Result) -> None:
        self._name.setText(f"{result.headline.symbol} {result.headline.name}".strip())
        self._headline.show_row(result.headline)
        set_text_or_hide(self._comparison, result.comparison)
        set_text_or_hide(self._fit, result.fit)
        set_text_or_hide(self._path, break_path(result.path))
        show_chip(self._model_status, result.model_status)
        show_chip(self._end_status, result.end_status)
        for target, row in zip(self._rows, padded(result.rows, _RESULT_ROWS_MAX, None), strict=True):
            target.show_row(row)
        texts = padded((*result.about_stand, *result.warnings), _WARNINGS_MAX, "")
        for warning, text in zip(self._warnings, texts, strict=True):
            show_chip(warning, Chip(text, Tone.WARN))


_REPEAT_HINT = N_("Move the run to the trash, and record the same series again at once")
_DECISION_BUTTONS = {
    Action.NEXT: (N_("Keep"), "Enter", (), N_("Keep the run with what was found in it (Enter)")),
    Action.REPEAT: (N_("Repeat"), "R", ("R",), _REPEAT_HINT),
    Action.DISCARD: (N_("Discard"), "Del", ("Del", "D"), N_("Move the run to the trash")),
}


class DecisionPanel(QFrame):
    """Note and decision about a run: Keep, Repeat, Discard. Hidden while no run waits for a decision."""

    def __init__(
        self, dispatch: Callable[[record.RecordEvent], None], leave_note: Callable[[], None]
    ) -> None:
        super().__init__()
        self._dispatch = dispatch
        self._note = ShortcutSafeEdit()
        self._note.setPlaceholderText(gettext("Note, kept with the run (N)"))
        set_tool_tip(self._note, gettext("Enter keeps the run with this note, Esc leaves the field"))
        self._note.setAccessibleName(gettext("Note on this run"))
        self._note.textEdited.connect(lambda note: dispatch(NoteEdited(note)))
        self._note.left.connect(leave_note)
        add_shortcut(self, "N", gettext("Write a note on the run; Esc leaves the field"), self._note.setFocus)
        self._buttons = {action: self._button(action) for action in _DECISION_BUTTONS}
        buttons = make_row(*((button, 1) for button in self._buttons.values()), spacing=8)
        make_column(self._note, buttons, spacing=8, margins=(16, 8), of=self)

    def show_decision(self, note: str | None, allowed: frozenset[Action]) -> None:
        """Show the buttons and the note of a run that waits for a decision; None hides the panel."""
        self.setVisible(note is not None)
        if note is not None and self._note.text() != note:
            self._note.setText(note)
        for action, button in self._buttons.items():
            button.setEnabled(action in allowed)
            set_property(button, "primary", "true" if action is Action.NEXT else "false")

    def take_focus(self) -> None:
        """Focus Keep, so that Enter and Space keep the run."""
        self._buttons[Action.NEXT].setFocus()

    def _button(self, action: Action) -> QPushButton:
        text, key, keys, description = _DECISION_BUTTONS[action]
        button = QPushButton(f"{gettext(text)}\n{key}")
        button.setProperty("scale", "large")
        button.clicked.connect(lambda: self._dispatch(action))
        if keys:
            bind_button(button, keys, gettext(description), self)
        else:  # the run bar has the shortcut
            set_tool_tip(button, gettext(description))
        return button
