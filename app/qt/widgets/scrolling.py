"""What is higher than its place scrolls; nothing ever scrolls sideways."""

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QFrame, QScrollArea, QWidget


def scrolling(content: QWidget | None = None, *, is_column: bool = True) -> QScrollArea:
    """A frameless area as wide as `content`, which may be set later; a column has the ground of a card."""
    area = QScrollArea()
    if is_column:
        area.setProperty("role", "column")
    area.setFrameShape(QFrame.Shape.NoFrame)
    area.setWidgetResizable(True)
    area.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
    if content is not None:
        area.setWidget(content)
    return area
