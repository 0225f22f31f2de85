"""Keyboard rules of the window: Enter presses the focused button, and the focus never moves by itself."""

from PySide6.QtCore import QEvent, Qt
from PySide6.QtGui import QKeyEvent, QShowEvent
from PySide6.QtWidgets import QApplication, QMainWindow, QPushButton, QToolButton, QWidget
from shiboken6 import isValid

_ENTER = (Qt.Key.Key_Return, Qt.Key.Key_Enter)


class KeyboardWindow(QMainWindow):
    """Window whose `home` has the focus where no other widget was chosen."""

    def __init__(self) -> None:
        super().__init__()
        self._focused_before: QWidget | None = None
        QApplication.instance().focusChanged.connect(self._on_focus_changed)  # type: ignore[union-attr]

    def home(self) -> QWidget | None:
        """Screen that is shown."""
        return self.centralWidget()

    def focus_home(self) -> None:
        """Give the focus to the screen, or to what its `take_focus` chooses."""
        home = self.home()
        if home is not None:
            getattr(home, "take_focus", home.setFocus)()

    def showEvent(self, event: QShowEvent) -> None:  # noqa: N802
        """Choose the focus at the start, which Qt would give to the first button."""
        super().showEvent(event)
        if not event.spontaneous():
            self.focus_home()

    def changeEvent(self, event: QEvent) -> None:  # noqa: N802
        """Where the focus was disabled or hidden behind a dialog, choose it anew: Qt has passed it on."""
        super().changeEvent(event)
        if event.type() != QEvent.Type.ActivationChange:
            return
        before, self._focused_before = self._focused_before, None
        if not self.isActiveWindow():
            self._focused_before = self.focusWidget()
        elif before is not None and isValid(before) and not (before.isVisible() and before.isEnabled()):
            self.focus_home()

    def event(self, event: QEvent) -> bool:
        """Let Enter press the focused button, even where it is a shortcut of the screen."""
        button = QApplication.focusWidget() if isinstance(event, QKeyEvent) else None
        if isinstance(button, QPushButton | QToolButton) and _is_enter(event):
            if event.type() == QEvent.Type.ShortcutOverride:
                event.accept()
                return True
            if event.type() == QEvent.Type.KeyPress:
                button.click()
                return True
        return super().event(event)

    def _on_focus_changed(self, old: QWidget | None, new: QWidget | None) -> None:
        """Qt passes the focus of a hidden or disabled widget on, perhaps to a field or to Stop: undo that."""
        if old is None or new is None or old.window() is not self or new.window() is not self:
            return
        if not (old.isVisible() and old.isEnabled()):
            self.focus_home()


def _is_enter(event: QEvent) -> bool:
    return isinstance(event, QKeyEvent) and event.key() in _ENTER and not event.isAutoRepeat()
