"""Labels by role, and chips: words with a tone."""

from PySide6.QtCore import Qt
from PySide6.QtGui import QTextDocumentFragment
from PySide6.QtWidgets import QLabel, QWidget

from app.presenters.screen import Chip
from app.qt.theme import Type, font, set_property


def label(
    text: str = "",
    role: Type = Type.TEXT,
    *,
    muted: bool = False,
    wrap: bool = False,
    parent: QWidget | None = None,
) -> QLabel:
    """Text of a role; wrapped text may be selected with the mouse."""
    made = QLabel(text, parent)
    made.setFont(font(role))
    made.setWordWrap(wrap)
    if wrap:
        made.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
    if muted:
        made.setProperty("role", "muted")
    return made


def show_chip(target: QLabel, chip: Chip) -> None:
    """Write a chip into a label; an empty one hides it. The mark before the word tells the tone by shape."""
    mark = {"ok": "✓ ", "warn": "▲ ", "bad": "■ "}.get(chip.tone.value, "")
    target.setText(mark + chip.text if chip.text else "")
    target.setToolTip(chip.hint)
    target.setVisible(bool(chip.text))
    set_property(target, "tone", chip.tone.value)


def plain_text(rich: str) -> str:
    """What a screen reader says of rich text: a subscript without its tags."""
    return QTextDocumentFragment.fromHtml(rich).toPlainText()


def break_path(path: str) -> str:
    """Let a long path wrap at its separators."""
    return path.replace("/", "/\u200b").replace("\\", "\\\u200b")
