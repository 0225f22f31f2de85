"""Layouts: rows and columns of widgets, forms, cards, scroll areas."""

from collections.abc import Iterable, Sequence
from typing import Final, TypeAlias, TypeVar

from PySide6.QtCore import Qt
from PySide6.QtWidgets import (
    QBoxLayout,
    QFrame,
    QGridLayout,
    QHBoxLayout,
    QLayout,
    QScrollArea,
    QVBoxLayout,
    QWidget,
)

from app.qt.theme import TextRole
from app.qt.widgets.text import label

STRETCH: Final = object()
"""Item of a row or column: empty space that takes what is left."""
Item: TypeAlias = QWidget | QLayout | tuple[QWidget | QLayout, int] | object
"""A widget or layout, one with its stretch factor, or `STRETCH`."""
_Box = TypeVar("_Box", bound=QBoxLayout)


def make_row(
    *items: Item, spacing: int = 0, margins: tuple[int, int] = (0, 0), of: QWidget | None = None
) -> QHBoxLayout:
    """Place items beside one another.

    Parameters
    ----------
    *items : QWidget, QLayout, (QWidget or QLayout, int), or STRETCH
    spacing : int
        Pixels between items.
    margins : tuple of int
        Pixels at left and right, and at top and bottom.
    of : QWidget, optional
        Widget that gets the layout.
    """
    return _fill(QHBoxLayout(of) if of is not None else QHBoxLayout(), items, spacing, margins)


def make_column(
    *items: Item, spacing: int = 0, margins: tuple[int, int] = (0, 0), of: QWidget | None = None
) -> QVBoxLayout:
    """Place items below one another; parameters as in `make_row`."""
    return _fill(QVBoxLayout(of) if of is not None else QVBoxLayout(), items, spacing, margins)


def _fill(box: _Box, items: Iterable[Item], spacing: int, margins: tuple[int, int]) -> _Box:
    box.setSpacing(spacing)
    horizontal, vertical = margins
    box.setContentsMargins(horizontal, vertical, horizontal, vertical)
    for item in items:
        part, stretch = item if isinstance(item, tuple) else (item, 0)
        if isinstance(part, QWidget):
            box.addWidget(part, stretch)
        elif isinstance(part, QLayout):
            box.addLayout(part, stretch)
        else:
            box.addStretch(1)
    return box


def make_form_grid(
    fields: Iterable[tuple[str, QWidget]], *, wide: bool = True, below: Sequence[QWidget] = ()
) -> QGridLayout:
    """Place fields below one another, their names at the left; names are accessible names too.

    Parameters
    ----------
    fields : iterable of (str, QWidget)
    wide : bool
        Fields take all the width; else the width that they need.
    below : sequence of QWidget
        A widget below each field; hidden ones take no room.
    """
    grid = QGridLayout()
    grid.setVerticalSpacing(8)
    grid.setHorizontalSpacing(12)
    for number, (name, field) in enumerate(fields):
        title = label(name)
        title.setBuddy(field)
        field.setAccessibleName(name)
        grid.addWidget(title, 2 * number, 0)
        if wide:
            grid.addWidget(field, 2 * number, 1)
        else:
            grid.addWidget(field, 2 * number, 1, Qt.AlignmentFlag.AlignLeft)
        if below:
            grid.addWidget(below[number], 2 * number + 1, 1)
    grid.setColumnStretch(1, 1)
    return grid


def make_card(title: str, text: str = "") -> tuple[QFrame, QVBoxLayout]:
    """Make a card with a heading and an optional text below it; the layout takes further widgets."""
    card = QFrame()
    card.setProperty("role", "card")
    layout = make_column(label(title, TextRole.HEADING), spacing=12, margins=(16, 16), of=card)
    if text:
        layout.addWidget(label(text, muted=True, wrap=True))
    return card, layout


def make_scroll_area(
    content: QWidget | None = None, *, is_column: bool = True, name: str = ""
) -> QScrollArea:
    """Make a frameless area that scrolls vertically.

    Parameters
    ----------
    content : QWidget, optional
        May be set later.
    is_column : bool
        The area has the background of a card.
    name : str
        Accessible name. An area with a name takes the keyboard focus, so that it can be scrolled by keys;
        content with focusable widgets needs none.
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
