"""Keys: what a key does is said once, and told by the tool tip of its button and on F1."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from PySide6.QtCore import Qt
from PySide6.QtGui import QKeySequence, QShortcut
from PySide6.QtWidgets import QAbstractButton, QWidget

_DESCRIBED = "described_keys"
_SHOWN = "shown_key"


@dataclass(frozen=True, slots=True)
class ShortcutHelp:
    """A key and what it does, as shown."""

    key: str
    description: str


def add_shortcut(
    owner: QWidget, keys: str | Sequence[str], words: str, act: Callable[[], object], *, focused: bool = False
) -> None:
    """Let a key do something as long as `owner` is shown.

    Parameters
    ----------
    owner : QWidget
    keys : str or sequence of str
        As in `Ctrl+E`; several do the same, and the first is the one that is told.
    words : str
        What it does, for people.
    act : callable
    focused : bool
        Only while `owner` has the focus: in a field the key is a letter.
    """
    for number, key in enumerate([keys] if isinstance(keys, str) else keys):
        shortcut = QShortcut(QKeySequence(key), owner)
        if focused:
            shortcut.setContext(Qt.ShortcutContext.WidgetShortcut)
        shortcut.setWhatsThis(words if number == 0 else "")
        shortcut.activated.connect(act)


def bind_button(
    button: QAbstractButton, keys: str | Sequence[str], words: str, owner: QWidget, *, focused: bool = False
) -> None:
    """Let a key press a button as `add_key` lets it do something; the button's tool tip says both."""
    add_shortcut(owner, keys, words, button.click, focused=focused)
    button.setProperty(_SHOWN, _native(keys if isinstance(keys, str) else keys[0]))
    set_button_hint(button, words)


def set_button_hint(button: QAbstractButton, words: str) -> None:
    """Say in a tool tip what a button does just now; its key stays in it."""
    key = button.property(_SHOWN)
    button.setToolTip(f"{words} ({key})" if key else words)


def describe_shortcut(widget: QWidget, key: str, words: str) -> None:
    """Tell on F1 of keys that the widget takes itself, such as arrows."""
    widget.setProperty(_DESCRIBED, (key, words))


def list_shortcuts(widget: QWidget, *, own: bool = False) -> list[ShortcutHelp]:
    """All keys of a widget and its parts, or only its own, in the order in which they were added."""
    depth = Qt.FindChildOption.FindDirectChildrenOnly if own else Qt.FindChildOption.FindChildrenRecursively
    shortcuts = [key for key in widget.findChildren(QShortcut, "", depth) if key.whatsThis()]
    parts = [widget] if own else [widget, *widget.findChildren(QWidget)]
    described = [part.property(_DESCRIBED) for part in parts]
    return [ShortcutHelp(_native(key.key().toString()), key.whatsThis()) for key in shortcuts] + [
        ShortcutHelp(*words) for words in described if words
    ]


def _native(keys: str) -> str:
    return QKeySequence(keys).toString(QKeySequence.SequenceFormat.NativeText)
