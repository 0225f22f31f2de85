"""A field of Record: while it is typed into, keys are letters; Escape gives the keyboard back."""

from collections.abc import Collection

from PySide6.QtCore import QEvent, Qt, Signal
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QLineEdit

ESCAPE = frozenset({Qt.Key.Key_Escape})
ESCAPE_AND_ENTER = ESCAPE | {Qt.Key.Key_Return, Qt.Key.Key_Enter}


class Field(QLineEdit):
    """A line that some keys leave, whatever else they do on the screen.

    Parameters
    ----------
    leaves : collection of Qt.Key
    """

    left = Signal()

    def __init__(self, leaves: Collection[Qt.Key] = ESCAPE) -> None:
        super().__init__()
        self._leaves = leaves

    def event(self, event: QEvent) -> bool:
        """Keep the keys that leave from being taken as shortcuts."""
        leaves = isinstance(event, QKeyEvent) and event.key() in self._leaves
        if leaves and event.type() == QEvent.Type.ShortcutOverride:
            event.accept()
            return True
        if leaves and event.type() == QEvent.Type.KeyPress:
            self.left.emit()
            return True
        return super().event(event)
