"""`slipstand calibrate`: counts of a gauge against a dial gauge, to a calibration file."""

import datetime
from pathlib import Path
from typing import Any

import typer

from analysis.calibration.calibrate import Calibration, DialGauge
from analysis.calibration.calibrate import calibrate as find_calibration
from analysis.calibration.points import CalibrationPoints
from analysis.catalogue import MICROMETRE, MILLIMETRE
from analysis.formatting import format_value
from app.acquisition.messages import PortSettings
from app.cli import output as out
from app.cli.calibration_live import measure_points
from app.cli.device_options import CalibrateOptions, CertificateOptions, ReadingOptions
from app.cli.errors import CommandError
from app.cli.option_values import calibration_file, check_figure_file, port_settings
from app.cli.options import LinkOptions
from app.runs.analysis_json import budget_documents, quantity_document, warning_documents
from app.runs.calibration_points import CalibrationDetails, calibrated_gauge, read_points
from config.files import activate_calibration, config_directory, load_gauges, save_calibration

_CHANNELS = {"table": 0, "relative": 1}


def calibrate(options: CalibrateOptions) -> None:
    """Calibrate a gauge against a dial: live, or from a file."""
    if options.gauge is None:
        raise typer.BadParameter("it must be given: table or relative", param_hint="'--gauge'")
    if options.degree not in (1, 2, 3):
        raise CommandError(f"--degree {options.degree} is not offered. Use 1 for a line, 2 or 3")
    figure = check_figure_file(options.figure)
    device = _device(options.source, options.link)
    base = calibration_file(options.calibration)
    target = _new_file(options.output)
    details = _details(options.certificate)
    points = _readings(options.source, device, base, options.gauge, target)
    found = find_calibration(points, _dial(options.certificate), options.degree)
    file, kept = _save(options.gauge, found, details, base, target, options.use)
    if figure is not None:
        from app.reports.figures.gauge_figures import save_calibration_figure  # loads matplotlib

        save_calibration_figure(figure, found, f"calibration of the {options.gauge} gauge")
    print_calibration(options.gauge, found, file, kept, use=options.use, as_json=options.as_json)


def _details(certificate: CertificateOptions) -> CalibrationDetails:
    """Return what is kept beside the calibration. Raises CommandError."""
    today = datetime.datetime.now().astimezone().date()
    last_day = certificate.valid_until.date() if certificate.valid_until else None
    if last_day is not None and last_day < today:
        raise CommandError(f"--valid-until {last_day} is past. Give a day to come")
    reference = certificate.reference
    if reference is None:
        reference = f"dial gauge {certificate.dial_resolution:g} mm"
    return CalibrationDetails(
        today,
        last_day,
        reference,
        certificate.certificate,
        certificate.by,
        certificate.serial_number,
        _from_mm(certificate.gauge_range),
    )


def _dial(certificate: CertificateOptions) -> DialGauge:
    """Return the dial gauge."""
    return DialGauge(certificate.dial_resolution * 1e-3, _from_mm(certificate.dial_uncertainty))


def _device(source: ReadingOptions, link: LinkOptions) -> PortSettings | None:
    """Return the device to read; None for a file. Raises CommandError unless one of them is given."""
    if (source.points is None) == (source.port is None):
        raise CommandError("give the readings with --points FILE, or a device with --port and --protocol")
    if source.port is None:
        return None
    if source.protocol is None:
        raise CommandError(f"--port {source.port} needs --protocol. See `slipstand device list`")
    return port_settings(link, source.port, source.protocol)


def _from_mm(length_mm: float | None) -> float | None:
    return None if length_mm is None else length_mm * 1e-3


def _new_file(output: Path | None) -> Path | None:
    if output is None:
        return None
    if output.suffix != ".toml":
        raise CommandError(f"-o {output.name} has no known ending. Use .toml")
    return out.output_file(output, force=False)


def _readings(
    source: ReadingOptions, device: PortSettings | None, base: Path, gauge: str, target: Path | None
) -> CalibrationPoints:
    gauges = load_gauges(base)
    if source.points is not None:
        return read_points(source.points.expanduser())
    if device is None:
        raise CommandError("there is neither a file nor a device. Give --points or --port")
    folder = target.parent if target else config_directory()
    folder.mkdir(parents=True, exist_ok=True)
    stamp = datetime.datetime.now().astimezone().strftime("%Y-%m-%d-%H%M%S")
    kept = folder / f"readings-{gauge}-{stamp}.csv"
    return measure_points(device, gauges, _CHANNELS[gauge], source.settle, kept)


