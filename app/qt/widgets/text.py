"""Labels by role, and chips: words with a tone."""

import html
import re

from PySide6.QtCore import Qt
from PySide6.QtGui import QTextDocumentFragment
from PySide6.QtWidgets import QLabel, QWidget

from app.presenters.base import Chip
from app.qt.theme import Type, font, set_property

_SYMBOL = re.compile(r"\b([fuva])_(d|s|max)\b")
_MARKUP = re.compile(r"</?\w+>|&\w+;")


def label(
    text: str = "",
    role: Type = Type.TEXT,
    *,
    muted: bool = False,
    wrap: bool = False,
    parent: QWidget | None = None,
) -> QLabel:
    """Text of a role, its symbols set; wrapped text may be selected with the mouse."""
    made = QLabel(typeset(text), parent)
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
    target.setText(typeset(mark + chip.text) if chip.text else "")
    target.setToolTip(chip.hint)
    target.setVisible(bool(chip.text))
    set_property(target, "tone", chip.tone.value)


def typeset(text: str) -> str:
    """Set the symbols in sentences of the analysis: f_d with a subscript. Without any, the text as it is."""
    if not _SYMBOL.search(text):
        return text
    rich = text if _MARKUP.search(text) else html.escape(text, quote=False)
    return _SYMBOL.sub(r"\1<sub>\2</sub>", rich)


def plain_text(rich: str) -> str:
    """What a screen reader says of rich text: a subscript without its tags."""
    return QTextDocumentFragment.fromHtml(rich).toPlainText()


def break_path(path: str) -> str:
    """Let a long path wrap at its separators."""
    return path.replace("/", "/\u200b").replace("\\", "\\\u200b")
