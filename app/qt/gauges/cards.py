"""The calibrations in use, a card a gauge."""

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QFrame, QScrollArea, QVBoxLayout, QWidget

from app.presenters.gauges.state import GaugeCard, GaugesState
from app.qt.gauges.value_grid import ValueGrid
from app.qt.theme import TextRole
from app.qt.widgets.layouts import make_column
from app.qt.widgets.text import break_path, label, show_chip
from messages.i18n import gettext

FOCUS_RING = 2
"""What is left free around the cards for it (px)."""


class CardsColumn(QScrollArea):
    """Both cards under one another, and where the calibrations are kept."""

    def __init__(self) -> None:
        super().__init__()
        self._cards = (_Card(), _Card())
        self._fault = label(wrap=True)
        self._file = label(role=TextRole.LABEL, muted=True, wrap=True)
        inside = QWidget()
        layout = QVBoxLayout(inside)
        layout.setContentsMargins(FOCUS_RING, FOCUS_RING, 4, FOCUS_RING)
        layout.setSpacing(8)
        for part in (*self._cards, self._fault, self._file):
            layout.addWidget(part)
        layout.addStretch(1)
        self.setWidget(inside)
        self.setWidgetResizable(True)
        self.setFrameShape(QFrame.Shape.NoFrame)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setAccessibleName(gettext("Calibrations in use"))

    def show_state(self, state: GaugesState) -> None:
        for shown, card in zip(self._cards, state.cards, strict=True):
            shown.show_card(card)
        show_chip(self._fault, state.checks_fault)
        self._file.setText(gettext("In use: {file}", file=break_path(state.file)) if state.file else "")


class _Card(QFrame):
    def __init__(self) -> None:
        super().__init__()
        self.setProperty("role", "card")
        self._name = label(role=TextRole.HEADING)
        self._standing = label(role=TextRole.STRONG, wrap=True)
        self._facts = ValueGrid()
        self._check = label(wrap=True)
        make_column(
            self._name, self._standing, self._facts, self._check, spacing=8, margins=(16, 12), of=self
        )

    def show_card(self, card: GaugeCard) -> None:
        self._name.setText(card.name)
        show_chip(self._standing, card.validity)
        self._facts.show_values(card.values)
        show_chip(self._check, card.check)
        self.setAccessibleName(f"{card.name}: {card.validity.text}; {card.check.text}")
