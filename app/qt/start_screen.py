"""View of the Start screen: simulated stand, amplifier and recordings side by side."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

from PySide6.QtCore import Qt
from PySide6.QtGui import QShowEvent
from PySide6.QtWidgets import QApplication, QComboBox, QFrame, QLabel, QLineEdit, QPushButton, QWidget

from app.presenters.base import Chip, Tone
from app.presenters.navigator import ConnectForm
from app.presenters.recent import RUNS_MAX
from app.presenters.start_screen import StartPresenter, StartState
from app.qt.theme import TextRole, set_property
from app.qt.widgets.inputs import ComboBox, make_button, show_default, show_texts
from app.qt.widgets.layouts import (
    STRETCH,
    Item,
    make_card,
    make_column,
    make_form_grid,
    make_row,
    make_scroll_area,
)
from app.qt.widgets.shortcuts import ENTER_KEYS, add_shortcut, bind_button
from app.qt.widgets.text import (
    break_path,
    button_text,
    label,
    padded,
    set_text_or_hide,
    set_tool_tip,
    show_chip,
    tool_tip,
)
from messages.i18n import N_, gettext

_CARD_WIDTHS, _CARD_HEIGHT = (256, 296), 344
_NAME_WIDTH = 200
_PARITIES = {"N": N_("none"), "E": N_("even"), "O": N_("odd")}


class StartScreen(QWidget):
    """Draws `StartState`; `ask_for_run` and `find_amplifier` open dialogs."""

    def __init__(
        self,
        presenter: StartPresenter,
        ask_for_run: Callable[[], None],
        find_amplifier: Callable[[], None] = lambda: None,
    ) -> None:
        super().__init__()
        self._presenter = presenter
        self._series = ComboBox()
        large_button = partial(make_button, large=True)
        self._try = large_button(gettext("Try with the simulated stand"), presenter.start_simulation)
        self._form = _Form(presenter)
        self._last_name = label(role=TextRole.STRONG, wrap=True)
        self._last = make_button(gettext("Connect again"), presenter.connect_last, large=True, primary=True)
        self._find = make_button(gettext("Find my amplifier"), find_amplifier)
        self._connect = large_button(gettext("Connect my amplifier"), presenter.connect)
        self._verified = label(muted=True, wrap=True)
        self._error = label(wrap=True)
        self._open = large_button(gettext("Open a recording"), ask_for_run)
        self._folder = label(muted=True, wrap=True)
        self._runs = _RecentRuns(presenter.open_run)
        self._status = label(role=TextRole.HEADING)
        self._disconnect = large_button(gettext("Disconnect"), presenter.navigator.close_connection)
        self._series.activated.connect(lambda _: presenter.set_series(self._series.currentText()))
        self._lay_out()
        for button, keys, words in (
            (self._try, "Alt+S", gettext("Start the simulated stand and connect to it")),
            (self._last, "Alt+A", gettext("Connect to the amplifier that was connected last")),
            (self._find, "Alt+F", gettext("Look at every free port for a device that is known")),
            (self._connect, "Alt+C", gettext("Connect to the amplifier as filled in")),
            (self._disconnect, "Alt+D", gettext("Let go of the device")),
        ):
            bind_button(button, keys, words, self)
        set_tool_tip(self._open, gettext("Open a recording") + " (Ctrl+O)")
        add_shortcut(self, ENTER_KEYS, "", self._press_primary)

    def show_state(self, state: StartState) -> None:
        if self._series.count() != len(state.all_series):
            self._series.addItems(state.all_series)
        self._series.setCurrentText(state.series)
        self._form.show_form(state)
        verified = state.selected_protocol.say_verified(gettext) if state.selected_protocol else ""
        self._verified.setText(verified[:1].upper() + verified[1:])
        show_chip(self._error, Chip(state.form_error, Tone.BAD))
        self._folder.setText(gettext("Runs are stored in {folder}", folder=break_path(state.recordings)))
        show_chip(self._status, _connection_chip(state))
        self._disconnect.setVisible(bool(state.connected))
        set_text_or_hide(self._last_name, state.last_device)
        self._last.setVisible(bool(state.last_device))
        self._runs.show_runs(state.runs)
        for button in (self._try, self._last, self._connect):
            button.setEnabled(not state.busy)
        likely = None if state.connected else self._last if state.last_device else self._try
        for button in (self._try, self._last):
            set_property(button, "primary", "true" if button is likely else "false")

    def showEvent(self, event: QShowEvent) -> None:  # noqa: N802
        super().showEvent(event)
        self._presenter.refresh()

    def _press_primary(self) -> None:
        """Connect as the fields in use say, else as at the last start, else to the simulated stand."""
        state, focused = self._presenter.state, QApplication.focusWidget()
        if focused is not None and self._form.isAncestorOf(focused):
            self._connect.click()
        elif focused is self._series or not (state.connected or state.last_device):
            self._try.click()
        elif not state.connected:
            self._last.click()

    def _lay_out(self) -> None:
        cards = make_row(
            STRETCH,
            (self._simulated_card(), 100),
            (self._amplifier_card(), 100),
            (self._recording_card(), 100),
            STRETCH,
            spacing=16,
        )
        cards.addStrut(_CARD_HEIGHT)
        motto = gettext("Pull the table back, let go, read the friction coefficient.")
        title = _centred("Slipstand", TextRole.NUMBER)
        status = make_row(STRETCH, self._status, self._disconnect, STRETCH, spacing=12)
        page = QWidget()
        layout = make_column(STRETCH, title, spacing=12, margins=(24, 16), of=page)
        layout.addWidget(_centred(motto, TextRole.HEADING))
        layout.addSpacing(4)
        layout.addLayout(cards)
        layout.addLayout(status)
        layout.addStretch(2)
        make_column(make_scroll_area(page, is_column=False), of=self)

    def _simulated_card(self) -> QFrame:
        hint = gettext("No amplifier needed: a stand is simulated and read through a port like a real one.")
        series = make_form_grid([(gettext("Series"), self._series)])
        self._series.setAccessibleName(gettext("Series of the simulated stand"))
        return _card(gettext("Simulated stand"), hint, series, self._try, STRETCH)

    def _amplifier_card(self) -> QFrame:
        hint = gettext("Both gauges, read through a serial port or the network.")
        last = make_column(self._last_name, self._last, spacing=6)
        parts = (last, self._find, self._form, self._verified, self._error, self._connect, STRETCH)
        return _card(gettext("My amplifier"), hint, *parts)

    def _recording_card(self) -> QFrame:
        hint = gettext("Look at a run again: record against simulation, and what was found.")
        return _card(gettext("Recordings"), hint, self._folder, self._open, self._runs, STRETCH)


class _RecentRuns(QWidget):
    """Buttons of the runs that were recorded or opened last."""

    def __init__(self, open_run: Callable[[str], None]) -> None:
        super().__init__()
        self._open_run = open_run
        self._paths: tuple[str, ...] = ()
        self._buttons = [make_button("", partial(self._open, number)) for number in range(RUNS_MAX)]
        for button in self._buttons:
            button.setProperty("role", "row")
        make_column(label(gettext("Recent runs"), TextRole.STRONG), *self._buttons, spacing=2, of=self)

    def show_runs(self, paths: tuple[str, ...]) -> None:
        self._paths = paths
        self.setVisible(bool(paths))
        for button, path in zip(self._buttons, padded(paths, RUNS_MAX, ""), strict=True):
            name, metrics = Path(path).stem, button.fontMetrics()
            elided = metrics.elidedText(name, Qt.TextElideMode.ElideMiddle, _NAME_WIDTH)
            button.setText(button_text(elided))
            button.setAccessibleName(gettext("Open {name}", name=name))
            set_tool_tip(button, path)
            button.setVisible(bool(path))

    def _open(self, number: int) -> None:
        self._open_run(self._paths[number])


class _Form(QWidget):
    """Port, protocol, baud, rate; parity, stop bits, settings and a second port are folded away."""

    def __init__(self, presenter: StartPresenter) -> None:
        super().__init__()
        self._port = ComboBox()
        self._port.setEditable(True)
        self._port.setPlaceholderText(gettext("No port found: write one"))
        self._protocol = ComboBox()
        self._parity = ComboBox()
        self._parity.addItems([gettext(words) for words in _PARITIES.values()])
        self._stop_bits = ComboBox()
        self._stop_bits.addItems(["1", "2"])
        self._fields = {name: QLineEdit() for name in ("baud", "rate_hz", "settings", "relative_port")}
        show_default(self._fields["rate_hz"], gettext("as the device is set"))
        self._fields["settings"].setPlaceholderText("KEY=VALUE KEY=VALUE")
        self._fields["relative_port"].setPlaceholderText(gettext("if it has a device of its own"))
        self._more = QPushButton(gettext("More settings"))
        self._more.setCheckable(True)
        self._more.toggled.connect(self._show_rare)
        self._rare = QWidget()
        self._lay_out()
        bind_button(
            self._more,
            "Alt+M",
            gettext("Parity, stop bits, the device's own settings, a second device"),
            self,
        )
        edits = [field.textEdited for field in self._fields.values()]
        for edited in (
            self._port.currentTextChanged,
            self._protocol.activated,
            self._parity.activated,
            self._stop_bits.activated,
            *edits,
        ):
            edited.connect(lambda _: presenter.set_form(self._read()))

    def show_form(self, state: StartState) -> None:
        self._port.blockSignals(True)
        _refill(self._port, [(port.url, port.description) for port in state.ports])
        self._port.setCurrentText(state.form.port)
        self._port.blockSignals(False)
        _refill(self._protocol, [(choice.name, choice.title) for choice in state.protocols])
        self._protocol.setCurrentText(state.form.protocol)
        form = state.form
        show_texts(self._fields, form)
        self._parity.setCurrentIndex(list(_PARITIES).index(form.parity))
        self._stop_bits.setCurrentText(form.stop_bits)
        has_rare = form.settings or form.relative_port or (form.parity, form.stop_bits) != ("N", "1")
        if has_rare and form != state.last_form:  # those of the last device need not be looked at
            self._more.setChecked(True)
        usual = state.selected_protocol.default_baud if state.selected_protocol else None
        show_default(self._fields["baud"], f"{usual}" if usual else gettext("the protocol's usual one"))

    def _read(self) -> ConnectForm:
        return ConnectForm(
            port=self._port.currentText(),
            protocol=self._protocol.currentText(),
            parity=list(_PARITIES)[self._parity.currentIndex()],
            stop_bits=self._stop_bits.currentText(),
            **{name: field.text() for name, field in self._fields.items()},
        )

    def _show_rare(self, shown: bool) -> None:
        self._rare.setVisible(shown)
        self._more.setText(gettext("Fewer settings") if shown else gettext("More settings"))

    def _lay_out(self) -> None:
        usual = make_form_grid(
            [
                (gettext("Port"), self._port),
                (gettext("Protocol"), self._protocol),
                (gettext("Baud"), self._fields["baud"]),
                (gettext("Rate, Hz"), self._fields["rate_hz"]),
            ]
        )
        rare = make_form_grid(
            [
                (gettext("Parity"), self._parity),
                (gettext("Stop bits"), self._stop_bits),
                (gettext("Settings"), self._fields["settings"]),
                (gettext("Port 2"), self._fields["relative_port"]),
            ]
        )
        self._fields["relative_port"].setAccessibleName(gettext("Port of gauge 2"))
        hint = gettext("Port of gauge 2, where each gauge has a device and a port of its own")
        set_tool_tip(self._fields["relative_port"], hint)
        rare.setContentsMargins(0, 0, 0, 0)
        self._rare.setLayout(rare)
        self._rare.hide()
        make_column(usual, self._rare, make_row(self._more, STRETCH), spacing=8, of=self)


def _connection_chip(state: StartState) -> Chip:
    if state.busy or not state.connected:
        return Chip(state.busy)
    if state.stopped_at:
        text = gettext("{device}: no samples since {time}", device=state.connected, time=state.stopped_at)
        return Chip(text, Tone.BAD)
    return Chip(gettext("Connected: {device}", device=state.connected))


def _refill(box: QComboBox, items: list[tuple[str, str]]) -> None:
    if [box.itemText(i) for i in range(box.count())] == [text for text, _ in items]:
        return
    box.clear()
    for index, (text, hint) in enumerate(items):
        box.addItem(text)
        box.setItemData(index, tool_tip(hint), Qt.ItemDataRole.ToolTipRole)


def _card(title: str, hint: str, *parts: Item) -> QFrame:
    card, _ = make_card(title, hint, *parts)
    card.setMinimumWidth(_CARD_WIDTHS[0])
    card.setMaximumWidth(_CARD_WIDTHS[1])
    return card


def _centred(text: str, role: TextRole) -> QLabel:
    made = label(text, role, muted=role is TextRole.HEADING)
    made.setAlignment(Qt.AlignmentFlag.AlignCenter)
    return made
