"""What a person would see of a widget: its words, and which of them are cut off."""

import re

from PySide6.QtGui import QTextDocument
from PySide6.QtWidgets import QLabel, QPushButton, QScrollArea, QWidget


def visible_words(widget: QWidget) -> str:
    """Text of all visible labels and buttons, a line each."""
    found = [*widget.findChildren(QLabel), *widget.findChildren(QPushButton)]
    return "\n".join(plain(item.text()) for item in found if item.isVisible() and item.text())


def plain(text: str) -> str:
    document = QTextDocument()
    document.setHtml(text)
    return document.toPlainText() if re.search(r"<\w+|&\w+;", text) else text


def clipped_words(widget: QWidget) -> list[str]:
    """Visible labels and buttons that are smaller than their words need; scrolled columns may be higher."""
    cut = []
    for item in (*widget.findChildren(QLabel), *widget.findChildren(QPushButton)):
        if not item.isVisible() or not item.text():
            continue
        needed = item.sizeHint()
        height = item.heightForWidth(item.width()) if item.hasHeightForWidth() else needed.height()
        wide_enough = item.hasHeightForWidth() or item.width() >= needed.width()
        if not wide_enough or item.height() < height or not _inside(item, widget):
            cut.append(f"{item.text()!r}: {item.width()} x {item.height()}, needs {needed.toTuple()}")
    return cut


def _inside(item: QWidget, widget: QWidget) -> bool:
    """Within the sides of every ancestor; below the lower edge only where it can be scrolled to."""
    ancestor = item.parentWidget()
    while ancestor is not None and ancestor is not widget:
        place = item.mapTo(ancestor, item.rect().topLeft())
        if place.x() < 0 or place.x() + item.width() > ancestor.width() + 1:
            return False
        if isinstance(ancestor.parentWidget(), QScrollArea):
            return True
        if place.y() < 0 or place.y() + item.height() > ancestor.height() + 1:
            return False
        ancestor = ancestor.parentWidget()
    return True
