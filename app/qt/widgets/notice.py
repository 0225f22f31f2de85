"""A strip above the screen that says what the operator must know. Never a box in the way."""

from PySide6.QtCore import Signal
from PySide6.QtGui import QFontDatabase, QGuiApplication
from PySide6.QtWidgets import QFrame, QHBoxLayout, QPlainTextEdit, QPushButton, QVBoxLayout, QWidget

from app.presenters.base import Notice
from app.qt.theme import set_property
from app.qt.widgets.text import label
from messages.i18n import gettext, gettext_noop

_WORDS = {"bad": gettext_noop("Error"), "warn": gettext_noop("Note"), "ok": gettext_noop("Done"), "plain": ""}
_DETAILS_HEIGHT = 168


class NoticeBar(QFrame):
    """Shows one notice, or nothing; what is known beyond its words is folded away."""

    acted = Signal()
    dismissed = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setProperty("role", "notice")
        self._shown: Notice | None = None
        self._kind = label()
        self._text = label(wrap=True)
        self._fold = QPushButton()
        self._copy = QPushButton(gettext("Copy"))
        self._action = QPushButton()
        self._dismiss = QPushButton()
        self._details = _details_field()
        self._lay_out()
        self._fold.clicked.connect(lambda _checked: self._unfold(self._details.isHidden()))
        self._copy.clicked.connect(lambda _checked: self._copy_details())
        self._action.clicked.connect(self.acted)
        self._dismiss.clicked.connect(self.dismissed)
        self.hide()

    def show_notice(self, notice: Notice | None) -> None:
        """Show a notice; None hides the strip."""
        if notice is not None and notice != self._shown:
            self._write(notice)
        self._shown = notice
        self.setVisible(notice is not None)

    def _write(self, notice: Notice) -> None:
        for widget in (self, self._kind):
            set_property(widget, "tone", notice.tone.value)
        kind = gettext(_WORDS[notice.tone.value])
        self._kind.setText(kind)
        self._kind.setVisible(bool(kind))
        self._text.setText(notice.text)
        self.setAccessibleName(f"{kind}: {notice.text}" if kind else notice.text)
        self._action.setText(gettext(notice.action))
        self._action.setVisible(bool(notice.action))
        self._dismiss.setText(gettext(notice.dismiss))
        self._details.setPlainText(notice.details)
        self._fold.setVisible(bool(notice.details))
        self._unfold(False)

    def _unfold(self, unfolded: bool) -> None:
        self._details.setVisible(unfolded)
        self._copy.setVisible(unfolded)
        self._fold.setText(gettext("Hide details") if unfolded else gettext("Details"))

    def _copy_details(self) -> None:
        QGuiApplication.clipboard().setText(f"{self._text.text()}\n{self._details.toPlainText()}")

    def _lay_out(self) -> None:
        line = QHBoxLayout()
        line.setSpacing(12)
        line.addWidget(self._kind)
        line.addWidget(self._text, 1)
        for button in (self._action, self._fold, self._copy, self._dismiss):
            line.addWidget(button)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(12, 8, 8, 8)
        layout.setSpacing(8)
        layout.addLayout(line)
        layout.addWidget(self._details)


def _details_field() -> QPlainTextEdit:
    field = QPlainTextEdit()
    field.setReadOnly(True)
    field.setFont(QFontDatabase.systemFont(QFontDatabase.SystemFont.FixedFont))
    field.setLineWrapMode(QPlainTextEdit.LineWrapMode.NoWrap)
    field.setTabChangesFocus(True)
    field.setFixedHeight(_DETAILS_HEIGHT)
    field.setAccessibleName(gettext("Details"))
    return field
