"""What the start page does: checks what was filled in and says where to go."""

import math
from collections.abc import Callable
from typing import Protocol

from app.acquisition.messages import PortSettings
from app.presenters.base import Presenter
from app.presenters.start.state import ConnectForm, PortChoice, StartState
from messages.i18n import gettext


class Navigator(Protocol):
    """Where the start page leads."""

    def open_simulated(self, series: str) -> None:
        """Start the simulated stand and record from it."""

    def open_port(self, port: PortSettings) -> None:
        """Record from an amplifier."""

    def close_connection(self) -> None:
        """Let go of what is connected."""

    def open_run(self, path: str) -> None:
        """Show a recording."""


class StartPresenter(Presenter[StartState]):
    """The first page.

    Parameters
    ----------
    state : StartState
        What can be chosen, and what is chosen at first.
    doors : Doors
    ports : callable
        Lists the serial ports of this computer.
    """

    def __init__(
        self, state: StartState, navigator: Navigator, ports: Callable[[], tuple[PortChoice, ...]]
    ) -> None:
        super().__init__(state)
        self._navigator = navigator
        self._ports = ports

    def set_series(self, code: str) -> None:
        """Series that the simulated stand shall run."""
        if code in self.state.all_series:
            self._update(series=code)

    def start_simulation(self) -> None:
        """Start the simulated stand and connect to it."""
        if not self.state.busy:
            self._navigator.open_simulated(self.state.series)

    def refresh_ports(self) -> None:
        """Look for ports again."""
        self._update(ports=self._ports())

    def set_form(self, form: ConnectForm) -> None:
        """Take what the operator filled in."""
        self._update(form=form, form_error="")

    def connect(self) -> None:
        """Connect to the amplifier as filled in, or say what is wrong with it."""
        if self.state.busy:
            return
        try:
            port = port_settings(self.state.form)
        except ValueError as error:
            self._update(form_error=str(error))
        else:
            self._navigator.open_port(port)

    def disconnect(self) -> None:
        """Let go of what is connected."""
        self._navigator.close_connection()

    def open_run(self, path: str) -> None:
        """Open a run file."""
        if path:
            self._navigator.open_run(path)

    def set_busy(self, what: str) -> None:
        """Say what is being waited for; empty when nothing."""
        self._update(busy=what)

    def set_connected(self, device: str) -> None:
        """Say what is connected; empty when nothing."""
        self._update(connected=device, busy="")


def port_settings(form: ConnectForm) -> PortSettings:
    """Check what was filled in. Raises ValueError that names field, value and remedy."""
    if not form.port.strip():
        raise ValueError(gettext("Choose a port, or type one: /dev/ttyUSB0, COM3, socket://host:port"))
    return PortSettings(
        url=form.port.strip(),
        protocol=form.protocol,
        baud=_whole(form.baud, gettext("Baud")),
        parity=form.parity,
        rate_hz=_number(form.rate_hz, gettext("Rate")),
        device=_settings(form.settings),
        relative_url=form.relative_port.strip(),
    )


def _settings(text: str) -> dict[str, str]:
    settings = {}
    for pair in text.split():
        key, equals, value = pair.partition("=")
        if not (key and equals):
            raise ValueError(
                gettext("Device setting {pair!r} is no KEY=VALUE: write them like map=NAME unit=1", pair=pair)
            )
        settings[key] = value
    return settings


def _whole(text: str, name: str) -> int | None:
    value = _number(text, name)
    if value is not None and value != int(value):
        raise ValueError(
            gettext(
                "{name} {text!r} is not a whole number: write one, or leave it empty",
                name=name,
                text=text.strip(),
            )
        )
    return None if value is None else int(value)


def _number(text: str, name: str) -> float | None:
    """Read a positive number; None where nothing was filled in. A decimal comma is one too."""
    if not text.strip():
        return None
    try:
        value = float(text.strip().replace(",", "."))
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value > 0.0):
        raise ValueError(
            gettext(
                "{name} {text!r} is not a number above 0: write one, or leave it empty",
                name=name,
                text=text.strip(),
            )
        )
    return value
