"""The table of runs: thousands of lines, drawn only as far as they are seen."""

from pathlib import Path
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
from PySide6.QtWidgets import (
    QAbstractItemView,
    QHeaderView,
    QStyledItemDelegate,
    QStyleOptionViewItem,
    QTableView,
)

from app.presenters.base import Tone
from app.presenters.runs.state import COLUMN_HINTS, USUAL_COLUMNS, Column, RunRow
from app.qt.theme import Theme
from app.qt.widgets.tables import COPIED_ROLE, NAME_ROLE, TitleHeader, serve_table
from app.qt.widgets.text import tool_tip
from app.qt.window_geometry import persist_layout
from messages.i18n import gettext

Index = QModelIndex | QPersistentModelIndex
_COLUMNS = tuple(Column)
_MEASURED = {Column.FRICTION: "f_d", Column.PERIOD: "T", Column.DAMPING: "n1"}
"""Symbols in the titles of copied columns, where the uncertainty has a column of its own."""
_RIGHT = {*_MEASURED, Column.DURATION, Column.TEMPERATURE}
_WIDTHS = {
    Column.NAME: 60,
    Column.DATE: 128,
    Column.SERIES: 66,
    Column.FRICTION: 140,
    Column.PERIOD: 78,
    Column.DAMPING: 76,
    Column.VERDICT: 94,
    Column.SOURCE: 76,
    Column.TEMPERATURE: 44,
    Column.NOTE: 44,
    Column.OPERATOR: 104,
    Column.DURATION: 84,
    Column.ENDED: 92,
    Column.FILE: 220,
}
"""At 96 dpi; those that are shown at first fit beside the preview in a window of 1280."""
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
        titles = TitleHeader(self)
        self.setHorizontalHeader(titles)
        titles.setHighlightSections(False)
        titles.setStretchLastSection(True)
        titles.setSortIndicatorShown(True)
        titles.setDefaultAlignment(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter)
        persist_layout(titles, "runs")
        titles.setMinimumSectionSize(min(_WIDTHS.values()))
        for number, column in enumerate(_COLUMNS):
            self.setColumnWidth(number, _WIDTHS[column])
        serve_table(self, [column.name for column in USUAL_COLUMNS])
        titles.sortIndicatorChanged.connect(self._want_order)
        self.selectionModel().selectionChanged.connect(self._tell_selected)
        self.doubleClicked.connect(lambda _: self.open_requested.emit())
        self.setItemDelegateForColumn(_COLUMNS.index(Column.NOTE), _NoteDelegate(self))
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


class _NoteDelegate(QStyledItemDelegate):
    """Elides a note at its end: it is read from its beginning."""

    def initStyleOption(self, option: QStyleOptionViewItem, index: Index) -> None:  # noqa: N802
        super().initStyleOption(option, index)
        option.textElideMode = Qt.TextElideMode.ElideRight


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
                return tool_tip(_hint(row, column) or text)
            case _ if role == COPIED_ROLE and column in _MEASURED:
                result = row.results.get(column)
                return ("", "") if result is None else (result.value, result.uncertainty)
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
        column = _COLUMNS[section]
        match role:
            case Qt.ItemDataRole.DisplayRole:
                return gettext(column.value)
            case Qt.ItemDataRole.ToolTipRole:
                return gettext(COLUMN_HINTS[column]) if column in COLUMN_HINTS else None
            case Qt.ItemDataRole.TextAlignmentRole if column in _RIGHT:
                return Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
            case _ if role == NAME_ROLE:
                return column.name
            case _ if role == COPIED_ROLE and column in _MEASURED:
                unit = column.value.partition(", ")[2]
                symbol = _MEASURED[column]
                return tuple(", ".join(filter(None, (name, unit))) for name in (symbol, f"u({symbol})"))
        return None


def _hint(row: RunRow, column: Column) -> str:
    if column is Column.VERDICT:
        return row.hint
    if column is Column.NAME:
        return Path(row.path).stem
    result = row.results.get(column)
    return "" if result is None else f"{result.value} {result.uncertainty_text}".strip()
