"""Work for the Gauges screen, done in a worker's process: one small value says what."""

import datetime
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from app.acquisition.ring import RingRows
from app.presenters.gauges.cards import NAMES
from app.presenters.gauges.state import CalibrationFit, CalibrationPoint, CheckForm, CheckKind, LabelledValue
from app.presenters.number_text import format_fixed, with_minus_sign, with_unit
from app.presenters.worker import ReportProgress
from config.schema import GaugeChecks, Gauges
from messages.i18n import gettext, translate

if TYPE_CHECKING:
    from analysis.calibration.calibrate import Calibration
    from analysis.calibration.known_displacement import DisplacementCheck
    from app.acquisition.gauge_samples import AveragedCounts
    from app.presenters.gauge_health import GaugeHealthState

_ENDS: tuple[Literal["table"], Literal["relative"]] = ("table", "relative")


@dataclass(frozen=True, slots=True)
class LoadCalibrations:
    """Read the calibrations in use, and how they were checked."""


@dataclass(frozen=True, slots=True)
class ActiveCalibrations:
    """What is in use, and where it is kept."""

    gauges: Gauges
    checks: GaugeChecks
    file: str
    checks_fault: str = ""


@dataclass(frozen=True, eq=False, slots=True)
class MeasureHealth:
    """Look at live samples of a stand at rest."""

    rows: RingRows
    rate_hz: float
    gauges: Gauges


@dataclass(frozen=True, slots=True)
class FitCalibration:
    """Make a calibration of readings; they are kept as a file first.

    Attributes
    ----------
    gauge : int
        0 or 1.
    readings : tuple of Reading
        In the order in which they were taken.
    degree : int
    resolution_m, uncertainty_m : float
        Of the dial gauge; None: not stated.
    kept : str
        Name of the file of readings, in the folder of settings.
    """

    gauge: int
    points: tuple[CalibrationPoint, ...]
    degree: int
    resolution_m: float
    uncertainty_m: float | None
    file_name: str


@dataclass(frozen=True, slots=True)
class SaveCalibration:
    """Write the calibration of readings to a new file, and perhaps make it the one in use."""

    fit: FitCalibration
    use: bool
    day: datetime.date
    valid_until: datetime.date | None = None
    reference: str = ""
    certificate: str = ""
    calibrated_by: str = ""


@dataclass(frozen=True, slots=True)
class SavedCalibration:
    """Where a calibration was written, and where the one before it is."""

    file: str
    previous: str


@dataclass(frozen=True, slots=True)
class CheckGauge:
    """Hold two readings against what is known, and keep the verdict.

    Attributes
    ----------
    form : CheckForm
    rest, moved : Average
    device : str
    """

    form: CheckForm
    rest: "AveragedCounts"
    moved: "AveragedCounts"
    device: str


@dataclass(frozen=True, slots=True)
class CheckOutcome:
    """What came of a check."""

    passed: bool
    values: tuple[LabelledValue, ...]
    warnings: tuple[str, ...]
    file: str


GaugesTask = LoadCalibrations | MeasureHealth | FitCalibration | SaveCalibration | CheckGauge


def execute(task: GaugesTask, _report: ReportProgress) -> Any:
    """Do a task. Raises AnalysisError, ConfigError."""
    match task:
        case LoadCalibrations():
            return _load()
        case MeasureHealth():
            return _judge(task)
        case FitCalibration():
            return _describe(_fit(task))
        case SaveCalibration():
            return _save(task)
        case CheckGauge():
            return _check(task)


def _load() -> ActiveCalibrations:
    from config.files import load_checks, load_gauges, settings_file
    from config.schema import ConfigError

    try:
        checks, fault = load_checks(), ""
    except ConfigError as error:
        checks, fault = GaugeChecks(), str(error)
    return ActiveCalibrations(load_gauges(), checks, str(settings_file("gauges.toml")), fault)


def _judge(task: MeasureHealth) -> "tuple[GaugeHealthState, ...]":
    from analysis.gauge_health import measure_health
    from app.acquisition.gauge_samples import samples_from_ring
    from app.presenters.gauge_health import gauge_health_state

    pair = samples_from_ring(task.rows, task.rate_hz, task.gauges)
    return tuple(
        gauge_health_state(name, measure_health(samples)) for name, samples in zip(NAMES, pair, strict=True)
    )


def _fit(task: FitCalibration) -> "Calibration":
    from analysis.calibration.calibrate import DialGauge, calibrate
    from analysis.calibration.points import CalibrationPoints

    counts = [reading.counts for reading in task.points]
    dial_m = [reading.dial_mm * 1e-3 for reading in task.points]
    _keep(task.file_name, counts, dial_m)
    dial = DialGauge(task.resolution_m, task.uncertainty_m)
    return calibrate(CalibrationPoints.from_readings(counts, dial_m), dial, task.degree)


