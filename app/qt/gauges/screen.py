"""The Gauges screen: calibrations in use at the left; health, ports and calibrating at the right."""

from functools import partial

from PySide6.QtGui import QResizeEvent, QShowEvent
from PySide6.QtWidgets import QFrame, QHBoxLayout, QStackedWidget, QTabBar, QVBoxLayout, QWidget

from app.presenters.gauges.state import GaugesEvents, GaugesState, GaugesTab
from app.qt.gauges.calibrate_panel import CalibratePanel
from app.qt.gauges.cards import FOCUS_RING, CardsColumn
from app.qt.gauges.check_panel import CheckPanel
from app.qt.gauges.health_panel import HealthPanel
from app.qt.gauges.ports_panel import PortsPanel
from app.qt.theme import Theme
from app.qt.widgets.shortcuts import add_shortcut
from messages.i18n import gettext

_COLUMN_SHARE = 0.27
_COLUMN_WIDTHS = (264, 360)
_KEYS = {
    GaugesTab.HEALTH: "Alt+H",
    GaugesTab.PORTS: "Alt+P",
    GaugesTab.CALIBRATE: "Alt+C",
    GaugesTab.CHECK: "Alt+K",
}


class GaugesScreen(QWidget):
    """Draws `GaugesState`.

    Parameters
    ----------
    theme : Theme
    events : GaugesEvents
        Told what the operator does.
    """

    def __init__(self, theme: Theme, events: GaugesEvents) -> None:
        super().__init__()
        self._events = events
        self._cards = CardsColumn()
        self._tabs = QTabBar()
        self._health = HealthPanel(theme, events.show_start)
        self._ports = PortsPanel(events)
        self._calibrate = CalibratePanel(theme, events)
        self._check = CheckPanel(events)
        self._sides = QStackedWidget()
        self._lay_out()
        self._tabs.currentChanged.connect(lambda index: events.set_tab(list(GaugesTab)[index]))
        self._add_keys()

    def show_state(self, state: GaugesState) -> None:
        """Draw what differs from what is shown."""
        self._tabs.setCurrentIndex(list(GaugesTab).index(state.tab))
        self._sides.setCurrentIndex(self._tabs.currentIndex())
        for part in (self._cards, self._health, self._ports):
            part.show_state(state)
        self._calibrate.show_state(state.calibration)
        self._check.show_state(state.check)

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: N802
        """Give the cards their share of the width."""
        super().resizeEvent(event)
        narrowest, widest = _COLUMN_WIDTHS
        self._cards.setFixedWidth(min(max(round(self.width() * _COLUMN_SHARE), narrowest), widest))

    def showEvent(self, event: QShowEvent) -> None:  # noqa: N802
        """Let the tabs be the first that the keyboard meets."""
        super().showEvent(event)
        self._tabs.setFocus()

    def _add_keys(self) -> None:
        events = self._events
        for side, key in _KEYS.items():
            add_shortcut(self, key, gettext(side.value), partial(events.set_tab, side))
        self._ports.add_keys(self)
        self._calibrate.add_keys(self)
        self._check.add_keys(self)

    def _lay_out(self) -> None:
        card = QFrame()
        card.setProperty("role", "card")
        inside = QVBoxLayout(card)
        inside.setContentsMargins(1, 1, 1, 1)
        for index, (side, key) in enumerate(_KEYS.items()):
            self._tabs.addTab(gettext(side.value))
            self._tabs.setTabToolTip(index, f"{gettext(side.value)} ({key})")
        self._tabs.setDrawBase(False)
        self._tabs.setExpanding(False)
        self._tabs.setAccessibleName(gettext("What is shown of the gauges"))
        for panel in (self._health, self._ports, self._calibrate, self._check):
            self._sides.addWidget(panel)
        inside.addWidget(self._tabs)
        inside.addWidget(self._sides, 1)
        layout = QHBoxLayout(self)
        beside = QVBoxLayout()
        beside.setContentsMargins(0, FOCUS_RING, 0, FOCUS_RING)  # edges in line with those of the cards
        beside.addWidget(card)
        around = 8 - FOCUS_RING
        layout.setContentsMargins(around, around, 8, around)
        layout.setSpacing(4)
        layout.addWidget(self._cards)
        layout.addLayout(beside, 1)
