"""Plots under one another with one time axis: drawing only, no knowledge of what is drawn."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pyqtgraph as pg
from numpy.typing import NDArray
from PySide6.QtCore import QPointF, QRectF, Qt, Signal
from PySide6.QtGui import QBrush, QPainter, QPixmapCache, QResizeEvent
from PySide6.QtWidgets import QGraphicsItem, QVBoxLayout, QWidget

from analysis.formatting import typeset
from app.qt.theme import TextRole, Theme, Tokens, colour, font

Floats = NDArray[np.float64]
AXIS_WIDTH = 52
_SMALLEST_HEIGHT = 96
_ENDLESS = 16_777_215.0
"""Qt's own largest height."""
_GRID_ALPHA = 51
"""20 % of 255."""
_CACHE_KB = 128 * 1024
"""Room for the pictures of axes and grids of a large screen; Qt's own 10 MB hold those of a small one."""


class Plot:
    """One plot in a row of a `PlotStack`: title and readout above, axes at the left and below.

    Built of pyqtgraph's view and axes; its `PlotItem` would bring seven menus along with each plot.

    Parameters
    ----------
    canvas : GraphicsLayoutWidget
    row : int
    interactive : bool
        The mouse zooms and pans in time.
    """

    def __init__(self, canvas: Any, row: int, *, interactive: bool) -> None:
        self.view = pg.ViewBox(enableMenu=False)
        self.view.setMouseEnabled(x=interactive, y=False)
        self.view.disableAutoRange()
        self.left = self._axis("left")
        self.bottom = self._axis("bottom")
        self.left.setWidth(AXIS_WIDTH)
        self.title = canvas.addLabel("", row=3 * row, col=0, colspan=2, justify="left")
        self.readout = canvas.addLabel("", row=3 * row, col=2, justify="right")
        canvas.addItem(self.left, row=3 * row + 1, col=0)
        canvas.addItem(self.view, row=3 * row + 1, col=1, colspan=2)
        canvas.addItem(self.bottom, row=3 * row + 2, col=1, colspan=2)

    def curve(self, **options: Any) -> Any:
        """Add an empty line."""
        return self.add(pg.PlotDataItem(antialias=True, **options))

    def add(self, item: Any) -> Any:
        """Add an item."""
        self.view.addItem(item, ignoreBounds=True)
        return item

    def set_value_range(self, low: float, high: float) -> None:
        """Show these values, from the lower edge to the upper."""
        self.view.setYRange(low, high, padding=0.0)

    def restyle(self, tokens: Tokens) -> None:
        """Take these colours."""
        for axis in (self.left, self.bottom):
            axis.setPen(pg.mkPen(tokens.line, width=1))
            axis.setTickPen(pg.mkPen(tokens.muted, width=1))
            axis.setTextPen(pg.mkPen(tokens.muted))

    def _axis(self, side: str) -> Any:
        axis = _Axis(side, linkView=self.view)
        axis.setGrid(_GRID_ALPHA)
        axis.enableAutoSIPrefix(False)  # "(x0.001)" is no unit
        axis.setStyle(tickFont=font(TextRole.LABEL), tickLength=0, maxTickLevel=1)
        # Axis and grid seldom change, but would be drawn with each frame: two thirds of its time.
        axis.setCacheMode(QGraphicsItem.CacheMode.DeviceCoordinateCache)
        return axis


class PlotStack(QWidget):
    """Several plots, linked in time, each with a title at its top left and a readout at its top right.

    Parameters
    ----------
    theme : Theme
    titles : sequence of (str, str)
        Rich text and colour token of each plot's title, first plot on top.
    interactive : bool
        Mouse zooms and pans.
    heights : sequence of int, optional
        Heights of the plots against one another; alike if absent.
    """

    hovered = Signal(float)
    """Time under the pointer (s); NaN when it has left."""
    resized = Signal(int)
    """Width of the plots in pixels."""

    def __init__(
        self,
        theme: Theme,
        titles: Sequence[tuple[str, str]],
        *,
        interactive: bool,
        heights: Sequence[int] = (),
    ) -> None:
        super().__init__()
        QPixmapCache.setCacheLimit(_CACHE_KB)
        self._theme = theme
        self._titles = list(titles)
        self._canvas = pg.GraphicsLayoutWidget()
        for part in (self._canvas, self._canvas.viewport()):
            part.setFocusPolicy(Qt.FocusPolicy.NoFocus)  # keys are for the whole plot, if for anything
        self.plots = [Plot(self._canvas, row, interactive=interactive) for row in range(len(titles))]
        self._arrange(heights or [1] * len(titles))
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addWidget(self._canvas)
        self._canvas.scene().sigMouseMoved.connect(self._on_mouse)
        self.setMinimumHeight(_SMALLEST_HEIGHT * len(titles))

    def restyle(self) -> None:
        """Take the colours of the theme."""
        tokens = self._theme.tokens
        self._canvas.setBackground(tokens.surface)
        for plot, (text, token) in zip(self.plots, self._titles, strict=True):
            _write(plot.title, text, getattr(tokens, token))
            plot.restyle(tokens)
        self.set_time_title(self.plots[-1].bottom.labelText)

    def set_title(self, row: int, text: str) -> None:
        """Write rich text at a plot's top left."""
        _, token = self._titles[row]
        self._titles[row] = text, token
        _write(self.plots[row].title, text, getattr(self._theme.tokens, token))

    def set_plot_visible(self, row: int, *, shown: bool) -> None:
        """Leave a plot out but for its title (and the time axis of the last), or show it again."""
        for item in (self.plots[row].view, self.plots[row].left):
            item.setVisible(shown)
        self._canvas.ci.layout.setRowMaximumHeight(3 * row + 1, _ENDLESS if shown else 0.0)

    def set_time_title(self, text: str) -> None:
        """Name the time axis."""
        self.plots[-1].bottom.setLabel(text, **{"color": self._theme.tokens.muted, "font-size": "11px"})

    def set_time_range(self, start_s: float, end_s: float) -> None:
        """Show this span of time in all plots."""
        self.plots[0].view.setXRange(start_s, end_s, padding=0.0)

    def time_range(self) -> tuple[float, float]:
        """Which span of time is shown (s)."""
        (start_s, end_s), _ = self.plots[0].view.viewRange()
        return float(start_s), float(end_s)

    def set_readout(self, row: int, text: str) -> None:
        """Write at a plot's top right."""
        _write(self.plots[row].readout, text, self._theme.tokens.text)

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: N802
        """Tell the new width of the plots."""
        super().resizeEvent(event)
        self.resized.emit(max(64, self.width() - AXIS_WIDTH - 20))

    def _arrange(self, heights: Sequence[int]) -> None:
        grid = self._canvas.ci.layout
        grid.setContentsMargins(8, 4, 12, 4)
        grid.setSpacing(0)
        for row, height in enumerate(heights):
            grid.setRowStretchFactor(3 * row + 1, height)
            grid.setRowPreferredHeight(3 * row + 1, 1000.0)
        for plot in self.plots[:-1]:
            plot.bottom.setStyle(showValues=False)
            plot.bottom.setHeight(4)
        for plot in self.plots[1:]:
            plot.view.setXLink(self.plots[0].view)

    def _on_mouse(self, position: QPointF) -> None:
        for plot in self.plots:
            if plot.view.sceneBoundingRect().contains(position):
                self.hovered.emit(float(plot.view.mapSceneToView(position).x()))
                return
        self.hovered.emit(math.nan)


