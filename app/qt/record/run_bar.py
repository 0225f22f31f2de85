"""The strip at the bottom of Record: what the next run is, and the three large buttons."""

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QKeySequence, QShortcut
from PySide6.QtWidgets import QFrame, QHBoxLayout, QLineEdit, QPushButton, QVBoxLayout, QWidget

from app.presenters.record.state import Action, RunChoices
from app.qt.theme import Type, set_property
from app.qt.widgets.choice import Choice
from app.qt.widgets.text import label

_BUTTONS = {
    Action.ARM: ("Arm", "A", ("A",), "Record the next pullback (A)"),
    Action.STOP: ("Stop", "Esc", ("Esc",), "End the recording now and keep it (Esc)"),
    Action.NEXT: (
        "Next",
        "Enter",
        ("Return", "Enter"),
        "Leave the result, make ready for the next run (Enter)",
    ),
}


class RunBar(QFrame):
    """Series, operator, note; Arm, Stop, Next."""

    acted = Signal(Action)
    series_chosen = Signal(str)
    operator_written = Signal(str)
    note_written = Signal(str)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setProperty("role", "bar")
        self._series = Choice()
        self._operator = QLineEdit()
        self._note = QLineEdit()
        self._buttons = {action: self._button(action) for action in Action}
        self._lay_out()
        self._series.activated.connect(lambda _: self.series_chosen.emit(self._series.currentText()))
        self._operator.textEdited.connect(self.operator_written)
        self._note.textEdited.connect(self.note_written)

    def show_choices(self, choices: RunChoices) -> None:
        """Write what the next run is."""
        if self._series.count() != len(choices.all_series):
            self._series.addItems(choices.all_series)
        self._series.setCurrentText(choices.series)
        self._series.setEnabled(choices.editable and not choices.series_fixed)
        self._series.setToolTip(
            choices.series_hint or "Series of the next run: pullback, contact, added mass"
        )
        for field, text in ((self._operator, choices.operator), (self._note, choices.note)):
            field.setEnabled(choices.editable)
            if field.text() != text:
                field.setText(text)

    def show_actions(self, allowed: frozenset[Action], primary: Action | None) -> None:
        """Enable what can be done, and bring out what comes next."""
        for action, button in self._buttons.items():
            button.setEnabled(action in allowed)
            set_property(button, "primary", "true" if action is primary else "false")

    def take_focus(self) -> None:
        """Focus the button that comes next, or else the first that can be pressed."""
        usable = [button for button in self._buttons.values() if button.isEnabled()]
        usable.sort(key=lambda button: button.property("primary") != "true")
        (usable[0] if usable else self).setFocus()

    def _button(self, action: Action) -> QPushButton:
        text, key, shortcuts, hint = _BUTTONS[action]
        button = QPushButton(f"{text}   {key}")
        button.setProperty("scale", "large")
        button.setToolTip(hint)
        button.setMinimumWidth(112)
        button.clicked.connect(lambda: self.acted.emit(action))
        for sequence in shortcuts:
            QShortcut(QKeySequence(sequence), self).activated.connect(button.click)
        return button

    def _lay_out(self) -> None:
        layout = QHBoxLayout(self)
        layout.setContentsMargins(12, 8, 12, 8)
        layout.setSpacing(12)
        self._series.setMinimumWidth(112)
        self._operator.setPlaceholderText("name")
        self._note.setPlaceholderText("kept with the next run")
        self._operator.setMaximumWidth(200)
        for name, field, stretch in (
            ("Series", self._series, 0),
            ("Operator", self._operator, 1),
            ("Note", self._note, 2),
        ):
            layout.addLayout(_named(name, field), stretch)
        for button in self._buttons.values():
            layout.addWidget(button)


def _named(name: str, field: QWidget) -> QVBoxLayout:
    column = QVBoxLayout()
    column.setSpacing(4)
    title = label(name, Type.LABEL, muted=True)
    title.setBuddy(field)
    field.setAccessibleName(name)
    column.addWidget(title)
    column.addWidget(field)
    column.setAlignment(Qt.AlignmentFlag.AlignVCenter)
    return column
