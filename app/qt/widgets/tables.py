"""Conventions of tables: rows copied for a spreadsheet, columns chosen from a menu and moved by dragging."""

from collections.abc import Callable, Collection, Iterable, Sequence
from functools import partial

from PySide6.QtCore import QPoint, QRect, Qt
from PySide6.QtGui import QGuiApplication, QKeySequence, QPainter, QPalette, QTextDocument
from PySide6.QtWidgets import QHeaderView, QMenu, QStyle, QStyleOptionHeader, QTableView

from analysis.formatting import MINUS, THIN_SPACE
from app.qt.widgets.shortcuts import add_shortcut
from app.qt.widgets.text import set_subscripts, set_tool_tip
from messages.i18n import gettext

NAME_ROLE = Qt.ItemDataRole.UserRole + 10
"""Of a title: name under which a choice of columns is kept. A column without one is always shown."""
COPIED_ROLE = Qt.ItemDataRole.UserRole + 11
"""Of a cell and of a title: texts for a spreadsheet, a column each; without it the shown text is copied."""
_ACROSS = Qt.Orientation.Horizontal


class TitleHeader(QHeaderView):
    """Titles of columns, symbols such as `f_d` set with their subscripts."""

    def __init__(self, table: QTableView) -> None:
        super().__init__(_ACROSS, table)
        self.setSectionsClickable(True)  # as the header that a table makes for itself

    def paintSection(self, painter: QPainter, rect: QRect, section: int) -> None:  # noqa: N802
        title = str(self.model().headerData(section, _ACROSS))
        rich = set_subscripts(title)
        if rich == title:
            super().paintSection(painter, rect, section)
            return
        option = QStyleOptionHeader()
        self.initStyleOption(option)
        option.rect, option.section = rect, section
        self.initStyleOptionForIndex(option, section)
        option.text = ""
        painter.save()
        self.style().drawControl(QStyle.ControlElement.CE_Header, option, painter, self)
        place = self.style().subElementRect(QStyle.SubElement.SE_HeaderLabel, option, self)
        side = self.model().headerData(section, _ACROSS, Qt.ItemDataRole.TextAlignmentRole)
        _draw_rich(painter, place, rich, self, side or self.defaultAlignment())
        painter.restore()


def _draw_rich(painter: QPainter, place: QRect, rich: str, of: QHeaderView, side: Qt.AlignmentFlag) -> None:
    document = QTextDocument()
    document.setDocumentMargin(0)
    document.setDefaultFont(of.font())
    colour = of.palette().color(QPalette.ColorRole.PlaceholderText).name()  # that of the style sheet
    lines = rich.replace("\n", "<br>")
    document.setHtml(
        f'<div align="{"right" if side & Qt.AlignmentFlag.AlignRight else "left"}">'
        f'<font color="{colour}">{lines}</font></div>'
    )
    document.setTextWidth(place.width())
    painter.translate(place.left(), place.top() + (place.height() - document.size().height()) / 2)
    document.drawContents(painter)


def serve_table(
    table: QTableView, columns: Sequence[str] = (), changed: Callable[[], object] = lambda: None
) -> None:
    """Let selected rows be copied, and columns chosen and moved.

    `columns` are the names of those that are shown at first, in their order; all if there are none. `changed`
    is called when others are shown.
    """
    header = table.horizontalHeader()
    for part, area in ((table, table.viewport()), (header, header.viewport())):
        part.setContextMenuPolicy(Qt.ContextMenuPolicy.CustomContextMenu)
        part.customContextMenuRequested.connect(
            lambda at, area=area: _open_menu(table, columns, changed, area.mapToGlobal(at))
        )
    header.setSectionsMovable(True)
    set_tool_tip(header, gettext("Drag a title to move its column; a right click chooses columns"))
    copy = gettext("Copy the selected rows with their titles, for a spreadsheet")
    add_shortcut(table, "Ctrl+C", copy, partial(copy_rows, table), focused=True)
    if columns:
        show_columns(header, columns)


def copy_rows(table: QTableView) -> None:
    """Copy the selected rows with their titles as text with tabs; nothing if none is selected."""
    if text := rows_text(table):
        QGuiApplication.clipboard().setText(text)


