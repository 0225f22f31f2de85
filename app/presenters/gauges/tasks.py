"""Functions that the Gauges screen calls in its worker process. Raise AnalysisError, ConfigError."""

import datetime
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Final, Literal

from analysis.calibration.calibrate import Calibration, DialGauge, calibrate
from analysis.calibration.known_displacement import DisplacementCheck
from analysis.calibration.points import CalibrationPoints
from analysis.catalogue import MICROMETRE
from analysis.formatting import typeset, with_unit
from analysis.gauge_health import measure_health
from app.acquisition import gauge_check
from app.acquisition.averaged_counts import AveragedCounts
from app.acquisition.gauge_check import ReferenceStep
from app.acquisition.gauge_samples import gauge_samples
from app.acquisition.ring import RingRows
from app.presenters.base import LabelledValue
from app.presenters.gauge_health import gauge_health_state
from app.presenters.gauge_health_state import GaugeHealthState
from app.presenters.gauges.state import (
    NAMES,
    ActiveCalibrations,
    CalibrationData,
    CalibrationFit,
    CalibrationForm,
    CheckForm,
    CheckKind,
    CheckOutcome,
)
from app.presenters.number_text import format_displacement, format_in
from app.runs.calibration_points import CalibrationDetails, calibrated_gauge, write_points
from config import files
from config.files import load_checks, load_gauges, settings_file
from config.schema import ConfigError, Filter, GaugeChecks, Gauges
from messages.i18n import N_, gettext, translate

_GAUGES: Final[tuple[Literal["table"], Literal["relative"]]] = ("table", "relative")


def load_calibrations() -> ActiveCalibrations:
    try:
        checks, fault = load_checks(), ""
    except ConfigError as error:
        checks, fault = GaugeChecks(), str(error)
    return ActiveCalibrations(load_gauges(), checks, str(settings_file("gauges.toml")), fault)


def measure_gauges(rows: RingRows, rate_hz: float, gauges: Gauges) -> tuple[GaugeHealthState, ...]:
    """Measure noise, drift and hum of samples at rest."""
    pair = gauge_samples([rows], rate_hz, gauges)
    return tuple(
        gauge_health_state(name, measure_health(samples)) for name, samples in zip(NAMES, pair, strict=True)
    )


def fit_calibration(data: CalibrationData) -> CalibrationFit:
    """Write the points to a file, then fit a calibration to them."""
    return _calibration_fit(_fit(data))


def save_calibration(
    form: CalibrationForm,
    data: CalibrationData,
    today: datetime.date,
    valid_until: datetime.date | None,
    stated: Filter | None,
) -> tuple[str, str]:
    """Write a calibration to a new file; return it, and that of the previous one if it was replaced."""
    found = _fit(data)
    base, name = settings_file("gauges.toml"), _GAUGES[form.gauge]
    reference = form.reference.strip() or f"dial gauge {form.resolution_mm.strip()} mm"
    details = CalibrationDetails(
        today, valid_until, reference, form.certificate.strip(), form.calibrated_by.strip(), filter=stated
    )
    gauge = calibrated_gauge(getattr(load_gauges(base), name), found, details)
    file = files.save_calibration({name: gauge}, Path(base), today)
    before = files.activate_calibration(file, today) if form.use else None
    return str(file), str(before) if before else ""


def _fit(data: CalibrationData) -> Calibration:
    counts = [reading.counts for reading in data.points]
    dial_m = [reading.dial_mm * 1e-3 for reading in data.points]
    _write_points(data.file_name, counts, dial_m)
    dial = DialGauge(data.resolution_m, data.uncertainty_m)
    return calibrate(CalibrationPoints.from_readings(counts, dial_m), dial, data.degree)


def _write_points(name: str, counts: list[float], dial_m: list[float]) -> None:
    """Write the points, so that they survive a crash of the window. Raises ConfigError."""
    path = files.config_directory() / name
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_points(path, counts, dial_m)
    except OSError as error:
        template = N_("{path}: cannot be written ({strerror}). Check the folder, its rights and its disk")
        raise ConfigError(template, path=path, strerror=error.strerror) from None


def _calibration_fit(found: Calibration) -> CalibrationFit:
    gain, zero, merits = found.gain_m_per_count, found.zero_count, found.characteristics
    polynomial = ", ".join(typeset(f"{term:.3g}") for term in found.polynomial)
    values = {
        gettext("gain"): with_unit(typeset(f"{gain.value * 1e6:.7g}"), "µm/count"),
        gettext("gain uncertainty"): with_unit(f"{found.gain_relative_standard_uncertainty * 100:.2g}", "%"),
        gettext("zero"): with_unit(typeset(f"{zero.value:.9g}"), "counts"),
        **({gettext("polynomial"): polynomial} if polynomial else {}),
        gettext("non-linearity"): _micrometres(merits.nonlinearity_m),
        gettext("hysteresis"): _micrometres(merits.hysteresis_m),
        gettext("repeatability"): _micrometres(merits.repeatability_m),
        gettext("zero drift"): _micrometres(merits.zero_drift_m),
        gettext("u of a displacement"): _micrometres(found.displacement_standard_uncertainty_m),
    }
    return CalibrationFit(
        found.points.dial_m * 1e3,
        found.residual_m * 1e6,
        found.points.direction > 0,
        tuple(LabelledValue(label, value) for label, value in values.items()),
        tuple(translate(warning.message) for warning in found.warnings),
    )


def _micrometres(value_m: float | None) -> str:
    if value_m is None or not math.isfinite(value_m):
        return gettext("not known yet")
    return format_in(MICROMETRE, value_m)


def check_gauge(form: CheckForm, rest: AveragedCounts, moved: AveragedCounts, device: str) -> CheckOutcome:
    """Compare two readings with the known step, and record the outcome."""
    name = _GAUGES[form.gauge]
    gauge = getattr(load_gauges(), name)
    scale = 1.0 if form.kind is CheckKind.SHUNT_COUNTS else 1e-3
    uncertainty = None if not form.uncertainty else scale * float(form.uncertainty)
    known = ReferenceStep(
        scale * float(form.known),
        uncertainty,
        "count" if form.kind is CheckKind.SHUNT_COUNTS else "m",
        "displacement" if form.kind is CheckKind.DISPLACEMENT else "shunt",
    )
    found = gauge_check.check_gauge(rest, moved, gauge, known)
    entry = gauge_check.check_entry(
        name, gauge, found, known,
        reference=form.reference, checked_by=form.checked_by, device=device,
    )  # fmt: skip
    file = files.append_check(entry)
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
        yield LabelledValue(words, format_displacement(value_m, 4))
    for line in found.budget:
        value = line.standard_uncertainty
        yield LabelledValue(
            translate(line.source.label), gettext("not stated") if math.isnan(value) else _micrometres(value)
        )
