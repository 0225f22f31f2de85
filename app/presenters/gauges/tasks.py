"""Tasks of the Gauges screen; the worker process executes them in `work`."""

import datetime
from dataclasses import dataclass
from typing import Final

from app.acquisition.averaged_counts import AveragedCounts
from app.acquisition.ring import RingRows
from app.presenters.base import LabelledValue
from app.presenters.gauges.state import CalibrationPoint, CheckForm
from app.presenters.worker import LazyFunction
from config.schema import GaugeChecks, Gauges

EXECUTE: Final = LazyFunction("app.presenters.gauges.work", "execute")


@dataclass(frozen=True, slots=True)
class LoadCalibrations:
    """Read the calibrations in use and their checks."""


@dataclass(frozen=True, slots=True)
class ActiveCalibrations:
    """The calibrations in use, their checks and their file; `checks_fault` if the checks cannot be read."""

    gauges: Gauges
    checks: GaugeChecks
    file: str
    checks_fault: str = ""


@dataclass(frozen=True, eq=False, slots=True)
class MeasureHealth:
    """Measure noise, drift and hum of live samples at rest."""

    rows: RingRows
    rate_hz: float
    gauges: Gauges


@dataclass(frozen=True, slots=True)
class FitCalibration:
    """Write the points to a file, then fit a calibration to them."""

    gauge: int
    """0 or 1."""
    points: tuple[CalibrationPoint, ...]
    """In the order in which they were taken."""
    degree: int
    resolution_m: float
    """Of the dial gauge; None: not stated."""
    uncertainty_m: float | None
    file_name: str
    """File of the points, in the folder of settings."""


@dataclass(frozen=True, slots=True)
class SaveCalibration:
    """Write a calibration to a new file; with `use`, activate it."""

    fit: FitCalibration
    use: bool
    day: datetime.date
    valid_until: datetime.date | None = None
    reference: str = ""
    certificate: str = ""
    calibrated_by: str = ""


@dataclass(frozen=True, slots=True)
class SavedCalibration:
    """File of the calibration, and of the previous one if it was replaced."""

    file: str
    previous: str


@dataclass(frozen=True, slots=True)
class CheckGauge:
    """Compare two readings with the known step, and record the outcome."""

    form: CheckForm
    rest: AveragedCounts
    moved: AveragedCounts
    device: str


@dataclass(frozen=True, slots=True)
class CheckOutcome:
    """Outcome of a check, and the file in which it is recorded."""

    passed: bool
    values: tuple[LabelledValue, ...]
    warnings: tuple[str, ...]
    file: str


GaugesTask = LoadCalibrations | MeasureHealth | FitCalibration | SaveCalibration | CheckGauge
