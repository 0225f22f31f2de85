"""F1: every key of the screen and of the window, made from the keys themselves: it cannot be wrong."""

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QDialog, QGridLayout, QPushButton, QVBoxLayout, QWidget

from app.qt.theme import TextRole
from app.qt.widgets.layouts import make_scroll_area
from app.qt.widgets.shortcuts import ShortcutHelp
from app.qt.widgets.text import label
from messages.i18n import gettext


class HelpDialog(QDialog):
    """Lists keys. It stays beside the window and stops nothing.

    Parameters
    ----------
    groups : list of (str, list of Key)
        A title and the keys under it.
    parent : QWidget
    """

    def __init__(self, groups: list[tuple[str, list[ShortcutHelp]]], parent: QWidget) -> None:
        super().__init__(parent)
        self.setWindowTitle(gettext("Keys"))
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        close = QPushButton(gettext("Close"))
        close.clicked.connect(self.close)
        area = make_scroll_area(_page(groups), is_column=False, name=gettext("Keys"))
        layout = QVBoxLayout(self)
        layout.setContentsMargins(16, 16, 16, 16)
        layout.setSpacing(12)
        layout.addWidget(area, 1)
        layout.addWidget(close, 0, Qt.AlignmentFlag.AlignRight)
        self.resize(560, min(640, 120 + 30 * sum(len(keys) + 2 for _, keys in groups)))


def _page(groups: list[tuple[str, list[ShortcutHelp]]]) -> QWidget:
    page = QWidget()
    grid = QGridLayout(page)
    grid.setContentsMargins(8, 8, 8, 8)  # clear of the focus ring
    grid.setHorizontalSpacing(24)
    grid.setVerticalSpacing(8)
    grid.setColumnStretch(1, 1)
    for title, keys in groups:
        grid.addWidget(label(title, TextRole.HEADING), grid.rowCount(), 0, 1, 2)
        for key in keys:
            row = grid.rowCount()
            grid.addWidget(label(key.key, TextRole.STRONG), row, 0, Qt.AlignmentFlag.AlignTop)
            grid.addWidget(label(key.description, wrap=True), row, 1)
    grid.setRowStretch(grid.rowCount(), 1)
    return page
