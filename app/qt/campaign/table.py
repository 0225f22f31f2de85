"""Table 1 as it fills: a row a series, each cell a value above its uncertainty."""

from PySide6.QtCore import QModelIndex, QPersistentModelIndex, QRectF, QSize, Qt, Signal
from PySide6.QtGui import QColor, QFont, QFontMetrics, QKeyEvent, QPainter, QPalette, QResizeEvent
from PySide6.QtWidgets import (
    QAbstractItemView,
    QHeaderView,
    QStyle,
    QStyledItemDelegate,
    QStyleOptionViewItem,
    QTableWidget,
    QTableWidgetItem,
)

from app.presenters.campaign.state import Cell, TableRow
from app.qt.theme import TextRole, Theme, font
from messages.i18n import gettext, ngettext

_SPREAD, _BOLD, _TONE = (Qt.ItemDataRole.UserRole + number for number in (1, 2, 3))
_PADDING, _ROW_HEIGHT = 6, 38
_MARKS = {"bad": "■ ", "warn": "▲ ", "ok": "✓ "}
_Index = QModelIndex | QPersistentModelIndex


class SeriesTable(QTableWidget):
    """Shows `TableRow`s; Enter and double click open the runs of a row."""

    row_selected = Signal(str)
    row_opened = Signal(str)

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._rows: tuple[TableRow, ...] = ()
        self.setItemDelegate(_TwoLines(theme, self))
        self.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        self.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
        self.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        self.setAlternatingRowColors(True)
        self.setShowGrid(False)
        self.setTabKeyNavigation(False)
        self.verticalHeader().hide()
        self.verticalHeader().setDefaultSectionSize(_ROW_HEIGHT)
        header = self.horizontalHeader()
        header.setSectionResizeMode(QHeaderView.ResizeMode.Fixed)
        header.setHighlightSections(False)
        header.setProperty("role", "tight")  # in line with the cells
        header.setFont(font(TextRole.LABEL))
        self.setAccessibleName(gettext("Table 1: quantities of each series"))
        self.itemSelectionChanged.connect(self._choose)
        self.itemDoubleClicked.connect(lambda _: self._open())

    def show_columns(self, columns: tuple[tuple[str, str], ...]) -> None:
        self.setColumnCount(1 + len(columns))
        titles = [f"{symbol}\n{unit}" for symbol, unit in columns]
        for column, title in enumerate([gettext("series"), *titles]):
            head = QTableWidgetItem(title)
            side = Qt.AlignmentFlag.AlignRight if column else Qt.AlignmentFlag.AlignLeft
            head.setTextAlignment(side | Qt.AlignmentFlag.AlignVCenter)
            self.setHorizontalHeaderItem(column, head)

    def show_rows(self, rows: tuple[TableRow, ...]) -> None:
        chosen = self._chosen()
        self._rows = rows
        self.blockSignals(True)
        self.setRowCount(len(rows))
        for line, row in enumerate(rows):
            self.setItem(line, 0, _head(row))
            for column, cell in enumerate(row.cells, start=1):
                self.setItem(line, column, _item(cell))
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
        hints = [max(self.sizeHintForColumn(c), header.sectionSizeHint(c)) for c in range(count)]
        spare = max(0, self.viewport().width() - sum(hints)) // max(1, count)
        for column, hint in enumerate(hints):
            header.resizeSection(column, hint + spare)

    def _chosen(self) -> str:
        lines = self.selectionModel().selectedRows() if self._rows else []
        return self._rows[lines[0].row()].label if lines else ""

    def _choose(self) -> None:
        self.row_selected.emit(self._chosen())

    def _open(self) -> None:
        if chosen := self._chosen():
            self.row_opened.emit(chosen)


class _TwoLines(QStyledItemDelegate):
    """Draws a cell's text, and below it smaller and muted what stands behind it."""

    def __init__(self, theme: Theme, table: SeriesTable) -> None:
        super().__init__(table)
        self._theme = theme

    def sizeHint(self, _option: QStyleOptionViewItem, index: _Index) -> QSize:  # noqa: N802
        lines = zip(_lines(index), _fonts(index), strict=True)
        widths = (_width(text, used) for text, used in lines)
        return QSize(max(widths) + 2 * _PADDING, _ROW_HEIGHT)

    def paint(self, painter: QPainter, option: QStyleOptionViewItem, index: _Index) -> None:
        widget = option.widget
        style = widget.style()
        style.drawPrimitive(QStyle.PrimitiveElement.PE_PanelItemViewItem, option, painter, widget)
        selected = bool(option.state & QStyle.StateFlag.State_Selected)
        colours = self._colours(index, option.palette, selected=selected)
        lines, side = _lines(index), Qt.AlignmentFlag(index.data(Qt.ItemDataRole.TextAlignmentRole))
        place = QRectF(option.rect).adjusted(_PADDING, 3, -_PADDING, -3)
        shown = [line for line in zip(lines, _fonts(index), colours, strict=True) if line[0]]
        height = place.height() / max(1, len(shown))
        painter.save()
        for number, (text, used, ink) in enumerate(shown):
            painter.setFont(used)
            painter.setPen(ink)
            at = QRectF(place.left(), place.top() + number * height, place.width(), height)
            painter.drawText(at, side | Qt.AlignmentFlag.AlignVCenter, text)
        painter.restore()

    def _colours(self, index: _Index, palette: QPalette, *, selected: bool) -> tuple[QColor, QColor]:
        if selected:
            both = palette.color(QPalette.ColorRole.HighlightedText)
            return both, both
        tokens = self._theme.tokens
        tone = index.data(_TONE)
        second = getattr(tokens, tone) if tone in _MARKS else tokens.muted
        return QColor(tokens.text), QColor(second)


def _head(row: TableRow) -> QTableWidgetItem:
    said = ngettext("{count} run", "{count} runs", len(row.runs)) if row.runs else gettext("no run yet")
    tone = row.status.tone.value
    below = f"{_MARKS.get(tone, '')}{row.status.text}" if row.status.text else said
    item = _filled(row.label, below, Qt.AlignmentFlag.AlignLeft, f"{said}\n{row.status.hint}".strip())
    item.setData(_BOLD, bool(row.runs))
    item.setData(_TONE, tone)
    item.setData(Qt.ItemDataRole.AccessibleTextRole, f"{row.label}, {said}, {row.status.text}")
    return item


def _item(cell: Cell) -> QTableWidgetItem:
    item = _filled(cell.value, cell.uncertainty, Qt.AlignmentFlag.AlignRight, cell.hint)
    item.setData(Qt.ItemDataRole.AccessibleTextRole, f"{cell.value} {cell.uncertainty}".strip() or cell.hint)
    return item


def _filled(text: str, below: str, side: Qt.AlignmentFlag, hint: str) -> QTableWidgetItem:
    item = QTableWidgetItem(text)
    item.setTextAlignment(side)
    item.setData(_SPREAD, below)
    item.setToolTip(hint)
    return item


def _lines(index: _Index) -> tuple[str, str]:
    return index.data(Qt.ItemDataRole.DisplayRole) or "", index.data(_SPREAD) or ""


def _fonts(index: _Index) -> tuple[QFont, QFont]:
    return font(TextRole.STRONG if index.data(_BOLD) else TextRole.TEXT), font(TextRole.LABEL)


def _width(text: str, used: QFont) -> int:
    return QFontMetrics(used).horizontalAdvance(text)
