"""`slipstand calibrate check`: a gauge against a known displacement or a shunt, and the verdict kept."""

import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, cast

import typer

from app.cli import output as out
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
    from analysis.calibration.known_displacement import DisplacementCheck
    from app.acquisition.gauge_check import ReferenceStep
    from app.acquisition.gauge_samples import AveragedCounts, CountAverager
    from app.acquisition.messages import PortSettings
    from config.schema import GaugeCheck, Gauges

GAUGES = ("table", "relative")
_WINDOWS = 5


def check(
    gauge: Annotated[str, typer.Option(help="table (gauge 1) or relative (gauge 2).")],
    port: Annotated[str, typer.Option(help="Serial port or URL of the device.")],
    protocol: Annotated[str, typer.Option(help="Protocol name, see `slipstand device list`.")],
    displacement: Annotated[
        float | None, typer.Option(help="How far the gauge is moved, with its sign (mm).")
    ] = None,
    shunt: Annotated[
        float | None, typer.Option(help="Instead: what the shunt resistor stands for (mm).")
    ] = None,
    shunt_counts: Annotated[float | None, typer.Option(help="Instead: the shunt's shift in counts.")] = None,
    uncertainty: Annotated[
        float | None,
        typer.Option(help="Standard uncertainty of what is known (mm, or counts with --shunt-counts)."),
    ] = None,
    seconds: Annotated[float, typer.Option(help="Seconds over which counts are averaged.")] = 2.0,
    reference: Annotated[str, typer.Option(help="Which dial gauge, gauge block or resistor.")] = "",
    by: Annotated[str, typer.Option(help="Who checks.")] = "",
    rate: DeviceRate = None,
    baud: Baud = None,
    parity: Parity = "N",
    relative_port: RelativePort = "",
    settings: DeviceSettings = None,
    calibration: Annotated[Path | None, typer.Option(help="Calibration file; gauges.toml if absent.")] = None,
    as_json: Json = False,
) -> None:
    """Check a gauge by a known displacement or its shunt.

    Before a test, move it so far, or switch its shunt resistor on.
    It passes if it is no further off than twice the combined standard uncertainty of calibration,
    displacement and readings. Ends with 1 if it does not; runs recorded later carry the verdict.
    """
    from app.cli.recording import calibration_file
    from config.files import checks_path, load_checks, load_gauges

    positive("--seconds", seconds)
    finite("--uncertainty", uncertainty, least=0.0)
    if gauge not in GAUGES:
        raise CommandError(f"--gauge {gauge!r} is not known. Use table or relative")
    device = port_settings(port, protocol, relative_port, rate, baud, parity, settings)
    known = _known(displacement, shunt, shunt_counts, uncertainty)
    gauges = load_gauges(calibration_file(calibration))
    load_checks(checks_path())  # refused before anybody moves the table
    name = cast(Literal["table", "relative"], gauge)
    found, entry = _checked(device, gauges, name, known, seconds, reference, by)
    _report(found, entry, as_json)
    if not found.passed:
        raise typer.Exit(1)


def _known(
    displacement_mm: float | None,
    shunt_mm: float | None,
    shunt_counts: float | None,
    uncertainty: float | None,
) -> "ReferenceStep":
    from app.acquisition.gauge_check import ReferenceStep

    given = {"--displacement": displacement_mm, "--shunt": shunt_mm, "--shunt-counts": shunt_counts}
    said = {name: value for name, value in given.items() if value is not None}
    if len(said) != 1:
        raise CommandError(
            "give one of --displacement, --shunt and --shunt-counts: what the gauge is tried with"
        )
    ((name, value),) = said.items()
    if not math.isfinite(value) or value == 0.0:
        raise CommandError(f"{name} {value:g} checks nothing. Give a finite number that is not 0")
    kind: Literal["displacement", "shunt"] = "displacement" if name == "--displacement" else "shunt"
    if name == "--shunt-counts":
        return ReferenceStep(value, uncertainty, "count", kind)
    return ReferenceStep(value * 1e-3, None if uncertainty is None else uncertainty * 1e-3, "m", kind)