def rows_text(table: QTableView) -> str:
    """Selected rows below the titles of the shown columns, in the order in which both are shown."""
    rows = sorted({index.row() for index in table.selectionModel().selectedIndexes()})
    if not rows:
        return ""
    model, shown = table.model(), _shown_sections(table.horizontalHeader())
    lines = [[cell for section in shown for cell in _titles(table, section)]]
    for row in rows:
        indexes = [model.index(row, section) for section in shown]
        lines.append([cell for index in indexes for cell in index.data(COPIED_ROLE) or (index.data(),)])
    return tabbed_text(lines)


def tabbed_text(lines: Iterable[Iterable[object]]) -> str:
    """Join cells by tabs and lines by line ends; signs of numbers are those that a spreadsheet knows."""
    return "".join("\t".join(map(_plain, line)) + "\n" for line in lines)


def shown_columns(header: QHeaderView) -> tuple[str, ...]:
    """Names of the shown columns in their order; empty for a table whose columns have no names."""
    return tuple(name for section in _shown_sections(header) if (name := _name(header, section)))


def show_columns(header: QHeaderView, names: Collection[str]) -> None:
    """Show these columns in this order, and hide the others; nothing is changed without a known name."""
    sections = {name: section for section in range(header.count()) if (name := _name(header, section))}
    wanted = [sections[name] for name in names if name in sections]
    if not wanted:
        return
    for name, section in sections.items():
        header.setSectionHidden(section, name not in names)
    unnamed = header.count() - len(sections)
    for place, section in enumerate(wanted):
        header.moveSection(header.visualIndex(section), unnamed + place)


def _open_menu(table: QTableView, usual: Sequence[str], changed: Callable[[], object], at: QPoint) -> None:
    menu, header = QMenu(table), table.horizontalHeader()
    copy = menu.addAction(gettext("Copy rows"))
    copy.setShortcut(QKeySequence.StandardKey.Copy)
    copy.setShortcutVisibleInContextMenu(True)
    copy.setEnabled(table.selectionModel().hasSelection())
    copy.triggered.connect(partial(copy_rows, table))
    menu.addSeparator()
    shown = shown_columns(header)
    for section in _sections(header):
        if name := _name(header, section):
            action = menu.addAction(_description(table, section))
            action.setCheckable(True)
            action.setChecked(name in shown)
            action.setEnabled(shown != (name,))  # a table without columns could not be brought back
            action.toggled.connect(partial(_show_column, header, section))
            action.toggled.connect(lambda _shown: changed())
    if usual:
        menu.addSeparator()
        reset = menu.addAction(gettext("Usual columns"))
        reset.triggered.connect(partial(show_columns, header, usual))
        reset.triggered.connect(lambda _checked: changed())
    menu.aboutToHide.connect(menu.deleteLater)
    menu.popup(at)


def _show_column(header: QHeaderView, section: int, shown: bool) -> None:
    header.setSectionHidden(section, not shown)


def _sections(header: QHeaderView) -> list[int]:
    """Sections in the order of the screen, hidden ones too."""
    return [header.logicalIndex(place) for place in range(header.count())]


def _shown_sections(header: QHeaderView) -> list[int]:
    return [section for section in _sections(header) if not header.isSectionHidden(section)]


def _name(header: QHeaderView, section: int) -> str:
    return header.model().headerData(section, _ACROSS, NAME_ROLE) or ""


def _titles(table: QTableView, section: int) -> Sequence[str]:
    model = table.model()
    return model.headerData(section, _ACROSS, COPIED_ROLE) or (str(model.headerData(section, _ACROSS)),)


def _description(table: QTableView, section: int) -> str:
    """Title of a column, and what it means where that is said."""
    model = table.model()
    title = _plain(str(model.headerData(section, _ACROSS)))
    meaning = model.headerData(section, _ACROSS, Qt.ItemDataRole.ToolTipRole)
    return f"{title}: {meaning}" if meaning else title


def _plain(text: object) -> str:
    """Text of one cell, with the signs that a spreadsheet takes for those of a number."""
    shown = "" if text is None else str(text)
    return " ".join(shown.replace(MINUS, "-").replace(THIN_SPACE, " ").split())
