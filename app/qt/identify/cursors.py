"""Cursors of Identify: lines in plots over time, points on the phase plane, and a table of values."""

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QObject, Qt, Signal
from PySide6.QtWidgets import QGridLayout, QHBoxLayout, QLabel, QWidget

from app.presenters.identify.state import Cursor, Cursors
from app.qt.theme import TextRole, Tokens
from app.qt.widgets.layouts import make_column
from app.qt.widgets.plots import Plot, pen, shade
from app.qt.widgets.text import label
from messages.i18n import gettext

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


_RIGHT = Qt.AlignmentFlag.AlignRight


class CursorBar(QWidget):
    """Shows `Cursors`; hidden without."""

    def __init__(self) -> None:
        super().__init__()
        self._grid = QGridLayout()
        self._grid.setHorizontalSpacing(12)
        self._grid.setVerticalSpacing(0)
        self._grid.setColumnStretch(0, 1)
        self._period = label(role=TextRole.STRONG)
        self._hint = label(gettext("← → move, with Shift by ten; A and B choose"), TextRole.LABEL, muted=True)
        below = QHBoxLayout()
        below.addWidget(self._hint, 1)
        below.addWidget(self._period)
        make_column(self._grid, below, margins=(16, 4), of=self)
        self._labels: dict[tuple[int, int], QLabel] = {}
        self.hide()

    def show_cursors(self, cursors: Cursors | None) -> None:
        self.setVisible(cursors is not None)
        if cursors is None:
            return
        rows = (("", "t", *cursors.symbols), *cursors.cells)
        for place in self._labels.keys() - {(r, c) for r, row in enumerate(rows) for c in range(len(row))}:
            self._labels[place].hide()
        for number, texts in enumerate(rows):
            for column, text in enumerate(texts):
                cell = self._cell(number, column)
                cell.setText(text)
                cell.show()
        self._period.setText(cursors.period)

    def _cell(self, row: int, column: int) -> QLabel:
        if (row, column) not in self._labels:
            made = label(role=TextRole.STRONG if column == 0 else TextRole.TEXT)
            if row == 0:
                made = label(role=TextRole.LABEL, muted=True)
            self._labels[row, column] = made
            self._grid.addWidget(made, row, column + 1, _RIGHT)
        return self._labels[row, column]


_SIZE = 9
_MARKS = {Cursor.A: "o", Cursor.B: "s"}


class CursorPoints:
    """Shows `Cursors` in two plots: value 1 against value 0, and value 3 against value 2."""

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
