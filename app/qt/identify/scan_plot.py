"""Residual against f_d, with a handle that sets f_d of the simulation by hand."""

from collections.abc import Callable

import numpy as np
from PySide6.QtCore import Qt, QTimer, Signal
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QFrame, QSizePolicy

from analysis.formatting import with_unit
from app.presenters.analysed_run import Objective
from app.presenters.identify.state import ManualFit
from app.presenters.number_text import format_fixed
from app.qt.theme import TextRole, Theme
from app.qt.widgets.inputs import make_button
from app.qt.widgets.layouts import make_column, make_row
from app.qt.widgets.plot_marks import draggable_line, pen, shade, shaded_region, vertical_line
from app.qt.widgets.plots import PlotStack
from app.qt.widgets.shortcuts import describe_shortcut
from app.qt.widgets.text import label
from messages.i18n import N_, gettext

_HEIGHT = 176
_HIGHEST = 10.0  # residual that is drawn, over that of the fit: where it is larger, f_d is ruled out
_STEP, _LONG_STEP = 1.0 / 400.0, 1.0 / 40.0
"""Shares of the range of the scan by which an arrow key moves the handle, and one with Shift."""
_KEYS = {Qt.Key.Key_Left: -1.0, Qt.Key.Key_Right: 1.0, Qt.Key.Key_Down: -1.0, Qt.Key.Key_Up: 1.0}
_WORDS = N_("Drag the handle, or use the arrow keys, to try another f<sub>d</sub> by hand.")
_POLL_MS = 1
"""Interval of `poll` while a result is awaited: that of the window is too long."""


class ScanPlot(QFrame):
    """Draws an `Objective` with a handle; `poll` processes results, and tells whether one is awaited."""

    friction_set = Signal(float)
    reset_requested = Signal()

    def __init__(self, theme: Theme, poll: Callable[[], bool]) -> None:
        super().__init__()
        self._theme = theme
        self._poll = poll
        self._scan: Objective | None = None
        self._stack = PlotStack(
            theme,
            ((gettext("residual, µm, against f<sub>d</sub>"), "text"),),
            format_point=_format_point,
        )
        self._stack.reserved_keys = frozenset(_KEYS) | {Qt.Key.Key_Home}
        self._stack.setAccessibleName(gettext("Residual against the friction coefficient, with a handle"))
        self.setFocusProxy(self._stack)
        (plot,) = self._stack.plots
        self._interval = shaded_region(plot)
        self._curve = plot.curve()
        self._curve.title, self._curve.unit = gettext("residual"), "µm"
        self._fitted = vertical_line(plot)
        self._handle = draggable_line(plot)
        self._words = label(gettext(_WORDS), TextRole.LABEL, muted=True, wrap=True)
        self._words.setMinimumHeight(2 * self._words.fontMetrics().lineSpacing())
        self._back = make_button(
            gettext("Back to the fit"),
            self.reset_requested.emit,
            gettext("Take the handle back to the fitted value (Home)"),
        )
        self._back.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)
        self.setSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Fixed)
        describe_shortcut(
            self, "← →", gettext("Try another f_d by hand, with Shift in larger steps; Home goes back")
        )
        self._lay_out()
        self._timer = QTimer(self)
        self._timer.setTimerType(Qt.TimerType.PreciseTimer)
        self._timer.setInterval(_POLL_MS)
        self._timer.timeout.connect(self._poll_again)
        self._handle.sigDragged.connect(self._report)
        theme.changed.connect(self._restyle)
        self._restyle()

    def show_scan(self, scan: Objective | None) -> None:
        self._scan = scan
        self._timer.stop()
        self.setVisible(scan is not None)
        if scan is None:
            return
        residual_um = 1e6 * scan.residual_m
        self._curve.show_points(scan.friction, residual_um)
        self._interval.setRegion(scan.interval_95)
        self._interval.show()
        self._fitted.setValue(scan.fitted)
        self._stack.plots[0].fit_values(
            np.minimum(residual_um, _HIGHEST * 1e6 * scan.residual_at(scan.fitted))
        )
        self._stack.set_time_range(float(scan.friction[0]), float(scan.friction[-1]))
        self._handle.setBounds((float(scan.friction[0]), float(scan.friction[-1])))
        self.show_manual_fit(None, "")

    def show_manual_fit(self, hand: ManualFit | None, text: str) -> None:
        if self._scan is None:
            return
        self._words.setText(text or gettext(_WORDS))
        self._back.setEnabled(hand is not None)
        if not self._handle.moving:
            self._handle.setValue(self._scan.fitted if hand is None else hand.friction)

    def keyPressEvent(self, event: QKeyEvent) -> None:  # noqa: N802
        direction = _KEYS.get(Qt.Key(event.key()))
        if event.key() == Qt.Key.Key_Home:
            self.reset_requested.emit()
        elif direction is None or self._scan is None:
            super().keyPressEvent(event)
        else:
            step = _LONG_STEP if event.modifiers() & Qt.KeyboardModifier.ShiftModifier else _STEP
            reach = float(self._scan.friction[-1] - self._scan.friction[0])
            self._handle.setValue(self._handle.value() + direction * step * reach)
            self._report()

    def _report(self, *_: object) -> None:
        self.friction_set.emit(float(self._handle.value()))
        self._timer.start()

    def _poll_again(self) -> None:
        if not self._poll():
            self._timer.stop()

    def _restyle(self) -> None:
        tokens = self._theme.tokens
        self._stack.restyle()
        self._stack.set_time_title("f<sub>d</sub>")
        self._curve.setPen(pen(tokens.text))
        self._fitted.setPen(pen(tokens.muted, dashes=(4.0, 4.0)))
        self._interval.setBrush(shade(tokens.accent, 0.16))
        self._handle.setPen(pen(tokens.accent))
        self._handle.setHoverPen(pen(tokens.text))

    def _lay_out(self) -> None:
        self._stack.setFixedHeight(_HEIGHT)
        below = make_row((self._words, 1), self._back)
        below.setContentsMargins(16, 0, 16, 4)
        make_column(self._stack, below, spacing=4, of=self)


def _format_point(friction: float, residual_um: float) -> str:
    return f"f<sub>d</sub> {format_fixed(friction, 5)}   {with_unit(format_fixed(residual_um, 1), 'µm')}"
