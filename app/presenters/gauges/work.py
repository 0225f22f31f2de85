"""Tasks of the Gauges screen, executed in its worker process."""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final, Literal

from analysis.calibration.calibrate import Calibration, DialGauge, calibrate
from analysis.calibration.known_displacement import DisplacementCheck
from analysis.calibration.points import CalibrationPoints
from analysis.catalogue import MICROMETRE, MILLIMETRE
from analysis.formatting import typeset, with_unit
from analysis.gauge_health import measure_health
from app.acquisition.gauge_check import ReferenceStep, check_entry, check_gauge
from app.acquisition.gauge_samples import gauge_samples
from app.presenters.base import LabelledValue, ReportProgress
from app.presenters.gauge_health import GaugeHealthState, gauge_health_state
from app.presenters.gauges.state import NAMES, CalibrationFit, CheckKind
from app.presenters.gauges.tasks import (
    ActiveCalibrations,
    CheckGauge,
    CheckOutcome,
    FitCalibration,
    GaugesTask,
    LoadCalibrations,
    MeasureHealth,
    SaveCalibration,
    SavedCalibration,
)
from app.presenters.number_text import format_in
from app.runs.calibration_points import CalibrationDetails, calibrated_gauge, write_points
from config.files import (
    activate_calibration,
    append_check,
    config_directory,
    load_checks,
    load_gauges,
    save_calibration,
    settings_file,
)
from config.schema import ConfigError, GaugeChecks
from messages.i18n import gettext, translate

_GAUGES: Final[tuple[Literal["table"], Literal["relative"]]] = ("table", "relative")


def execute(task: GaugesTask, _report: ReportProgress) -> Any:
    """Execute a task. Raises AnalysisError, ConfigError."""
    match task:
        case LoadCalibrations():
            return _load_calibrations()
        case MeasureHealth():
            return _measure_health(task)
        case FitCalibration():
            return _calibration_fit(_fit(task))
        case SaveCalibration():
            return _save_calibration(task)
        case CheckGauge():
            return _check_gauge(task)


def _load_calibrations() -> ActiveCalibrations:
    try:
        checks, fault = load_checks(), ""
    except ConfigError as error:
        checks, fault = GaugeChecks(), str(error)
    return ActiveCalibrations(load_gauges(), checks, str(settings_file("gauges.toml")), fault)


def _measure_health(task: MeasureHealth) -> tuple[GaugeHealthState, ...]:
    pair = gauge_samples([task.rows], task.rate_hz, task.gauges)
    return tuple(
        gauge_health_state(name, measure_health(samples)) for name, samples in zip(NAMES, pair, strict=True)
    )


def _fit(task: FitCalibration) -> Calibration:
    counts = [reading.counts for reading in task.points]
    dial_m = [reading.dial_mm * 1e-3 for reading in task.points]
    _write_points(task.file_name, counts, dial_m)
    dial = DialGauge(task.resolution_m, task.uncertainty_m)
    return calibrate(CalibrationPoints.from_readings(counts, dial_m), dial, task.degree)


def _write_points(name: str, counts: list[float], dial_m: list[float]) -> None:
    """Write the points, so that they survive a crash of the window. Raises ConfigError."""
    path = config_directory() / name
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_points(path, counts, dial_m)
    except OSError as error:
        raise ConfigError(
            "{path}: cannot be written ({strerror}). Check the folder, its rights and its disk",
            path=path,
            strerror=error.strerror,
        ) from None


def _calibration_fit(found: Calibration) -> CalibrationFit:
    gain, zero, merits = found.gain_m_per_count, found.zero_count, found.characteristics
    values = [
        LabelledValue(gettext("gain"), with_unit(typeset(f"{gain.value * 1e6:.7g}"), "µm/count")),
        LabelledValue(
            gettext("gain uncertainty"),
            with_unit(f"{found.gain_relative_standard_uncertainty * 100:.2g}", "%"),
        ),
        LabelledValue(gettext("zero"), with_unit(typeset(f"{zero.value:.9g}"), "counts")),
    ]
    if found.polynomial:
        values.append(
            LabelledValue(
                gettext("polynomial"), ", ".join(typeset(f"{term:.3g}") for term in found.polynomial)
            )
        )
    values += [
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
        tuple(values),
        tuple(translate(warning.message) for warning in found.warnings),
    )


def _micrometres(value_m: float | None) -> str:
    if value_m is None or not math.isfinite(value_m):
        return gettext("not known yet")
    return format_in(MICROMETRE, value_m)


def _save_calibration(task: SaveCalibration) -> SavedCalibration:
    found = _fit(task.fit)
    base, name = settings_file("gauges.toml"), _GAUGES[task.fit.gauge]
    details = CalibrationDetails(
        task.day, task.valid_until, task.reference, task.certificate, task.calibrated_by
    )
    gauge = calibrated_gauge(getattr(load_gauges(base), name), found, details)
    file = save_calibration({name: gauge}, Path(base), task.day)
    before = activate_calibration(file, task.day) if task.use else None
    return SavedCalibration(str(file), str(before) if before else "")


def _check_gauge(task: CheckGauge) -> CheckOutcome:
    form, name = task.form, _GAUGES[task.form.gauge]
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
        tuple(_check_values(found)),
        tuple(translate(one.message) for one in found.warnings),
        str(file),
    )


def _check_values(found: DisplacementCheck) -> Iterator[LabelledValue]:
    for words, value_m in (
        (gettext("known"), found.expected_m),
        (gettext("measured"), found.measured_m),
        (gettext("off by"), found.deviation_m),
        (gettext("allowed, twice the standard uncertainty"), found.tolerance_m),
    ):
        yield LabelledValue(words, format_in(MILLIMETRE, value_m, 4))
    for line in found.budget:
        value = line.standard_uncertainty
        yield LabelledValue(
            translate(line.source.label), gettext("not stated") if math.isnan(value) else _micrometres(value)
        )
