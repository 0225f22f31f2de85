"""The table of runs: thousands of lines, drawn only as far as they are seen."""

from typing import Any

from PySide6.QtCore import (
    QAbstractTableModel,
    QItemSelection,
    QItemSelectionModel,
    QModelIndex,
    QPersistentModelIndex,
    Qt,
    Signal,
)
from PySide6.QtGui import QColor, QKeyEvent
from PySide6.QtWidgets import QAbstractItemView, QHeaderView, QTableView

from app.presenters.base import Tone
from app.presenters.runs.state import Column, RunRow
from app.qt.theme import Theme
from app.qt.window_geometry import persist_layout
from messages.i18n import gettext

Index = QModelIndex | QPersistentModelIndex
_COLUMNS = tuple(Column)
_RIGHT = {Column.FRICTION, Column.DURATION}
_WIDTHS = (220, 128, 84, 148, 124, 180, 104, 84, 92)
"""Of `Column` in this order."""
_LINE_HEIGHT = 28
_ARROWS = (Qt.Key.Key_Up, Qt.Key.Key_Down)


class RunsTable(QTableView):
    """Shows `RunRow`s; tells which are selected, by which column to sort, and which is to be opened."""

    selected = Signal(tuple)
    sort_requested = Signal(Column)
    open_requested = Signal()

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._model = _Model(theme)
        self._order: tuple[Column, Qt.SortOrder] | None = None
        self.setModel(self._model)
        self.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        self.setSelectionMode(QAbstractItemView.SelectionMode.ExtendedSelection)
        self.setAlternatingRowColors(True)
        self.setShowGrid(False)
        self.setWordWrap(False)
        self.setTextElideMode(Qt.TextElideMode.ElideMiddle)  # runs of a day differ at the end of their names
        self.setTabKeyNavigation(False)
        self.setAccessibleName(gettext("Runs"))
        self.setHorizontalScrollMode(QAbstractItemView.ScrollMode.ScrollPerPixel)
        lines = self.verticalHeader()
        lines.hide()
        lines.setSectionResizeMode(QHeaderView.ResizeMode.Fixed)
        lines.setDefaultSectionSize(_LINE_HEIGHT)
        titles = self.horizontalHeader()
        titles.setHighlightSections(False)
        titles.setStretchLastSection(True)
        titles.setSectionsClickable(True)
        titles.setSortIndicatorShown(True)
        titles.setDefaultAlignment(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter)
        persist_layout(titles, "runs")
        for number, width in enumerate(_WIDTHS):
            self.setColumnWidth(number, width)
        titles.sortIndicatorChanged.connect(self._want_order)
        self.selectionModel().selectionChanged.connect(self._tell_selected)
        self.doubleClicked.connect(lambda _: self.open_requested.emit())
        theme.changed.connect(self.viewport().update)

    def show_rows(self, rows: tuple[RunRow, ...], selected: tuple[str, ...]) -> None:
        model = self.selectionModel()
        model.blockSignals(True)
        if rows is not self._model.rows:
            top = self.verticalScrollBar().value()
            self._model.show_rows(rows)
            self.verticalScrollBar().setValue(top)
        if selected != self._selected_paths():
            self._select(rows, set(selected))
        model.blockSignals(False)
        self.viewport().update()

    def keyPressEvent(self, event: QKeyEvent) -> None:  # noqa: N802
        """Let arrows select the only row too, which they cannot leave."""
        super().keyPressEvent(event)
        if event.key() in _ARROWS and not self._selected_paths():
            self.selectRow(self.currentIndex().row())

    def _select(self, rows: tuple[RunRow, ...], chosen: set[str]) -> None:
        model, last = self.selectionModel(), len(_COLUMNS) - 1
        selection = QItemSelection()
        for number, row in enumerate(rows):
            if row.path in chosen:
                selection.select(self._model.index(number, 0), self._model.index(number, last))
        model.select(selection, QItemSelectionModel.SelectionFlag.ClearAndSelect)
        if selection.indexes():
            model.setCurrentIndex(selection.indexes()[0], QItemSelectionModel.SelectionFlag.NoUpdate)

    def show_order(self, column: Column, *, descending: bool) -> None:
        order = Qt.SortOrder.DescendingOrder if descending else Qt.SortOrder.AscendingOrder
        self._order = column, order
        self.horizontalHeader().setSortIndicator(_COLUMNS.index(column), order)

    def _want_order(self, number: int, order: Qt.SortOrder) -> None:
        """A title was clicked, or an order restored: wanting the same column again turns it round."""
        wanted = _COLUMNS[number], order
        for _ in Qt.SortOrder:
            if self._order != wanted:
                self.sort_requested.emit(_COLUMNS[number])

    def _tell_selected(self, *_: object) -> None:
        self.selected.emit(self._selected_paths())

    def _selected_paths(self) -> tuple[str, ...]:
        numbers = sorted(index.row() for index in self.selectionModel().selectedRows())
        return tuple(self._model.rows[number].path for number in numbers)


class _Model(QAbstractTableModel):
    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self.rows: tuple[RunRow, ...] = ()

    def show_rows(self, rows: tuple[RunRow, ...]) -> None:
        self.beginResetModel()
        self.rows = rows
        self.endResetModel()

    def rowCount(self, parent: Index = QModelIndex()) -> int:  # noqa: N802, B008
        return 0 if parent.isValid() else len(self.rows)

    def columnCount(self, parent: Index = QModelIndex()) -> int:  # noqa: N802, B008
        return 0 if parent.isValid() else len(_COLUMNS)

    def data(self, index: Index, role: int = Qt.ItemDataRole.DisplayRole) -> Any:
        row, column = self.rows[index.row()], _COLUMNS[index.column()]
        text = row.cells[index.column()]
        match role:
            case Qt.ItemDataRole.DisplayRole:
                return text
            case Qt.ItemDataRole.ToolTipRole:
                return row.hint if column is Column.VERDICT and row.hint else text
            case Qt.ItemDataRole.TextAlignmentRole if column in _RIGHT:
                return Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
            case Qt.ItemDataRole.ForegroundRole if column is Column.VERDICT and row.tone is not Tone.PLAIN:
                return QColor(getattr(self._theme.tokens, row.tone.value))
        return None

    def headerData(  # noqa: N802
        self, section: int, orientation: Qt.Orientation, role: int = Qt.ItemDataRole.DisplayRole
    ) -> Any:
        if orientation is not Qt.Orientation.Horizontal:
            return None
        if role == Qt.ItemDataRole.DisplayRole:
            return gettext(_COLUMNS[section].value)
        if role == Qt.ItemDataRole.TextAlignmentRole and _COLUMNS[section] in _RIGHT:
            return Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
        return None
