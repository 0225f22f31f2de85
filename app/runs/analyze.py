"""One run identified: from its file to the numbers, and back into the file when asked."""

import dataclasses
import math
from collections.abc import Callable
from pathlib import Path

import msgspec

from analysis.classical_estimates import estimate_classically
from analysis.identification import Identification
from analysis.identify import identify
from analysis.one_mass.identify import identify_one_mass
from analysis.quantities import Quantity
from analysis.record import Record
from app.runs import analysis_json
from app.runs.analysis_input import to_record
from app.runs.analysis_request import AnalysisRequest
from app.runs.metadata import QUANTITY_UNITS
from app.runs.origin import analysis_origin
from app.runs.reader import Run, open_run
from app.runs.saved_analyses import (
    Document,
    SavedAnalysis,
    analysis_document,
    inputs_hash,
    latest_valid,
    save_analysis,
)
from app.runs.validator import Validator
from drivers.samples import Losses
from messages.message import Message

Progress = Callable[[float, str | Message], None]
"""Called with the share that is done and what is being done, a name or a message."""
REFITS_MIN, REFITS_MAX = 100, 1_000_000
"""A 95 % interval of fewer refits would be that of a handful."""


@dataclasses.dataclass(frozen=True, eq=False)
class Analysis:
    """What an identification took and gave; `document` is what `analyze --json` says."""

    run: Run
    record: Record
    identification: Identification
    document: Document
    saved_as: int | None = None
    repeats: SavedAnalysis | None = None  # the kept analysis that it repeats


def analyze_run(
    path: Path,
    request: AnalysisRequest,
    *,
    save: bool = False,
    progress: Progress | None = None,
    validator: Validator | None = None,
    trusted: bool = False,
) -> Analysis:
    """Identify one run, and keep the result in it with `save`. Raises RunError, AnalysisError.

    `progress` is called with the share done (0 to 1) and what is being done. `validator` is to be given
    for many runs, else one is started. `trusted`: the caller has validated the file.
    """
    run = open_run(path, validator=validator, trusted=trusted)
    whole = _with_masses(to_record(run, metres_only=request.kind == "two-mass"), request)
    record = _selected(whole, request)
    if request.kind == "one-mass":
        identification = _one_mass(run, record, request)
    else:
        identification = identify(
            record, model=request.model, progress=progress, monte_carlo=request.monte_carlo
        )
    record = record.replace(decay_end_s=identification.events.free_decay_end_s)
    metadata = run.metadata
    identification.warnings.extend(
        [
            *analysis_json.mass_warnings(metadata, record.masses),
            *analysis_json.added_mass_warnings(request, record.masses),
            *analysis_json.unstated_warnings(record, identification),
            *analysis_json.calibration_warnings(
                metadata.gauges, metadata.start_time and metadata.start_time.date()
            ),
            *analysis_json.gauge_check_warnings(metadata.gauge_checks),
            *(
                analysis_json.zero_warnings(run.end, record, identification)
                if request.kind == "two-mass"
                else ()
            ),
        ]
    )
    losses = run.end.losses if run.end else Losses(samples=len(run))
    document = analysis_document(path, metadata.series, losses, identification)
    inputs = inputs_hash(whole)
    document["origin"] = analysis_origin(
        path, metadata, run.identifier, request, inputs, has_gauge_2=run.relative_reading is not None
    )
    if request.classical:
        document["classical"] = _classical(record, identification)
    if identification.monte_carlo is not None:
        document["monte_carlo"] = analysis_json.monte_carlo_document(
            identification.monte_carlo, identification.results
        )
    number = None
    if save:
        number = save_analysis(path, document, inputs, msgspec.to_builtins(request))
    return Analysis(run, record, identification, document, number)


def _classical(record: Record, result: Identification) -> Document | None:
    if result.kind == "one-mass":
        return analysis_json.one_mass_document(result)
    if "friction_dynamic" not in result.parameters:
        return None
    return analysis_json.classical_document(estimate_classically(record, result), result)


def _one_mass(run: Run, record: Record, request: AnalysisRequest) -> Identification:
    metadata = run.metadata
    in_metres = metadata.unit == QUANTITY_UNITS[metadata.quantity]
    mass = None
    if in_metres or request.table_mass_kg is not None:
        table, added_kg = record.masses, request.added_mass_kg or 0.0
        uncertainty_kg = math.hypot(table.table_mass_uncertainty_kg, request.added_mass_uncertainty_kg)
        mass = Quantity.normal(table.table_mass_kg + added_kg, uncertainty_kg, "kg")
    unit = "m" if in_metres else metadata.unit.partition("/")[0]
    return identify_one_mass(record, quantity=metadata.quantity, unit=unit, mass=mass)


def _with_masses(record: Record, request: AnalysisRequest) -> Record:
    given = {
        name: value
        for name in ("table_mass_kg", "plate_mass_kg")
        if (value := getattr(request, name)) is not None
    }
    return record.replace(masses=dataclasses.replace(record.masses, **given)) if given else record


def _selected(record: Record, request: AnalysisRequest) -> Record:
    """The part of the record that is asked for. Raises RecordError for a span that the record lacks."""
    if request.from_s is not None or request.until_s is not None:
        ends = (request.from_s, -math.inf), (request.until_s, math.inf)
        record = record.between(*(end if given is None else given for given, end in ends))
    return record.replace(release=request.release)


def repeat_saved_analysis(path: Path, validator: Validator | None = None) -> Analysis:
    """Identify a run as its newest analysis that still stands did. Raises RunError, AnalysisError."""
    run = open_run(path, validator=validator)
    in_metres = run.metadata.unit == "m" and run.metadata.quantity == "displacement"
    kept = latest_valid(run.analyses, to_record(run, metres_only=in_metres))
    asked = None if kept is None else AnalysisRequest.of_settings(kept.settings)
    request = msgspec.structs.replace(asked or AnalysisRequest(), classical=False, monte_carlo=None)
    analysis = analyze_run(path, request, trusted=True)
    return analysis if kept is None else dataclasses.replace(analysis, repeats=kept)
