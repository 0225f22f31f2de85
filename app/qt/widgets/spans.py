"""Shaded spans of time behind the curves of a plot, however many: one item, as `region` is for one span."""

from typing import Any

import pyqtgraph as pg
from PySide6.QtCore import QRectF
from PySide6.QtGui import QBrush, QPainter
from PySide6.QtWidgets import QGraphicsItem

from app.qt.widgets.plots import Plot

_BEHIND = -10


class Spans(pg.GraphicsObject):  # type: ignore[misc]  # pyqtgraph has no types
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
