"""`slipstand calibrate check`: a gauge against a known displacement or a shunt, and the verdict kept."""

import math
from typing import Any, Literal, cast

import typer

from analysis.calibration.known_displacement import DisplacementCheck
from analysis.catalogue import MICROMETRE, MILLIMETRE
from analysis.formatting import format_signed
from app.acquisition.averaged_counts import AveragedCounts, CountAverager
from app.acquisition.gauge_check import ReferenceStep, check_entry, check_gauge
from app.cli import output as out
from app.cli.calibrate import GAUGES, ask_operator, open_counts, steady_counts
from app.cli.device_options import CheckOptions, StepOptions
from app.cli.errors import CommandError
from app.cli.option_values import calibration_file, device_settings
from app.runs.analysis_json import warning_documents
from config.files import append_check, checks_path, load_checks, load_gauges
from config.schema import GaugeCheck


def check(options: CheckOptions) -> None:
    device = device_settings(options.source)
    step = _step(options.step)
    gauges = load_gauges(calibration_file(options.calibration))
    load_checks(checks_path())  # a damaged file is refused before anybody moves the table
    name = cast(Literal["table", "relative"], options.gauge)
    gauge = getattr(gauges, name)
    with open_counts(device, gauges, name) as (averager, title):
        at_rest, moved = _instructions(step)
        rest = _read(averager, options.seconds, at_rest)
        found = check_gauge(rest, _read(averager, options.seconds, moved), gauge, step)
    entry = check_entry(
        name, gauge, found, step, reference=options.reference, checked_by=options.by, device=title
    )
    out.print_status(f"kept in {append_check(entry)}")
    if options.as_json:
        out.print_json(check_document(found, entry))
    else:
        _print_check(found, entry)
    if not found.passed:
        raise typer.Exit(1)


def _step(known: StepOptions) -> ReferenceStep:
    options = {
        "--displacement": known.displacement,
        "--shunt": known.shunt,
        "--shunt-counts": known.shunt_counts,
    }
    given = {name: value for name, value in options.items() if value is not None}
    if len(given) != 1:
        raise CommandError(
            "give one of --displacement, --shunt and --shunt-counts: the gauge is checked with it"
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


def _instructions(step: ReferenceStep) -> tuple[str, str]:
    """What the operator does for the first reading and for the second."""
    if step.kind == "shunt":
        return "Shunt off, the table at rest", "Switch the shunt on, and move nothing"
    moved = f"Move the gauge by {step.value * 1e3:+g} mm, and hold it"
    return "Let the gauge rest, the dial at 0", moved


def _read(averager: CountAverager, window_s: float, instruction: str) -> AveragedCounts:
    if not ask_operator(f"{instruction}, then press Enter: "):
        raise CommandError("the check was broken off: nothing is kept. Press Enter at each step")
    return steady_counts(averager, window_s, "counted as uncertainty")


def _print_check(found: DisplacementCheck, entry: GaugeCheck) -> None:
    out.print_line(
        f"{'PASS' if found.passed else 'FAIL'}  gauge {GAUGES.index(entry.gauge) + 1} ({entry.gauge})"
    )
    lengths = (("known", found.expected_m), ("measured", found.measured_m), ("deviation", found.deviation_m))
    rows = [
        (label, f"{format_signed(MILLIMETRE.scale * value_m, 4)} {MILLIMETRE.symbol}")
        for label, value_m in lengths
    ]
    tolerance = MILLIMETRE.text(found.tolerance_m, 4)
    rows.append(("tolerance", f"{tolerance}, twice the combined standard uncertainty of"))
    for line in found.budget:
        uncertainty = MICROMETRE.text(line.standard_uncertainty, 1)
        shown = "not stated" if math.isnan(line.standard_uncertainty) else uncertainty
        rows.append(("", f"{shown:>10}  {line.source}"))
    out.print_fields(rows, 11)
    for warning in found.warnings:
        out.print_line(f"warning {warning.code}: {warning.message}")
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
            {"source": str(line.source), "standard_uncertainty": _stated(line.standard_uncertainty)}
            for line in found.budget
        ],
        "warnings": warning_documents(found.warnings),
    }


def _stated(uncertainty: float) -> float | None:
    return None if math.isnan(uncertainty) else uncertainty
