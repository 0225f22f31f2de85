"""A quantity in figures: large value, smaller uncertainty and unit, and its name above."""

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QHBoxLayout, QVBoxLayout, QWidget

from app.presenters.results import ResultRow
from app.qt.theme import Type
from app.qt.widgets.text import label


class Value(QWidget):
    """A number in large figures with its uncertainty and unit in smaller ones, and its name above it."""

    def __init__(self, value: Type, spread: Type, *, named: bool = False) -> None:
        super().__init__()
        self._named = named
        self._name = label(role=Type.LABEL, muted=True)
        self._value = label(role=value)
        self._spread = label(role=spread)
        numbers = QHBoxLayout()
        numbers.setContentsMargins(0, 0, 0, 0)
        numbers.setSpacing(8)
        numbers.addWidget(self._value, 0, Qt.AlignmentFlag.AlignBaseline)
        numbers.addWidget(self._spread, 1, Qt.AlignmentFlag.AlignBaseline)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setSpacing(0)
        layout.addWidget(self._name)
        layout.addLayout(numbers)
        self._name.setVisible(named)

    def show_row(self, row: ResultRow | None) -> None:
        """Write a row; None hides it."""
        self.setVisible(row is not None)
        if row is None:
            return
        if self._named:
            self._name.setText(f"{row.symbol}\u2002{row.name}")
        self._value.setText(row.value)
        self._spread.setText(row.uncertainty_text)
