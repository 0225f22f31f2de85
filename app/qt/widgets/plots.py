"""Plots below one another with one time axis."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pyqtgraph as pg
from numpy.typing import NDArray
from PySide6.QtCore import QPointF, QRectF, Qt, Signal
from PySide6.QtGui import QBrush, QPainter, QPixmapCache, QResizeEvent
from PySide6.QtWidgets import QGraphicsItem, QWidget

from analysis.formatting import typeset, with_unit
from app.presenters.number_text import format_fixed
from app.qt.theme import TextRole, Theme, Tokens, colour, font
from app.qt.widgets.layouts import make_column

Floats = NDArray[np.float64]
AXIS_WIDTH = 52
_SMALLEST_HEIGHT = 96
_ENDLESS = 16_777_215.0
"""Qt's own largest height."""
_BEHIND = -10
_GRID_ALPHA = 51
"""20 % of 255."""
_CACHE_KB = 128 * 1024
"""Room for the pictures of axes and grids of a large screen; Qt's own 10 MB hold those of a small one."""


class Plot:
    """One plot in a row of a `PlotStack`: title and readout above, axes at the left and below.

    It is built of pyqtgraph's view and axes: a `PlotItem` would create seven menus for each plot.
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
        return self.add(pg.PlotDataItem(antialias=True, **options))

    def add(self, item: Any) -> Any:
        self.view.addItem(item, ignoreBounds=True)
        return item

    def set_value_range(self, low: float, high: float) -> None:
        self.view.setYRange(low, high, padding=0.0)

    def fit_values(self, *lines: Floats) -> None:
        """Show all values of lines, with a margin."""
        self.set_value_range(*value_extent(*lines))

    def restyle(self, tokens: Tokens) -> None:
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

    `titles` are rich text and colour token of each plot, from the top. `heights` are relative.
    """

    hovered = Signal(float)  # time under the pointer (s); NaN when it has left
    resized = Signal(int)  # width of the plots in pixels

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
        make_column(self._canvas, of=self)
        self._canvas.scene().sigMouseMoved.connect(self._on_mouse)
        self.setMinimumHeight(_SMALLEST_HEIGHT * len(titles))

    def restyle(self) -> None:
        tokens = self._theme.tokens
        self._canvas.setBackground(tokens.surface)
        for plot, (text, token) in zip(self.plots, self._titles, strict=True):
            _write(plot.title, text, getattr(tokens, token))
            plot.restyle(tokens)
        self.set_time_title(self.plots[-1].bottom.labelText)

    def set_title(self, row: int, text: str) -> None:
        _, token = self._titles[row]
        self._titles[row] = text, token
        _write(self.plots[row].title, text, getattr(self._theme.tokens, token))

    def set_plot_visible(self, row: int, *, shown: bool) -> None:
        """Show a plot, or only its title (and the time axis, of the last)."""
        for item in (self.plots[row].view, self.plots[row].left):
            item.setVisible(shown)
        self._canvas.ci.layout.setRowMaximumHeight(3 * row + 1, _ENDLESS if shown else 0.0)

    def set_time_title(self, text: str) -> None:
        self.plots[-1].bottom.setLabel(text, **{"color": self._theme.tokens.muted, "font-size": "11px"})

    def set_time_range(self, start_s: float, end_s: float) -> None:
        self.plots[0].view.setXRange(start_s, end_s, padding=0.0)

    def time_range(self) -> tuple[float, float]:
        (start_s, end_s), _ = self.plots[0].view.viewRange()
        return float(start_s), float(end_s)

    def set_readout(self, row: int, text: str) -> None:
        _write(self.plots[row].readout, text, self._theme.tokens.text)

    def show_values(
        self, row: int, at_s: float, values: Sequence[float], unit: str, decimals: int = 3
    ) -> None:
        """Show a time (nothing if NaN) and the values of a plot there (a dash if NaN) as its readout."""
        texts = [format_fixed(value, decimals) if math.isfinite(value) else "–" for value in values]
        at = "" if math.isnan(at_s) else with_unit(format_fixed(at_s, 3), "s")
        self.set_readout(row, f"{at}   {with_unit(' | '.join(texts), unit)}" if at and texts else at)

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: N802
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
    def tickStrings(self, values: Any, scale: float, spacing: float) -> list[str]:  # noqa: N802
        return [typeset(text) for text in super().tickStrings(values, scale, spacing)]