class _Axis(pg.AxisItem):  # type: ignore[misc]  # pyqtgraph has no types
    """An axis whose numbers carry a true minus."""

    def tickStrings(self, values: Any, scale: float, spacing: float) -> list[str]:  # noqa: N802
        return [typeset(text) for text in super().tickStrings(values, scale, spacing)]


def pen(token_colour: str, *, alpha: float = 1.0, dashes: Sequence[float] = ()) -> Any:
    """One pixel wide: two cost five times as much."""
    return pg.mkPen(colour(token_colour, alpha), width=1, dash=list(dashes) or None)


def shade(token_colour: str, alpha: float) -> Any:
    """Brush of a shaded span."""
    return pg.mkBrush(colour(token_colour, alpha))


def value_at(time_s: Floats, values: Floats, at_s: float) -> float:
    """Value of a drawn line at a time; NaN beside it."""
    if not len(time_s) or not time_s[0] <= at_s <= time_s[-1]:
        return math.nan
    return float(values[min(int(np.searchsorted(time_s, at_s)), len(values) - 1)])


def shaded_region(plot: Plot, orientation: str = "vertical") -> Any:
    """A hidden shaded span behind the curves of a plot; `place_region` shows it."""
    item = pg.LinearRegionItem(orientation=orientation, movable=False, pen=pg.mkPen(None))
    item.setZValue(-10)
    item.hide()
    return plot.add(item)


def vertical_line(plot: Plot) -> Any:
    """A line from the lower edge to the upper, at a value that `setValue` sets."""
    return plot.add(pg.InfiniteLine(angle=90, movable=False))


def draggable_line(plot: Plot) -> Any:
    """An upright line that the mouse can draw along, with a grip."""
    line = pg.InfiniteLine(angle=90, movable=True)
    line.addMarker("o", position=0.5, size=14.0)
    line.setZValue(20)
    return plot.add(line)


def place_region(item: Any, span: tuple[float, float] | None) -> None:
    """Show a span where it belongs; None hides it."""
    item.setVisible(span is not None)
    if span is not None:
        item.setRegion(span)


def _write(item: Any, text: str, text_colour: str) -> None:
    """Write into a label; where it is wider than its place it is cut, rather than the plot pushed aside."""
    item.setText(f'<span style="color: {text_colour}; font-size: 12px">{text}</span>')
    item.setMinimumWidth(0.0)


_BEHIND = -10


class ShadedSpans(pg.GraphicsObject):  # type: ignore[misc]  # pyqtgraph has no types
    """Spans as high as the plot. `show_spans` and `set_brush` change them."""

    def __init__(self, plot: Plot) -> None:
        super().__init__()
        self._spans: tuple[tuple[float, float], ...] = ()
        self._brush = QBrush()
        self.setZValue(_BEHIND)
        self.setCacheMode(QGraphicsItem.CacheMode.DeviceCoordinateCache)  # they seldom change
        plot.add(self)

    @property
    def spans(self) -> tuple[tuple[float, float], ...]:
        """What is shaded, from and to, in the unit of the plot's axis."""
        return self._spans

    def show_spans(self, spans: tuple[tuple[float, float], ...]) -> None:
        """Shade these."""
        self._spans = spans
        self.update()

    def set_brush(self, brush: Any) -> None:
        """Shade with this."""
        self._brush = brush
        self.update()

    def viewTransformChanged(self) -> None:  # noqa: N802
        """The plot shows another stretch."""
        super().viewTransformChanged()
        self.prepareGeometryChange()

    def boundingRect(self) -> QRectF:  # noqa: N802
        """All that the plot shows."""
        return QRectF(self.viewRect())

    def paint(self, painter: QPainter, *_: Any) -> None:
        """Fill the spans that can be seen."""
        seen = self.viewRect()
        for start, end in self._spans:
            left, right = max(start, seen.left()), min(end, seen.right())
            if left < right:
                painter.fillRect(QRectF(left, seen.top(), right - left, seen.height()), self._brush)
