"""Two upright lines through all plots of a stack, drawn along together."""

from functools import partial
from typing import Any

import pyqtgraph as pg
from PySide6.QtCore import QObject, Signal

from app.presenters.identify.state import Cursor, Cursors
from app.qt.theme import Tokens
from app.qt.widgets.plots import Plot, pen

_ABOVE = 15


class CursorLines(QObject):
    """Shows `Cursors`; `drawn` tells which line the mouse has moved, and to where."""

    moved = Signal(Cursor, float)

    def __init__(self, plots: list[Plot]) -> None:
        super().__init__()
        self._lines = {
            cursor: [self._line(plot, cursor, i) for i, plot in enumerate(plots)] for cursor in Cursor
        }

    def show_cursors(self, cursors: Cursors | None) -> None:
        for cursor, lines in self._lines.items():
            for line in lines:
                line.setVisible(cursors is not None)
                if cursors is not None and not line.moving:
                    line.setValue(cursors.at(cursor))

    def restyle(self, tokens: Tokens) -> None:
        for cursor, dashes in ((Cursor.A, (6.0, 3.0)), (Cursor.B, ())):
            for line in self._lines[cursor]:
                line.setPen(pen(tokens.accent, dashes=dashes))
                line.setHoverPen(pen(tokens.text))
                if hasattr(line, "label"):
                    line.label.setColor(tokens.accent)

    def _line(self, plot: Plot, cursor: Cursor, row: int) -> Any:
        named = {"label": cursor.value, "labelOpts": {"position": 0.93}} if row == 0 else {}
        line = pg.InfiniteLine(angle=90, movable=True, **named)
        line.setZValue(_ABOVE)
        line.hide()
        line.sigDragged.connect(partial(self._tell, cursor))
        return plot.add(line)

    def _tell(self, cursor: Cursor, line: Any) -> None:
        at_s = float(line.value())
        for other in self._lines[cursor]:
            if other is not line:
                other.setValue(at_s)
        self.moved.emit(cursor, at_s)