def pen(token_colour: str, *, alpha: float = 1.0, dashes: Sequence[float] = ()) -> Any:
    """Pen of one pixel: two pixels take five times as long to draw."""
    return pg.mkPen(colour(token_colour, alpha), width=1, dash=list(dashes) or None)


def shade(token_colour: str, alpha: float) -> Any:
    return pg.mkBrush(colour(token_colour, alpha))


def value_at(time_s: Floats, values: Floats, at_s: float) -> float:
    """Value of a drawn line at a time; NaN outside it."""
    if not len(time_s) or not time_s[0] <= at_s <= time_s[-1]:
        return math.nan
    return float(values[min(int(np.searchsorted(time_s, at_s)), len(values) - 1)])


def value_extent(*lines: Floats) -> tuple[float, float]:
    """Lowest and highest value of lines, with a margin; -1 and 1 without any."""
    values = [line[np.isfinite(line)] for line in lines]
    low = min((float(line.min()) for line in values if len(line)), default=-1.0)
    high = max((float(line.max()) for line in values if len(line)), default=1.0)
    margin = 0.06 * (high - low) or 1.0
    return low - margin, high + margin


def shaded_region(plot: Plot, orientation: str = "vertical") -> Any:
    """Add a hidden shaded span behind the curves of a plot; `place_region` shows it."""
    item = pg.LinearRegionItem(orientation=orientation, movable=False, pen=pg.mkPen(None))
    item.setZValue(_BEHIND)
    item.hide()
    return plot.add(item)


def vertical_line(plot: Plot) -> Any:
    return plot.add(pg.InfiniteLine(angle=90, movable=False))


def draggable_line(plot: Plot) -> Any:
    """Add a vertical line with a grip that the mouse can drag."""
    line = pg.InfiniteLine(angle=90, movable=True)
    line.addMarker("o", position=0.5, size=14.0)
    line.setZValue(20)
    return plot.add(line)


def place_region(item: Any, span: tuple[float, float] | None) -> None:
    item.setVisible(span is not None)
    if span is not None:
        item.setRegion(span)


def _write(item: Any, text: str, text_colour: str) -> None:
    """Set the text of a label; a wide one is cut instead of moving the plot."""
    item.setText(f'<span style="color: {text_colour}; font-size: 12px">{text}</span>')
    item.setMinimumWidth(0.0)


class ShadedSpans(pg.GraphicsObject):  # type: ignore[misc]  # pyqtgraph has no types
    def __init__(self, plot: Plot) -> None:
        super().__init__()
        self._spans: tuple[tuple[float, float], ...] = ()
        self._brush = QBrush()
        self.setZValue(_BEHIND)
        self.setCacheMode(QGraphicsItem.CacheMode.DeviceCoordinateCache)  # they seldom change
        plot.add(self)

    @property
    def spans(self) -> tuple[tuple[float, float], ...]:
        return self._spans

    def show_spans(self, spans: tuple[tuple[float, float], ...]) -> None:
        self._spans = spans
        self.update()

    def set_brush(self, brush: Any) -> None:
        self._brush = brush
        self.update()

    def viewTransformChanged(self) -> None:  # noqa: N802
        super().viewTransformChanged()
        self.prepareGeometryChange()

    def boundingRect(self) -> QRectF:  # noqa: N802
        return QRectF(self.viewRect())

    def paint(self, painter: QPainter, *_: Any) -> None:
        seen = self.viewRect()
        for start, end in self._spans:
            left, right = max(start, seen.left()), min(end, seen.right())
            if left < right:
                painter.fillRect(QRectF(left, seen.top(), right - left, seen.height()), self._brush)
