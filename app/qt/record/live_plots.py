"""Plots of the live traces with their marks."""

import math
from typing import Any

import pyqtgraph as pg
from PySide6.QtCore import Signal
from PySide6.QtWidgets import QWidget

from analysis.catalogue import MILLIMETRE, displacement_decimals, displacement_unit
from app.presenters.record.state import Span, TraceMarks, Traces
from app.qt.theme import Theme
from app.qt.widgets.layouts import make_column
from app.qt.widgets.plot_marks import pen, place_region, shade, shaded_region
from app.qt.widgets.plot_view import X
from app.qt.widgets.plots import Plot, PlotStack, value_at
from messages.i18n import N_, gettext

TITLES = (
    (N_("table displacement u<sub>1</sub>, {unit}"), "channel_1"),
    (N_("relative displacement u<sub>2</sub> − u<sub>1</sub>, {unit}"), "channel_2"),
)
_NAMES = (N_("table displacement"), N_("relative displacement"))


class LivePlots(QWidget):
    """Draws `Traces`. A part that the user has zoomed into stays until the time axis begins anew."""

    resized = Signal(int)
    zoomed = Signal(
        object
    )  # part of the time axis in view (s), None for all of it; comes while a state is shown

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        unit = displacement_unit()
        titles = [(gettext(text, unit=unit.symbol), token) for text, token in TITLES]
        self._stack = PlotStack(theme, titles)
        self._scale = unit.scale / MILLIMETRE.scale
        for plot in self._stack.plots:
            plot.left.setScale(self._scale)
        self.set_run_name("")
        self._stack.resized.connect(self.resized)
        self._stack.hovered.connect(self._hover)
        self._traces = Traces()
        self._zoom_s: Span | None = None
        self._pointed_s = math.nan
        self._curves = [plot.curve() for plot in self._stack.plots]
        for curve, name in zip(self._curves, _NAMES, strict=True):
            curve.title, curve.unit = gettext(name), "mm"
        self._stack.plots[0].view.sigXRangeChanged.connect(lambda *_: self._report_zoom())
        self._marks = [_PlotMarks(plot, is_first=row == 0) for row, plot in enumerate(self._stack.plots)]
        make_column(self._stack, of=self)
        self._stack.setAccessibleName(gettext("Live traces of table displacement and relative displacement"))
        theme.changed.connect(self._restyle)
        self._restyle()

    def set_run_name(self, name: str) -> None:
        """Name the run in the files of the plots; none while it is recorded."""
        self._stack.export_name = name or gettext("live traces")

    def show_traces(self, traces: Traces) -> None:
        if traces is self._traces:
            return
        old, self._traces = self._traces, traces
        begins_anew = traces.time_title != old.time_title
        if traces.span != old.span or begins_anew:
            self._stack.set_time_range(*traces.span, keep=not begins_anew)
        if _limits(traces) != _limits(old):
            self._set_limits()
        if begins_anew:
            self._stack.set_time_title(gettext(traces.time_title))
        self._draw()
        if traces.marks != old.marks:
            self._draw_marks(traces.marks)
        if not math.isnan(self._pointed_s):
            self._read_out()

    def _draw(self) -> None:
        lines = (self._traces.table, self._traces.relative)
        for curve, line in zip(self._curves, lines, strict=True):
            curve.show_polyline(line)

    def _report_zoom(self) -> None:
        is_whole = self._stack.plots[0].view.is_home(X)
        zoom_s = None if is_whole else self._stack.time_range()
        if zoom_s != self._zoom_s:
            self._zoom_s = zoom_s
            self.zoomed.emit(zoom_s)

    def _set_limits(self) -> None:
        for plot, limit_mm in zip(self._stack.plots, _limits(self._traces), strict=True):
            plot.set_value_range(-limit_mm, limit_mm, keep=True)

    def _draw_marks(self, marks: TraceMarks) -> None:
        for items in self._marks:
            items.show(marks)

    def _restyle(self) -> None:
        tokens = self._theme.tokens
        self._stack.restyle()
        for curve, token in zip(self._curves, (tokens.channel_1, tokens.channel_2), strict=True):
            curve.setPen(pen(token))
        for items in self._marks:
            items.restyle(self._theme)
        self._stack.set_time_range(*self._traces.span, keep=True)
        self._set_limits()
        self._stack.set_time_title(gettext(self._traces.time_title))
        self._draw_marks(self._traces.marks)

    def _hover(self, at_s: float) -> None:
        self._pointed_s = at_s
        self._read_out()

    def _read_out(self) -> None:
        for row, line in enumerate((self._traces.table, self._traces.relative)):
            value = value_at(line.time_s, line.value, self._pointed_s)
            at_s = math.nan if math.isnan(value) else self._pointed_s
            unit, decimals = displacement_unit().symbol, displacement_decimals(3)
            self._stack.show_values(row, at_s, [self._scale * value], unit, decimals)


def _limits(traces: Traces) -> tuple[float, float]:
    return traces.table_limit_mm, traces.relative_limit_mm


class _PlotMarks:
    def __init__(self, plot: Plot, *, is_first: bool) -> None:
        self._is_first = is_first
        self._before = shaded_region(plot)
        self._slip = shaded_region(plot)
        self._band = shaded_region(plot, "horizontal")
        self._release = _line(plot, angle=90, text=gettext("release") if is_first else "", position=0.12)
        self._range = [_line(plot, angle=0, text=text, position=0.5) for text in (gettext("gauge range"), "")]
        band_text = gettext("hold here") if is_first else gettext("plate must stand between these")
        self._edges = [_line(plot, angle=0, text=text, position=0.2) for text in ("", band_text)]

    def restyle(self, theme: Theme) -> None:
        tokens = theme.tokens
        self._before.setBrush(shade(tokens.muted, 0.12))
        self._slip.setBrush(shade(tokens.channel_2, tokens.slip_alpha))
        self._band.setBrush(shade(tokens.accent, 0.12))
        _recolour(self._release, tokens.text)
        for line in self._range:
            _recolour(line, tokens.warn, dashed=True)
        for line in self._edges:
            _recolour(line, tokens.accent, dashed=True)

    def show(self, marks: TraceMarks) -> None:
        ends_mm = marks.table_range_mm if self._is_first else marks.relative_range_mm
        band_mm = marks.target_mm if self._is_first else marks.plate_range_mm
        place_region(self._before, marks.before_release)
        place_region(self._slip, marks.slip)
        place_region(self._band, band_mm)
        _place_line(self._release, marks.release_s)
        _place_lines(self._range, ends_mm)
        _place_lines(self._edges, band_mm)


def _line(plot: Plot, *, angle: int, text: str, position: float) -> Any:
    options = {"position": position, "movable": False, "fill": None}
    item = pg.InfiniteLine(angle=angle, movable=False, label=text or None, labelOpts=options)
    item.hide()
    return plot.add(item)


def _recolour(line: Any, token: str, *, dashed: bool = False) -> None:
    line.setPen(pen(token, dashes=(4.0, 4.0) if dashed else ()))
    if getattr(line, "label", None) is not None:
        line.label.setColor(token)


def _place_line(item: Any, value: float | None) -> None:
    item.setVisible(value is not None)
    if value is not None:
        item.setValue(value)


def _place_lines(items: list[Any], span: Span | None) -> None:
    for item, value in zip(items, span or (None, None), strict=True):
        _place_line(item, value)
