"""Record screen: status bar, live traces, column of guidance or result, run bar."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from PySide6.QtCore import Qt
from PySide6.QtGui import QResizeEvent, QShowEvent
from PySide6.QtWidgets import QApplication, QFrame, QLabel, QLineEdit, QSizePolicy, QStackedWidget, QWidget

from app.presenters.base import EMPTY_CHIP, Chip
from app.presenters.record.presenter import RecordPresenter
from app.presenters.record.state import Action, PlotResized, PlotZoomed, RecordState, StatusBar
from app.presenters.results import Result
from app.qt.record.live_plots import LivePlots
from app.qt.record.panels import DecisionPanel, GuidancePanel, ResultPanel
from app.qt.record.plan_dialog import PlanDialog
from app.qt.record.run_bar import RunBar
from app.qt.record.sound import CuePlayer
from app.qt.theme import TextRole, Theme, set_property
from app.qt.widgets.inputs import make_button
from app.qt.widgets.layouts import STRETCH, make_column, make_frame, make_row, make_scroll_area
from app.qt.widgets.shortcuts import bind_button, set_button_hint
from app.qt.widgets.text import label, padded, set_text_or_hide, set_tool_tip, show_chip
from messages.i18n import gettext

_COLUMN_SHARE = 0.31
_COLUMN_WIDTHS = (356, 480)
"""The narrowest column holds f_d with its uncertainty beside a scroll bar."""


class RecordScreen(QWidget):
    """Shows `RecordState`; `connect_device` shows where a device is connected."""

    def __init__(
        self, theme: Theme, presenter: RecordPresenter, connect_device: Callable[[], object] = lambda: None
    ) -> None:
        super().__init__()
        self._presenter = presenter
        self._shown: RecordState | None = None
        self._status_bar = StatusBarWidget()
        self._plots = LivePlots(theme)
        self._plots.resized.connect(lambda width_px: presenter.dispatch(PlotResized(width_px)))
        later = Qt.ConnectionType.QueuedConnection  # a state that is being shown may change the view
        self._plots.zoomed.connect(lambda span: presenter.dispatch(PlotZoomed(span)), later)
        self._guidance = GuidancePanel(theme, connect_device)
        self._result = ResultPanel()
        self._decision = DecisionPanel(presenter.dispatch, self.take_focus)
        self._status_line = StatusLine(lambda: presenter.dispatch(Action.UNDO))
        self._column = _Column((self._guidance, self._result), (self._decision, self._status_line))
        self._bar = RunBar(presenter.dispatch, self._edit_plan, self.take_focus)
        self._plan: PlanDialog | None = None
        self._sound = CuePlayer()
        self._parts: dict[str, Callable[[Any], None]] = {
            "status_bar": self._status_bar.show_status,
            "guidance": self._guidance.show_guidance,
            "connected": self._guidance.show_connected,
            "readings": self._guidance.show_readings,
            "live_estimate": self._guidance.show_live_estimate,
            "progress": self._guidance.show_progress,
            "result": self._show_result,
            "disarms": self._bar.show_stop,
        }
        card = make_frame(self._plots)
        middle = make_row((card, 1), self._column, spacing=8)
        make_column(self._status_bar, (middle, 1), self._bar, spacing=8, margins=(8, 8), of=self)

    def show_state(self, state: RecordState) -> None:
        """Show the parts of a state that differ from the state shown."""
        old, self._shown = self._shown, state
        for name, show in self._parts.items():
            if old is None or getattr(state, name) != getattr(old, name):
                show(getattr(state, name))
        self._plots.show_traces(state.traces)
        if old is None or (state.choices, state.plan) != (old.choices, old.plan):
            self._bar.show_choices(state.choices, state.plan)
            if self._plan is not None:
                self._plan.show_plan(state.plan, state.choices.series)
        if old is None or (state.status_message, state.undo) != (old.status_message, old.undo):
            self._status_line.show_status(state.status_message, state.undo)
        if old is None or _actions(state) != _actions(old):
            self._bar.show_actions(state.allowed, state.primary, keeps=state.decision is not None)
            self._decision.show_decision(state.decision, state.allowed)
            is_asked = old is not None and (state.decision is None) is not (old.decision is None)
            focused = QApplication.focusWidget()
            is_typing = isinstance(focused, QLineEdit) and focused.isVisible()
            if is_asked and self.isVisible() and not is_typing:
                self.take_focus()
        if state.cue is not None and (old is None or state.cue is not old.cue):
            self._sound.play(state.cue)

    def showEvent(self, event: QShowEvent) -> None:  # noqa: N802
        super().showEvent(event)
        self.take_focus()

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: N802
        super().resizeEvent(event)
        narrowest, widest = _COLUMN_WIDTHS
        self._column.setFixedWidth(min(max(round(self.width() * _COLUMN_SHARE), narrowest), widest))

    def take_focus(self) -> None:
        """Focus Keep while a run waits for a decision, else no button: none is pressed by mistake."""
        decides = self._shown is not None and self._shown.decision is not None
        (self._decision.take_focus if decides else self.setFocus)()

    def _edit_plan(self) -> None:
        if self._plan is None:
            self._plan = PlanDialog(self._presenter, self)
        if self._shown is not None:
            self._plan.open_with(self._shown.plan, self._shown.choices.series)

    def _show_result(self, result: Result | None) -> None:
        self._plots.set_run_name("" if result is None else Path(result.path).stem)
        if result is not None:
            self._result.show_result(result)
        self._column.stack.setCurrentIndex(int(result is not None))


def _actions(state: RecordState) -> tuple[object, ...]:
    return state.allowed, state.primary, state.decision


class _Column(QFrame):
    """Card with one of two panels, which scroll in a low window, and widgets below them."""

    def __init__(self, panels: Sequence[QWidget], below: Sequence[QWidget]) -> None:
        super().__init__()
        self.setProperty("role", "card")
        self.stack = QStackedWidget()
        for panel in panels:
            area = make_scroll_area(panel)
            area.setFocusPolicy(Qt.FocusPolicy.NoFocus)
            self.stack.addWidget(area)
        make_column((self.stack, 1), *below, margins=(1, 1), of=self)


_WIDE, _NARROW = 24, 10
_MARGIN = 12
_ELIDED_MIN = 72
"""Pixels of an elided name: some letters stay readable."""


class StatusBarWidget(QFrame):
    """Shows `StatusBar`. In a narrow window gaps shrink, then the names of device and run are elided."""

    def __init__(self) -> None:
        super().__init__()
        self.setProperty("role", "bar")
        self._device = label(role=TextRole.STRONG)
        self._rate, self._lost_samples, self._disk = label(), label(), label()
        self._gauges = (label(), label())
        self._stopped = label(muted=True)
        self._simulated = label(role=TextRole.STRONG)
        self._run = label(role=TextRole.STRONG)
        self._names = {self._device: "", self._run: ""}
        lights = (self._rate, self._lost_samples, *self._gauges)
        left = (self._simulated, self._device, *lights, self._stopped)
        self._row = make_row(*left, STRETCH, self._run, self._disk, margins=(_MARGIN, 8), of=self)
        self.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Fixed)
        self._device.setAccessibleName(gettext("Device"))
        self._rate.setAccessibleName(gettext("Measured sample rate"))
        self._lost_samples.setAccessibleName(gettext("Lost samples"))
        self._stopped.setAccessibleName(gettext("Time of these values"))
        self._disk.setAccessibleName(gettext("Free disk space"))
        self._run.setAccessibleName(gettext("Run of its series"))

    def show_status(self, status: StatusBar) -> None:
        show_chip(self._device, replace(status.device, text=gettext(status.device.text)))  # "no device"
        set_text_or_hide(self._rate, status.rate)
        set_property(self._rate, "tone", "stale" if status.stopped_at else "plain")
        at = gettext("at {time}", time=status.stopped_at) if status.stopped_at else ""
        set_text_or_hide(self._stopped, at)
        show_chip(self._simulated, status.simulated)
        show_chip(self._run, status.run)
        show_chip(self._lost_samples, status.lost_samples)
        show_chip(self._disk, status.disk)
        for target, chip in zip(self._gauges, padded(status.gauges, 2, EMPTY_CHIP), strict=True):
            show_chip(target, chip)
        self._names = {target: target.text() for target in self._names}
        self._fit()

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: N802
        super().resizeEvent(event)
        self._fit()

    def _fit(self) -> None:
        for target, text in self._names.items():
            target.setText(text)
        spacing = _WIDE if self._excess(_WIDE) <= 0 else _NARROW
        self._row.setSpacing(spacing)
        for target, text in self._names.items():
            if (excess := self._excess(spacing)) > 0:
                room = max(target.sizeHint().width() - excess, _ELIDED_MIN)
                target.setText(target.fontMetrics().elidedText(text, Qt.TextElideMode.ElideRight, room))
                set_tool_tip(target, target.toolTip() or text)

    def _excess(self, spacing: int) -> int:
        """Pixels by which the labels are too wide."""
        shown = [w for w in self.findChildren(QLabel) if w.isVisibleTo(self)]
        wanted = sum(w.sizeHint().width() for w in shown) + spacing * len(shown)
        return wanted + 2 * _MARGIN + 2 - self.width()


class StatusLine(QFrame):
    """Outcome of the last action, with an Undo button where it can be taken back; hidden if empty."""

    def __init__(self, undo: Callable[[], object]) -> None:
        super().__init__()
        self._message = label(wrap=True)
        self._undo = make_button(gettext("Undo"), undo)
        bind_button(self._undo, "Ctrl+Z", gettext("Take back what was decided about the last run"), self)
        make_row((self._message, 1), self._undo, spacing=8, margins=(16, 8), of=self)

    def show_status(self, message: Chip, undo: str) -> None:
        self.setVisible(bool(message.text or undo))
        show_chip(self._message, message)
        self._undo.setVisible(bool(undo))
        set_button_hint(self._undo, undo)