def _keep(name: str, counts: list[float], dial_m: list[float]) -> None:
    """Write the readings, so that they outlive the window. Raises ConfigError."""
    from app.runs.calibration_points import write_points
    from config.files import config_directory
    from config.schema import ConfigError

    path = config_directory() / name
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_points(path, counts, dial_m)
    except OSError as error:
        raise ConfigError(
            f"{path}: cannot be written ({error.strerror}). Check the folder, its rights and its disk"
        ) from None


def _describe(found: "Calibration") -> CalibrationFit:
    gain, zero, merits = found.gain_m_per_count, found.zero_count, found.characteristics
    facts = [
        LabelledValue(gettext("gain"), with_unit(with_minus_sign(f"{gain.value * 1e6:.7g}"), "µm/count")),
        LabelledValue(
            gettext("gain uncertainty"),
            with_unit(f"{found.gain_relative_standard_uncertainty * 100:.2g}", "%"),
        ),
        LabelledValue(gettext("zero"), with_unit(with_minus_sign(f"{zero.value:.9g}"), "counts")),
    ]
    if found.polynomial:
        facts.append(
            LabelledValue(
                gettext("polynomial"), ", ".join(with_minus_sign(f"{term:.3g}") for term in found.polynomial)
            )
        )
    facts += [
        LabelledValue(name, _micrometres(value_m))
        for name, value_m in (
            ("non-linearity", merits.nonlinearity_m),
            ("hysteresis", merits.hysteresis_m),
            ("repeatability", merits.repeatability_m),
            ("zero drift", merits.zero_drift_m),
            ("u of a displacement", found.displacement_standard_uncertainty_m),
        )
    ]
    return CalibrationFit(
        found.points.dial_m * 1e3,
        found.residual_m * 1e6,
        found.points.direction > 0,
        tuple(facts),
        tuple(translate(caution.message) for caution in found.warnings),
    )


def _micrometres(value_m: float | None) -> str:
    if value_m is None or not math.isfinite(value_m):
        return gettext("not known yet")
    return with_unit(format_fixed(value_m * 1e6, 1), "µm")


def _save(task: SaveCalibration) -> SavedCalibration:
    from app.runs.calibration_points import CalibrationDetails, calibrated_gauge
    from config.files import activate_calibration, load_gauges, save_calibration, settings_file

    found = _fit(task.fit)
    base, name = settings_file("gauges.toml"), _ENDS[task.fit.gauge]
    about = CalibrationDetails(
        task.day, task.valid_until, task.reference, task.certificate, task.calibrated_by
    )
    gauge = calibrated_gauge(getattr(load_gauges(base), name), found, about)
    file = save_calibration({name: gauge}, Path(base), task.day)
    before = activate_calibration(file, task.day) if task.use else None
    return SavedCalibration(str(file), str(before) if before else "")


def _check(task: CheckGauge) -> CheckOutcome:
    from app.acquisition.gauge_check import ReferenceStep, check_entry, check_gauge
    from config.files import append_check, load_gauges

    form, name = task.form, _ENDS[task.form.gauge]
    gauge = getattr(load_gauges(), name)
    scale = 1.0 if form.kind is CheckKind.SHUNT_COUNTS else 1e-3
    uncertainty = None if not form.uncertainty else scale * float(form.uncertainty)
    known = ReferenceStep(
        scale * float(form.known),
        uncertainty,
        "count" if form.kind is CheckKind.SHUNT_COUNTS else "m",
        "displacement" if form.kind is CheckKind.DISPLACEMENT else "shunt",
    )
    found = check_gauge(task.rest, task.moved, gauge, known)
    entry = check_entry(
        name, gauge, found, known,
        reference=form.reference, checked_by=form.checked_by, device=task.device,
    )  # fmt: skip
    file = append_check(entry)
    return CheckOutcome(
        found.passed,
        tuple(_check_facts(found)),
        tuple(translate(one.message) for one in found.warnings),
        str(file),
    )


def _check_facts(found: "DisplacementCheck") -> Iterator[LabelledValue]:
    for words, value_m in (
        (gettext("known"), found.expected_m),
        (gettext("measured"), found.measured_m),
        (gettext("off by"), found.deviation_m),
        (gettext("allowed, twice the standard uncertainty"), found.tolerance_m),
    ):
        yield LabelledValue(words, with_unit(format_fixed(value_m * 1e3, 4), "mm"))
    for line in found.budget:
        value = line.standard_uncertainty
        yield LabelledValue(
            translate(line.source.label), gettext("not stated") if math.isnan(value) else _micrometres(value)
        )
