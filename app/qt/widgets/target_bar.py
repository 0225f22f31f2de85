"""A bar that shows how far something is of where it should be, readable from two metres away."""

from PySide6.QtCore import QRectF, QSize, Qt
from PySide6.QtGui import QPainter, QPaintEvent
from PySide6.QtWidgets import QSizePolicy, QWidget

from app.presenters.record.state import PullbackTarget
from app.qt.theme import Theme, colour
from messages.i18n import gettext

_HEIGHT = 40
_RADIUS = 6.0


class TargetBar(QWidget):
    """Fills towards a mark; the fill turns green and the mark is crossed when the target is reached."""

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self._target: PullbackTarget | None = None
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        theme.changed.connect(self.update)

    def sizeHint(self) -> QSize:  # noqa: N802
        """As high as a button."""
        return QSize(240, _HEIGHT)

    def show_target(self, target: PullbackTarget | None) -> None:
        """Show how far it is; None hides the bar."""
        self.setVisible(target is not None)
        if target == self._target:
            return
        self._target = target
        if target is not None:
            self.setAccessibleName(
                gettext("Pulled {now:.1f} of {target:.1f} mm", now=target.now_mm, target=target.target_mm)
            )
        self.update()

    def paintEvent(self, _event: QPaintEvent) -> None:  # noqa: N802
        """Draw ground, fill and mark."""
        if self._target is None:
            return
        tokens = self._theme.tokens
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setPen(Qt.PenStyle.NoPen)
        ground = QRectF(self.rect()).adjusted(0.0, 6.0, 0.0, -6.0)
        painter.setBrush(colour(tokens.line))
        painter.drawRoundedRect(ground, _RADIUS, _RADIUS)
        painter.setClipRect(QRectF(0.0, 0.0, self._x(self._target.now_mm), self.height()))
        painter.setBrush(colour(tokens.ok if self._target.is_reached else tokens.accent))
        painter.drawRoundedRect(ground, _RADIUS, _RADIUS)
        painter.setClipping(False)
        painter.setBrush(colour(tokens.text))
        painter.drawRect(QRectF(self._x(self._target.target_mm) - 1.5, 0.0, 3.0, self.height()))
        painter.end()

    def _x(self, value_mm: float) -> float:
        full_mm = self._target.full_mm if self._target else 1.0
        return min(max(value_mm / full_mm, 0.0), 1.0) * self.width()
