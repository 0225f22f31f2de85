"""The series plan in a line: as many series about the chosen one as fit, each with what is done of it."""

from PySide6.QtCore import Signal
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QHBoxLayout, QPushButton, QSizePolicy, QWidget

from app.presenters.record.state import PlanState, SeriesProgress
from app.qt.theme import set_property
from app.qt.widgets.text import label
from messages.i18n import gettext, ngettext

_SPACING = 4


class PlanStrip(QWidget):
    """Shows a plan; a click on a series chooses it."""

    chosen = Signal(str)

    def __init__(self) -> None:
        super().__init__()
        self._progress: tuple[SeriesProgress, ...] = ()
        self._series = ""
        self._buttons: list[QPushButton] = []
        self._empty = label(gettext("No series is planned yet"), muted=True)
        self._layout = QHBoxLayout(self)
        self._layout.setContentsMargins(0, 0, 0, 0)
        self._layout.setSpacing(_SPACING)
        self._more = label(muted=True)
        self._layout.addWidget(self._empty)
        self._layout.addWidget(self._more)
        self._layout.addStretch(1)
        self.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)
        self.setAccessibleName(gettext("Series plan"))

    def show_plan(self, plan: PlanState, series: str, *, choosable: bool) -> None:
        """Show a plan, and which series is chosen."""
        self._progress, self._series = plan.progress, series
        while len(self._buttons) < len(plan.progress):
            self._add_button()
        for button, one in zip(self._buttons, plan.progress, strict=False):
            button.setText(f"{one.series}  {one.dots}")
            button.setToolTip(one.description)
            button.setAccessibleName(one.description)
            button.setEnabled(choosable)
            set_property(button, "state", _state(one, series))
        self._place()

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: N802
        """Show as many as fit."""
        super().resizeEvent(event)
        self._place()

    def _place(self) -> None:
        first, end = self._fitting()
        for number, button in enumerate(self._buttons):
            button.setVisible(first <= number < end)
        hidden = len(self._progress) - (end - first)
        self._more.setText(f"+{hidden}")
        self._more.setToolTip(
            ngettext("One more series is planned", "{count} more series are planned", hidden)
        )
        self._more.setVisible(hidden > 0)
        self._empty.setVisible(not self._progress and self._empty.sizeHint().width() <= self.width())

    def _fitting(self) -> tuple[int, int]:
        """Numbers of the series that fit: the one before the chosen one, that one, and what follows."""
        widths = [button.sizeHint().width() + _SPACING for button in self._buttons[: len(self._progress)]]
        names = [one.series for one in self._progress]
        chosen = names.index(self._series) if self._series in names else 0
        room = self.width() + _SPACING
        if sum(widths) > room:
            room -= self._more.fontMetrics().horizontalAdvance("+999") + _SPACING
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
        made = QPushButton(self)
        made.setProperty("role", "plan")
        made.clicked.connect(lambda: self.chosen.emit(made.text().split()[0]))
        self._buttons.append(made)
        self._layout.insertWidget(self._layout.count() - 2, made)


def _state(one: SeriesProgress, series: str) -> str:
    if one.series == series:
        return "now"
    return "full" if one.is_full else "ahead"
