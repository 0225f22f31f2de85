"""Parts of the JSON of an analysis that stand beside its results: classical figures, Monte Carlo, masses."""

import datetime
import math
import sys
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np

from analysis.identification import Identification, ModelSelection, MonteCarlo
from analysis.quantities import COVERAGE_FACTOR, BudgetLine, Quantity, ResultWarning, parse_source
from analysis.record import Record, StandMasses, unstated_gain_warnings
from messages.i18n import N_
from messages.message import Message, joined, message

if TYPE_CHECKING:
    from analysis.classical_estimates import ClassicalEstimates
    from analysis.plate.friction import PlateFriction
    from app.runs.analysis_request import AnalysisRequest
    from app.runs.metadata import EndMetadata, RunMetadata
    from config.schema import Gauge, GaugeCheck, Gauges

_OFF = 3.0  # the plain log decrement is called biased so many standard uncertainties off the fitted one
_ZERO_MOVED = 0.01
"""Of the pullback: what friction in the stand or drift moves the zero by that is worth a word."""
_ZERO_MOVED_M = 50e-6
_SWING_READINGS = 10
"""In the last two periods, over which the swing is averaged; fewer tell nothing of its middle."""
_GAUGE_NAMES = {"table": "gauge 1 (table)", "relative": "gauge 2 (relative)"}


def classical_document(checks: "ClassicalEstimates", result: Identification) -> dict[str, Any]:
    """The paper's own figures, with notes on what they are worth."""
    decrement = None
    if checks.log_decrement is not None and checks.log_decrement_uncertainty is not None:
        decrement = quantity_document(
            Quantity.normal(checks.log_decrement, checks.log_decrement_uncertainty, "1")
        )
    return {
        "period_s": checks.period_s,
        "log_decrement": decrement,
        "cycles": checks.cycles,
        "friction_of_residual": list(checks.friction_candidates),
        "friction_of_paper": checks.friction_by_paper_method,
        "notes": _notes(checks, result),
    }


def one_mass_document(result: Identification) -> dict[str, Any]:
    """The plain log decrement of a decay, with a note where friction biases it."""
    plain = result.results.get("log_decrement_classical")
    notes = [
        str(caution.message) for caution in result.warnings if caution.code == "coulomb-biases-log-decrement"
    ]
    return {"log_decrement": None if plain is None else quantity_document(plain), "notes": notes}


def monte_carlo_document(drawn: MonteCarlo, budget: dict[str, Quantity]) -> dict[str, Any]:
    """Both methods side by side: by JCGM 100 and as drawn by JCGM 101, and whether they agree."""
    compared = drawn.full or drawn.linear
    return {
        "draws": drawn.draws,
        "refits": drawn.refits,
        "compared": "refits" if drawn.full else "draws",
        "results": {
            name: {
                "budget": quantity_document(budget[name]),
                "drawn": quantity_document(drawn.linear[name]),
                "refitted": quantity_document(drawn.full[name]) if name in drawn.full else None,
                "difference": _difference(budget[name], quantity),
                "tolerance": drawn.tolerances[name],
                "agrees": drawn.agrees[name],
            }
            for name, quantity in compared.items()
        },
    }


def warning_documents(
    warnings: Iterable[ResultWarning], *, with_templates: bool = False
) -> list[dict[str, Any]]:
    """Warnings with code and message; `with_templates` also template and values where there are any."""
    return [
        {"code": warning.code, "message": str(warning.message)}
        | (msgspec.to_builtins(warning.message) if with_templates and warning.message.values else {})
        for warning in warnings
    ]


def read_warning(document: dict[str, Any]) -> ResultWarning:
    """Warning of a document. Without a template, the sentence itself is the template."""
    if "template" not in document:
        return ResultWarning(document["code"], Message(document["message"]))
    return ResultWarning(document["code"], msgspec.convert(document, Message))


def read_model(document: dict[str, Any]) -> ModelSelection | None:
    """The chosen model of an analysis without those tried; degrees of old ones follow from `adequate`."""
    model = document["model"]
    if model is None:
        return None
    own = {"degree": "ideal" if model["adequate"] else "none"} | model | {"tried": ()}
    return msgspec.convert(own, ModelSelection)


