"""The right column while recording: what to do now, how far it is, where we are."""

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QHBoxLayout, QLabel, QProgressBar, QPushButton, QVBoxLayout, QWidget

from app.presenters.base import Progress
from app.presenters.record.state import GuidanceState, LiveEstimate, LiveReadings
from app.qt.theme import TextRole, Theme, set_property
from app.qt.widgets.stepper import Stepper
from app.qt.widgets.target_bar import TargetBar
from app.qt.widgets.text import ValueLabel, label
from messages.i18n import gettext

_MOST_RUNNING = 3


class GuidancePanel(QWidget):
    """One large sentence, a target bar, the stepper, and the newest values."""

    connect_wanted = Signal()

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._connect = QPushButton(gettext("Connect"))
        self._connect.setProperty("scale", "large")
        self._connect.setProperty("primary", "true")
        self._connect.clicked.connect(self.connect_wanted)
        self._instruction = label(role=TextRole.INSTRUCTION, wrap=True)
        self._detail = label(role=TextRole.HEADING, wrap=True)
        for sentence in (self._instruction, self._detail):
            sentence.setAlignment(Qt.AlignmentFlag.AlignTop)
        self._target = TargetBar(theme)
        self._stepper = Stepper()
        self._progress = QProgressBar()
        self._progress.setTextVisible(False)
        self._working = label(muted=True)
        self._running = [
            ValueLabel(TextRole.NUMBER, TextRole.HEADING, named=True) for _ in range(_MOST_RUNNING)
        ]
        self._note = label(muted=True, wrap=True)
        self._readings = (
            _Reading(gettext("u<sub>1</sub>, mm"), "1"),
            _Reading(gettext("u<sub>2</sub> − u<sub>1</sub>, mm"), "2"),
        )
        self._origin = label(role=TextRole.LABEL, muted=True)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(16, 16, 16, 16)
        layout.setSpacing(12)
        for widget in (
            self._stepper,  # on top, where no sentence of another length moves it
            self._instruction,
            self._detail,
            self._target,
            self._working,
            self._progress,
            self._connect,
        ):
            layout.addWidget(widget)
        layout.addStretch(1)
        for value in self._running:
            layout.addWidget(value)
        layout.addWidget(self._note)
        layout.addStretch(1)
        row = QHBoxLayout()
        row.setSpacing(16)
        for reading in self._readings:
            row.addWidget(reading, 1)
        layout.addLayout(row)
        layout.addWidget(self._origin)

    def show_guidance(self, guidance: GuidanceState) -> None:
        """Say what to do."""
        self._instruction.setText(guidance.instruction)
        self._detail.setText(guidance.detail)
        for widget in (self._instruction, self._detail):
            set_property(widget, "tone", guidance.tone.value)
        for widget, lines in ((self._instruction, 1), (self._detail, 2)):
            _keep_room(widget, lines if guidance.target is not None else 0)
        self._target.show_target(guidance.target)
        self._stepper.show_steps(guidance.steps)

    def show_connected(self, connected: bool) -> None:
        """Offer to connect a device where there is none."""
        self._connect.setVisible(not connected)

    def show_progress(self, progress: Progress | None) -> None:
        """Say how far the work is; None hides it."""
        self._working.setVisible(progress is not None)
        self._progress.setVisible(progress is not None)
        if progress is None:
            return
        self._working.setText(progress.text)
        self._progress.setRange(0, 0 if progress.fraction is None else 100)
        self._progress.setValue(round(100 * (progress.fraction or 0.0)))

    def show_live_estimate(self, running: LiveEstimate) -> None:
        """Write what is known of the run so far; nothing of it hides the rows."""
        for index, target in enumerate(self._running):
            target.show_row(running.rows[index] if index < len(running.rows) else None)
        self._note.setText(running.note)
        self._note.setVisible(bool(running.note))

    def show_readings(self, readings: LiveReadings) -> None:
        """Write the newest values."""
        for target, text in zip(self._readings, (readings.table, readings.relative), strict=True):
            target.show_value(text)
        self._origin.setText(readings.origin)


class _Reading(QWidget):
    """A channel's name and its newest value in large figures."""

    def __init__(self, name: str, channel: str) -> None:
        super().__init__()
        title = label(name, TextRole.LABEL, muted=True)
        self._value = label(role=TextRole.NUMBER)
        self._value.setProperty("channel", channel)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setSpacing(0)
        layout.addWidget(title)
        layout.addWidget(self._value)

    def show_value(self, text: str) -> None:
        self._value.setText(text)


def _keep_room(target: QLabel, least_lines: int) -> None:
    """Keep the room that was needed before, so that a shorter sentence moves nothing; 0 gives it up."""
    line = target.fontMetrics().lineSpacing() + 1  # text that can be selected rounds each line up
    needed = max(target.heightForWidth(target.width()), least_lines * line)
    target.setMinimumHeight(max(needed, target.minimumHeight()) if least_lines else 0)
