"""Curves and points of plots: drawn with what a screen can show, and known by name and unit."""

from typing import Any

import numpy as np
import pyqtgraph as pg
from numpy.typing import NDArray
from PySide6.QtCore import QRectF
from PySide6.QtGui import QPaintEngine, QPainter
from PySide6.QtWidgets import QGraphicsItem

from app.presenters.decimated_history import Polyline
from app.presenters.decimated_line import DecimatedLine
from app.qt.widgets.plot_band import Band

Floats = NDArray[np.float64]

_DENSE_STROKES = 100.0
"""A line of extremes that crosses the plot this often is drawn as a band: much faster, and looks alike."""
_EDGE_PX = 8
"""Width of the spans of the edges of a band: several swings have room in one that cannot be told apart."""


class Curve(pg.PlotCurveItem):  # type: ignore[misc]  # pyqtgraph has no types
    """A curve with its name and unit."""

    title = ""
    unit = ""

    def __init__(self, *, antialias: bool = True) -> None:
        super().__init__(antialias=antialias)
        self._polyline = Polyline.empty()
        self._band = Band()
        self._is_band = False

    def viewTransformChanged(self) -> None:  # noqa: N802
        """As pyqtgraph, and forget what was in view, which it remembers for items."""
        self._cachedView = None
        super().viewTransformChanged()

    def boundingRect(self) -> QRectF:  # noqa: N802
        """All that is in view: pyqtgraph looks for the extremes of all points anew at each step of a zoom."""
        return QRectF(self.viewRect()) if len(self._polyline.time_s) else QRectF()

    def samples(self) -> tuple[Floats, Floats]:
        """All points (n,), which a table of the plot has."""
        return self._polyline.time_s, self._polyline.value

    def show_points(self, x: Floats, y: Floats) -> None:
        """Draw few points (n,) each, in any order; NaN breaks the line."""
        self._polyline, self._is_band = Polyline(x, y), False
        self.setData(x, y, connect="finite")

    def keep_picture(self, *, kept: bool) -> None:
        """Draw from a picture as long as the curve and the view do not change.

        That is faster where only other items change, and slower where the view does.
        """
        modes = QGraphicsItem.CacheMode
        self.setCacheMode(modes.DeviceCoordinateCache if kept else modes.NoCache)

    def show_polyline(self, line: Polyline) -> None:
        """Draw a line; one of lowest and highest values as a band, where strokes could not be told apart."""
        self._show(line, is_dense=self._is_dense(line))

    def _show(self, line: Polyline, *, is_dense: bool) -> None:
        self._polyline, self._is_band = line, is_dense and line.is_min_max
        if self._is_band:
            self._band.show_line(line)
            self.prepareGeometryChange()
            self.update()
        else:
            smooth = {"connect": "finite" if line.has_gaps else "all", "antialias": not is_dense}
            self.setData(line.time_s, line.value, skipFiniteCheck=True, **smooth)

    def paint(self, painter: QPainter, *arguments: Any) -> None:
        if not self._is_band:
            super().paint(painter, *arguments)
        elif painter.paintEngine().type() == QPaintEngine.Type.Raster:
            self._band.paint(painter, self.getViewBox().viewRect(), self.opts["pen"].color())
        else:  # a drawing has strokes
            painter.setPen(self.opts["pen"])
            painter.drawPath(pg.arrayToQPath(self._polyline.time_s, self._polyline.value, connect="finite"))

    def _is_dense(self, line: Polyline) -> bool:
        view = self.getViewBox()
        if view is None:
            return False
        _, (low, high) = view.viewRange()
        return line.strokes(high - low) > _DENSE_STROKES


class Line(Curve):
    """A curve over rising times: whatever part is in view, as finely as pixels can show it.

    A line that `is_smooth` is drawn through some of its points; where its swings are too many, the edges of
    its band are drawn, so that a record behind it stays in sight. The picture is kept until it changes.
    """

    def __init__(self, *, is_smooth: bool = False) -> None:
        super().__init__()
        self._is_smooth = is_smooth
        self._line: DecimatedLine | None = None
        self._drawn: tuple[object, ...] = ()

    def show_line(self, time_s: Floats | None, values: Floats | None) -> None:
        """Draw values at times, (n,) each; nothing if None."""
        self._drawn = ()
        if time_s is None or values is None or not len(values):
            self._line = None
            self.show_polyline(Polyline.empty())
        else:
            self._line = DecimatedLine(time_s, values)
            self.refresh()

    def samples(self) -> tuple[Floats, Floats]:
        return (np.empty(0), np.empty(0)) if self._line is None else (self._line.time_s, self._line.values)

    def refresh(self, *_: object) -> None:
        """Draw the part in view, if another is in view than when it was drawn."""
        view = self.getViewBox()
        if self._line is None or view is None:
            return
        (start_s, end_s), (low, high) = view.viewRange()
        wanted = (start_s, end_s, high - low, view.width(), view.height())
        if wanted == self._drawn:
            return
        self._drawn = wanted
        part, pixels = (start_s, end_s), int(view.width())
        if not self._is_smooth:
            self.show_polyline(self._line.part(*part, pixels))
            return
        line = self._line.thinned(*part, pixels)
        if self._is_dense(line):
            line = _edges(self._line.part(*part, pixels // _EDGE_PX))
        self._show(line, is_dense=False)


def _edges(line: Polyline) -> Polyline:
    """Lower and upper edge of a line of lowest and highest values, one after the other."""
    return Polyline(
        np.concatenate((line.time_s[::2], line.time_s[:1], line.time_s[::2])),
        np.concatenate((line.value[::2], [np.nan], line.value[1::2])),
    )


class Points(pg.ScatterPlotItem):  # type: ignore[misc]  # pyqtgraph has no types
    """Marks with their name and unit."""

    title = ""
    unit = ""

    def samples(self) -> tuple[Floats, Floats]:
        x, y = self.getData()
        return x, y