def json_values(value: Any) -> Any:
    """A value as read back from JSON: objects are dicts, and numbers that are not finite None."""
    return msgspec.json.decode(msgspec.json.encode(value))


def plate_document(plate: "PlateFriction | None") -> dict[str, Any] | None:
    """Friction from the plate alone: each slip, and how friction varies; None where there is none."""
    if plate is None:
        return None
    names = "time_s", "friction", "friction_standard_uncertainty", "position_m", "speed_m_per_s", "path_m"
    columns = [getattr(plate, name).tolist() for name in names]
    return {
        "slips": [dict(zip(names, row, strict=True)) for row in zip(*columns, strict=True)],
        "variation": json_values(plate.variation),
        "gauge_2_lag_s": plate.lag_s,
        "gauge_2_lag_standard_uncertainty_s": plate.lag_standard_uncertainty_s,
    }


def budget_documents(budget: Iterable[BudgetLine]) -> list[dict[str, Any]]:
    """Budget lines with the names of their sources; what is not stated is null."""
    documents: list[dict[str, Any]] = json_values(
        [
            {
                "source": str(line.source),
                "contribution_to": line.contribution_to,
                "standard_uncertainty": line.standard_uncertainty,
            }
            for line in budget
        ]
    )
    return documents


def read_budget_line(document: dict[str, Any]) -> BudgetLine:
    """Budget line of a document; NaN where the uncertainty is not stated."""
    return BudgetLine(
        parse_source(document["source"]),
        sys.intern(document["contribution_to"]),
        _or_nan(document["standard_uncertainty"]),
    )


def read_quantity(document: dict[str, Any]) -> Quantity:
    """Quantity of a document; NaN in place of null."""
    low, high = document["interval_95"] or (math.nan, math.nan)
    uncertainty = _or_nan(document["standard_uncertainty"])
    return Quantity(document["value"], uncertainty, (low, high), document["unit"])


def quantity_document(quantity: Quantity) -> dict[str, Any]:
    """A quantity as in `results`; what is not finite is null."""
    document: dict[str, Any] = json_values(quantity)
    interval = None if None in document["interval_95"] else document["interval_95"]
    expanded = json_values(quantity.expanded_uncertainty)
    return document | {
        "interval_95": interval, "expanded_uncertainty": expanded, "coverage_factor": COVERAGE_FACTOR,
    }  # fmt: skip


def _or_nan(value: float | None) -> float:
    return math.nan if value is None else float(value)


def mass_warnings(metadata: "RunMetadata", used: StandMasses) -> Iterator[ResultWarning]:
    """Say which masses were used where they are not those of the run."""
    template = N_("{body} mass {mass_kg:g} kg as given, not {run_mass_kg:g} kg as in the run")
    masses = [
        message(template, body=message(body), mass_kg=mass_kg, run_mass_kg=of_run)
        for body, mass_kg, of_run in (
            ("table", used.table_mass_kg, metadata.table_mass_kg),
            ("plate", used.plate_mass_kg, metadata.plate_mass_kg),
        )
        if mass_kg != of_run
    ]
    if masses:
        text = message("analysed with {masses}.", masses=joined(masses, " and "))
        yield ResultWarning("masses-given", text)


def added_mass_warnings(request: "AnalysisRequest", used: StandMasses) -> Iterator[ResultWarning]:
    """Say which mass stiffness and damping are of, where the table carried more than its own."""
    if request.added_mass_kg is not None:
        text = message(
            "the table carried {added_kg:g} kg beside its own {table_kg:g} kg: stiffness and damping"
            " coefficient are those of {together_kg:g} kg.",
            added_kg=request.added_mass_kg,
            table_kg=used.table_mass_kg,
            together_kg=used.table_mass_kg + request.added_mass_kg,
        )
        yield ResultWarning("mass-added", text)


def unstated_warnings(record: Record, result: Identification) -> Iterator[ResultWarning]:
    """Say which uncertainties are missing: of gains, and of a clock that was not timed."""
    if "friction_dynamic" in result.results:
        has_gauge_2 = record.relative_displacement_m is not None
        yield from unstated_gain_warnings(record.table_gauge, record.relative_gauge if has_gauge_2 else None)
    if "period_s" in result.results and not record.clock_is_timed:
        text = message(
            "the clock was not timed: an error of it is an error of T, whose uncertainty lacks that part, and"
            " twice as large in f_d. Record with Slipstand, which times the clock."
        )
        yield ResultWarning("clock-not-timed", text)


