"""Table 1 as it fills: a row a series, each cell a value above its uncertainty."""

from PySide6.QtCore import QModelIndex, QPersistentModelIndex, QRectF, QSize, Qt, Signal
from PySide6.QtGui import QColor, QFontMetrics, QKeyEvent, QPainter, QPalette, QResizeEvent
from PySide6.QtWidgets import (
    QAbstractItemView,
    QHeaderView,
    QStyle,
    QStyledItemDelegate,
    QStyleOptionViewItem,
    QTableWidget,
    QTableWidgetItem,
)

from app.presenters.campaign.state import Cell, TableRow, all_columns
from app.qt.theme import TextRole, Theme, font
from app.qt.widgets.tables import COPIED_ROLE, NAME_ROLE, TitleHeader, serve_table
from app.qt.widgets.text import set_tool_tip
from app.qt.window_geometry import persist_layout
from messages.i18n import gettext, ngettext

_LINES = Qt.ItemDataRole.UserRole + 1
_PADDING, _ROW_HEIGHT = 6, 38
_SERIES = "series"  # name of the first column
_MARKS = {"bad": "■ ", "warn": "▲ ", "ok": "✓ "}
_Index = QModelIndex | QPersistentModelIndex
_Line = tuple[str, TextRole, str]
"""Text, font, and name of the theme's colour."""


class SeriesTable(QTableWidget):
    """Shows `TableRow`s; Enter and double click open the runs of a row."""

    row_selected = Signal(str)
    row_opened = Signal(str)

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._rows: tuple[TableRow, ...] = ()
        self.setItemDelegate(_LinesDelegate(theme, self))
        self.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        self.setSelectionMode(QAbstractItemView.SelectionMode.ExtendedSelection)
        self.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        self.setAlternatingRowColors(True)
        self.setShowGrid(False)
        self.setTabKeyNavigation(False)
        self.verticalHeader().hide()
        self.verticalHeader().setDefaultSectionSize(_ROW_HEIGHT)
        header = TitleHeader(self)
        self.setHorizontalHeader(header)
        header.setSectionResizeMode(QHeaderView.ResizeMode.Fixed)
        header.setHighlightSections(False)
        header.setProperty("role", "tight")  # in line with the cells
        header.setFont(font(TextRole.LABEL))
        self.setAccessibleName(gettext("Table 1: quantities of each series"))
        self.itemSelectionChanged.connect(lambda: self.row_selected.emit(self._chosen()))
        self.itemDoubleClicked.connect(lambda _: self._open())

    def show_columns(self, columns: tuple[tuple[str, str], ...]) -> None:
        self.setColumnCount(1 + len(columns))
        self.setHorizontalHeaderItem(0, _title_item(gettext("series"), _SERIES))
        for column, ((symbol, unit), (quantity, _)) in enumerate(
            zip(columns, all_columns(), strict=True), start=1
        ):
            title = _title_item(f"{symbol}\n{unit}", quantity.name, gettext(quantity.description))
            copied = [", ".join(filter(None, (name, unit))) for name in (symbol, f"u({symbol})")]
            title.setData(COPIED_ROLE, copied)
            self.setHorizontalHeaderItem(column, title)
        usual = [quantity.name for quantity, column in all_columns() if not column.is_optional]
        serve_table(self, (_SERIES, *usual), self._fit)
        persist_layout(self.horizontalHeader(), "campaign")

    def show_rows(self, rows: tuple[TableRow, ...]) -> None:
        chosen = self._chosen()
        self._rows = rows
        self.blockSignals(True)
        self.setRowCount(len(rows))
        for line, row in enumerate(rows):
            self.setItem(line, 0, _series_item(row))
            for column, cell in enumerate(row.cells, start=1):
                self.setItem(line, column, _cell_item(cell))
        labels = [row.label for row in rows]
        self.clearSelection()
        if chosen in labels:
            self.selectRow(labels.index(chosen))
        self.blockSignals(False)
        self._fit()

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: N802
        super().resizeEvent(event)
        self._fit()

    def keyPressEvent(self, event: QKeyEvent) -> None:  # noqa: N802
        if event.key() in (Qt.Key.Key_Return, Qt.Key.Key_Enter):
            self._open()
        else:
            super().keyPressEvent(event)

    def _fit(self) -> None:
        header, count = self.horizontalHeader(), self.columnCount()
        shown = [c for c in range(count) if not self.isColumnHidden(c)]
        hints = {c: max(self.sizeHintForColumn(c), header.sectionSizeHint(c)) for c in shown}
        spare = max(0, self.viewport().width() - sum(hints.values())) // max(1, len(hints))
        for column, hint in hints.items():
            header.resizeSection(column, hint + spare)

    def _chosen(self) -> str:
        lines = self.selectionModel().selectedRows() if self._rows else []
        return self._rows[lines[0].row()].label if lines else ""

    def _open(self) -> None:
        if chosen := self._chosen():
            self.row_opened.emit(chosen)


