"""What became of the last run, and the way back."""

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QFrame, QHBoxLayout, QPushButton

from app.presenters.base import Chip
from app.qt.widgets.shortcuts import bind_button, set_button_hint
from app.qt.widgets.text import label, show_chip
from messages.i18n import gettext


class StatusLine(QFrame):
    """A line of news with an Undo button where there is something to take back; hidden without news."""

    undone = Signal()

    def __init__(self) -> None:
        super().__init__()
        self._said = label(wrap=True)
        self._undo = QPushButton(gettext("Undo"))
        self._undo.clicked.connect(self.undone)
        bind_button(self._undo, "Ctrl+Z", gettext("Take back what was decided about the last run"), self)
        layout = QHBoxLayout(self)
        layout.setContentsMargins(16, 8, 16, 8)
        layout.setSpacing(8)
        layout.addWidget(self._said, 1)
        layout.addWidget(self._undo)

    def show_status(self, said: Chip, undo: str) -> None:
        """Show news; `undo` says what can be taken back."""
        self.setVisible(bool(said.text or undo))
        show_chip(self._said, said)
        self._undo.setVisible(bool(undo))
        set_button_hint(self._undo, undo)