def calibration_warnings(gauges: "Gauges", day: datetime.date | None) -> Iterator[ResultWarning]:
    """Say which gauges' calibrations had expired on the day of a run, where that is known."""
    if day is None:
        return
    template = N_(
        "the calibration of {gauge} was valid until {valid_until}, the run is of {day}. Calibrate"
        " it again: slipstand calibrate"
    )
    for name, said in _GAUGE_NAMES.items():
        gauge: Gauge = getattr(gauges, name)
        if gauge.is_expired(day):
            text = message(template, gauge=message(said), valid_until=gauge.valid_until, day=day)
            yield ResultWarning("calibration-expired", text)


def zero_warnings(
    ending: "EndMetadata | None", record: Record, result: Identification
) -> Iterator[ResultWarning]:
    """Say where the table swings about another place than that where it rested before the pull."""
    period, begins_s = result.results.get("period_s"), result.events.slip_end_s or result.events.release_s
    if ending is None or ending.zero_m is None or ending.held_m is None or period is None:
        return
    last = record.time_s[record.time_s > record.time_s[-1] - 2.0 * period.value / record.clock_scale]
    if result.curves is None or len(last) < _SWING_READINGS or begins_s is None or last[0] < begins_s:
        return
    swing_m = result.curves(last).table_displacement_m
    moved_m = float(np.average(swing_m, weights=np.hanning(len(last)))) - ending.zero_m
    if abs(moved_m) > max(_ZERO_MOVED * abs(ending.held_m - ending.zero_m), _ZERO_MOVED_M):
        template = N_(
            "the table swings about a place {moved_m:+.0f} um from where it rested before the pull:"
            " gauge 1 drifted meanwhile, or friction in the stand held the table. f_d is found from the"
            " swing alone."
        )
        yield ResultWarning("zero-moved", message(template, moved_m=moved_m * 1e6))


def gauge_check_warnings(checks: "tuple[GaugeCheck, ...]") -> Iterator[ResultWarning]:
    """Say which gauges did not pass the last check before a run."""
    for check in checks:
        if not check.passed:
            text = message(
                "{gauge} was {deviation_m:+.0f} um off at {expected_m:g} mm in its last check"
                " ({at}), where {tolerance_m:.0f} um are allowed. Calibrate it again:"
                " slipstand calibrate",
                gauge=message(_GAUGE_NAMES[check.gauge]),
                deviation_m=check.deviation_m * 1e6,
                expected_m=check.expected_m * 1e3,
                at=f"{check.at:%Y-%m-%d %H:%M}",
                tolerance_m=check.tolerance_m * 1e6,
            )
            yield ResultWarning("gauge-check-failed", text)


def _notes(checks: "ClassicalEstimates", result: Identification) -> list[str]:
    notes = []
    fitted = result.results.get("log_decrement")
    if checks.log_decrement is not None and fitted is not None:
        own = checks.log_decrement_uncertainty or 0.0
        away = checks.log_decrement - fitted.value
        if abs(away) > _OFF * (own**2 + fitted.standard_uncertainty**2) ** 0.5:
            bends = any(caution.code == "tail-not-exponential" for caution in result.warnings)
            cause = "dry friction in the stand" if bends else "noise or an offset"
            share = f" {away / fitted.value:+.1%}" if abs(fitted.value) > fitted.standard_uncertainty else ""
            notes.append(f"the plain log decrement is{share} off the fitted one: {cause} biases it")
    count = len(checks.friction_candidates)
    if count > 1:
        notes.append(f"the residual displacement alone allows {count} values of f_d, so it cannot choose one")
    if count == 0 and "residual_displacement_m" in result.results:
        notes.append("no f_d from 0.03 to 0.3 gives the measured residual displacement")
    return notes


def _difference(budget: Quantity, drawn: Quantity) -> float:
    """Largest distance between the ends of both 95 % intervals."""
    return max(abs(a - b) for a, b in zip(budget.interval_95, drawn.interval_95, strict=True))
