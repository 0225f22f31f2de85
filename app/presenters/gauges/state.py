"""State of the Gauges screen, and the forms of its tabs."""

from dataclasses import dataclass
from enum import StrEnum
from typing import Final

import numpy as np
from numpy.typing import NDArray

from app.presenters.base import EMPTY_CHIP, Chip, LabelledValue
from app.presenters.gauge_health_state import GaugeHealthState
from app.presenters.navigator import ConnectForm
from config.schema import FilterKind, GaugeChecks, Gauges
from messages.i18n import N_

Floats = NDArray[np.float64]
NAMES: Final = (N_("Gauge 1, table"), N_("Gauge 2, relative"))
NO_DEVICE: Final = N_("No samples: connect the device first")
CONNECTION_LOST: Final = N_("The connection is gone: the reading was not taken")
DEVICE_LOST: Final = N_("No sample came after {time}: the reading was not taken")
NO_SAMPLES: Final = N_("No sample has come since {time}: look at device and cable")


class GaugesTab(StrEnum):
    """Tabs of the screen; the value is the title."""

    HEALTH = N_("Health")
    PORTS = N_("Ports and devices")
    CALIBRATE = N_("Calibrate")
    CHECK = N_("Check")


@dataclass(frozen=True, slots=True)
class GaugeCard:
    """The calibration in use of one gauge."""

    name: str
    validity: Chip
    values: tuple[LabelledValue, ...]
    check: Chip = EMPTY_CHIP  # outcome of the last check against a known displacement


@dataclass(frozen=True, slots=True)
class GaugesState:
    """State of the screen, apart from the tabs that have a presenter of their own."""

    cards: tuple[GaugeCard, ...]
    file: str = ""
    checks_fault: Chip = EMPTY_CHIP
    tab: GaugesTab = GaugesTab.HEALTH
    device: str = ""
    health: tuple[GaugeHealthState, ...] = ()  # empty while nothing is known
    health_note: str = ""
    stopped_at: str = ""
    """Time of day of the last sample, if none comes any more; `health` is of then."""


@dataclass(frozen=True, slots=True)
class ActiveCalibrations:
    """The calibrations in use, their checks and their file; `checks_fault` if the checks cannot be read."""

    gauges: Gauges
    checks: GaugeChecks
    file: str
    checks_fault: str = ""


@dataclass(frozen=True, slots=True)
class PortCard:
    """A serial port of this computer."""

    url: str
    identity: str = ""  # USB chip or board, and USB numbers
    status: Chip = EMPTY_CHIP
    """The device that was recognised, or why none was; empty before the port is probed."""
    description: tuple[str, ...] = ()  # how the device was verified, problems and remedies
    suggested_form: ConnectForm | None = None  # form of the Start screen that connects to the device
    needs_second: bool = False
    """The device reads one gauge: the form lacks the port of gauge 2."""


@dataclass(frozen=True, slots=True)
class PortsState:
    """State of the tab Ports and devices."""

    ports: tuple[PortCard, ...] | None = None  # until they were listed
    progress: str = ""
    message: Chip = EMPTY_CHIP
    query_silent: bool = False  # whether the probe sends identification requests to silent devices


@dataclass(frozen=True, slots=True)
class CalibrationForm:
    """Fields of a calibration, as typed. Lengths in mm."""

    gauge: int = 0
    degree: int = 1
    resolution_mm: str = "0.01"
    uncertainty_mm: str = ""
    reference: str = ""
    certificate: str = ""
    calibrated_by: str = ""
    valid_until: str = ""
    filter_kind: FilterKind | None = None  # None keeps the filter as it was
    filter_order: str = ""
    filter_corner_hz: str = ""
    use: bool = True


@dataclass(frozen=True, slots=True)
class CalibrationPoint:
    """Mean counts at a dial reading (mm)."""

    counts: float
    dial_mm: float


@dataclass(frozen=True, slots=True)
class CalibrationData:
    """What a calibration is fitted to, and how."""

    points: tuple[CalibrationPoint, ...]
    degree: int
    resolution_m: float
    uncertainty_m: float | None  # of the dial gauge; None where it is not stated
    file_name: str


@dataclass(frozen=True, eq=False, slots=True)
class CalibrationFit:
    """Curve fitted to the points."""

    dial_mm: Floats  # (n,) float64: dial reading, and dial reading minus curve, in the order of the points
    residual_um: Floats
    upward: NDArray[np.bool_]  # (n,) bool: whether the dial was rising
    values: tuple[LabelledValue, ...]
    warnings: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class CalibrationState:
    """State of the tab Calibrate."""

    form: CalibrationForm = CalibrationForm()
    live_value: str = ""
    live_note: str = ""  # noise of the counts, or why there are none
    stopped_at: str = ""
    """Time of day of the last sample, if none comes any more; `live_value` is of then."""
    points: tuple[CalibrationPoint, ...] = ()
    reading_status: str = ""  # progress of the reading being averaged; empty while none is
    fit: CalibrationFit | None = None
    message: Chip = EMPTY_CHIP
    can_save: bool = False
    offers_reconnect: bool = False  # whether the device is still read with the previous calibration


class CheckKind(StrEnum):
    """Reference of a check; the value is the label."""

    DISPLACEMENT = N_("a displacement, mm")
    SHUNT = N_("a shunt, in mm")
    SHUNT_COUNTS = N_("a shunt, in counts")


@dataclass(frozen=True, slots=True)
class CheckForm:
    """Fields of a check, as typed."""

    gauge: int = 0
    kind: CheckKind = CheckKind.DISPLACEMENT
    known: str = ""
    uncertainty: str = ""
    reference: str = ""
    checked_by: str = ""


@dataclass(frozen=True, slots=True)
class CheckOutcome:
    """Outcome of a check, and the file in which it is recorded."""

    passed: bool
    values: tuple[LabelledValue, ...]
    warnings: tuple[str, ...]
    file: str


@dataclass(frozen=True, slots=True)
class CheckState:
    """State of the tab Check: a gauge compared with a known step, in two readings."""

    form: CheckForm = CheckForm()
    is_started: bool = False  # whether a check is under way, which locks the form
    instruction: str = ""
    stopped_at: str = ""
    """Time of day of the last sample, if none comes any more."""
    reading_status: str = ""  # progress of the reading being averaged; empty while none is
    outcome: Chip = EMPTY_CHIP
    values: tuple[LabelledValue, ...] = ()
    """Known and measured step, tolerance, and the budget of the tolerance."""
    warnings: tuple[str, ...] = ()
    message: Chip = EMPTY_CHIP
