"""What the start page shows, as values."""

from dataclasses import dataclass
from typing import Protocol


@dataclass(frozen=True, slots=True)
class PortChoice:
    """A serial port of this computer."""

    url: str
    description: str = ""


@dataclass(frozen=True, slots=True)
class ProtocolChoice:
    """A device's language."""

    name: str
    title: str
    default_baud: int | None = None
    verified: str = ""
    """Against what it was tested."""


@dataclass(frozen=True, slots=True)
class ConnectForm:
    """What the operator has filled in, as typed."""

    port: str = ""
    protocol: str = ""
    baud: str = ""
    rate_hz: str = ""
    parity: str = "N"
    settings: str = ""
    """The device's own, `KEY=VALUE KEY=VALUE`."""
    relative_port: str = ""
    """Of gauge 2, where each gauge has a device of its own."""


@dataclass(frozen=True, slots=True)
class StartState:
    """The whole page. `busy` says what is being waited for; `connected` what is connected already."""

    all_series: tuple[str, ...]
    series: str
    protocols: tuple[ProtocolChoice, ...] = ()
    ports: tuple[PortChoice, ...] = ()
    form: ConnectForm = ConnectForm()
    form_error: str = ""
    recordings: str = ""
    busy: str = ""
    connected: str = ""

    @property
    def selected_protocol(self) -> ProtocolChoice | None:
        """The protocol that is filled in, if it is one."""
        return next((choice for choice in self.protocols if choice.name == self.form.protocol), None)


class StartEvents(Protocol):
    """What the start page tells its presenter."""

    def set_series(self, code: str) -> None:
        """Series that the simulated stand shall run."""

    def start_simulation(self) -> None:
        """Start the simulated stand and connect to it."""

    def refresh_ports(self) -> None:
        """Look for ports again."""

    def set_form(self, form: ConnectForm) -> None:
        """Take what the operator filled in."""

    def connect(self) -> None:
        """Connect to the amplifier as filled in."""

    def disconnect(self) -> None:
        """Let go of what is connected."""

    def open_run(self, path: str) -> None:
        """Open a run file."""
