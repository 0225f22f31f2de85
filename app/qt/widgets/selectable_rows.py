"""Rows of labels that are selected by mouse and keys, and copied as text for a spreadsheet."""

from collections.abc import Sequence
from dataclasses import dataclass

from PySide6.QtCore import QPoint, QRect, Qt
from PySide6.QtGui import (
    QContextMenuEvent,
    QGuiApplication,
    QKeyEvent,
    QKeySequence,
    QMouseEvent,
    QPainter,
    QPaintEvent,
    QPalette,
)
from PySide6.QtWidgets import QFrame, QGridLayout, QLabel, QMenu, QScrollArea

from app.qt.theme import colour
from app.qt.widgets.shortcuts import describe_shortcut
from app.qt.widgets.tables import tabbed_text
from messages.i18n import gettext

_SHIFT, _CONTROL = Qt.KeyboardModifier.ShiftModifier, Qt.KeyboardModifier.ControlModifier
_STEPS = {Qt.Key.Key_Up: -1, Qt.Key.Key_Down: 1}
_SELECTED = 0.16  # opacity of the ground of a selected row
_MARGIN = 2  # pixels around a row on its ground


@dataclass(frozen=True, slots=True)
class GridRow:
    """Lines of a grid that make one row, and the cells of which it is copied."""

    first_line: int
    last_line: int
    copied: tuple[str, ...]


class SelectableRows(QFrame):
    """A grid of labels; a click selects a row, Ctrl and Shift more, Ctrl+C copies them below `titles`.

    Without a selection all rows are copied.
    """

    def __init__(self, name: str, grid: QGridLayout, titles: Sequence[str], rows: Sequence[GridRow]) -> None:
        super().__init__()
        self._grid = grid
        self._titles = titles
        self._rows = rows
        self._selected: frozenset[int] = frozenset()
        self._anchor = self._current = 0
        grid.setContentsMargins(0, 0, 0, 0)
        self.setLayout(grid)
        self.setProperty("role", "rows")
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setAccessibleName(name)
        for cell in self.findChildren(QLabel):  # they would select their own text
            cell.setTextInteractionFlags(Qt.TextInteractionFlag.NoTextInteraction)
        describe_shortcut(
            self, "Ctrl+C", gettext("Copy the selected results, or all; arrows and clicks select")
        )

    @property
    def selected(self) -> tuple[int, ...]:
        return tuple(sorted(self._selected))

    def copy(self) -> None:
        chosen = self.selected or range(len(self._rows))
        lines = [self._titles, *(self._rows[row].copied for row in chosen)]
        QGuiApplication.clipboard().setText(tabbed_text(lines))

    def select_all(self) -> None:
        self._select(range(len(self._rows)))

    def mousePressEvent(self, event: QMouseEvent) -> None:  # noqa: N802
        row = self._row_at(event.position().toPoint())
        if row is None:
            self._select(())
        elif event.button() == Qt.MouseButton.LeftButton or row not in self._selected:
            self._click(row, event.modifiers())

    def mouseMoveEvent(self, event: QMouseEvent) -> None:  # noqa: N802
        row = self._row_at(event.position().toPoint())
        if row is not None and event.buttons() & Qt.MouseButton.LeftButton:
            self._extend_to(row)

    def keyPressEvent(self, event: QKeyEvent) -> None:  # noqa: N802
        step = _STEPS.get(Qt.Key(event.key()))
        if event.matches(QKeySequence.StandardKey.Copy):
            self.copy()
        elif event.matches(QKeySequence.StandardKey.SelectAll):
            self.select_all()
        elif step is not None and self._rows:
            row = min(max(self._current + step, 0), len(self._rows) - 1) if self._selected else self._current
            self._click(row, event.modifiers() & _SHIFT)
        else:
            super().keyPressEvent(event)

    def contextMenuEvent(self, event: QContextMenuEvent) -> None:  # noqa: N802
        menu = QMenu(self)
        for text, keys, act in (
            (gettext("Copy rows"), QKeySequence.StandardKey.Copy, self.copy),
            (gettext("Select all"), QKeySequence.StandardKey.SelectAll, self.select_all),
        ):
            action = menu.addAction(text, act)
            action.setShortcut(keys)
            action.setShortcutVisibleInContextMenu(True)
        menu.aboutToHide.connect(menu.deleteLater)
        menu.popup(event.globalPos())

    def paintEvent(self, event: QPaintEvent) -> None:  # noqa: N802
        super().paintEvent(event)
        painter = QPainter(self)
        ground = colour(self.palette().color(QPalette.ColorRole.Highlight), _SELECTED)
        for row in self._selected:
            painter.fillRect(self._place(row), ground)
        painter.end()

    def _click(self, row: int, keys: Qt.KeyboardModifier) -> None:
        if keys & _SHIFT:
            self._extend_to(row)
            return
        self._anchor = self._current = row
        self._select(self._selected ^ {row} if keys & _CONTROL else {row})

    def _extend_to(self, row: int) -> None:
        self._current = row
        self._select(range(min(self._anchor, row), max(self._anchor, row) + 1))

    def _select(self, rows: "range | frozenset[int] | set[int] | tuple[int, ...]") -> None:
        self._selected = frozenset(rows)
        texts = ["; ".join(filter(None, self._rows[row].copied)) for row in self.selected]
        self.setAccessibleDescription(". ".join(texts))
        self.update()
        if self._selected:
            self._scroll_to(self._place(self._current))

    def _scroll_to(self, place: QRect) -> None:
        parent = self.parentWidget()
        while parent is not None and not isinstance(parent, QScrollArea):
            parent = parent.parentWidget()
        if parent is not None and (content := parent.widget()) is not None:
            middle = self.mapTo(content, place.center())
            parent.ensureVisible(middle.x(), middle.y(), 0, place.height())

    def _place(self, row: int) -> QRect:
        """Where a row is, over the whole width; the grid itself does not tell where its lines are wrapped."""
        lines = range(self._rows[row].first_line, self._rows[row].last_line + 1)
        cells = (
            self._grid.itemAtPosition(line, at) for line in lines for at in range(self._grid.columnCount())
        )
        places = [cell.geometry() for cell in cells if cell is not None]
        top, bottom = min(place.top() for place in places), max(place.bottom() for place in places)
        return QRect(0, top - _MARGIN, self.width(), bottom - top + 1 + 2 * _MARGIN)

    def _row_at(self, at: QPoint) -> int | None:
        return next((row for row in range(len(self._rows)) if self._place(row).contains(at)), None)
