"""A box to tick, whose state shows by a drawn mark (a style sheet can only take one from a file)."""

from PySide6.QtCore import QPointF, Qt
from PySide6.QtGui import QPainter, QPaintEvent, QPalette, QPen
from PySide6.QtWidgets import QCheckBox, QStyle, QStyleOptionButton

_MARK = ((0.22, 0.52), (0.42, 0.72), (0.78, 0.30))
"""Corners of the mark, in parts of the box."""


class Tick(QCheckBox):
    """A `QCheckBox` with a check mark in it when ticked: colour alone would say nothing to many."""

    def paintEvent(self, event: QPaintEvent) -> None:  # noqa: N802
        """Draw the box and its words, then the mark over it."""
        super().paintEvent(event)
        if not self.isChecked():
            return
        option = QStyleOptionButton()
        self.initStyleOption(option)
        box = self.style().subElementRect(QStyle.SubElement.SE_CheckBoxIndicator, option, self)
        enabled = self.isEnabled()
        group = QPalette.ColorGroup.Active if enabled else QPalette.ColorGroup.Disabled
        role = QPalette.ColorRole.HighlightedText if enabled else QPalette.ColorRole.Text
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setPen(QPen(self.palette().color(group, role), 2.0, Qt.PenStyle.SolidLine))
        painter.drawPolyline(
            [QPointF(box.x() + x * box.width(), box.y() + y * box.height()) for x, y in _MARK]
        )
        painter.end()
