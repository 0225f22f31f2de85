"""The Simulated stand screen: state and presenter. Options before the start, faults and truth after it."""

from dataclasses import dataclass

from app.presenters.base import EMPTY_CHIP, Chip
from app.presenters.gauges.state import LabelledValue


@dataclass(frozen=True, slots=True)
class StandForm:
    """Options as typed; an empty field takes the default."""

    series: str
    friction: str = ""
    tilt_mrad: str = ""
    noise_um: str = ""
    rate_hz: str = ""
    drop_percent: str = ""
    flip_percent: str = ""


@dataclass(frozen=True, slots=True)
class StandState:
    """State of the screen.

    Attributes
    ----------
    all_series : tuple of str
    form : StandForm
    defaults : StandForm
    is_running : bool
        Whether the simulated stand is connected.
    fault_duration_s : str
        Duration of the next fault, as typed.
    truth : tuple of LabelledValue
        True parameters of the running stand.
    disturbances : tuple of str
        Injected faults, the newest first.
    message : Chip
        What is wrong with the last input.
    """

    all_series: tuple[str, ...]
    form: StandForm
    defaults: StandForm
    is_running: bool = False
    fault_duration_s: str = "2"
    truth: tuple[LabelledValue, ...] = ()
    disturbances: tuple[str, ...] = ()
    message: Chip = EMPTY_CHIP
