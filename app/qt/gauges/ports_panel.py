"""Tab Ports and devices: serial ports, the devices recognised on them, buttons to connect."""

from collections.abc import Callable

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QFrame, QPushButton, QWidget

from app.presenters.gauges.ports import PortsPresenter
from app.presenters.gauges.state import PortCard, PortsState
from app.qt.theme import TextRole
from app.qt.widgets.inputs import CheckBox, make_button
from app.qt.widgets.layouts import STRETCH, make_column, make_row, make_scroll_area
from app.qt.widgets.shortcuts import bind_button
from app.qt.widgets.text import label, set_text_or_hide, set_tool_tip, show_chip
from messages.i18n import N_, gettext

_EMPTY = N_("No serial port is plugged into this computer. Plug the amplifier in, then look again.")
_NOT_LOOKED_AT = N_("Not looked at yet: Look at the ports (F5) listens here, and says what speaks.")


class PortsPanel(QWidget):
    """Draws the list of ports; `chosen` says that one of them was taken."""

    chosen = Signal()

    def __init__(self, presenter: PortsPresenter) -> None:
        super().__init__()
        self._presenter = presenter
        self._shown: tuple[PortCard, ...] | None = None
        self._look = make_button(gettext("Look at the ports"), presenter.probe)
        self._stop = make_button(gettext("Stop looking"), presenter.cancel)
        self._query_silent = CheckBox(gettext("Ask silent devices, too"))
        set_tool_tip(
            self._query_silent,
            gettext("Sends each silent device questions that only read. Without it nothing is sent to any."),
        )
        self._progress = label(muted=True, wrap=True)
        self._message = label(wrap=True)
        self._list = make_scroll_area(name=gettext("Ports of this computer"))
        self._query_silent.clicked.connect(presenter.set_query_silent)
        self._lay_out()

    def show_state(self, state: PortsState) -> None:
        if state.progress and (self._look.hasFocus() or self.focusWidget() is None):
            self._list.setFocus()  # Qt would go on to the button that stops what was just begun
        self._look.setEnabled(not state.progress)
        self._stop.setEnabled(bool(state.progress))
        self._query_silent.setChecked(state.query_silent)
        set_text_or_hide(self._progress, state.progress)
        show_chip(self._message, state.message)
        if state.ports != self._shown:
            self._shown = state.ports
            self._list.setWidget(self._rows(state.ports))

    def focus_found(self) -> None:
        """Focus the first device that was found; the button Look without one."""
        found = self._list.findChildren(QPushButton)
        (found[0] if found else self._look).setFocus()

    def add_keys(self, screen: QWidget) -> None:
        bind_button(self._look, "F5", gettext("Listen on every free port, and say what speaks there"), screen)

    def _rows(self, ports: tuple[PortCard, ...] | None) -> QWidget:
        inside = QWidget()
        cards = ports or ()
        is_pair = sum(card.suggested_form is not None for card in cards) > 1
        rows: list[QWidget] = [self._row(card, is_pair) for card in cards]
        if ports == ():
            rows.append(label(gettext(_EMPTY), TextRole.HEADING, muted=True, wrap=True))
        make_column(*rows, STRETCH, spacing=8, margins=(16, 8), of=inside)
        return inside

    def _row(self, card: PortCard, is_pair: bool) -> QFrame:
        finding = label(role=TextRole.STRONG, wrap=True)
        show_chip(finding, card.status)
        identity = label(card.identity or gettext("No USB device"), muted=True, wrap=True)
        texts = [label(card.url, TextRole.HEADING, wrap=True), identity, finding]
        if not card.status.text:
            texts.append(label(gettext(_NOT_LOOKED_AT), muted=True, wrap=True))
        texts += [label(text, wrap=True) for text in card.description]
        buttons = []
        if card.suggested_form is not None:
            hint = gettext("Fill in the start page for {url}", url=card.url)
            use = make_button(gettext("Use this port"), self._choice(self._presenter.fill_port, card), hint)
            use.setAccessibleName(gettext("Use {url}", url=card.url))
            connect = [] if card.needs_second else [self._connect_button(card)]
            second = [self._second_button(card)] if is_pair else []
            buttons.append(make_column(*connect, use, *second, STRETCH, spacing=6))
        row = QFrame()
        row.setProperty("role", "card")
        make_row((make_column(*texts, spacing=4), 1), *buttons, spacing=6, margins=(12, 12), of=row)
        return row

    def _connect_button(self, card: PortCard) -> QPushButton:
        hint = gettext("Connect to the device on {url} as it was found", url=card.url)
        connect = make_button(
            gettext("Connect"), self._choice(self._presenter.connect, card), hint, primary=True
        )
        connect.setAccessibleName(gettext("Connect to {url}", url=card.url))
        return connect

    def _second_button(self, card: PortCard) -> QPushButton:
        hint = gettext(
            "Gauge 2 has a device of its own on {url}: choose the port of gauge 1 first", url=card.url
        )
        choice = self._choice(self._presenter.fill_second_port, card)
        second = make_button(gettext("Use for gauge 2"), choice, hint)
        second.setAccessibleName(gettext("Use {url} for gauge 2", url=card.url))
        return second

    def _choice(self, choose: Callable[[str], None], card: PortCard) -> Callable[[], None]:
        def act() -> None:
            self.chosen.emit()
            choose(card.url)

        return act

    def _lay_out(self) -> None:
        head = make_row(self._look, self._stop, self._query_silent, STRETCH, spacing=12)
        head.setContentsMargins(16, 8, 16, 0)
        text = make_column(self._progress, self._message, margins=(16, 0))
        make_column(head, text, (self._list, 1), spacing=8, of=self)
