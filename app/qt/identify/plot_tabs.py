"""Plots of Identify, a page for each tab, with cursors that mouse and keys move on all of them."""

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QStackedWidget

from app.presenters.identify.state import Cursor, Cursors, Motion, PlotTab
from app.qt.identify.curve_plots import CurvePlots
from app.qt.identify.motion_plots import PhasePlots, TimePlots
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
_TIME_PLOTS = {
    PlotTab.VELOCITY: (
        (
            N_("velocities, mm/s &nbsp; — table u<sub>1</sub>′ &nbsp; - - plate u<sub>2</sub>′"),
            ("channel_1", "channel_2"),
        ),
        (N_("relative velocity u<sub>2</sub>′ − u<sub>1</sub>′, mm/s"), ("text",)),
    ),
    PlotTab.ACCELERATION: (
        (N_("table acceleration u<sub>1</sub>″, m/s²"), ("channel_1",)),
        (N_("plate acceleration u<sub>2</sub>″, m/s²"), ("channel_2",)),
    ),
    PlotTab.RELATIVE: (
        (N_("relative acceleration u<sub>2</sub>″ − u<sub>1</sub>″, m/s²"), ("text",)),
        (N_("relative displacement u<sub>2</sub> − u<sub>1</sub>, mm"), ("channel_2",)),
    ),
}
"""Titles of the plots, and colours of the lines of the tab in the same order."""
_STEP, _LONG_STEP = 1, 10
"""Samples by which an arrow key moves a cursor, and one with Shift."""
_DIRECTIONS = {Qt.Key.Key_Left: -1, Qt.Key.Key_Right: 1}
_CURSOR_KEYS = {Qt.Key.Key_A: Cursor.A, Qt.Key.Key_B: Cursor.B}


class PlotTabs(QStackedWidget):
    """One page for each `PlotTab`."""

    cursor_moved = Signal(Cursor, float)
    cursor_stepped = Signal(int)
    cursor_activated = Signal(Cursor)

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self.curves = CurvePlots(theme)
        self.motions = {
            tab: TimePlots(theme, [(gettext(title), colours) for title, colours in plots])
            for tab, plots in _TIME_PLOTS.items()
        } | {PlotTab.PHASE: PhasePlots(theme)}
        for tab in PlotTab:
            page = self._page(tab)
            page.setAccessibleName(gettext(_NAMES[tab]))
            self.addWidget(page)
            if isinstance(page, CurvePlots | TimePlots):
                page.cursors.moved.connect(self.cursor_moved)
        self.setProperty("role", "plots")
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        describe_shortcut(
            self, "← → A B", gettext("Move a cursor by a reading, with Shift by ten; choose the cursor")
        )

    def show_motion(self, motion: Motion, slips: tuple[tuple[float, float], ...]) -> None:
        for tab, lines in motion.items():
            self.motions[tab].show_lines(lines, slips)

    def show_tab(self, tab: PlotTab, cursors: Cursors | None) -> None:
        page = self._page(tab)
        page.cursors.show_cursors(cursors)
        self.setCurrentWidget(page)
        self.setAccessibleName(page.accessibleName())
        cells = () if cursors is None else (*map(" ".join, cursors.cells), cursors.period)
        self.setAccessibleDescription("; ".join(cells))

    def span(self) -> tuple[float, float] | None:
        """Visible times (s); None on the phase plane."""
        page = self.currentWidget()
        return page.span() if isinstance(page, CurvePlots | TimePlots) else None

    def keyPressEvent(self, event: QKeyEvent) -> None:  # noqa: N802
        key = Qt.Key(event.key())
        if key in _DIRECTIONS:
            is_long = event.modifiers() & Qt.KeyboardModifier.ShiftModifier
            self.cursor_stepped.emit(_DIRECTIONS[key] * (_LONG_STEP if is_long else _STEP))
        elif key in _CURSOR_KEYS:
            self.cursor_activated.emit(_CURSOR_KEYS[key])
        else:
            super().keyPressEvent(event)

    def _page(self, tab: PlotTab) -> CurvePlots | TimePlots | PhasePlots:
        return self.motions.get(tab, self.curves)
