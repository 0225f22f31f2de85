"""What is higher than its place scrolls; nothing ever scrolls sideways."""

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QFrame, QScrollArea, QWidget


def scrolling(content: QWidget | None = None, *, is_column: bool = True, name: str = "") -> QScrollArea:
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
