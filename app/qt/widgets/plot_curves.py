"""Curves and points of plots: drawn with what a screen can show, and known by name and unit."""

from typing import Any

import numpy as np
import pyqtgraph as pg
from numpy.typing import NDArray
from PySide6.QtWidgets import QGraphicsItem

from app.presenters.decimated_history import Polyline
from app.presenters.decimated_line import DecimatedLine

Floats = NDArray[np.float64]

_DENSE_STROKES = 100.0
"""A line that crosses the plot this often is drawn as a filled band: ten times faster, and looks alike."""


class Curve(pg.PlotCurveItem):  # type: ignore[misc]  # pyqtgraph has no types
    """A curve with its name and unit."""

    title = ""
    unit = ""

    def __init__(self) -> None:
        super().__init__(antialias=True)

    def setPen(self, *arguments: Any, **options: Any) -> None:  # noqa: N802
        super().setPen(*arguments, **options)
        if self.opts["fillLevel"] is not None:
            self.setBrush(self.opts["pen"].color())

    def samples(self) -> tuple[Floats, Floats]:
        """All points (n,), which a table of the plot has."""
        return (np.empty(0), np.empty(0)) if self.xData is None else (self.xData, self.yData)

    def show_polyline(self, line: Polyline, height: float) -> None:
        """Draw a line in a plot of this height, as a band where strokes could not be told apart."""
        is_dense = line.strokes(height) > _DENSE_STROKES
        if is_dense and line.is_min_max and not line.has_gaps:
            self._show_band(line)
            return
        self.setData(
            line.time_s,
            line.value,
            connect="finite" if line.has_gaps else "all",
            skipFiniteCheck=True,
            fillLevel=None,
            antialias=not is_dense,
        )

    def _show_band(self, line: Polyline) -> None:
        """Fill between the lowest and the highest value of each span."""
        low, high = line.value[::2], line.value[1::2]
        self.setData(
            np.concatenate((line.time_s[::2], line.time_s[::-2])),
            np.concatenate((low, high[::-1])),
            connect="all",
            skipFiniteCheck=True,
            fillLevel="enclosed",
            brush=self.opts["pen"].color(),
            antialias=False,
        )


class Line(Curve):
    """A curve over rising times: whatever part is in view, as finely as pixels can show it.

    Its picture is kept until it changes.
    """

    def __init__(self, *, is_smooth: bool = False) -> None:
        super().__init__()
        self._is_smooth = is_smooth
        self._line: DecimatedLine | None = None
        self._drawn: tuple[object, ...] = ()
        self.setCacheMode(QGraphicsItem.CacheMode.DeviceCoordinateCache)

    def show_line(self, time_s: Floats | None, values: Floats | None) -> None:
        """Draw values at times, (n,) each; nothing if None."""
        self._drawn = ()
        if time_s is None or values is None or not len(values):
            self._line = None
            self.setData(np.empty(0), np.empty(0))
        else:
            self._line = DecimatedLine(time_s, values, is_smooth=self._is_smooth)
            self.refresh()

    def samples(self) -> tuple[Floats, Floats]:
        return (np.empty(0), np.empty(0)) if self._line is None else (self._line.time_s, self._line.values)

    def refresh(self, *_: object) -> None:
        """Draw the part in view, if another is in view than when it was drawn."""
        view = self.getViewBox()
        if self._line is None or view is None:
            return
        (start_s, end_s), (low, high) = view.viewRange()
        wanted = (start_s, end_s, high - low, view.width())
        if wanted != self._drawn:
            self._drawn = wanted
            self.show_polyline(self._line.part(start_s, end_s, int(view.width())), high - low)


class Points(pg.ScatterPlotItem):  # type: ignore[misc]  # pyqtgraph has no types
    """Marks with their name and unit."""

    title = ""
    unit = ""

    def samples(self) -> tuple[Floats, Floats]:
        x, y = self.getData()
        return x, y
