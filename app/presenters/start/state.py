"""The Start screen: state and presenter. Connects to the simulated stand or an amplifier, or opens a run."""

from dataclasses import dataclass, field

from app.presenters.navigator import ConnectForm


@dataclass(frozen=True, slots=True)
class PortChoice:
    """A serial port of this computer."""

    url: str
    description: str = ""


@dataclass(frozen=True, slots=True)
class ProtocolChoice:
    """A protocol that devices speak."""

    name: str
    title: str
    default_baud: int | None = None
    verified: str = ""
    """How it was verified."""


@dataclass(frozen=True, slots=True)
class StartState:
    """State of the screen. `busy` names the work in progress, `connected` the connected device."""

    all_series: tuple[str, ...]
    series: str
    protocols: tuple[ProtocolChoice, ...] = ()
    ports: tuple[PortChoice, ...] = ()
    form: ConnectForm = field(default_factory=ConnectForm)
    form_error: str = ""
    recordings: str = ""
    busy: str = ""
    connected: str = ""

    @property
    def selected_protocol(self) -> ProtocolChoice | None:
        """Protocol of the form; None if it is unknown."""
        return next((choice for choice in self.protocols if choice.name == self.form.protocol), None)
