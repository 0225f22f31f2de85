"""`slipstand calibrate`: counts of a gauge against a dial gauge, to a calibration file."""

import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from app.cli.calibration_check import check
from app.cli.errors import CommandError
from app.cli.options import (
    Baud,
    DeviceRate,
    DeviceSettings,
    Json,
    Parity,
    RelativePort,
    finite,
    port_settings,
    positive,
)

if TYPE_CHECKING:
    from analysis.calibration.calibrate import Calibration
    from analysis.calibration.readings import Readings
    from app.acquisition.messages import PortSettings
    from app.runs.calibration_points import About

_CHANNELS = {"table": 0, "relative": 1}
_DATE = ["%Y-%m-%d"]


commands = typer.Typer(invoke_without_command=True)
commands.command("check")(check)


@commands.callback()
def calibrate(
    context: typer.Context,
    gauge: Annotated[str | None, typer.Option(help="table (gauge 1) or relative (gauge 2).")] = None,
    points: Annotated[
        Path | None, typer.Option(help="CSV of readings: counts, dial_mm, perhaps direction and round.")
    ] = None,
    port: Annotated[str | None, typer.Option(help="Serial port or URL, to read the counts live.")] = None,
    protocol: Annotated[str | None, typer.Option(help="Protocol name, with --port.")] = None,
    rate: DeviceRate = None,
    baud: Baud = None,
    parity: Parity = "N",
    relative_port: RelativePort = "",
    settings: DeviceSettings = None,
    settle: Annotated[float, typer.Option(help="Seconds over which counts are averaged.")] = 1.0,
    degree: Annotated[int, typer.Option(help="1 for a line, 2 or 3 for a polynomial.")] = 1,
    dial_resolution: Annotated[float, typer.Option(help="To which the dial is read (mm).")] = 0.01,
    dial_uncertainty: Annotated[
        float | None, typer.Option(help="Standard uncertainty of the dial gauge, of its certificate (mm).")
    ] = None,
    reference: Annotated[str | None, typer.Option(help="Which dial gauge.")] = None,
    certificate: Annotated[str, typer.Option(help="Its certificate.")] = "",
    serial_number: Annotated[str | None, typer.Option(help="Of the gauge calibrated.")] = None,
    gauge_range: Annotated[float | None, typer.Option("--range", help="Range of the gauge (mm).")] = None,
    by: Annotated[str, typer.Option(help="Who calibrates.")] = "",
    valid_until: Annotated[
        datetime.datetime | None, typer.Option(formats=_DATE, help="Last day on which it holds.")
    ] = None,
    calibration: Annotated[
        Path | None, typer.Option(help="File that brings all else; gauges.toml if absent.")
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="A new file; a dated one beside gauges.toml if absent."),
    ] = None,
    use: Annotated[bool, typer.Option("--use", help="Make it gauges.toml; the one before is kept.")] = False,
    figure: Annotated[Path | None, typer.Option(help="Draw readings and residuals: PNG, SVG or PDF.")] = None,
    as_json: Json = False,
) -> None:
    """Calibrate a gauge against a dial: live, or from a file.

    Live, the device gives the counts, and the dial is typed in at each step.
    Take the table up and down in even steps, twice or more. Without --use give the file to `record
    --calibration`.
    """
    if context.invoked_subcommand is not None:
        return
    from analysis.calibration.calibrate import DialGauge
    from analysis.calibration.calibrate import calibrate as find_calibration
    from app.cli.calibration_text import report
    from app.cli.recording import gauges_file_of
    from app.runs.calibration_points import About

    for name, value in (("--settle", settle), ("--range", gauge_range)):
        positive(name, value)
    for name, value in (("--dial-resolution", dial_resolution), ("--dial-uncertainty", dial_uncertainty)):
        finite(name, value, least=0.0)
    gauge = _check_words(gauge, degree, figure)
    live = _port_of(points, port, protocol, rate, baud, parity, relative_port, settings)
    base = gauges_file_of(calibration)
    target = _new_file(output)
    dial = DialGauge(dial_resolution * 1e-3, None if dial_uncertainty is None else dial_uncertainty * 1e-3)
    today = datetime.datetime.now().astimezone().date()
    last_day = valid_until.date() if valid_until else None
    if last_day is not None and last_day < today:
        raise CommandError(f"--valid-until {last_day} is past. Give a day to come")
    about = About(
        today, last_day,
        f"dial gauge {dial_resolution:g} mm" if reference is None else reference, certificate, by,
        serial_number, None if gauge_range is None else gauge_range * 1e-3,
    )  # fmt: skip
    readings = _readings(points, live, base, gauge, settle, target)
    found = find_calibration(readings, dial, degree)
    file, kept = _save(gauge, found, about, base, target, use)
    _draw(figure, found, gauge)
    report(gauge, found, file, kept, use=use, as_json=as_json)


