"""What the Gauges screen shows, as values."""

from dataclasses import dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from app.presenters.base import EMPTY_CHIP, Chip
from app.presenters.start.state import ConnectForm
from messages.i18n import N_

if TYPE_CHECKING:  # it brings the analysis along, which the start of the window does without
    from app.presenters.gauge_health import GaugeHealthState

Floats = NDArray[np.float64]


class GaugesTab(StrEnum):
    """What the larger part of the screen shows, by the names of its tabs."""

    HEALTH = N_("Health")
    PORTS = N_("Ports and devices")
    CALIBRATE = N_("Calibrate")
    CHECK = N_("Check")


@dataclass(frozen=True, slots=True)
class LabelledValue:
    """A line of a table: what it is, and its value with unit."""

    label: str
    value: str


@dataclass(frozen=True, slots=True)
class GaugeCard:
    """The calibration of one gauge that is in use.

    Attributes
    ----------
    name : str
    standing : Chip
        Whether it holds, or until when.
    facts : tuple of Fact
    check : Chip
        How it was last checked against a known displacement.
    """

    name: str
    validity: Chip
    values: tuple[LabelledValue, ...]
    check: Chip = EMPTY_CHIP


@dataclass(frozen=True, slots=True)
class CalibrationForm:
    """What the operator has filled in, as typed. Lengths in mm."""

    gauge: int = 0
    degree: int = 1
    resolution_mm: str = "0.01"
    uncertainty_mm: str = ""
    reference: str = ""
    certificate: str = ""
    calibrated_by: str = ""
    valid_until: str = ""
    use: bool = True


@dataclass(frozen=True, slots=True)
class CalibrationPoint:
    """Mean counts at what the dial showed (mm)."""

    counts: float
    dial_mm: float


@dataclass(frozen=True, eq=False, slots=True)
class CalibrationFit:
    """What the readings make.

    Attributes
    ----------
    dial_mm, residual_um : (n,) float64
        Dial reading minus curve, in the order in which they were taken.
    upward : (n,) bool
        Taken on the way up.
    facts : tuple of Fact
        Gain, zero, merits and uncertainty.
    cautions : tuple of str
    """

    dial_mm: Floats
    residual_um: Floats
    upward: NDArray[np.bool_]
    values: tuple[LabelledValue, ...]
    warnings: tuple[str, ...]


NO_DEVICE = N_("No samples: connect the device first")


@dataclass(frozen=True, slots=True)
class CalibrationState:
    """The calibration that is being made.

    Attributes
    ----------
    form : CalibrationForm
    live : str
        Mean counts just now; empty without samples.
    live_words : str
        Their noise, or why there are none.
    readings : tuple of Reading
    waiting : str
        Why a reading is not taken yet; empty when none is.
    fitted : FittedCalibration, optional
    message : Chip
        What came of the last action, or is missing.
    can_save : bool
    offers_reconnect : bool
        The device is still read by the calibration before.
    """

    form: CalibrationForm = CalibrationForm()
    live_value: str = ""
    live_note: str = NO_DEVICE
    points: tuple[CalibrationPoint, ...] = ()
    reading_status: str = ""
    fit: CalibrationFit | None = None
    message: Chip = EMPTY_CHIP
    can_save: bool = False
    offers_reconnect: bool = False


class CheckKind(StrEnum):
    """What a gauge is tried with; the value is what is shown."""

    DISPLACEMENT = N_("a displacement, mm")
    SHUNT = N_("a shunt, in mm")
    SHUNT_COUNTS = N_("a shunt, in counts")


@dataclass(frozen=True, slots=True)
class CheckForm:
    """What the operator has filled in about a check, as typed."""

    gauge: int = 0
    kind: CheckKind = CheckKind.DISPLACEMENT
    known: str = ""
    uncertainty: str = ""
    reference: str = ""
    checked_by: str = ""


