"""The Identify screen: curves at the left, what was found at the right; or what is missing, in words."""

from collections.abc import Callable

from PySide6.QtCore import Qt
from PySide6.QtWidgets import (
    QFrame,
    QHBoxLayout,
    QProgressBar,
    QPushButton,
    QStackedWidget,
    QTabBar,
    QVBoxLayout,
    QWidget,
)

from app.presenters.identify.state import IdentifyEvents, IdentifyState, Motion, Side
from app.presenters.screen import Chip, Progress, Tone
from app.qt.identify.curve_plots import CurvePlots
from app.qt.identify.findings import Findings
from app.qt.identify.motion_plots import PhasePlots, RatesPlots
from app.qt.identify.scan_plot import ScanPlot
from app.qt.theme import Theme, Type
from app.qt.widgets.scrolling import scrolling
from app.qt.widgets.text import label, show_chip

_COLUMN_WIDTH = 384
_VELOCITIES = (
    "velocities, mm/s &nbsp; — table u<sub>1</sub>′ &nbsp; - - plate u<sub>2</sub>′",
    "relative velocity u<sub>2</sub>′ − u<sub>1</sub>′, mm/s",
)
_ACCELERATIONS = (
    "accelerations, m/s² &nbsp; — table u<sub>1</sub>″ &nbsp; - - plate u<sub>2</sub>″",
    "relative acceleration u<sub>2</sub>″ − u<sub>1</sub>″, m/s²",
)


class IdentifyScreen(QWidget):
    """Draws `IdentifyState`.

    Parameters
    ----------
    theme : Theme
    events : IdentifyEvents
        Told what the operator does.
    ask_for_run : callable
        Lets the operator choose a recording.
    """

    def __init__(self, theme: Theme, events: IdentifyEvents, ask_for_run: Callable[[], None]) -> None:
        super().__init__()
        self._title = label(role=Type.HEADING)
        self._title.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self._open = QPushButton("Open another recording")
        self._open.clicked.connect(ask_for_run)
        self._events = events
        self._shown: IdentifyState | None = None
        self._tabs = QTabBar()
        self._sides = QStackedWidget()
        self._curves = CurvePlots(theme)
        self._velocities = RatesPlots(theme, _VELOCITIES, "mm/s")
        self._accelerations = RatesPlots(theme, _ACCELERATIONS, "m/s²")
        self._phase = PhasePlots(theme)
        self._scan = ScanPlot(theme)
        self._column = scrolling()
        self._waiting = _Waiting(events.cancel, ask_for_run)
        self._stack = QStackedWidget()
        self._stack.addWidget(self._waiting)
        self._stack.addWidget(self._filled())
        self._lay_out()
        self._tabs.currentChanged.connect(self._show_side)
        self._scan.friction_set.connect(events.set_friction)
        self._scan.fit_wanted.connect(events.fit_again)

    def show_state(self, state: IdentifyState) -> None:
        """Draw a run, or say why there is none."""
        self._title.setText(state.title or "No recording is open")
        old, self._shown = self._shown, state
        filled = state.curves is not None and state.progress is None
        self._open.setVisible(filled)
        if state.curves is None or not filled:
            self._waiting.show_words(_words(state), state.progress)
            self._stack.setCurrentIndex(0)
            return
        if old is None or state.curves is not old.curves or old.progress is not None:
            self._curves.show_curves(state.curves)
            self._show_motion(state.motion)
            self._scan.show_scan(state.scan)
            self._column.setWidget(Findings(state))
        elif state.hand is not old.hand:
            self._curves.show_hand(state.hand)
            self._scan.show_hand(state.hand)
        self._tabs.setCurrentIndex(list(Side).index(state.side))
        self._sides.setCurrentIndex(self._tabs.currentIndex())
        self._stack.setCurrentIndex(1)

    def _show_motion(self, motion: Motion | None) -> None:
        """Draw what only the fitted motion has; without one its tabs are off."""
        for index in range(1, len(Side)):
            self._tabs.setTabEnabled(index, motion is not None)
        if motion is None:
            return
        self._velocities.show_lines(
            motion.time_s, motion.table_mm_per_s, motion.plate_mm_per_s, motion.relative_mm_per_s
        )
        self._accelerations.show_lines(
            motion.time_s, motion.table_m_per_s2, motion.plate_m_per_s2, motion.relative_m_per_s2
        )
        self._phase.show_motion(motion)

    def _show_side(self, index: int) -> None:
        self._events.show_side(list(Side)[index])

    def _filled(self) -> QWidget:
        card, side, page = QFrame(), QFrame(), QWidget()
        for title in Side:
            self._tabs.addTab(title.value)
        self._tabs.setDrawBase(False)
        self._tabs.setExpanding(False)
        self._tabs.setAccessibleName("What is drawn")
        for plots in (self._curves, self._velocities, self._accelerations, self._phase):
            self._sides.addWidget(plots)
        for frame, parts in ((card, (self._tabs, self._sides)), (side, (self._scan, self._column))):
            frame.setProperty("role", "card")
            inside = QVBoxLayout(frame)
            inside.setContentsMargins(1, 1, 1, 1)
            for part in parts:
                inside.addWidget(part)
        side.setFixedWidth(_COLUMN_WIDTH)
        layout = QHBoxLayout(page)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setSpacing(8)
        layout.addWidget(card, 1)
        layout.addWidget(side)
        return page

    def _lay_out(self) -> None:
        top = QHBoxLayout()
        top.setContentsMargins(4, 0, 0, 0)
        top.addWidget(self._title, 1)
        top.addWidget(self._open)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(8, 8, 8, 8)
        layout.setSpacing(8)
        layout.addLayout(top)
        layout.addWidget(self._stack, 1)


class _Waiting(QFrame):
    """In place of the curves: what goes on, what went wrong, or what will be here."""

    def __init__(self, cancel: Callable[[], None], ask_for_run: Callable[[], None]) -> None:
        super().__init__()
        self.setProperty("role", "card")
        self._words = label(role=Type.HEADING, wrap=True)
        self._words.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self._bar = QProgressBar()
        self._bar.setTextVisible(False)
        self._bar.setFixedWidth(320)
        self._cancel = QPushButton("Cancel")
        self._cancel.clicked.connect(cancel)
        self._open = QPushButton("Open a recording")
        self._open.clicked.connect(ask_for_run)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(24, 24, 24, 24)
        layout.setSpacing(16)
        layout.addStretch(1)
        layout.addWidget(self._words)
        for widget in (self._bar, self._cancel, self._open):
            layout.addWidget(widget, 0, Qt.AlignmentFlag.AlignHCenter)
        layout.addStretch(1)

    def show_words(self, words: Chip, progress: Progress | None) -> None:
        show_chip(self._words, words)
        self._open.setVisible(progress is None)
        self._bar.setVisible(progress is not None)
        self._cancel.setVisible(progress is not None)
        if progress is not None:
            self._bar.setRange(0, 0 if progress.fraction is None else 100)
            self._bar.setValue(round(100 * (progress.fraction or 0.0)))


def _words(state: IdentifyState) -> Chip:
    if state.progress is not None:
        return Chip(state.progress.text)
    if state.failure:
        return Chip(state.failure, Tone.BAD)
    return Chip("Here a recording is compared with its simulation. Record a pullback, or open a recording.")