def _check_words(gauge: str | None, degree: int, figure: Path | None) -> str:
    """Return the gauge, if all words are known. Raises CommandError."""
    if gauge is None:
        raise typer.BadParameter("it must be given: table or relative", param_hint="'--gauge'")
    if gauge not in _CHANNELS:
        raise CommandError(f"--gauge {gauge!r} is not known. Use table or relative")
    if degree not in (1, 2, 3):
        raise CommandError(f"--degree {degree} is not offered. Use 1 for a line, 2 or 3")
    if figure is not None and figure.suffix not in (".png", ".svg", ".pdf"):
        raise CommandError(f"--figure {figure.name} has no known ending. Use .png, .svg or .pdf")
    if figure is not None and not figure.expanduser().absolute().parent.is_dir():
        raise CommandError(
            f"--figure {figure}: there is no such folder. Make it first or choose another path"
        )
    return gauge


def _port_of(
    points: Path | None,
    port: str | None,
    protocol: str | None,
    rate: float | None,
    baud: int | None,
    parity: str,
    relative_port: str,
    settings: list[str] | None,
) -> "PortSettings | None":
    """The device to read, None for a file. Raises CommandError unless exactly one of them is given."""
    if (points is None) == (port is None):
        raise CommandError("give the readings with --points FILE, or a device with --port and --protocol")
    if port is None:
        return None
    if protocol is None:
        raise CommandError(f"--port {port} needs --protocol. See `slipstand device list`")
    return port_settings(port, protocol, relative_port, rate, baud, parity, settings)


def _new_file(output: Path | None) -> Path | None:
    from app.cli.output import new_file

    if output is None:
        return None
    if output.suffix != ".toml":
        raise CommandError(f"-o {output.name} has no known ending. Use .toml")
    return new_file(output, force=False)


def _readings(
    points: Path | None,
    live: "PortSettings | None",
    base: Path,
    gauge: str,
    settle_s: float,
    target: Path | None,
) -> "Readings":
    from app.cli.calibration_live import take_points
    from app.runs.calibration_points import read_points
    from config.files import config_directory, load_gauges

    gauges = load_gauges(base)
    if points is not None:
        return read_points(points.expanduser())
    if live is None:
        raise CommandError("there is neither a file nor a device. Give --points or --port")
    folder = target.parent if target else config_directory()
    folder.mkdir(parents=True, exist_ok=True)
    stamp = datetime.datetime.now().astimezone().strftime("%Y-%m-%d-%H%M%S")
    kept = folder / f"readings-{gauge}-{stamp}.csv"
    return take_points(live, gauges, _CHANNELS[gauge], settle_s, kept)


def _save(
    name: str, found: "Calibration", about: "About", base: Path, target: Path | None, use: bool
) -> tuple[Path, Path | None]:
    from app.runs.calibration_points import calibrated_gauge
    from config.files import load_gauges, save_calibration, use_calibration

    before = getattr(load_gauges(base), name)
    file = save_calibration({name: calibrated_gauge(before, found, about)}, base, about.day, target)
    return file, use_calibration(file, about.day) if use else None


def _draw(figure: Path | None, found: "Calibration", gauge: str) -> None:
    if figure is not None:
        from app.reports.calibration_figure import save_calibration_figure

        save_calibration_figure(figure.expanduser(), found, f"calibration of the {gauge} gauge")
