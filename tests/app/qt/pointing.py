"""What a hand does in a plot: wheel, drags, clicks and keys, as events of the window system."""

import time

import pyqtgraph as pg
from PySide6.QtCore import QEvent, QPoint, QPointF, Qt
from PySide6.QtGui import QMouseEvent, QWheelEvent
from PySide6.QtWidgets import QApplication, QWidget

from app.qt.widgets.plots import PlotStack

NO_KEYS = Qt.KeyboardModifier.NoModifier
_BETWEEN_MOVES_S = 0.012
"""pyqtgraph takes 100 moves of the mouse a second."""


class Hand:
    """Acts in the plots of a stack, at places in parts of a plot: from its left, from its top."""

    def __init__(self, stack: PlotStack) -> None:
        self.stack = stack
        (view,) = stack.findChildren(pg.GraphicsView)
        self._view = view
        self._viewport: QWidget = view.viewport()

    def place(self, x: float, y: float, row: int = 0) -> QPointF:
        """Where in the widget a part of a plot is."""
        rect = self.stack.plots[row].view.sceneBoundingRect()
        scene = QPointF(rect.left() + x * rect.width(), rect.top() + y * rect.height())
        return QPointF(self._view.mapFromScene(scene))

    def value(self, at: QPointF, row: int = 0) -> QPointF:
        """What a place means in the units of a plot."""
        return self.stack.plots[row].view.mapSceneToView(self._view.mapToScene(at.toPoint()))

    def wheel(
        self, steps: int, at: QPointF, keys: Qt.KeyboardModifier = NO_KEYS, *, sideways: int = 0
    ) -> None:
        event = QWheelEvent(
            at,
            self._viewport.mapToGlobal(at),
            QPoint(),
            QPoint(120 * sideways, 120 * steps),
            Qt.MouseButton.NoButton,
            keys,
            Qt.ScrollPhase.NoScrollPhase,
            False,
        )
        QApplication.sendEvent(self._viewport, event)

    def move(self, at: QPointF, buttons: Qt.MouseButton = Qt.MouseButton.NoButton, keys=NO_KEYS) -> None:
        time.sleep(_BETWEEN_MOVES_S)
        self._send(QEvent.Type.MouseMove, at, Qt.MouseButton.NoButton, buttons, keys)

    def drag(
        self,
        start: QPointF,
        end: QPointF,
        button: Qt.MouseButton = Qt.MouseButton.LeftButton,
        keys: Qt.KeyboardModifier = NO_KEYS,
    ) -> None:
        self.move(start)
        self._send(QEvent.Type.MouseButtonPress, start, button, button, keys)
        for part in (0.3, 0.6, 1.0):
            self.move(start + part * (end - start), button, keys)
        self._send(QEvent.Type.MouseButtonRelease, end, button, Qt.MouseButton.NoButton, keys)

    def click(self, at: QPointF, button: Qt.MouseButton = Qt.MouseButton.LeftButton) -> None:
        self.move(at)
        self._send(QEvent.Type.MouseButtonPress, at, button, button)
        self._send(QEvent.Type.MouseButtonRelease, at, button, Qt.MouseButton.NoButton)

    def double_click(self, at: QPointF) -> None:
        button = Qt.MouseButton.LeftButton
        self.click(at)
        self._send(QEvent.Type.MouseButtonDblClick, at, button, button)
        self._send(QEvent.Type.MouseButtonRelease, at, button, Qt.MouseButton.NoButton)

    def _send(
        self,
        kind: QEvent.Type,
        at: QPointF,
        button: Qt.MouseButton,
        buttons: Qt.MouseButton,
        keys: Qt.KeyboardModifier = NO_KEYS,
    ) -> None:
        event = QMouseEvent(kind, at, self._viewport.mapToGlobal(at), button, buttons, keys)
        QApplication.sendEvent(self._viewport, event)
