"""The states of a pullback in a row: done, now, ahead."""

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QHBoxLayout, QLabel, QWidget

from app.presenters.record.state import Step, StepStatus
from app.qt.theme import TextRole, set_property
from app.qt.widgets.text import label
from messages.i18n import gettext


class Stepper(QWidget):
    """Shows steps; the one that is now is filled, those done carry a tick."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._steps: tuple[Step, ...] = ()
        self._labels: list[QLabel] = []
        self._layout = QHBoxLayout(self)
        self._layout.setContentsMargins(0, 0, 0, 0)
        self._layout.setSpacing(4)

    def show_steps(self, steps: tuple[Step, ...]) -> None:
        """Show steps."""
        if steps == self._steps:
            return
        self._steps = steps
        while len(self._labels) < len(steps):
            self._add_label()
        for target, step in zip(self._labels, steps, strict=True):
            mark = "✓" if step.status is StepStatus.DONE else ""
            target.setText(f"{mark}{step.name}")
            set_property(target, "step", step.status.value)
        now = next((step.name for step in steps if step.status is StepStatus.NOW), gettext("none"))
        self.setAccessibleName(gettext("Step: {name}", name=now))

    def _add_label(self) -> None:
        made = label(role=TextRole.LABEL)
        made.setAlignment(Qt.AlignmentFlag.AlignCenter)
        made.setMinimumHeight(24)
        self._labels.append(made)
        self._layout.addWidget(made, 1)
