"""What the Simulated stand screen shows, as values."""

from dataclasses import dataclass
from typing import Protocol

from app.presenters.base import EMPTY_CHIP, Chip
from app.presenters.gauges.state import LabelledValue


@dataclass(frozen=True, slots=True)
class StandForm:
    """What the operator has filled in, as typed; an empty field takes what is usual."""

    series: str
    friction: str = ""
    tilt_mrad: str = ""
    noise_um: str = ""
    rate_hz: str = ""
    drop_percent: str = ""
    flip_percent: str = ""


@dataclass(frozen=True, slots=True)
class StandState:
    """The whole screen.

    Attributes
    ----------
    all_series : tuple of str
    form : StandForm
    usual : StandForm
        What an empty field stands for.
    runs : bool
        The simulated stand is what is connected.
    seconds : str
        How long a fault lasts, as typed.
    truth : tuple of Fact
        Of the stand that runs.
    happened : tuple of str
        Faults on demand, the newest first.
    message : Chip
        What is wrong with what was filled in or asked for.
    """

    all_series: tuple[str, ...]
    form: StandForm
    defaults: StandForm
    is_running: bool = False
    fault_duration_s: str = "2"
    truth: tuple[LabelledValue, ...] = ()
    disturbances: tuple[str, ...] = ()
    message: Chip = EMPTY_CHIP


class StandEvents(Protocol):
    """What the Simulated stand screen tells its presenter."""

    def set_form(self, form: StandForm) -> None:
        """Take what was filled in."""

    def start(self) -> None:
        """Start a stand that is so, and connect to it."""

    def set_fault_duration(self, seconds: str) -> None:
        """How long the next fault lasts."""

    def inject_fault(self, kind: str) -> None:
        """Let a fault happen now."""