def _checked(
    port: "PortSettings",
    gauges: "Gauges",
    name: Literal["table", "relative"],
    known: "ReferenceStep",
    window_s: float,
    reference: str,
    by: str,
) -> "tuple[DisplacementCheck, GaugeCheck]":
    from app.acquisition.gauge_check import check_entry, check_gauge
    from app.acquisition.gauge_samples import CountAverager
    from app.acquisition.run_setup import complete_port_settings
    from app.acquisition.stream.live_stream import open_stream
    from config.files import append_check

    gauge = getattr(gauges, name)
    with (
        open_stream(complete_port_settings(port, gauges.device), gauges) as stream,
        CountAverager(stream, GAUGES.index(name)) as still,
    ):
        device = stream.identity.name or port.protocol
        out.print_status(f"{device}, {stream.rate_hz:g} Hz")
        rest = _read(still, window_s, _at_rest(known))
        moved = _read(still, window_s, _with_it(known))
    found = check_gauge(rest, moved, gauge, known)
    entry = check_entry(name, gauge, found, known, reference=reference, checked_by=by, device=device)
    out.print_status(f"kept in {append_check(entry)}")
    return found, entry


def _at_rest(known: "ReferenceStep") -> str:
    return "Shunt off, the table at rest" if known.kind == "shunt" else "Let the gauge rest, the dial at 0"


def _with_it(known: "ReferenceStep") -> str:
    if known.kind == "shunt":
        return "Switch the shunt on, and move nothing"
    return f"Move the gauge by {known.value * 1e3:+g} mm, and hold it"


def _read(still: "CountAverager", window_s: float, words: str) -> "AveragedCounts":
    """Wait for the operator, then for the gauge to stand still."""
    sys.stderr.write(f"{words}, then press Enter: ")
    sys.stderr.flush()
    if not sys.stdin.readline():
        raise CommandError("the check was broken off: nothing is kept. Press Enter at each step")

    def tell(average: "AveragedCounts") -> None:
        out.print_status(f"still moving by {average.creep_counts:.3g} counts, waiting")

    average = still.steady_average(window_s, _WINDOWS, tell)
    if not average.is_steady:
        out.print_status(f"still creeping by {average.creep_counts:.3g} counts; counted as uncertainty")
    return average


def _report(found: "DisplacementCheck", entry: "GaugeCheck", as_json: bool) -> None:
    if as_json:
        out.print_json(check_document(found, entry))
        return
    out.print_line(
        f"{'PASS' if found.passed else 'FAIL'}  gauge {GAUGES.index(entry.gauge) + 1} ({entry.gauge})"
    )
    for label, value_m in (
        ("known", found.expected_m),
        ("measured", found.measured_m),
        ("deviation", found.deviation_m),
    ):
        out.print_line(f"{label:10} {value_m * 1e3:+.4f} mm")
    out.print_line(
        f"{'tolerance':10} {found.tolerance_m * 1e3:.4f} mm, twice the combined standard uncertainty of"
    )
    for line in found.budget:
        said = f"{line.standard_uncertainty * 1e6:.1f} µm"
        out.print_line(
            f"           {'not stated' if math.isnan(line.standard_uncertainty) else said:>10}  {line.source}"
        )
    for caution in found.warnings:
        out.print_line(f"warning {caution.code}: {caution.message}")
    if not found.passed:
        out.print_line(
            f"Check plugs and mounting, then calibrate again: slipstand calibrate --gauge {entry.gauge}"
        )


def check_document(found: "DisplacementCheck", entry: "GaugeCheck") -> dict[str, Any]:
    """JSON object of a check."""
    return {
        "schema": "slipstand-gauge-check/1",
        "gauge": entry.gauge,
        "kind": entry.kind,
        "date": entry.at.isoformat(),
        "passed": found.passed,
        "expected_m": found.expected_m,
        "measured_m": found.measured_m,
        "deviation_m": found.deviation_m,
        "standard_uncertainty_m": found.standard_uncertainty_m,
        "tolerance_m": found.tolerance_m,
        "budget": [
            {
                "source": str(line.source),
                "standard_uncertainty": None
                if math.isnan(line.standard_uncertainty)
                else line.standard_uncertainty,
            }
            for line in found.budget
        ],
        "warnings": [{"code": caution.code, "message": str(caution.message)} for caution in found.warnings],
    }
