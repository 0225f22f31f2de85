"""Keyboard shortcuts: their description is in the tool tip of the button and in the help dialog."""

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from PySide6.QtCore import Qt
from PySide6.QtGui import QKeySequence, QShortcut
from PySide6.QtWidgets import QAbstractButton, QDialog, QGridLayout, QPushButton, QWidget

from app.qt.theme import TextRole
from app.qt.widgets.layouts import STRETCH, make_column, make_row, make_scroll_area
from app.qt.widgets.text import label, set_tool_tip
from messages.i18n import gettext

ENTER_KEYS = ("Return", "Enter")
_DESCRIBED = "described_keys"
_SHOWN = "shown_key"


@dataclass(frozen=True, slots=True)
class ShortcutHelp:
    """A key and its description, as shown."""

    key: str
    description: str


def add_shortcut(
    owner: QWidget, keys: str | Sequence[str], words: str, act: Callable[[], object], *, focused: bool = False
) -> None:
    """Let keys, as in `Ctrl+E`, call `act` while `owner` is shown; help and tool tips name the first.

    With `focused` they act only while `owner` has the focus: in a field the key is a letter.
    """
    for number, key in enumerate([keys] if isinstance(keys, str) else keys):
        shortcut = QShortcut(QKeySequence(key), owner)
        if focused:
            shortcut.setContext(Qt.ShortcutContext.WidgetShortcut)
        shortcut.setWhatsThis(words if number == 0 else "")
        shortcut.setAutoRepeat(key not in ENTER_KEYS)  # one that is held down would answer the next question
        shortcut.activated.connect(act)


def bind_button(
    button: QAbstractButton,
    keys: str | Sequence[str],
    words: str,
    owner: QWidget,
    *,
    focused: bool = False,
    act: Callable[[], object] | None = None,
) -> None:
    """Let keys press a button, or call `act`; its tool tip has the description and the first key."""
    add_shortcut(owner, keys, words, act or button.click, focused=focused)
    button.setProperty(_SHOWN, _native(keys if isinstance(keys, str) else keys[0]))
    set_button_hint(button, words)


def set_button_hint(button: QAbstractButton, words: str) -> None:
    """Set the description in the tool tip of a button; its key stays in it."""
    key = button.property(_SHOWN)
    set_tool_tip(button, f"{words} ({key})" if key else words)


def describe_shortcut(widget: QWidget, key: str, words: str) -> None:
    """List keys in the help that the widget handles itself, such as arrows."""
    widget.setProperty(_DESCRIBED, (key, words))


def list_shortcuts(widget: QWidget, *, own: bool = False) -> list[ShortcutHelp]:
    """Shortcuts of a widget and its parts, or only its own, in the order in which they were added.

    Those that several parts have, such as plots, are listed once.
    """
    depth = Qt.FindChildOption.FindDirectChildrenOnly if own else Qt.FindChildOption.FindChildrenRecursively
    shortcuts = [key for key in widget.findChildren(QShortcut, "", depth) if key.whatsThis()]
    parts = [widget] if own else [widget, *widget.findChildren(QWidget)]
    described = [part.property(_DESCRIBED) for part in parts]
    found = [ShortcutHelp(_native(key.key().toString()), key.whatsThis()) for key in shortcuts]
    return list(dict.fromkeys([*found, *(ShortcutHelp(*words) for words in described if words)]))


def _native(keys: str) -> str:
    """Name of a key as this system has it; on a Mac it is a symbol, elsewhere Return is marked Enter."""
    marked = keys if sys.platform == "darwin" else keys.replace("Return", "Enter")
    return QKeySequence(marked).toString(QKeySequence.SequenceFormat.NativeText)


class HelpDialog(QDialog):
    """Lists shortcuts by group. It does not block the window."""

    def __init__(self, groups: list[tuple[str, list[ShortcutHelp]]], parent: QWidget) -> None:
        super().__init__(parent)
        self.setWindowTitle(gettext("Keys"))
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        close = QPushButton(gettext("Close"))
        close.clicked.connect(self.close)
        area = make_scroll_area(_page(groups), is_column=False, name=gettext("Keys"))
        make_column((area, 1), make_row(STRETCH, close), spacing=12, margins=(16, 16), of=self)
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
