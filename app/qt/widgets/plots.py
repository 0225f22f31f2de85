"""Plots under one another with one time axis: drawing only, no knowledge of what is drawn."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pyqtgraph as pg
from numpy.typing import NDArray
from PySide6.QtCore import QPointF, Signal
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QGraphicsItem, QVBoxLayout, QWidget

from app.presenters.numbers import signed
from app.qt.theme import Theme, Type, colour, font

FloatArray = NDArray[np.float64]
AXIS_WIDTH = 52
_SMALLEST_HEIGHT = 96


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
        self._theme = theme
        self._titles = list(titles)
        self._canvas = pg.GraphicsLayoutWidget()
        self._canvas.ci.layout.setContentsMargins(8, 4, 12, 4)
        self._canvas.ci.layout.setSpacing(0)
        self._labels: list[Any] = []
        self._readouts: list[Any] = []
        self.plots: list[Any] = []
        for row in range(len(titles)):
            self._add_plot(row, interactive)
            self._canvas.ci.layout.setRowStretchFactor(2 * row + 1, heights[row] if heights else 1)
            self._canvas.ci.layout.setRowPreferredHeight(2 * row + 1, 1000.0)
        self._hide_inner_time_axes()
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addWidget(self._canvas)
        self._canvas.scene().sigMouseMoved.connect(self._on_mouse)
        self.setMinimumHeight(_SMALLEST_HEIGHT * len(titles))

    def restyle(self) -> None:
        """Take the colours of the theme."""
        tokens = self._theme.tokens
        self._canvas.setBackground(tokens.surface)
        for row, (text, token) in enumerate(self._titles):
            self._labels[row].setText(_html(text, getattr(tokens, token)))
            for side in ("left", "bottom"):
                axis = self.plots[row].getAxis(side)
                axis.setPen(pg.mkPen(tokens.line, width=1))
                axis.setTickPen(pg.mkPen(tokens.muted, width=1))
                axis.setTextPen(pg.mkPen(tokens.muted))
        self.plots[-1].getAxis("bottom").labelStyle = {"color": tokens.muted, "font-size": "11px"}

    def set_time_title(self, text: str) -> None:
        """Name the time axis."""
        axis = self.plots[-1].getAxis("bottom")
        if axis.labelText != text:
            axis.setLabel(text, **{"color": self._theme.tokens.muted, "font-size": "11px"})

    def set_span(self, start_s: float, end_s: float) -> None:
        """Show this span of time in all plots."""
        self.plots[0].setXRange(start_s, end_s, padding=0.0)

    def set_title(self, row: int, text: str) -> None:
        """Name a plot anew."""
        self._titles[row] = (text, self._titles[row][1])
        self._labels[row].setText(_html(text, getattr(self._theme.tokens, self._titles[row][1])))

    def set_readout(self, row: int, text: str) -> None:
        """Write at a plot's top right."""
        self._readouts[row].setText(_html(text, self._theme.tokens.text))

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: N802
        """Tell the new width of the plots."""
        super().resizeEvent(event)
        self.resized.emit(max(64, self.width() - AXIS_WIDTH - 20))

    def _add_plot(self, row: int, interactive: bool) -> None:
        title = self._canvas.addLabel("", row=2 * row, col=0, justify="left")
        readout = self._canvas.addLabel("", row=2 * row, col=1, justify="right")
        axes = {side: _Axis(side) for side in ("left", "bottom")}
        plot = self._canvas.addPlot(row=2 * row + 1, col=0, colspan=2, axisItems=axes)
        plot.hideButtons()
        plot.setMenuEnabled(False)
        plot.setMouseEnabled(x=interactive, y=False)
        plot.showGrid(x=True, y=True, alpha=0.2)
        plot.getAxis("left").setWidth(AXIS_WIDTH)
        for side in ("left", "bottom"):
            axes[side].setStyle(tickFont=font(Type.LABEL), tickLength=0, maxTickLevel=1)
            # Axis and grid seldom change, but would be drawn with each frame: two thirds of its time.
            axes[side].setCacheMode(QGraphicsItem.CacheMode.DeviceCoordinateCache)
        if self.plots:
            plot.setXLink(self.plots[0])
        self._labels.append(title)
        self._readouts.append(readout)
        self.plots.append(plot)

    def _hide_inner_time_axes(self) -> None:
        for plot in self.plots[:-1]:
            plot.getAxis("bottom").setStyle(showValues=False)
            plot.getAxis("bottom").setHeight(4)

    def _on_mouse(self, position: QPointF) -> None:
        for plot in self.plots:
            if plot.vb.sceneBoundingRect().contains(position):
                self.hovered.emit(float(plot.vb.mapSceneToView(position).x()))
                return
        self.hovered.emit(float("nan"))


class _Axis(pg.AxisItem):  # type: ignore[misc]  # pyqtgraph has no types
    """An axis whose numbers carry a true minus."""

    def tickStrings(self, values: Any, scale: float, spacing: float) -> list[str]:  # noqa: N802
        return [signed(text) for text in super().tickStrings(values, scale, spacing)]


def pen(token_colour: str, *, alpha: float = 1.0, dashes: Sequence[float] = ()) -> Any:
    """One pixel wide: two cost five times as much."""
    return pg.mkPen(colour(token_colour, alpha), width=1, dash=list(dashes) or None)


def shade(token_colour: str, alpha: float) -> Any:
    """Brush of a shaded span."""
    return pg.mkBrush(colour(token_colour, alpha))


def nearest(time_s: FloatArray, values: FloatArray, at_s: float) -> float:
    """Value of a drawn line at a time; NaN beside it."""
    if not len(time_s) or not time_s[0] <= at_s <= time_s[-1]:
        return float("nan")
    return float(values[min(int(np.searchsorted(time_s, at_s)), len(values) - 1)])


def _html(text: str, text_colour: str) -> str:
    return f'<span style="color: {text_colour}; font-size: 12px">{text}</span>'
