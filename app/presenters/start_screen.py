"""The Start screen: state and presenter. Connects to the simulated stand or an amplifier, or opens a run."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field

from app.acquisition.messages import PortSettings
from app.presenters.base import Presenter
from app.presenters.navigator import ConnectForm, Navigator
from app.presenters.number_text import FormError, parse_number
from drivers.driver import DeviceDriver
from messages.i18n import gettext, translate


@dataclass(frozen=True, slots=True)
class PortChoice:
    url: str
    description: str = ""


@dataclass(frozen=True, slots=True)
class StartState:
    """State of the screen. `busy` names the work in progress, `connected` the connected device.

    `stopped_at` is the time of day of its last sample, if none comes any more.
    """

    all_series: tuple[str, ...]
    series: str
    protocols: tuple[DeviceDriver, ...] = ()
    ports: tuple[PortChoice, ...] = ()
    form: ConnectForm = field(default_factory=ConnectForm)
    form_error: str = ""
    recordings: str = ""
    busy: str = ""
    connected: str = ""
    stopped_at: str = ""

    @property
    def selected_protocol(self) -> DeviceDriver | None:
        return next((choice for choice in self.protocols if choice.name == self.form.protocol), None)


class StartPresenter(Presenter[StartState]):
    """Checks the form, and opens connections and runs; `ports` lists the serial ports of this computer."""

    def __init__(
        self, state: StartState, navigator: Navigator, ports: Callable[[], tuple[PortChoice, ...]]
    ) -> None:
        super().__init__(state)
        self.navigator = navigator
        self._ports = ports

    def set_series(self, code: str) -> None:
        if code in self.state.all_series:
            self._update(series=code)

    def start_simulation(self) -> None:
        if not self.state.busy:
            self.navigator.open_simulated(self.state.series)

    def refresh_ports(self) -> None:
        self._update(ports=self._ports())

    def set_form(self, form: ConnectForm) -> None:
        self._update(form=form, form_error="")

    def connect(self) -> None:
        if self.state.busy:
            return
        try:
            port = port_settings(self.state.form)
        except FormError as error:
            self._update(form_error=translate(error.message))
        else:
            self.navigator.open_port(port)

    def set_busy(self, what: str) -> None:
        self._update(busy=what)

    def set_connected(self, device: str) -> None:
        self._update(connected=device, busy="", stopped_at="")

    def set_stopped(self, stopped_at: str) -> None:
        self._update(stopped_at=stopped_at)


def port_settings(form: ConnectForm) -> PortSettings:
    """Settings of a port. Raises FormError."""
    if not form.port.strip():
        raise FormError("Choose a port, or type one: /dev/ttyUSB0, COM3, socket://host:port")
    return PortSettings(
        url=form.port.strip(),
        protocol=form.protocol,
        baud=_whole(form.baud.strip(), gettext("Baud")),
        parity=form.parity,
        stop_bits=int(form.stop_bits),
        rate_hz=_positive(form.rate_hz.strip(), gettext("Rate")),
        device=_settings(form.settings),
        relative_url=form.relative_port.strip(),
    )


def _settings(text: str) -> dict[str, str]:
    settings = {}
    for pair in text.split():
        key, equals, value = pair.partition("=")
        if not (key and equals):
            raise FormError(
                "Device setting {pair!r} is no KEY=VALUE: write them like map=NAME unit=1", pair=pair
            )
        settings[key] = value
    return settings


def _positive(text: str, name: str) -> float | None:
    value = parse_number(text)
    if value is not None and not (math.isfinite(value) and value > 0.0):
        raise FormError(
            "{name} {text!r} is not a number above 0: write one, or leave it empty", name=name, text=text
        )
    return value


def _whole(text: str, name: str) -> int | None:
    value = _positive(text, name)
    if value is not None and value != int(value):
        raise FormError(
            "{name} {text!r} is not a whole number: write one, or leave it empty", name=name, text=text
        )
    return None if value is None else int(value)
