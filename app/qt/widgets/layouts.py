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

STRETCH: Final = object()  # item of a row or column: empty space that takes what is left
Item: TypeAlias = QWidget | QLayout | tuple[QWidget | QLayout, int] | object
"""A widget or layout, one with its stretch factor, or `STRETCH`."""
_Box = TypeVar("_Box", bound=QBoxLayout)


def make_row(
    *items: Item, spacing: int = 0, margins: tuple[int, int] = (0, 0), of: QWidget | None = None
) -> QHBoxLayout:
    """Place items beside one another; `of` gets the layout.

    `margins` are the pixels at left and right, and at top and bottom.
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

    Fields take all the width, unless `wide` is False. `below` has a widget for each field, placed below it;
    hidden ones take no room.
    """
    grid = QGridLayout()
    grid.setVerticalSpacing(8)
    grid.setHorizontalSpacing(12)
    for number, (name, field) in enumerate(fields):
        title = label(name)
        title.setBuddy(field)
        field.setAccessibleName(name)
        grid.addWidget(title, 2 * number, 0)
        grid.addWidget(field, 2 * number, 1, Qt.AlignmentFlag(0) if wide else Qt.AlignmentFlag.AlignLeft)
        if below:
            grid.addWidget(below[number], 2 * number + 1, 1)
    grid.setColumnStretch(1, 1)
    return grid


def make_card(title: str, text: str = "", *parts: Item) -> tuple[QFrame, QVBoxLayout]:
    """Make a card with a heading, an optional text and items below it; the layout takes further items."""
    card = QFrame()
    card.setProperty("role", "card")
    texts = [label(text, muted=True, wrap=True)] if text else []
    heading = label(title, TextRole.HEADING)
    return card, make_column(heading, *texts, *parts, spacing=12, margins=(16, 16), of=card)


def make_frame(*items: Item, spacing: int = 0) -> QFrame:
    """Make a card whose items reach its border."""
    card = QFrame()
    card.setProperty("role", "card")
    make_column(*items, spacing=spacing, margins=(1, 1), of=card)
    return card


def make_scroll_area(
    content: QWidget | None = None, *, is_column: bool = True, name: str = ""
) -> QScrollArea:
    """Make a frameless area that scrolls vertically.

    With `is_column` it has the background of a card. An area with an accessible name takes the keyboard
    focus, so that it can be scrolled by keys; content with focusable widgets needs none.
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


def clear(layout: QLayout) -> None:
    """Remove and delete the widgets of a layout."""
    while (item := layout.takeAt(0)) is not None:
        if (widget := item.widget()) is not None:
            widget.deleteLater()
