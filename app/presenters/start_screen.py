"""The Start screen: state and presenter. Connects to the simulated stand or an amplifier, or opens a run."""

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, replace

from app.acquisition.messages import PortSettings
from app.presenters.base import Presenter
from app.presenters.navigator import ConnectForm, Navigator
from app.presenters.number_text import FormError, parse_number
from app.presenters.recent import RecentItems
from config.schema import RecentDevice
from drivers.driver import DeviceDriver
from messages.i18n import gettext, translate


@dataclass(frozen=True, slots=True)
class PortChoice:
    url: str
    description: str = ""
    usb: str = ""
    """USB numbers, which stay where the name changes; empty for other ports."""


@dataclass(frozen=True, slots=True)
class StartState:
    """State of the screen. `busy` names the work in progress, `connected` the connected device.

    `stopped_at` is the time of day of its last sample, if none comes any more.
    `last_device` is name and port of the amplifier that was connected last, `runs` the paths of recent runs.
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
    last_device: str = ""
    last_form: ConnectForm | None = None
    """Form that connects to the last amplifier."""
    runs: tuple[str, ...] = ()

    @property
    def selected_protocol(self) -> DeviceDriver | None:
        return next((choice for choice in self.protocols if choice.name == self.form.protocol), None)


class StartPresenter(Presenter[StartState]):
    """Checks the form, and opens connections and runs; `ports` lists the serial ports of this computer."""

    def __init__(
        self,
        state: StartState,
        navigator: Navigator,
        ports: Callable[[], tuple[PortChoice, ...]],
        recent: RecentItems | None = None,
    ) -> None:
        self._recent = recent or RecentItems()
        if self._recent.device is not None:
            state = replace(state, form=_recent_form(self._recent.device))
        super().__init__(state)
        self.navigator = navigator
        self._ports = ports
        self._show_recent()

    def set_series(self, code: str) -> None:
        if code in self.state.all_series:
            self._update(series=code)

    def start_simulation(self) -> None:
        if not self.state.busy:
            self.navigator.open_simulated(self.state.series)

    def refresh(self) -> None:
        """List ports and recent items anew."""
        self._update(ports=self._ports())
        self._show_recent()

    def open_run(self, path: str) -> None:
        self.navigator.open_run(path)

    def connect_last(self) -> None:
        """Connect the last amplifier, also where its USB port has another name now."""
        device = self._recent.device
        if device is not None:
            form = _recent_form(device)
            self.set_form(replace(form, port=_present_port(device, self._ports())))
            self.connect()

    def remember_device(self, name: str, port: PortSettings) -> None:
        """Keep what is connected now as the last amplifier."""
        usb = next((choice.usb for choice in self.state.ports if choice.url == port.url), "")
        self._recent.set_device(RecentDevice(name=name, usb=usb, **asdict(connect_form(port))))
        self._show_recent()

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

    def _show_recent(self) -> None:
        device, runs = self._recent.device, self._recent.runs
        if device is None:
            self._update(last_device="", last_form=None, runs=runs)
            return
        last = gettext("{device} on {port}", device=device.name, port=device.port)
        self._update(last_device=last, last_form=_recent_form(device), runs=runs)


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


def connect_form(port: PortSettings) -> ConnectForm:
    """Form that `port_settings` reads as these settings."""
    return ConnectForm(
        port=port.url,
        protocol=port.protocol,
        baud="" if port.baud is None else str(port.baud),
        rate_hz="" if port.rate_hz is None else repr(port.rate_hz),
        parity=port.parity or "N",
        stop_bits=str(port.stop_bits or 1),
        settings=" ".join(f"{key}={value}" for key, value in port.device.items()),
        relative_port=port.relative_url,
    )


def _recent_form(device: RecentDevice) -> ConnectForm:
    return ConnectForm(**{name: getattr(device, name) for name in ConnectForm.__dataclass_fields__})


def _present_port(device: RecentDevice, ports: Sequence[PortChoice]) -> str:
    """Address of the port of a device now: where its adapter is another one by name, if only one is alike."""
    alike = [port.url for port in ports if port.usb and port.usb == device.usb]
    return alike[0] if len(alike) == 1 else device.port


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