@dataclass(frozen=True, slots=True)
class CheckState:
    """A gauge tried against what is known, in two readings.

    Attributes
    ----------
    form : CheckForm
    started : bool
        It is under way, so that the form is fixed.
    instruction : str
        What to do now; empty when nothing is.
    waiting : str
        Why a reading is not taken yet; empty when none is.
    verdict : Chip
        What came of it.
    facts : tuple of Fact
        Known, measured, allowed, and what the tolerance is made of.
    cautions : tuple of str
    message : Chip
        What is missing, or went wrong.
    """

    form: CheckForm = field(default_factory=CheckForm)
    is_started: bool = False
    instruction: str = ""
    reading_status: str = ""
    outcome: Chip = EMPTY_CHIP
    values: tuple[LabelledValue, ...] = ()
    warnings: tuple[str, ...] = ()
    message: Chip = EMPTY_CHIP


@dataclass(frozen=True, slots=True)
class PortCard:
    """A port of this computer, and what was found on it.

    Attributes
    ----------
    url : str
    identity : str
        Chip or board, and USB numbers.
    finding : Chip
        What speaks there, or why nobody knows; empty before it was looked at.
    words : tuple of str
        What else is to be known: how it was tested, what stands in the way, remedies.
    suggestion : ConnectForm, optional
        How to record from it.
    """

    url: str
    identity: str = ""
    status: Chip = EMPTY_CHIP
    description: tuple[str, ...] = ()
    suggested_form: ConnectForm | None = None


@dataclass(frozen=True, slots=True)
class GaugesState:
    """The whole screen.

    Attributes
    ----------
    cards : tuple of GaugeCard
        Gauge 1 first.
    file : str
        Where these calibrations are kept.
    side : Side
    device : str
        What is connected; empty when nothing is.
    health : tuple of GaugeHealthState
        Empty as long as nothing is known.
    health_words : str
        Why nothing is known.
    ports : tuple of PortCard
    probing : str
        What is being done on a port; empty when nothing.
    ports_message : Chip
    asks : bool
        Silent devices are asked who they are.
    calibration : CalibrationState
    check : CheckState
    """

    cards: tuple[GaugeCard, ...]
    file: str = ""
    checks_fault: Chip = EMPTY_CHIP
    tab: GaugesTab = GaugesTab.HEALTH
    device: str = ""
    health: "tuple[GaugeHealthState, ...]" = ()
    check: CheckState = field(default_factory=CheckState)
    health_note: str = ""
    ports: tuple[PortCard, ...] = ()
    probing: str = ""
    ports_message: Chip = EMPTY_CHIP
    query_silent: bool = False
    calibration: CalibrationState = field(default_factory=CalibrationState)


class GaugesEvents(Protocol):
    """What the Gauges screen tells its presenter."""

    def set_tab(self, side: GaugesTab) -> None:
        """Show another tab."""

    def show_start(self) -> None:
        """Go where a device is connected."""

    def probe(self) -> None:
        """Look at all ports."""

    def cancel_probe(self) -> None:
        """Stop looking."""

    def set_query_silent(self, asks: bool) -> None:
        """Whether silent devices are asked who they are."""

    def fill_port(self, url: str) -> None:
        """Fill in how to record from a port."""

    def fill_second_port(self, url: str) -> None:
        """Fill in that gauge 2 has a device of its own on a port."""

    def set_calibration_form(self, form: CalibrationForm) -> None:
        """Take what was filled in about the calibration."""

    def set_check_form(self, form: CheckForm) -> None:
        """Take what was filled in about a check."""

    def advance_check(self) -> None:
        """Begin a check, or take the reading that is asked for."""

    def cancel_check(self) -> None:
        """Break the check off."""

    def take_point(self, dial_text: str) -> None:
        """The dial shows this many millimetres."""

    def undo_point(self) -> None:
        """Take the last reading back."""

    def restart_calibration(self) -> None:
        """Begin another calibration."""

    def save_calibration(self) -> None:
        """Keep the calibration as a file."""

    def reconnect(self) -> None:
        """Connect again, by the new calibration."""
