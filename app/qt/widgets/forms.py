"""Fields under one another, their names at the left, and cards that hold them."""

from collections.abc import Iterable, Sequence

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QFrame, QGridLayout, QVBoxLayout, QWidget

from app.qt.theme import Type
from app.qt.widgets.text import label


def form_grid(
    fields: Iterable[tuple[str, QWidget]], *, wide: bool = True, below: Sequence[QWidget] = ()
) -> QGridLayout:
    """Fields with their names, which screen readers say too.

    Parameters
    ----------
    fields : iterable of (str, QWidget)
    wide : bool
        Fields take all the width; else what they need.
    below : sequence of QWidget
        What stands under each field, if anything does; hidden ones take no room.
    """
    grid = QGridLayout()
    grid.setVerticalSpacing(8)
    grid.setHorizontalSpacing(12)
    for number, (name, field) in enumerate(fields):
        line = 2 * number
        title = label(name)
        title.setBuddy(field)
        field.setAccessibleName(name)
        grid.addWidget(title, line, 0)
        if wide:
            grid.addWidget(field, line, 1)
        else:
            grid.addWidget(field, line, 1, Qt.AlignmentFlag.AlignLeft)
        if below:
            grid.addWidget(below[number], line + 1, 1)
    grid.setColumnStretch(1, 1)
    return grid


def titled_card(title: str, words: str = "") -> tuple[QFrame, QVBoxLayout]:
    """A card with a heading and, if need be, words under it; and the layout for the rest."""
    card = QFrame()
    card.setProperty("role", "card")
    layout = QVBoxLayout(card)
    layout.setContentsMargins(16, 16, 16, 16)
    layout.setSpacing(12)
    layout.addWidget(label(title, Type.HEADING))
    if words:
        layout.addWidget(label(words, muted=True, wrap=True))
    return card, layout
