"""`slipstand calibrate`: counts of a gauge against a dial gauge, to a calibration file."""

import datetime
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

import msgspec
import numpy as np
import typer

from analysis.calibration.calibrate import Calibration, DialGauge
from analysis.calibration.calibrate import calibrate as find_calibration
from analysis.calibration.points import CalibrationPoints
from analysis.catalogue import MICROMETRE, MILLIMETRE
from analysis.formatting import format_value
from app.acquisition.averaged_counts import AveragedCounts, CountAverager, NoAverageError
from app.acquisition.messages import PortSettings
from app.acquisition.run_setup import complete_port_settings
from app.acquisition.stream.live_stream import LiveStream, open_stream
from app.cli import output as out
from app.cli.device_options import CalibrateOptions, CertificateOptions, ReadingOptions
from app.cli.errors import CommandError
from app.cli.option_values import calibration_file, checked, figure_file, port_settings
from app.cli.shared_options import LinkOptions
from app.runs.analysis_json import budget_documents, quantity_document, warning_documents
from app.runs.calibration_points import CalibrationDetails, calibrated_gauge, read_points, write_points
from config.files import activate_calibration, config_directory, load_gauges, save_calibration
from config.schema import Filter, Gauge, Gauges

GAUGES: Final = ("table", "relative")
_MAX_WINDOWS = 5
"""Windows after which counts that still creep are taken."""


def calibrate(options: CalibrateOptions) -> None:
    if options.gauge is None:
        raise typer.BadParameter("it must be given: table or relative", param_hint="'--gauge'")
    if options.degree not in (1, 2, 3):
        raise CommandError(f"--degree {options.degree} is not offered. Use 1 for a line, 2 or 3")
    figure, certificate = figure_file(options.figure), options.certificate
    device = _device(options.source, options.link)
    base = calibration_file(options.calibration)
    target = out.output_file(options.output, False, (".toml",)) if options.output else None
    details = _details(certificate)
    gauges = load_gauges(base)
    if options.source.points:
        points = read_points(options.source.points.expanduser())
    else:
        kept = _readings_file(target.parent if target else config_directory(), options.gauge)
        points = measure_points(device, gauges, options.gauge, options.source.settle, kept)
    dial = DialGauge(certificate.dial_resolution * 1e-3, _from_mm(certificate.dial_uncertainty))
    found = find_calibration(points, dial, options.degree)
    gauge = calibrated_gauge(getattr(gauges, options.gauge), found, details)
    file = save_calibration({options.gauge: gauge}, base, details.date, target)
    replaced = activate_calibration(file, details.date) if options.use else None
    if figure is not None:
        from app.reports.figures.gauge_figures import save_calibration_figure  # loads matplotlib

        save_calibration_figure(figure, found, f"calibration of the {options.gauge} gauge")
    if options.as_json:
        out.print_json(calibration_document(options.gauge, found, gauge, file, replaced, options.use))
    else:
        _print_calibration(found, gauge, file, replaced, use=options.use)


def _details(certificate: CertificateOptions) -> CalibrationDetails:
    """Return what is kept beside the calibration. Raises CommandError."""
    today = datetime.datetime.now().astimezone().date()
    last_day = certificate.valid_until.date() if certificate.valid_until else None
    if last_day is not None and last_day < today:
        raise CommandError(f"--valid-until {last_day} is past. Give a day to come")
    reference = certificate.reference
    return CalibrationDetails(
        today,
        last_day,
        f"dial gauge {certificate.dial_resolution:g} mm" if reference is None else reference,
        certificate.certificate,
        certificate.by,
        certificate.serial_number,
        _from_mm(certificate.gauge_range),
        _stated_filter(certificate),
    )


def _stated_filter(options: CertificateOptions) -> Filter | None:
    """Return the filter that is stated. Raises CommandError."""
    if options.filter is None:
        if options.filter_corner is not None:
            raise CommandError("--filter-corner needs --filter. Give its kind")
        return None
    return checked(Filter, kind=options.filter, order=options.filter_order, corner_hz=options.filter_corner)


def _device(source: ReadingOptions, link: LinkOptions) -> PortSettings:
    """Return the device to read, unless there is a file. Raises CommandError unless one of them is given."""
    if (source.points is None) == (source.port is None):
        raise CommandError("give the readings with --points FILE, or a device with --port and --protocol")
    if source.port is not None and source.protocol is None:
        raise CommandError(f"--port {source.port} needs --protocol. See `slipstand device list`")
    return port_settings(link, source.port or "", source.protocol or "")


def _from_mm(length_mm: float | None) -> float | None:
    return None if length_mm is None else length_mm * 1e-3


def _readings_file(folder: Path, gauge: str) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    return folder / f"readings-{gauge}-{datetime.datetime.now().astimezone():%Y-%m-%d-%H%M%S}.csv"


def measure_points(
    port: PortSettings, gauges: Gauges, gauge: str, window_s: float, kept: Path
) -> CalibrationPoints:
    """Ask for dial readings on stdin and average the counts at each; `kept` is written with every one.

    Raises DriverError, AcquisitionError, CalibrationError.
    """
    counts: list[float] = []
    dial_mm: list[float] = []
    with open_counts(port, gauges, gauge) as (averager, _):
        out.print_status(
            "Move the table in steps up and down, two rounds or more; at each, type what the dial shows (mm)."
            " `undo` takes the last one back, an empty line ends."
        )
        while (line := ask_operator(f"dial {len(counts) + 1} (mm): ").strip()) not in ("", "end"):
            if line == "undo":
                if not counts:
                    continue
                counts.pop()
                out.print_status(f"{dial_mm.pop():g} mm taken back")
            else:
                try:
                    length_mm = float(line.replace(",", "."))
                    average = steady_counts(averager, window_s, "taken as it is")
                except ValueError:
                    out.print_status(f"{line!r} is not a number of millimetres. Type it again")
                    continue
                except NoAverageError as error:
                    out.print_status(f"not taken: {error}")
                    continue
                counts.append(average.counts)
                dial_mm.append(length_mm)
                noise = f"noise {average.noise_counts:.3g}"
                out.print_status(f"{length_mm:g} mm: {average.counts:.8g} counts, {noise}")
            _keep(kept, counts, dial_mm)
    if counts:
        out.print_status(f"readings kept in {kept}")
    return CalibrationPoints.from_readings(counts, np.array(dial_mm) * 1e-3)


