"""Fields under one another, their names at the left, and cards that hold them."""

from collections.abc import Iterable, Sequence

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QFrame, QGridLayout, QScrollArea, QVBoxLayout, QWidget

from app.qt.theme import TextRole
from app.qt.widgets.text import label


def make_form_grid(
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


def make_card(title: str, words: str = "") -> tuple[QFrame, QVBoxLayout]:
    """A card with a heading and, if need be, words under it; and the layout for the rest."""
    card = QFrame()
    card.setProperty("role", "card")
    layout = QVBoxLayout(card)
    layout.setContentsMargins(16, 16, 16, 16)
    layout.setSpacing(12)
    layout.addWidget(label(title, TextRole.HEADING))
    if words:
        layout.addWidget(label(words, muted=True, wrap=True))
    return card, layout


def make_scroll_area(
    content: QWidget | None = None, *, is_column: bool = True, name: str = ""
) -> QScrollArea:
    """A frameless area as wide as `content`, which may be set later; a column has the ground of a card.

    What has nothing in it that takes the keyboard needs a `name`: the area then takes it, so that it can be
    scrolled. All else is scrolled to when it gets the focus.
    """
    area = QScrollArea()
    area.setAccessibleName(name)
    area.setFocusPolicy(Qt.FocusPolicy.StrongFocus if name else Qt.FocusPolicy.NoFocus)
    if is_column:
        area.setProperty("role", "column")
    area.setFrameShape(QFrame.Shape.NoFrame)
    area.setWidgetResizable(True)
    area.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
    if content is not None:
        area.setWidget(content)
    return area
