"""The Record screen: header, live traces, the column that guides or tells the result, the run bar."""

from collections.abc import Callable, Sequence

from PySide6.QtCore import Qt
from PySide6.QtGui import QResizeEvent, QShowEvent
from PySide6.QtWidgets import (
    QApplication,
    QFrame,
    QHBoxLayout,
    QLineEdit,
    QStackedWidget,
    QVBoxLayout,
    QWidget,
)

from app.presenters.record.presenter import RecordPresenter
from app.presenters.record.state import Action, NoteEdited, PlotResized, RecordState, SeriesChosen
from app.presenters.results import Result
from app.qt.record.decision_panel import DecisionPanel
from app.qt.record.guidance_panel import GuidancePanel
from app.qt.record.live_plots import LivePlots
from app.qt.record.plan_dialog import PlanDialog
from app.qt.record.result_panel import ResultPanel
from app.qt.record.run_bar import RunBar
from app.qt.record.sound import CuePlayer
from app.qt.record.status_bar import StatusBarWidget
from app.qt.record.status_line import StatusLine
from app.qt.theme import Theme
from app.qt.widgets.layouts import make_scroll_area

_COLUMN_SHARE = 0.31
_COLUMN_WIDTHS = (356, 480)
"""The narrowest holds f_d with its uncertainty beside a scroll bar."""


class RecordScreen(QWidget):
    """Draws `RecordState`, part by part where a part has changed.

    Parameters
    ----------
    theme : Theme
    presenter : RecordPresenter
    connect_device : callable
        Shows where a device is connected.
    """

    def __init__(
        self,
        theme: Theme,
        presenter: RecordPresenter,
        connect_device: Callable[[], object] = lambda: None,
    ) -> None:
        super().__init__()
        self._presenter = presenter
        self._shown: RecordState | None = None
        self._header = StatusBarWidget()
        self._plots = LivePlots(theme)
        self._guidance = GuidancePanel(theme)
        self._result = ResultPanel()
        self._decision = DecisionPanel()
        self._news = StatusLine()
        self._column = _Column((self._guidance, self._result), (self._decision, self._news))
        self._bar = RunBar()
        self._plan: PlanDialog | None = None
        self._sound = CuePlayer()
        self._lay_out()
        self._connect(connect_device)

    def show_state(self, state: RecordState) -> None:
        """Draw what differs from what is shown."""
        old, self._shown = self._shown, state
        typed_into = QApplication.focusWidget()
        if old is None or state.status_bar != old.status_bar:
            self._header.show_status(state.status_bar)
        self._plots.show_traces(state.traces)
        if old is None or state.guidance != old.guidance:
            self._guidance.show_guidance(state.guidance)
        if old is None or state.connected != old.connected:
            self._guidance.show_connected(state.connected)
        if old is None or state.readings != old.readings:
            self._guidance.show_readings(state.readings)
        if old is None or state.live_estimate != old.live_estimate:
            self._guidance.show_live_estimate(state.live_estimate)
        if old is None or state.progress != old.progress:
            self._guidance.show_progress(state.progress)
        if old is None or state.result != old.result:
            self._show_result(state.result)
        if old is None or (state.choices, state.plan) != (old.choices, old.plan):
            self._bar.show_choices(state.choices, state.plan)
            if self._plan is not None:
                self._plan.show_plan(state.plan)
        if old is None or (state.status_message, state.undo) != (old.status_message, old.undo):
            self._news.show_status(state.status_message, state.undo)
        if old is None or _to_do(state) != _to_do(old):
            self._show_actions(state)
            is_typing = isinstance(typed_into, QLineEdit) and typed_into.isVisible()
            if self.isVisible() and not is_typing:
                self._take_focus()  # a button that is disabled passes it on, perhaps to a field
        if state.cue is not None and (old is None or state.cue is not old.cue):
            self._sound.play(state.cue)

    def showEvent(self, event: QShowEvent) -> None:  # noqa: N802
        """Let the buttons be the first that the keyboard meets."""
        super().showEvent(event)
        self._take_focus()

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: N802
        """Give the column its share of the width."""
        super().resizeEvent(event)
        narrowest, widest = _COLUMN_WIDTHS
        self._column.setFixedWidth(min(max(round(self.width() * _COLUMN_SHARE), narrowest), widest))

    def _take_focus(self) -> None:
        """Focus what comes next: what becomes of a run, if that is to be decided."""
        decides = self._shown is not None and self._shown.decision is not None
        (self._decision if decides else self._bar).take_focus()

    def _show_actions(self, state: RecordState) -> None:
        keeps = state.decision is not None
        self._bar.show_actions(state.allowed, state.primary, keeps=keeps)
        self._decision.show_decision(state.decision, state.allowed)

    def _edit_plan(self) -> None:
        if self._plan is None:
            self._plan = PlanDialog(self._presenter, self)
        if self._shown is not None:
            self._plan.open_with(self._shown.plan)

    def _show_result(self, result: Result | None) -> None:
        if result is not None:
            self._result.show_result(result)
        self._column.show_second(result is not None)

    def _connect(self, connect_device: Callable[[], object]) -> None:
        dispatch = self._presenter.dispatch
        for panel in (self._bar, self._decision):
            panel.acted.connect(dispatch)
        self._bar.series_chosen.connect(lambda series: dispatch(SeriesChosen(series)))
        self._bar.filled.connect(dispatch)
        self._bar.plan_wanted.connect(self._edit_plan)
        self._decision.noted.connect(lambda note: dispatch(NoteEdited(note)))
        self._decision.left_note.connect(self._take_focus)
        self._bar.left_form.connect(self._take_focus)
        self._news.undone.connect(lambda: dispatch(Action.UNDO))
        self._plots.resized.connect(lambda width_px: dispatch(PlotResized(width_px)))
        self._guidance.connect_wanted.connect(connect_device)

    def _lay_out(self) -> None:
        card = QFrame()
        card.setProperty("role", "card")
        inside = QVBoxLayout(card)
        inside.setContentsMargins(1, 1, 1, 1)
        inside.addWidget(self._plots)
        middle = QHBoxLayout()
        middle.setSpacing(8)
        middle.addWidget(card, 1)
        middle.addWidget(self._column)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(8, 8, 8, 8)
        layout.setSpacing(8)
        layout.addWidget(self._header)
        layout.addLayout(middle, 1)
        layout.addWidget(self._bar)


def _to_do(state: RecordState) -> tuple[object, ...]:
    return state.allowed, state.primary, state.decision


class _Column(QFrame):
    """A card that shows one of two panels, which scroll where the window is low, and what is below both."""

    def __init__(self, panels: Sequence[QWidget], below: Sequence[QWidget]) -> None:
        super().__init__()
        self.setProperty("role", "card")
        self._stack = QStackedWidget()
        for panel in panels:
            area = make_scroll_area(panel)
            area.setFocusPolicy(Qt.FocusPolicy.NoFocus)
            self._stack.addWidget(area)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(1, 1, 1, 1)
        layout.setSpacing(0)
        layout.addWidget(self._stack, 1)
        for widget in below:
            layout.addWidget(widget)

    def show_second(self, second: bool) -> None:
        self._stack.setCurrentIndex(int(second))
