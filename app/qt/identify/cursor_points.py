"""The moments of both cursors as points on the phase plane, which has no time axis."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pyqtgraph as pg

from app.presenters.identify.state import Cursor, Cursors
from app.qt.theme import Tokens
from app.qt.widgets.plots import Plot, pen, shade

_ABOVE = 15
_SIZE = 9
_MARKS = {Cursor.A: "o", Cursor.B: "s"}


class CursorPoints:
    """Shows `Cursors` in plots: the first draws value 1 against value 0, the second value 3 against value 2."""

    def __init__(self, plots: Sequence[Plot]) -> None:
        self._points = {cursor: [_Point(plot, cursor) for plot in plots] for cursor in Cursor}

    def show_cursors(self, cursors: Cursors | None) -> None:
        for row, points in enumerate(self._points.values()):
            for number, point in enumerate(points):
                place = (np.nan, np.nan) if cursors is None else cursors.values[row][2 * number :][:2]
                point.put(*place)

    def restyle(self, tokens: Tokens) -> None:
        for point in self._points[Cursor.A]:
            point.restyle(tokens.text, tokens.surface)
        for point in self._points[Cursor.B]:
            point.restyle(tokens.text, tokens.text)


class _Point:
    """A mark with a letter beside it."""

    def __init__(self, plot: Plot, cursor: Cursor) -> None:
        self._mark = plot.add(pg.ScatterPlotItem(size=_SIZE, symbol=_MARKS[cursor]))
        self._letter: Any = plot.add(pg.TextItem(cursor.value, anchor=(-0.3, 1.1)))
        for item in (self._mark, self._letter):
            item.setZValue(_ABOVE)

    def put(self, across: float, up: float) -> None:
        is_somewhere = bool(np.isfinite(across) and np.isfinite(up))
        self._mark.setData([across] if is_somewhere else [], [up] if is_somewhere else [])
        self._letter.setVisible(is_somewhere)
        if is_somewhere:
            self._letter.setPos(across, up)

    def restyle(self, line: str, ground: str) -> None:
        self._mark.setPen(pen(line))
        self._mark.setBrush(shade(ground, 1.0))
        self._letter.setColor(line)
