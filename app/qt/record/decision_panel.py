"""Below the result: what is to become of the run, with a note, under large buttons."""

from PySide6.QtCore import QEvent, Qt, Signal
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QFrame, QHBoxLayout, QPushButton, QVBoxLayout

from app.presenters.record.state import Action, PendingDecision
from app.qt.theme import set_property
from app.qt.widgets.inputs import ShortcutSafeEdit
from app.qt.widgets.shortcuts import add_shortcut, bind_button
from messages.i18n import N_, gettext

_BUTTONS = {
    Action.NEXT: (
        N_("Keep"),
        "Enter",
        (),
        N_("Keep the run with what was found in it (Enter)"),
    ),
    Action.REPEAT: (
        N_("Repeat"),
        "R",
        ("R",),
        N_("Move the run to the trash, and record the same series again at once"),
    ),
    Action.DISCARD: (N_("Discard"), "Del", ("Del", "D"), N_("Move the run to the trash")),
}


class DecisionPanel(QFrame):
    """A note field, Keep, Repeat, Discard; hidden where nothing is to be decided."""

    acted = Signal(Action)
    noted = Signal(str)
    left_note = Signal()
    """The keyboard is wanted by the buttons again."""

    def __init__(self) -> None:
        super().__init__()
        self._note = ShortcutSafeEdit()
        self._note.setPlaceholderText(gettext("Note, kept with the run (N)"))
        self._note.setToolTip(gettext("Enter keeps the run with this note, Esc leaves the field"))
        self._note.setAccessibleName(gettext("Note on this run"))
        self._note.textEdited.connect(self.noted)
        self._note.left.connect(self.left_note)
        add_shortcut(self, "N", gettext("Write a note on the run; Esc leaves the field"), self._note.setFocus)
        self._buttons = {action: self._button(action) for action in _BUTTONS}
        layout = QVBoxLayout(self)
        layout.setContentsMargins(16, 8, 16, 8)
        layout.setSpacing(8)
        layout.addWidget(self._note)
        row = QHBoxLayout()
        row.setSpacing(8)
        for button in self._buttons.values():
            row.addWidget(button, 1)
        layout.addLayout(row)

    def show_decision(self, decision: PendingDecision | None, allowed: frozenset[Action]) -> None:
        """Ask what is to become of a run; None where nothing is to be asked."""
        self.setVisible(decision is not None)
        if decision is not None and self._note.text() != decision.note:
            self._note.setText(decision.note)
        for action, button in self._buttons.items():
            button.setEnabled(action in allowed)
            set_property(button, "primary", "true" if action is Action.NEXT else "false")

    def take_focus(self) -> None:
        """Let Enter and Space keep the run."""
        self._buttons[Action.NEXT].setFocus()

    def _button(self, action: Action) -> QPushButton:
        text, key, keys, words = _BUTTONS[action]
        button = _Button(f"{gettext(text)}\n{key}")
        button.setProperty("scale", "large")
        button.clicked.connect(lambda: self.acted.emit(action))
        if keys:
            bind_button(button, keys, gettext(words), self)
        else:  # the bar below has the key
            button.setToolTip(gettext(words))
        return button


class _Button(QPushButton):
    """A button that Enter presses while it has the focus, whatever else Enter does on the screen."""

    def event(self, event: QEvent) -> bool:
        """Keep Enter from being taken as a shortcut."""
        is_ours = isinstance(event, QKeyEvent) and event.key() in (Qt.Key.Key_Return, Qt.Key.Key_Enter)
        if is_ours and event.type() == QEvent.Type.ShortcutOverride:
            event.accept()
            return True
        if is_ours and event.type() == QEvent.Type.KeyPress:
            self.click()
            return True
        return super().event(event)