def _save(
    name: str, found: Calibration, about: CalibrationDetails, base: Path, target: Path | None, use: bool
) -> tuple[Path, Path | None]:
    before = getattr(load_gauges(base), name)
    file = save_calibration({name: calibrated_gauge(before, found, about)}, base, about.date, target)
    return file, activate_calibration(file, about.date) if use else None


_MERITS = (
    ("nonlinearity_m", "non-linearity"),
    ("hysteresis_m", "hysteresis"),
    ("repeatability_m", "repeatability"),
    ("zero_drift_m", "zero drift"),
)


def print_calibration(
    gauge: str, found: Calibration, file: Path, kept: Path | None, *, use: bool, as_json: bool
) -> None:
    """Say what was found and where it is."""
    if as_json:
        out.print_json(calibration_document(gauge, found, file, kept, use))
        return
    _say_readings(found)
    _say_result(found)
    for caution in found.warnings:
        out.print_line(f"warning {caution.code}: {caution.message}")
    out.print_line(f"wrote {file}")
    if kept is not None:
        out.print_line(f"the calibration before it is kept as {kept}")
    if not use:
        out.print_line(
            f"take it with: slipstand record --calibration {file}, or calibrate with --use for all runs"
        )


def calibration_document(
    gauge: str, found: Calibration, file: Path, kept: Path | None, used: bool
) -> dict[str, Any]:
    """JSON object of a calibration."""
    readings = found.points
    rows = zip(
        readings.counts,
        readings.dial_m,
        readings.direction,
        readings.round_number,
        found.residual_m,
        strict=True,
    )
    return {
        "schema": "slipstand-calibration/1",
        "gauge": gauge,
        "file": str(file),
        "in_use": used,
        "kept": None if kept is None else str(kept),
        "gain_m_per_count": quantity_document(found.gain_m_per_count),
        "gain_relative_standard_uncertainty": found.gain_relative_standard_uncertainty,
        "zero_count": quantity_document(found.zero_count),
        "zero_standard_uncertainty_m": found.zero_standard_uncertainty_m,
        "polynomial": list(found.polynomial),
        "displacement_standard_uncertainty_m": found.displacement_standard_uncertainty_m,
        "scatter_m": found.scatter_m,
        **{name: getattr(found.characteristics, name) for name, _ in _MERITS},
        "budget": budget_documents(found.budget),
        "readings": [
            {
                "counts": float(counts), "dial_m": float(dial_m), "direction": "up" if way > 0 else "down",
                "round": int(number), "residual_m": float(left),
            }
            for counts, dial_m, way, number, left in rows
        ],
        "warnings": warning_documents(found.warnings),
    }  # fmt: skip


def _say_readings(found: Calibration) -> None:
    readings, most_m = found.points, float(max(abs(found.residual_m))) or 1.0
    out.print_table(
        (
            "round",
            "way",
            MILLIMETRE.labelled("dial"),
            "counts",
            MICROMETRE.labelled("residual"),
            _scale(most_m),
        ),
        [
            (
                str(readings.round_number[i]),
                "up" if readings.direction[i] > 0 else "down",
                f"{readings.dial_m[i] * 1e3:.4g}",
                f"{readings.counts[i]:.9g}",
                f"{found.residual_m[i] * 1e6:+.1f}",
                _mark(found.residual_m[i] / most_m, "^" if readings.direction[i] > 0 else "v"),
            )
            for i in range(len(readings))
        ],
    )


_HALF = 12


def _scale(most_m: float) -> str:
    """Head of the column in which the residuals are drawn, as wide as it."""
    end = f"{most_m * 1e6:.3g}"
    return f"{'-' + end:<{_HALF}}0{'+' + end:>{_HALF}}"


def _mark(share: float, mark: str) -> str:
    """Draw a residual as a mark on its side of the line, at its share of the largest one."""
    line = [" "] * _HALF + ["|"] + [" "] * _HALF
    line[_HALF + round(_HALF * share)] = mark
    return "".join(line)


def _say_result(found: Calibration) -> None:
    gain, zero = found.gain_m_per_count, found.zero_count
    relative = found.gain_relative_standard_uncertainty
    out.print_line(f"gain           {gain.value:.7g} m/count, standard uncertainty {relative:.2g} of it")
    out.print_line(f"zero           {format_value(zero.value, zero.standard_uncertainty)} counts")
    if found.polynomial:
        terms = ", ".join(f"{term:.5g}" for term in found.polynomial)
        out.print_line(f"polynomial     {terms} (1/m, 1/m²)")
    for name, label in _MERITS:
        value_m = getattr(found.characteristics, name)
        out.print_line(f"{label:14} {'not known' if value_m is None else MICROMETRE.text(value_m, 1)}")
    whole = MICROMETRE.text(found.displacement_standard_uncertainty_m, 1)
    out.print_line(f"displacement   standard uncertainty {whole} within the readings")
