"""The Gauges screen: calibrations in use at the left; health, ports, calibration and check at the right."""

from functools import partial

from PySide6.QtGui import QResizeEvent, QShowEvent
from PySide6.QtWidgets import QFrame, QStackedWidget, QTabBar, QWidget

from app.presenters.gauges.presenter import GaugesPresenter
from app.presenters.gauges.state import GaugeCard, GaugesState, GaugesTab
from app.qt.gauges.calibrate_panel import CalibratePanel
from app.qt.gauges.check_panel import CheckPanel
from app.qt.gauges.health_panel import HealthPanel
from app.qt.gauges.ports_panel import PortsPanel
from app.qt.theme import TextRole, Theme
from app.qt.widgets.layouts import STRETCH, make_column, make_frame, make_row, make_scroll_area
from app.qt.widgets.shortcuts import add_shortcut
from app.qt.widgets.text import ValueGrid, break_path, label, show_chip
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
    """Draws `GaugesState`."""

    def __init__(self, theme: Theme, presenter: GaugesPresenter) -> None:
        super().__init__()
        self._presenter = presenter
        self._cards = CardsColumn()
        self._tabs = QTabBar()
        self._health = HealthPanel(theme, presenter.navigator.show_start)
        self._ports = PortsPanel(presenter.ports)
        self._calibrate = CalibratePanel(theme, presenter.calibration, presenter.navigator.reconnect)
        self._check = CheckPanel(presenter.check)
        self._pages = QStackedWidget()
        self._lay_out()
        self._tabs.currentChanged.connect(lambda index: presenter.set_tab(list(GaugesTab)[index]))
        self._add_keys()
        presenter.ports.attach(self._ports)
        presenter.calibration.attach(self._calibrate)
        presenter.check.attach(self._check)

    def show_state(self, state: GaugesState) -> None:
        self._tabs.setCurrentIndex(list(GaugesTab).index(state.tab))
        self._pages.setCurrentIndex(self._tabs.currentIndex())
        self._cards.show_state(state)
        self._health.show_state(state)

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: N802
        super().resizeEvent(event)
        narrowest, widest = _COLUMN_WIDTHS
        self._cards.setFixedWidth(min(max(round(self.width() * _COLUMN_SHARE), narrowest), widest))

    def showEvent(self, event: QShowEvent) -> None:  # noqa: N802
        super().showEvent(event)
        self.take_focus()

    def take_focus(self) -> None:
        self._tabs.setFocus()

    def _add_keys(self) -> None:
        for tab, key in _KEYS.items():
            add_shortcut(self, key, gettext(tab.value), partial(self._presenter.set_tab, tab))
        self._ports.add_keys(self)
        self._calibrate.add_keys(self)
        self._check.add_keys(self)

    def _lay_out(self) -> None:
        card = make_frame(self._tabs, (self._pages, 1), spacing=6)
        for index, (tab, key) in enumerate(_KEYS.items()):
            self._tabs.addTab(gettext(tab.value))
            self._tabs.setTabToolTip(index, f"{gettext(tab.value)} ({key})")
        self._tabs.setDrawBase(False)
        self._tabs.setExpanding(False)
        self._tabs.setAccessibleName(gettext("What is shown of the gauges"))
        for panel in (self._health, self._ports, self._calibrate, self._check):
            self._pages.addWidget(panel)
        around = 8 - FOCUS_RING
        beside = make_column(card, margins=(0, FOCUS_RING))  # edges in line with those of the cards
        row = make_row(self._cards, (beside, 1), spacing=4, of=self)
        row.setContentsMargins(around, around, 8, around)


FOCUS_RING = 2  # what is left free around the cards for it (px)


class CardsColumn(QWidget):
    """Both cards under one another, and where the calibrations are kept."""

    def __init__(self) -> None:
        super().__init__()
        self._cards = (_Card(), _Card())
        self._fault = label(wrap=True)
        self._file = label(role=TextRole.LABEL, muted=True, wrap=True)
        inside = QWidget()
        column = make_column(*self._cards, self._fault, self._file, STRETCH, spacing=8, of=inside)
        column.setContentsMargins(FOCUS_RING, FOCUS_RING, 4, FOCUS_RING)
        area = make_scroll_area(inside, is_column=False, name=gettext("Calibrations in use"))
        make_column(area, of=self)

    def show_state(self, state: GaugesState) -> None:
        for shown, card in zip(self._cards, state.cards, strict=True):
            shown.show_card(card)
        show_chip(self._fault, state.checks_fault)
        self._file.setText(gettext("In use: {file}", file=break_path(state.file)) if state.file else "")


class _Card(QFrame):
    def __init__(self) -> None:
        super().__init__()
        self.setProperty("role", "card")
        self._name = label(role=TextRole.HEADING)
        self._standing = label(role=TextRole.STRONG, wrap=True)
        self._facts = ValueGrid()
        self._check = label(wrap=True)
        make_column(
            self._name, self._standing, self._facts, self._check, spacing=8, margins=(16, 12), of=self
        )

    def show_card(self, card: GaugeCard) -> None:
        self._name.setText(card.name)
        show_chip(self._standing, card.validity)
        self._facts.show_values(card.values)
        show_chip(self._check, card.check)
        self.setAccessibleName(f"{card.name}: {card.validity.text}; {card.check.text}")
