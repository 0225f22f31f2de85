"""The view of one plot: what mouse and wheel do in it, and the range that it may show."""

import math
from typing import Any

import pyqtgraph as pg
from PySide6.QtCore import QPoint, QPointF, QRectF, Qt, Signal
from PySide6.QtWidgets import QGraphicsRectItem

from app.qt.theme import Tokens, colour

Span = tuple[float, float]
X, Y = 0, 1  # axes
STEP = 0.8
"""Part of a range that is left after zooming in by one step of the wheel, or one key."""
PAN = 0.1
"""Part of a range by which a step of the wheel, or a key, moves it."""
_DEEPEST = 1e-6  # smallest range, as a part of all: some readings of an hour
_SLIGHT_PX = 12  # a box that is less wide or high keeps that axis as it is
_NOTCH = 120.0  # angle of one step of a wheel, in eighths of a degree
_BOX_FILL = 0.12  # opacity


class PlotView(pg.ViewBox):  # type: ignore[misc]  # pyqtgraph has no types
    """Zooms and moves within `limits`; `home` is what a reset shows.

    The wheel zooms in x at the pointer, with Ctrl in y; with Shift, or turned sideways, it moves. Dragging
    draws a box to zoom into; with Shift, or by the middle button, it moves. Over an axis they act on it
    alone.
    """

    reset_requested = Signal()
    menu_requested = Signal(QPoint)

    def __init__(self) -> None:
        super().__init__(enableMenu=False)
        self.disableAutoRange()
        self._home: list[Span] = [(0.0, 1.0), (0.0, 1.0)]
        self._box = QGraphicsRectItem(self)
        self._box.setZValue(1e3)
        self._box.hide()

    def set_home(self, axis: int, home: Span, limits: Span | None = None, *, keep: bool = False) -> None:
        """Set what a reset shows of an axis and how far it may go, and show it.

        With `keep` a range that the user has chosen stays, as far as the limits allow.
        """
        stays = keep and not self.is_home(axis)
        low, high = limits or home
        self._home[axis] = home
        name = "xy"[axis]
        self.setLimits(
            **{
                f"{name}Min": low,
                f"{name}Max": high,
                f"min{name.upper()}Range": _DEEPEST * (high - low),
            }
        )
        if not stays:
            self.show_home(axis)

    def grow_home(self, axis: int, span: Span) -> None:
        """Widen what a reset shows of an axis, and its limits, to hold a span; a chosen range stays."""
        (low, high), name = self._home[axis], "xy"[axis]
        grown = min(low, span[0]), max(high, span[1])
        if grown != (low, high):
            least, most = self.state["limits"][f"{name}Limits"]
            self.set_home(axis, grown, (min(least, grown[0]), max(most, grown[1])), keep=True)

    def show_home(self, axis: int) -> None:
        self.show_ranges({axis: self._home[axis]})

    def is_home(self, axis: int) -> bool:
        """Tell whether an axis shows what a reset would show."""
        low, high = self._home[axis]
        near = 1e-6 * (high - low)
        return all(
            math.isclose(shown, end, rel_tol=0.0, abs_tol=near)
            for shown, end in zip(self.viewRange()[axis], (low, high), strict=True)
        )

    def show_ranges(self, ranges: dict[int, Span]) -> None:
        """Show ranges by axis, all at once: curves are drawn anew for each change."""
        if ranges:
            self.setRange(xRange=ranges.get(X), yRange=ranges.get(Y), padding=0.0)

    def zoom(self, axis: int, factor: float, at: float | None = None) -> None:
        """Make the range of an axis `factor` as long; `at`, by default the middle, stays where it is."""
        low, high = self.viewRange()[axis]
        centre = 0.5 * (low + high) if at is None else min(max(at, low), high)
        self.show_ranges({axis: (centre + factor * (low - centre), centre + factor * (high - centre))})

    def pan(self, axis: int, share: float) -> None:
        """Move the range of an axis by a share of it, up to the limits."""
        low, high = self.viewRange()[axis]
        self.show_ranges({axis: self._moved(axis, share * (high - low))})

    def restyle(self, tokens: Tokens) -> None:
        self._box.setPen(pg.mkPen(tokens.accent))
        self._box.setBrush(colour(tokens.accent, _BOX_FILL))

    def wheelEvent(self, event: Any, axis: int | None = None) -> None:  # noqa: N802
        event.accept()
        steps, keys = event.delta() / _NOTCH, event.modifiers()
        if event.orientation() is Qt.Orientation.Horizontal or keys & Qt.KeyboardModifier.ShiftModifier:
            self.pan(X, -PAN * steps)
            return
        zoomed = axis if axis is not None else Y if keys & Qt.KeyboardModifier.ControlModifier else X
        at = self.mapSceneToView(event.scenePos())
        self.zoom(zoomed, STEP**steps, (at.x(), at.y())[zoomed])

    def mouseDragEvent(self, event: Any, axis: int | None = None) -> None:  # noqa: N802
        if event.button() == Qt.MouseButton.RightButton:
            event.ignore()
            return
        event.accept()
        is_left = event.button() == Qt.MouseButton.LeftButton
        if is_left and axis is None and not event.modifiers() & Qt.KeyboardModifier.ShiftModifier:
            self._drag_box(event)
        else:
            self._drag_range(event, (X, Y) if axis is None else (axis,))

    def mouseClickEvent(self, event: Any) -> None:  # noqa: N802
        if event.button() == Qt.MouseButton.RightButton:
            event.accept()
            self.menu_requested.emit(event.screenPos().toPoint())
        elif event.button() == Qt.MouseButton.LeftButton and event.double():
            event.accept()
            self.reset_requested.emit()

    def _drag_range(self, event: Any, axes: tuple[int, ...]) -> None:
        before, now = (self.mapSceneToView(at) for at in (event.lastScenePos(), event.scenePos()))
        shifts = (before.x() - now.x(), before.y() - now.y())
        self.show_ranges({axis: self._moved(axis, shifts[axis]) for axis in axes})

    def _moved(self, axis: int, shift: float) -> Span:
        low, high = self.viewRange()[axis]
        return low + shift, high + shift

    def _drag_box(self, event: Any) -> None:
        box, axes = self._dragged_box(event)
        self._box.setRect(box)
        self._box.setVisible(bool(axes) and not event.isFinish())
        if event.isFinish():
            ends = self.mapToView(box.topLeft()), self.mapToView(box.bottomRight())
            spans = tuple(zip(*((end.x(), end.y()) for end in ends), strict=True))
            self.show_ranges({axis: (min(spans[axis]), max(spans[axis])) for axis in axes})

    def _dragged_box(self, event: Any) -> tuple[QRectF, tuple[int, ...]]:
        """Box in pixels of the view, and the axes that it zooms; it is as long as the others."""
        start, now = (self._inside(at) for at in (event.buttonDownScenePos(), event.scenePos()))
        box, all_of_it = QRectF(start, now).normalized(), self.rect()
        axes = tuple(axis for axis, length in ((X, box.width()), (Y, box.height())) if length >= _SLIGHT_PX)
        if axes == (X,):
            box = QRectF(box.left(), all_of_it.top(), box.width(), all_of_it.height())
        elif axes == (Y,):
            box = QRectF(all_of_it.left(), box.top(), all_of_it.width(), box.height())
        return box, axes

    def _inside(self, scene: QPointF) -> QPointF:
        """A point of the scene in pixels of the view; one outside becomes the nearest inside."""
        point, room = self.mapFromScene(scene), self.rect()
        return QPointF(
            min(max(point.x(), room.left()), room.right()), min(max(point.y(), room.top()), room.bottom())
        )