def _keep(path: Path, counts: list[float], dial_mm: list[float]) -> None:
    try:
        write_points(path, counts, [length_mm * 1e-3 for length_mm in dial_mm])
    except OSError as error:
        raise CommandError(
            f"{path}: cannot be written ({error.strerror}). Check the folder, its rights and its disk"
        ) from None


@contextmanager
def open_counts(port: PortSettings, gauges: Gauges, gauge: str) -> Iterator[tuple[CountAverager, str]]:
    """Open a device; yield the averager of a gauge's counts, and the device's name."""
    with open_gauges(port, gauges) as (stream, title), CountAverager(stream, GAUGES.index(gauge)) as averager:
        yield averager, title


@contextmanager
def open_gauges(port: PortSettings, gauges: Gauges) -> Iterator[tuple[LiveStream, str]]:
    """Open and print a device; yield its stream and its name."""
    with open_stream(complete_port_settings(port, gauges.device), gauges) as stream:
        title = stream.identity.name or port.protocol
        out.print_status(f"{title}, {stream.rate_hz:g} Hz")
        yield stream, title


def steady_counts(averager: CountAverager, window_s: float, if_creeping: str) -> AveragedCounts:
    """Average the counts when they are steady, or after some windows. Raises NoAverageError."""

    def print_moving(average: AveragedCounts) -> None:
        out.print_status(f"still moving by {average.creep_counts:.3g} counts, waiting")

    average = averager.steady_average(window_s, _MAX_WINDOWS, print_moving)
    if not average.is_steady:
        out.print_status(f"still creeping by {average.creep_counts:.3g} counts; {if_creeping}")
    return average


def ask_operator(question: str) -> str:
    """Ask on stderr; return the line that is typed, "" at the end of the input."""
    sys.stderr.write(question)
    sys.stderr.flush()
    return sys.stdin.readline()


_MERITS = (
    ("nonlinearity_m", "non-linearity"),
    ("hysteresis_m", "hysteresis"),
    ("repeatability_m", "repeatability"),
    ("zero_drift_m", "zero drift"),
)


def _print_calibration(
    found: Calibration, gauge: Gauge, file: Path, replaced: Path | None, *, use: bool
) -> None:
    _print_readings(found)
    gain, zero = found.gain_m_per_count, found.zero_count
    relative = found.gain_relative_standard_uncertainty
    rows = [
        ("gain", f"{gain.value:.7g} m/count, standard uncertainty {relative:.2g} of it"),
        ("zero", f"{format_value(zero.value, zero.standard_uncertainty)} counts"),
    ]
    if found.polynomial:
        rows.append(("polynomial", f"{', '.join(f'{term:.5g}' for term in found.polynomial)} (1/m, 1/m²)"))
    for name, label in _MERITS:
        value_m = getattr(found.characteristics, name)
        rows.append((label, "not known" if value_m is None else MICROMETRE.text(value_m, 1)))
    whole = MICROMETRE.text(found.displacement_standard_uncertainty_m, 1)
    rows.append(("displacement", f"standard uncertainty {whole} within the readings"))
    stated = str(gauge.filter.description) if gauge.filter else "not stated: give --filter, or none"
    rows.append(("filter", stated))
    out.print_fields(rows, 15)
    for warning in found.warnings:
        out.print_line(f"warning {warning.code}: {warning.message}")
    out.print_line(f"wrote {file}")
    if replaced is not None:
        out.print_line(f"the calibration before it is kept as {replaced}")
    if not use:
        out.print_line(
            f"take it with: slipstand record --calibration {file}, or calibrate with --use for all runs"
        )


def calibration_document(
    name: str, found: Calibration, gauge: Gauge, file: Path, kept: Path | None, used: bool
) -> dict[str, Any]:
    """JSON object of a calibration."""
    points = found.points
    columns = (points.counts, points.dial_m, points.direction, points.round_number, found.residual_m)
    return {
        "schema": "slipstand-calibration/1",
        "gauge": name,
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
        **{merit: getattr(found.characteristics, merit) for merit, _ in _MERITS},
        "filter": gauge.filter and msgspec.to_builtins(gauge.filter),
        "budget": budget_documents(found.budget),
        "readings": [
            {
                "counts": float(counts), "dial_m": float(dial_m), "direction": "up" if way > 0 else "down",
                "round": int(number), "residual_m": float(left),
            }
            for counts, dial_m, way, number, left in zip(*columns, strict=True)
        ],
        "warnings": warning_documents(found.warnings),
    }  # fmt: skip


def _print_readings(found: Calibration) -> None:
    readings, most_m = found.points, float(max(abs(found.residual_m))) or 1.0
    lengths = MILLIMETRE.labelled("dial"), "counts", MICROMETRE.labelled("residual")
    out.print_table(
        ("round", "way", *lengths, _scale(most_m)),
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
