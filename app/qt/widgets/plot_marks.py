"""Marks of plots that are no curves: pens, shaded spans, lines that stand or are dragged, the crosshair."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import pyqtgraph as pg
from PySide6.QtCore import QLineF, QPointF, QRectF, Qt
from PySide6.QtGui import QBrush, QColor, QPainter

from app.qt.theme import Tokens, colour, mixed

if TYPE_CHECKING:
    from app.qt.widgets.plots import Plot

_BEHIND, _ABOVE = -10, 30
_GRID_SHARES = (0.2, 0.1)
"""Of the ink in lines at ticks with a number, and between them."""


def pen(token_colour: str | QColor, *, alpha: float = 1.0, dashes: Sequence[float] = ()) -> Any:
    """Pen of one pixel: two pixels take five times as long to draw."""
    return pg.mkPen(colour(token_colour, alpha), width=1, dash=list(dashes) or None)


def shade(token_colour: str, alpha: float) -> Any:
    return pg.mkBrush(colour(token_colour, alpha))


def hatching(ink: str) -> Any:
    """Brush of what was not used."""
    brush = QBrush(colour(ink, 0.4))
    brush.setStyle(Qt.BrushStyle.BDiagPattern)
    return brush


def shaded_region(plot: "Plot", orientation: str = "vertical") -> Any:
    """Add a hidden shaded span behind the curves of a plot; `place_region` shows it."""
    item = pg.LinearRegionItem(orientation=orientation, movable=False, pen=pg.mkPen(None))
    item.setZValue(_BEHIND)
    item.hide()
    return plot.add(item)


def vertical_line(plot: "Plot") -> Any:
    return plot.add(pg.InfiniteLine(angle=90, movable=False))


def draggable_line(plot: "Plot") -> Any:
    """Add a vertical line that the mouse can drag, with a grip that looks like no point of a curve."""
    line = pg.InfiniteLine(angle=90, movable=True)
    line.addMarker("<|>", position=0.5, size=16.0)
    line.setZValue(20)
    return plot.add(line)


def place_region(item: Any, span: tuple[float, float] | None) -> None:
    item.setVisible(span is not None)
    if span is not None:
        item.setRegion(span)


class _Backdrop(pg.GraphicsObject):  # type: ignore[misc]  # pyqtgraph has no types
    """Item behind the curves of a plot, as large as what is in view."""

    def __init__(self, plot: "Plot", depth: float) -> None:
        super().__init__()
        self.setZValue(depth)
        plot.add(self)

    def viewTransformChanged(self) -> None:  # noqa: N802
        super().viewTransformChanged()
        self.prepareGeometryChange()

    def boundingRect(self) -> QRectF:  # noqa: N802
        return QRectF(self.viewRect())


class ShadedSpans(_Backdrop):
    def __init__(self, plot: "Plot") -> None:
        self._spans: tuple[tuple[float, float], ...] = ()
        self._brush = QBrush()
        super().__init__(plot, _BEHIND)

    @property
    def spans(self) -> tuple[tuple[float, float], ...]:
        return self._spans

    def show_spans(self, spans: tuple[tuple[float, float], ...]) -> None:
        self._spans = spans
        self.setVisible(bool(spans))
        self.update()

    def set_brush(self, brush: Any) -> None:
        self._brush = brush
        self.update()

    def paint(self, painter: QPainter, *_: Any) -> None:
        seen = self.viewRect()
        if self._brush.style() is not Qt.BrushStyle.SolidPattern:  # a hatching has the pitch of pixels
            self._brush.setTransform(painter.worldTransform().inverted()[0])
        for start, end in self._spans:
            left, right = max(start, seen.left()), min(end, seen.right())
            if left < right:
                painter.fillRect(QRectF(left, seen.top(), right - left, seen.height()), self._brush)


class Grid(_Backdrop):
    """Lines at the ticks of both axes.

    Those of pyqtgraph's axes are pictures as large as the plot, made anew with each step of a zoom.
    """

    def __init__(self, plot: "Plot") -> None:
        self._axes = (plot.bottom, plot.left)
        self._pens: list[Any] = []
        super().__init__(plot, 2 * _BEHIND)

    def restyle(self, tokens: Tokens) -> None:
        self._pens = [pen(mixed(tokens.muted, tokens.surface, share)) for share in _GRID_SHARES]
        self.update()

    def paint(self, painter: QPainter, *_: Any) -> None:
        seen = self.viewRect()
        painter.setRenderHint(QPainter.RenderHint.Antialiasing, False)
        for level, grid_pen in enumerate(self._pens):
            painter.setPen(grid_pen)
            across, along = (axis.ticks_in_view(level) for axis in self._axes)
            lines = [QLineF(x, seen.top(), x, seen.bottom()) for x in across]
            painter.drawLines(lines + [QLineF(seen.left(), y, seen.right(), y) for y in along])


class Crosshair:
    """Lines through the pointer: in each plot at its time, and in the plot under it at its height."""

    def __init__(self, plots: "Sequence[Plot]") -> None:
        self._verticals = [self._line(plot, 90) for plot in plots]
        self._horizontals = [self._line(plot, 0) for plot in plots]

    def show_at(self, row: int, at: QPointF) -> None:
        for line in self._verticals:
            line.setValue(at.x())
            line.show()
        for number, line in enumerate(self._horizontals):
            line.setVisible(number == row)
            line.setValue(at.y())

    def hide(self) -> None:
        for line in (*self._verticals, *self._horizontals):
            line.hide()

    def restyle(self, tokens: Tokens) -> None:
        for line in (*self._verticals, *self._horizontals):
            line.setPen(pen(tokens.muted, alpha=0.6))

    def _line(self, plot: "Plot", angle: int) -> Any:
        line = pg.InfiniteLine(angle=angle, movable=False)
        line.setAcceptedMouseButtons(Qt.MouseButton.NoButton)
        line.setZValue(_ABOVE)
        line.hide()
        return plot.add(line)
