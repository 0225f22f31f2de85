"""`slipstand calibrate check`: a gauge against a known displacement or a shunt, and the verdict kept."""

import math
import sys
from typing import Any, Literal, cast

import typer

from analysis.calibration.known_displacement import DisplacementCheck
from analysis.catalogue import MICROMETRE, MILLIMETRE
from analysis.formatting import format_signed
from app.acquisition.averaged_counts import AveragedCounts, CountAverager
from app.acquisition.gauge_check import ReferenceStep, check_entry, check_gauge
from app.acquisition.run_setup import complete_port_settings
from app.acquisition.stream.live_stream import open_stream
from app.cli import output as out
from app.cli.device_options import CheckOptions, StepOptions
from app.cli.errors import CommandError
from app.cli.option_values import calibration_file, device_settings
from app.runs.analysis_json import warning_documents
from config.files import append_check, checks_path, load_checks, load_gauges
from config.schema import GaugeCheck

GAUGES = ("table", "relative")
_WINDOWS = 5


def check(options: CheckOptions) -> None:
    """Check a gauge by a known displacement or its shunt."""
    device = device_settings(options.source)
    known = _step(options.step)
    gauges = load_gauges(calibration_file(options.calibration))
    load_checks(checks_path())  # a damaged file is refused before anybody moves the table
    name = cast(Literal["table", "relative"], options.gauge)
    port = complete_port_settings(device, gauges.device)
    with open_stream(port, gauges) as stream, CountAverager(stream, GAUGES.index(name)) as averager:
        title = stream.identity.name or device.protocol
        out.print_status(f"{title}, {stream.rate_hz:g} Hz")
        rest = _read(averager, options.seconds, _at_rest(known))
        moved = _read(averager, options.seconds, _with_it(known))
    found = check_gauge(rest, moved, getattr(gauges, name), known)
    entry = check_entry(
        name,
        getattr(gauges, name),
        found,
        known,
        reference=options.reference,
        checked_by=options.by,
        device=title,
    )
    out.print_status(f"kept in {append_check(entry)}")
    _report(found, entry, options.as_json)
    if not found.passed:
        raise typer.Exit(1)


def _step(known: StepOptions) -> ReferenceStep:
    """Return the step in SI units or counts. Raises CommandError."""
    options = {
        "--displacement": known.displacement,
        "--shunt": known.shunt,
        "--shunt-counts": known.shunt_counts,
    }
    given = {name: value for name, value in options.items() if value is not None}
    if len(given) != 1:
        raise CommandError(
            "give one of --displacement, --shunt and --shunt-counts: what the gauge is tried with"
        )
    ((name, value),) = given.items()
    if not math.isfinite(value) or value == 0.0:
        raise CommandError(f"{name} {value:g} checks nothing. Give a finite number that is not 0")
    if name == "--shunt-counts":
        return ReferenceStep(value, known.uncertainty, "count", "shunt")
    uncertainty_m = None if known.uncertainty is None else known.uncertainty * 1e-3
    return ReferenceStep(
        value * 1e-3, uncertainty_m, "m", "displacement" if name == "--displacement" else "shunt"
    )


def _at_rest(known: ReferenceStep) -> str:
    return "Shunt off, the table at rest" if known.kind == "shunt" else "Let the gauge rest, the dial at 0"


def _with_it(known: ReferenceStep) -> str:
    if known.kind == "shunt":
        return "Switch the shunt on, and move nothing"
    return f"Move the gauge by {known.value * 1e3:+g} mm, and hold it"


def _read(still: CountAverager, window_s: float, words: str) -> AveragedCounts:
    """Wait for the operator, then for the gauge to stand still."""
    sys.stderr.write(f"{words}, then press Enter: ")
    sys.stderr.flush()
    if not sys.stdin.readline():
        raise CommandError("the check was broken off: nothing is kept. Press Enter at each step")

    def tell(average: AveragedCounts) -> None:
        out.print_status(f"still moving by {average.creep_counts:.3g} counts, waiting")

    average = still.steady_average(window_s, _WINDOWS, tell)
    if not average.is_steady:
        out.print_status(f"still creeping by {average.creep_counts:.3g} counts; counted as uncertainty")
    return average


def _report(found: DisplacementCheck, entry: GaugeCheck, as_json: bool) -> None:
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
        out.print_line(f"{label:10} {format_signed(MILLIMETRE.scale * value_m, 4)} {MILLIMETRE.symbol}")
    tolerance = MILLIMETRE.text(found.tolerance_m, 4)
    out.print_line(f"{'tolerance':10} {tolerance}, twice the combined standard uncertainty of")
    for line in found.budget:
        said = MICROMETRE.text(line.standard_uncertainty, 1)
        out.print_line(
            f"           {'not stated' if math.isnan(line.standard_uncertainty) else said:>10}  {line.source}"
        )
    for caution in found.warnings:
        out.print_line(f"warning {caution.code}: {caution.message}")
    if not found.passed:
        out.print_line(
            f"Check plugs and mounting, then calibrate again: slipstand calibrate --gauge {entry.gauge}"
        )


def check_document(found: DisplacementCheck, entry: GaugeCheck) -> dict[str, Any]:
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
        "warnings": warning_documents(found.warnings),
    }
