"""Friction of each slip against sliding velocity, position and time, with fitted lines and their bands."""

from typing import Any

import pyqtgraph as pg
from PySide6.QtWidgets import QWidget

from app.presenters.identify.state import Floats, SlipPlot, SlipPlots
from app.presenters.number_text import format_fixed
from app.qt.identify.cursors import CursorLines
from app.qt.theme import Theme
from app.qt.widgets.layouts import make_column
from app.qt.widgets.plot_curves import Points
from app.qt.widgets.plot_marks import pen, shade
from app.qt.widgets.plots import Plot, PlotStack
from app.qt.widgets.text import label, set_subscripts

_POINT = 5  # in pixels
_BAND = 0.16  # opacity


class SlipPages(QWidget):
    """Draws `SlipPlots`; cursors move on the plot against time."""

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self._shown: SlipPlots | None = None
        self._statement = label(wrap=True)
        self._statement.setContentsMargins(16, 4, 16, 0)
        self._stacks = [PlotStack(theme, (("", "channel_2"),), format_point=_format_point) for _ in range(3)]
        self._items: list[tuple[Plot, Any]] = []
        self.cursors = CursorLines(self._stacks[-1].plots)
        make_column(self._statement, *((stack, 1) for stack in self._stacks), of=self)
        theme.changed.connect(self._draw)
        self._draw()

    def show_plots(self, shown: SlipPlots) -> None:
        self._shown = shown
        self._statement.setText(set_subscripts(shown.statement))
        for stack, plot in zip(self._stacks, shown.plots, strict=True):
            stack.set_title(0, plot.title)
            ends = plot.scale * plot.trend.grid()[[0, -1]]
            stack.set_time_range(float(ends[0]), float(ends[1]))
            stack.plots[0].set_value_range(*plot.trend.value_range())
        self._draw()

    def span(self) -> tuple[float, float]:
        """Drawn part of the time axis (s)."""
        return self._stacks[-1].time_range()

    def _draw(self) -> None:
        for pane, item in self._items:
            pane.remove(item)
        self._items = []
        self.cursors.restyle(self._theme.tokens)
        for stack in self._stacks:
            stack.restyle()
        for stack, plot in zip(self._stacks, () if self._shown is None else self._shown.plots, strict=False):
            stack.set_time_title(plot.axis)
            pane = stack.plots[0]
            self._items += [(pane, pane.add(item)) for item in self._items_of(plot)]

    def _items_of(self, plot: SlipPlot) -> list[Any]:
        tokens, trend = self._theme.tokens, plot.trend
        at = trend.grid()
        line, half_width = trend.line(at)
        edges = [
            pg.PlotCurveItem(plot.scale * at, line + side * half_width, pen=None) for side in (-1.0, 1.0)
        ]
        x = plot.scale * trend.at
        return [
            pg.FillBetweenItem(*edges, brush=shade(tokens.simulation, _BAND)),
            pg.PlotCurveItem(plot.scale * at, line, pen=pen(tokens.simulation, dashes=(5.0, 5.0))),
            pg.ErrorBarItem(
                x=x, y=trend.friction, height=2.0 * trend.half_width_95, beam=0.0, pen=pen(tokens.channel_2)
            ),
            self._points(x, trend.friction),
        ]

    def _points(self, x: Floats, friction: Floats) -> Points:
        points = Points(
            x=x, y=friction, size=_POINT, pen=None, brush=pg.mkBrush(self._theme.tokens.channel_2)
        )
        points.title = "f_d"
        return points


def _format_point(x: float, friction: float) -> str:
    return f"{format_fixed(x, 3)}   f<sub>d</sub> {format_fixed(friction, 4)}"
