"""A strip above the screen that says what the operator must know. Never a box in the way."""

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QFrame, QHBoxLayout, QPushButton, QWidget

from app.presenters.screen import Notice
from app.qt.theme import set_property
from app.qt.widgets.text import label

_WORDS = {"bad": "Error", "warn": "Note", "ok": "Done", "plain": ""}


class NoticeBar(QFrame):
    """Shows one notice, or nothing."""

    acted = Signal()
    dismissed = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setProperty("role", "notice")
        self._kind = label()
        self._text = label(wrap=True)
        self._action = QPushButton()
        self._dismiss = QPushButton("Dismiss")
        layout = QHBoxLayout(self)
        layout.setContentsMargins(12, 8, 8, 8)
        layout.setSpacing(12)
        layout.addWidget(self._kind)
        layout.addWidget(self._text, 1)
        layout.addWidget(self._action)
        layout.addWidget(self._dismiss)
        self._action.clicked.connect(self.acted)
        self._dismiss.clicked.connect(self.dismissed)
        self.hide()

    def show_notice(self, notice: Notice | None) -> None:
        """Show a notice; None hides the strip."""
        self.setVisible(notice is not None)
        if notice is None:
            return
        for widget in (self, self._kind):
            set_property(widget, "tone", notice.tone.value)
        self._kind.setText(_WORDS[notice.tone.value])
        self._text.setText(notice.text)
        self.setAccessibleName(f"{_WORDS[notice.tone.value]}: {notice.text}")
        self._action.setText(notice.action)
        self._action.setVisible(bool(notice.action))
        self._dismiss.setText(notice.dismiss)