class _LinesDelegate(QStyledItemDelegate):
    """Draws the lines of a cell (`_LINES`) below one another."""

    def __init__(self, theme: Theme, table: SeriesTable) -> None:
        super().__init__(table)
        self._theme = theme

    def sizeHint(self, _option: QStyleOptionViewItem, index: _Index) -> QSize:  # noqa: N802
        widths = [QFontMetrics(font(role)).horizontalAdvance(text) for text, role, _ in _lines(index)]
        return QSize(max(widths, default=0) + 2 * _PADDING, _ROW_HEIGHT)

    def paint(self, painter: QPainter, option: QStyleOptionViewItem, index: _Index) -> None:
        style = option.widget.style()
        style.drawPrimitive(QStyle.PrimitiveElement.PE_PanelItemViewItem, option, painter, option.widget)
        selected = bool(option.state & QStyle.StateFlag.State_Selected)
        side = Qt.AlignmentFlag(index.data(Qt.ItemDataRole.TextAlignmentRole)) | Qt.AlignmentFlag.AlignVCenter
        place = QRectF(option.rect).adjusted(_PADDING, 3, -_PADDING, -3)
        lines = _lines(index)
        height = place.height() / max(1, len(lines))
        painter.save()
        for number, (text, role, token) in enumerate(lines):
            painter.setFont(font(role))
            ink = QColor(getattr(self._theme.tokens, token))
            painter.setPen(option.palette.color(QPalette.ColorRole.HighlightedText) if selected else ink)
            line = QRectF(place.left(), place.top() + number * height, place.width(), height)
            painter.drawText(line, side, text)
        painter.restore()


def _lines(index: _Index) -> list[_Line]:
    return index.data(_LINES) or []


def _series_item(row: TableRow) -> QTableWidgetItem:
    runs = ngettext("{count} run", "{count} runs", len(row.runs)) if row.runs else gettext("no run yet")
    tone = row.status.tone.value
    status = f"{_MARKS.get(tone, '')}{row.status.text}" if row.status.text else runs
    item = _item(
        (row.label, TextRole.STRONG if row.runs else TextRole.TEXT, "text"),
        (status, TextRole.LABEL, tone if tone in _MARKS else "muted"),
        Qt.AlignmentFlag.AlignLeft,
        f"{runs}\n{row.status.hint}".strip(),
    )
    item.setData(Qt.ItemDataRole.AccessibleTextRole, f"{row.label}, {runs}, {row.status.text}")
    return item


def _title_item(title: str, name: str, hint: str = "") -> QTableWidgetItem:
    item = QTableWidgetItem(title)
    side = Qt.AlignmentFlag.AlignLeft if name == _SERIES else Qt.AlignmentFlag.AlignRight
    item.setTextAlignment(side | Qt.AlignmentFlag.AlignVCenter)
    set_tool_tip(item, hint)
    item.setData(NAME_ROLE, name)
    return item


def _cell_item(cell: Cell) -> QTableWidgetItem:
    value = (cell.value, TextRole.TEXT, "text")
    item = _item(value, (cell.uncertainty, TextRole.LABEL, "muted"), Qt.AlignmentFlag.AlignRight, cell.hint)
    item.setData(Qt.ItemDataRole.AccessibleTextRole, f"{cell.value} {cell.uncertainty}".strip() or cell.hint)
    item.setData(COPIED_ROLE, [cell.value, cell.uncertainty.removeprefix("± ")])
    return item


def _item(first: _Line, second: _Line, side: Qt.AlignmentFlag, hint: str) -> QTableWidgetItem:
    item = QTableWidgetItem(first[0])
    item.setTextAlignment(side)
    item.setData(_LINES, [line for line in (first, second) if line[0]])
    set_tool_tip(item, hint)
    return item
