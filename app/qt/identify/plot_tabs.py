"""What the left of Identify draws, a page a tab, with cursors that mouse and keys move on all of them."""

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QStackedWidget

from app.presenters.identify.state import Cursor, Cursors, PlotTab
from app.qt.identify.curve_plots import CurvePlots
from app.qt.identify.motion_plots import MotionTabs, TimePlots
from app.qt.theme import Theme
from app.qt.widgets.shortcuts import describe_shortcut
from messages.i18n import N_, gettext

_NAMES = {
    PlotTab.DISPLACEMENT: N_("Record against simulation, and residual"),
    PlotTab.VELOCITY: N_("Velocities of the fitted motion"),
    PlotTab.ACCELERATION: N_("Accelerations of the fitted motion"),
    PlotTab.RELATIVE: N_("Relative acceleration of the fitted motion"),
    PlotTab.PHASE: N_("Phase plane of the fitted motion"),
}
_READINGS, _MANY_READINGS = 1, 10
"""Which an arrow key moves a cursor by, and one with Shift."""
_KEYS = {Qt.Key.Key_Left: -1, Qt.Key.Key_Right: 1}
_CHOICES = {Qt.Key.Key_A: Cursor.A, Qt.Key.Key_B: Cursor.B}


class PlotTabs(QStackedWidget):
    """One page a `Side`, in their order."""

    cursor_moved = Signal(Cursor, float)
    cursor_stepped = Signal(int)
    cursor_activated = Signal(Cursor)

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self.curves = CurvePlots(theme)
        self.motions = MotionTabs(theme)
        self._pages = dict(zip(PlotTab, (self.curves, *self.motions.widgets), strict=True))
        for side, page in self._pages.items():
            page.setAccessibleName(gettext(_NAMES[side]))
            self.addWidget(page)
            if isinstance(page, CurvePlots | TimePlots):
                page.cursors.moved.connect(self.cursor_moved)
        self.setProperty("role", "plots")
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        describe_shortcut(
            self, "← → A B", gettext("Move a cursor by a reading, with Shift by ten; choose the cursor")
        )

    def show_tab(self, side: PlotTab, cursors: Cursors | None) -> None:
        page = self._pages[side]
        page.cursors.show_cursors(cursors)
        self.setCurrentWidget(page)
        self.setAccessibleName(page.accessibleName())
        self.setAccessibleDescription(_spoken(cursors))

    def span(self) -> tuple[float, float] | None:
        """Times that are in sight (s); None on the phase plane, which has none."""
        page = self.currentWidget()
        return page.span() if isinstance(page, CurvePlots | TimePlots) else None

    def keyPressEvent(self, event: QKeyEvent) -> None:  # noqa: N802
        key = Qt.Key(event.key())
        if key in _KEYS:
            many = event.modifiers() & Qt.KeyboardModifier.ShiftModifier
            self.cursor_stepped.emit(_KEYS[key] * (_MANY_READINGS if many else _READINGS))
        elif key in _CHOICES:
            self.cursor_activated.emit(_CHOICES[key])
        else:
            super().keyPressEvent(event)


def _spoken(cursors: Cursors | None) -> str:
    """What a screen reader says of them."""
    if cursors is None:
        return ""
    return "; ".join([*(" ".join(texts) for texts in cursors.cells), cursors.period])
