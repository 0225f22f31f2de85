"""The selected runs drawn over one another, aligned at their release."""

import math

import numpy as np
from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QWidget

from app.presenters.runs.state import Overlay, Trace
from app.qt.theme import TextRole, Theme, colour
from app.qt.widgets.layouts import make_column
from app.qt.widgets.plot_marks import pen
from app.qt.widgets.plot_view import X
from app.qt.widgets.plots import PlotStack, value_at
from app.qt.widgets.text import label, markup
from messages.i18n import N_, gettext, ngettext

_TITLES = (
    N_("table displacement u<sub>1</sub>, {unit}"),
    N_("relative displacement u<sub>2</sub> − u<sub>1</sub>, {unit}"),
)
_CHANNELS = (N_("table displacement"), N_("relative displacement"))
_MOST = 8
_MOST_VALUES = 3
"""More values do not fit beside a title."""
_DASHES: tuple[tuple[float, ...], ...] = ((), (6.0, 3.0), (2.0, 3.0))
"""Curves are told apart by more than their colour."""


class RunsPreview(QWidget):
    """Draws an `Overlay`. A part that the user has zoomed into stays while it is drawn more finely."""

    zoomed = Signal(tuple, int)  # part of the time axis in view (s), and its width in pixels

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self._overlay = Overlay()
        self._stack = PlotStack(theme, [("", "text") for _ in _TITLES])
        self._stack.hovered.connect(self._show_values)
        self._stack.plots[0].view.sigXRangeChanged.connect(lambda *_: self._report_zoom())
        self._stack.pictured = self  # with the names
        self._curves = [[plot.line() for _ in range(_MOST)] for plot in self._stack.plots]
        self._names = label(role=TextRole.LABEL, wrap=True)
        self._words = label(muted=True, wrap=True)
        self._words.setAlignment(Qt.AlignmentFlag.AlignTop)
        make_column((self._stack, 1), self._names, self._words, spacing=4, of=self)
        self._names.setContentsMargins(12, 0, 12, 4)
        self._words.setContentsMargins(12, 8, 12, 8)
        self._stack.setAccessibleName(gettext("Preview of the selected runs"))
        theme.changed.connect(self._restyle)
        self._restyle()
        self.show_overlay(None)

    def show_overlay(self, overlay: Overlay | None) -> None:
        shown = self._overlay
        self._overlay = overlay or Overlay(
            message=gettext("Select runs to see them here, several to compare them.")
        )
        traces = self._overlay.traces
        for row, title in enumerate(_TITLES):
            self._stack.set_title(row, gettext(title, unit=self._overlay.unit))
        self._stack.setVisible(bool(traces))
        self._names.setVisible(bool(traces))
        self._words.setText(gettext(self._overlay.message))
        self._words.setVisible(bool(self._overlay.message))
        count = ngettext("{count} run", "{count} runs", len(traces))
        self._stack.export_name = traces[0].name if len(traces) == 1 else count
        self._draw(keep=_has_same_extent(shown, self._overlay))

    def _report_zoom(self) -> None:
        view = self._stack.plots[0].view
        if not view.is_home(X):
            self.zoomed.emit(self._stack.time_range(), int(view.width()))

    def _draw(self, *, keep: bool) -> None:
        traces = self._overlay.traces
        for number, curves in enumerate(zip(*self._curves, strict=True)):
            trace = traces[number] if number < len(traces) else None
            for channel, (curve, line) in enumerate(zip(curves, _lines(trace), strict=True)):
                curve.title = "" if trace is None else ", ".join((trace.name, gettext(_CHANNELS[channel])))
                curve.unit = self._overlay.unit
                curve.show_line(None if trace is None else trace.time_s, line)
        if traces:
            self._set_extent(traces, keep=keep)
        self._restyle()

    def _set_extent(self, traces: tuple[Trace, ...], *, keep: bool) -> None:
        starts = [float(trace.time_s[0]) for trace in traces if len(trace.time_s)]
        ends = [float(trace.time_s[-1]) for trace in traces if len(trace.time_s)]
        if starts:
            self._stack.set_time_range(min(starts), max(ends), keep=keep)
        for row, plot in enumerate(self._stack.plots):
            lines = [line for trace in traces if (line := _lines(trace)[row]) is not None]
            plot.fit_values(*lines, keep=keep)

    def _restyle(self) -> None:
        self._stack.restyle()
        self._stack.set_time_title(self._overlay.time_label)
        tokens = self._theme.tokens
        is_single = len(self._overlay.traces) == 1
        for row, channel in enumerate((tokens.channel_1, tokens.channel_2)):
            for number, curve in enumerate(self._curves[row]):
                token = channel if is_single else tokens.overlay[number]
                curve.setPen(pen(token, dashes=() if is_single else _DASHES[number % len(_DASHES)]))
        self._show_legend()

    def _show_legend(self) -> None:
        tokens = self._theme.tokens
        traces = self._overlay.traces
        if len(traces) == 1:
            self._names.setText(traces[0].name)
            return
        marks = ("———", "−\u00a0−\u00a0−", "·\u00a0·\u00a0·")  # lines break after dashes, not minuses
        names = (
            f'<span style="color: {colour(tokens.overlay[number]).name()}">'
            f"{marks[number % len(marks)]}\u00a0{markup(trace.name)}</span>"
            for number, trace in enumerate(traces)
        )
        self._names.set_rich_text("&nbsp;&nbsp; ".join(names))

    def _show_values(self, at_s: float) -> None:
        for row in range(len(_TITLES)):
            values = [
                value_at(trace.time_s, line, at_s)
                for trace in self._overlay.traces
                if (line := _lines(trace)[row]) is not None
            ]
            values = [value for value in values if math.isfinite(value)]
            self._stack.show_values(
                row, at_s, values if len(values) <= _MOST_VALUES else (), self._overlay.unit
            )


def _has_same_extent(one: Overlay, other: Overlay) -> bool:
    """Tell whether two overlays show the same runs, perhaps in other detail."""
    names = [[(trace.path, trace.name) for trace in overlay.traces] for overlay in (one, other)]
    return names[0] == names[1] and one.time_label == other.time_label


def _lines(trace: Trace | None) -> tuple[np.ndarray | None, np.ndarray | None]:
    return (None, None) if trace is None else (trace.table, trace.relative)
