"""`slipstand calibrate`: counts of a gauge against a dial gauge, to a calibration file."""

import dataclasses
import datetime
import math
from pathlib import Path
from typing import Annotated, Any

import typer

from analysis.calibration.calibrate import Calibration, DialGauge
from analysis.calibration.calibrate import calibrate as find_calibration
from analysis.calibration.points import CalibrationPoints
from analysis.catalogue import MICROMETRE, MILLIMETRE
from analysis.formatting import format_value
from app.acquisition.messages import PortSettings
from app.cli import output as out
from app.cli.calibration_check import check
from app.cli.calibration_live import measure_points
from app.cli.errors import CommandError
from app.cli.options import (
    CalibrationFile,
    FigureFile,
    Json,
    LinkOptions,
    calibration_file,
    check_figure_file,
    choice,
    number,
    with_options,
)
from app.runs.analysis_json import quantity_document as describe_quantity
from app.runs.calibration_points import CalibrationDetails, calibrated_gauge, read_points
from config.files import activate_calibration, config_directory, load_gauges, save_calibration

_CHANNELS = {"table": 0, "relative": 1}


@dataclasses.dataclass(frozen=True)
class ReadingOptions:
    """Where the readings come from: a file, or a device."""

    points: Annotated[
        Path | None,
        typer.Option("--points", help="CSV of readings: counts, dial_mm, perhaps direction and round."),
    ] = None
    port: Annotated[
        str | None, typer.Option("--port", help="Serial port or URL, to read the counts live.")
    ] = None
    protocol: Annotated[str | None, typer.Option("--protocol", help="Protocol name, with --port.")] = None
    settle: Annotated[
        float, number("--settle", above=0.0, help="Seconds over which counts are averaged.")
    ] = 1.0

    def device(self, link: LinkOptions) -> PortSettings | None:
        """Return the device to read; None for a file. Raises CommandError unless one of them is given."""
        if (self.points is None) == (self.port is None):
            raise CommandError("give the readings with --points FILE, or a device with --port and --protocol")
        if self.port is None:
            return None
        if self.protocol is None:
            raise CommandError(f"--port {self.port} needs --protocol. See `slipstand device list`")
        return link.port_settings(self.port, self.protocol)


@dataclasses.dataclass(frozen=True)
class CertificateOptions:
    """What is stated of dial gauge and calibration."""

    dial_resolution: Annotated[
        float, number("--dial-resolution", least=0.0, help="Resolution of the dial readings (mm).")
    ] = 0.01
    dial_uncertainty: Annotated[
        float | None,
        number(
            "--dial-uncertainty",
            least=0.0,
            help="Standard uncertainty of the dial gauge, of its certificate (mm).",
        ),
    ] = None
    reference: Annotated[str | None, typer.Option("--reference", help="Which dial gauge.")] = None
    certificate: Annotated[str, typer.Option("--certificate", help="Its certificate.")] = ""
    serial_number: Annotated[str | None, typer.Option("--serial-number", help="Of the gauge calibrated.")] = (
        None
    )
    gauge_range: Annotated[float | None, number("--range", above=0.0, help="Range of the gauge (mm).")] = None
    by: Annotated[str, typer.Option("--by", help="Who calibrates.")] = ""
    valid_until: Annotated[
        datetime.datetime | None,
        typer.Option("--valid-until", formats=["%Y-%m-%d"], help="Last day on which it holds."),
    ] = None

    def dial(self) -> DialGauge:
        """Return the dial gauge."""
        return DialGauge(self.dial_resolution * 1e-3, _from_mm(self.dial_uncertainty))

    def details(self) -> CalibrationDetails:
        """Return what is kept beside the calibration. Raises CommandError."""
        today = datetime.datetime.now().astimezone().date()
        last_day = self.valid_until.date() if self.valid_until else None
        if last_day is not None and last_day < today:
            raise CommandError(f"--valid-until {last_day} is past. Give a day to come")
        reference = f"dial gauge {self.dial_resolution:g} mm" if self.reference is None else self.reference
        return CalibrationDetails(
            today,
            last_day,
            reference,
            self.certificate,
            self.by,
            self.serial_number,
            _from_mm(self.gauge_range),
        )


commands = typer.Typer(invoke_without_command=True, add_completion=False, rich_markup_mode=None)
commands.command("check")(check)


@commands.callback()
@with_options
def calibrate(
    *,
    context: typer.Context,
    gauge: Annotated[
        str | None, choice("--gauge", *_CHANNELS, help="table (gauge 1) or relative (gauge 2).")
    ] = None,
    source: ReadingOptions,
    link: LinkOptions,
    degree: Annotated[int, typer.Option(help="1 for a line, 2 or 3 for a polynomial.")] = 1,
    certificate: CertificateOptions,
    calibration: CalibrationFile = None,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="A new file; a dated one beside gauges.toml if absent."),
    ] = None,
    use: Annotated[bool, typer.Option("--use", help="Make it gauges.toml; the one before is kept.")] = False,
    figure: FigureFile = None,
    as_json: Json = False,
) -> None:
    """Calibrate a gauge against a dial: live, or from a file.

    Live, the device gives the counts, and the dial is typed in at each step.
    Take the table up and down in even steps, twice or more. Without --use give the file to `record
    --calibration`.
    """
    if context.invoked_subcommand is not None:
        return
    if gauge is None:
        raise typer.BadParameter("it must be given: table or relative", param_hint="'--gauge'")
    if degree not in (1, 2, 3):
        raise CommandError(f"--degree {degree} is not offered. Use 1 for a line, 2 or 3")
    figure = check_figure_file(figure)
    device = source.device(link)
    base = calibration_file(calibration)
    target = _new_file(output)
    details = certificate.details()
    points = _readings(source, device, base, gauge, target)
    found = find_calibration(points, certificate.dial(), degree)
    file, kept = _save(gauge, found, details, base, target, use)
    if figure is not None:
        from app.reports.figures.gauge_figures import save_calibration_figure  # loads matplotlib

        save_calibration_figure(figure, found, f"calibration of the {gauge} gauge")
    print_calibration(gauge, found, file, kept, use=use, as_json=as_json)


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
        "gain_m_per_count": describe_quantity(found.gain_m_per_count),
        "gain_relative_standard_uncertainty": found.gain_relative_standard_uncertainty,
        "zero_count": describe_quantity(found.zero_count),
        "zero_standard_uncertainty_m": found.zero_standard_uncertainty_m,
        "polynomial": list(found.polynomial),
        "displacement_standard_uncertainty_m": found.displacement_standard_uncertainty_m,
        "scatter_m": found.scatter_m,
        **{name: getattr(found.characteristics, name) for name, _ in _MERITS},
        "budget": [
            {
                "source": str(line.source),
                "contribution_to": line.contribution_to,
                "standard_uncertainty": None
                if math.isnan(line.standard_uncertainty)
                else line.standard_uncertainty,
            }
            for line in found.budget
        ],
        "readings": [
            {
                "counts": float(counts), "dial_m": float(dial_m), "direction": "up" if way > 0 else "down",
                "round": int(number), "residual_m": float(left),
            }
            for counts, dial_m, way, number, left in rows
        ],
        "warnings": [{"code": caution.code, "message": str(caution.message)} for caution in found.warnings],
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
