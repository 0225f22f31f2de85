"""Cursors of Identify: lines in plots over time, points on the phase plane, and a table of values."""

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QObject, Qt, Signal
from PySide6.QtWidgets import QGridLayout, QLabel, QWidget

from app.presenters.identify.state import Cursor, Cursors
from app.qt.theme import TextRole, Tokens
from app.qt.widgets.layouts import make_column, make_row
from app.qt.widgets.plot_marks import pen, shade
from app.qt.widgets.plots import Plot
from app.qt.widgets.text import label, padded, set_text_or_hide
from messages.i18n import gettext

_ABOVE = 15


class CursorLines(QObject):
    """Shows `Cursors`; `moved` has the line that the mouse has moved, and its time."""

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
        line.sigDragged.connect(partial(self._report, cursor))
        return plot.add(line)

    def _report(self, cursor: Cursor, line: Any) -> None:
        at_s = float(line.value())
        for other in self._lines[cursor]:
            if other is not line:
                other.setValue(at_s)
        self.moved.emit(cursor, at_s)


_MOST_CELLS = 6  # columns of `Cursors.cells`: name, time, and four values on the phase plane


class CursorBar(QWidget):
    """Shows `Cursors`; hidden without."""

    def __init__(self) -> None:
        super().__init__()
        self._grid = QGridLayout()
        self._grid.setHorizontalSpacing(12)
        self._grid.setVerticalSpacing(0)
        self._grid.setColumnStretch(0, 1)
        self._period = label(role=TextRole.STRONG)
        hint = label(gettext("← → move, with Shift by ten; A and B choose"), TextRole.LABEL, muted=True)
        make_column(self._grid, make_row((hint, 1), self._period), margins=(16, 4), of=self)
        self._cells = [[self._cell(row, column) for column in range(_MOST_CELLS)] for row in range(4)]
        self.hide()

    def show_cursors(self, cursors: Cursors | None) -> None:
        self.setVisible(cursors is not None)
        if cursors is None:
            return
        rows = (("", "t", *cursors.symbols), *cursors.cells)
        for cells, texts in zip(self._cells, rows, strict=True):
            for cell, text in zip(cells, padded(texts, _MOST_CELLS, ""), strict=True):
                set_text_or_hide(cell, text)
        self._period.setText(cursors.period)

    def _cell(self, row: int, column: int) -> QLabel:
        role = TextRole.LABEL if row == 0 else TextRole.TEXT if column else TextRole.STRONG
        cell = label(role=role, muted=row == 0)
        self._grid.addWidget(cell, row, column + 1, Qt.AlignmentFlag.AlignRight)
        return cell


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
                point.show_at(*place)

    def restyle(self, tokens: Tokens) -> None:
        for cursor, fill in ((Cursor.A, tokens.surface), (Cursor.B, tokens.text)):
            for point in self._points[cursor]:
                point.restyle(tokens.text, fill)


class _Point:
    """A mark with a letter beside it."""

    def __init__(self, plot: Plot, cursor: Cursor) -> None:
        self._mark = plot.add(pg.ScatterPlotItem(size=_SIZE, symbol=_MARKS[cursor]))
        self._letter: Any = plot.add(pg.TextItem(cursor.value, anchor=(-0.3, 1.1)))
        self._mark.setZValue(_ABOVE)
        self._letter.setZValue(_ABOVE)

    def show_at(self, x: float, y: float) -> None:
        is_visible = bool(np.isfinite(x) and np.isfinite(y))
        self._mark.setData([x] if is_visible else [], [y] if is_visible else [])
        self._letter.setVisible(is_visible)
        if is_visible:
            self._letter.setPos(x, y)

    def restyle(self, line: str, ground: str) -> None:
        self._mark.setPen(pen(line))
        self._mark.setBrush(shade(ground, 1.0))
        self._letter.setColor(line)
