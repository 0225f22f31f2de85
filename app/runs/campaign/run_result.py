"""What a campaign takes of one run file: its newest result that still stands, else a new one."""

import contextlib
import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

import h5py
import msgspec

from analysis.campaign.series import RunResult, SeriesKey
from analysis.identification import Degree
from analysis.quantities import BudgetLine, BudgetSource, Quantity
from app.runs.analysis_input import CLOCK_TOLERANCE
from app.runs.analysis_json import read_budget_line, read_quantity, read_warning
from app.runs.analyze import Progress, analyze_run
from app.runs.batch.tasks import (
    AnalysisTask,
    error_message,
    kept_document,
    latest_valid_in_file,
    validate_and_count,
)
from app.runs.hashes import content_hash
from app.runs.metadata import RunMetadata
from app.runs.metadata_io import read_identifier, read_metadata
from app.runs.reader import read_file
from app.runs.saved_analyses import Document
from app.runs.validator import Validator, shared_validator
from config.schema import ConfigError
from messages.message import EMPTY, Message

_MASSES = ("table_mass_kg", "plate_mass_kg")
_OF_CALIBRATION = (
    "gain_m_per_count",
    "gain_relative_standard_uncertainty",
    "polynomial",
    "nonlinearity_m",
    "delay_s",
    "delay_standard_uncertainty_s",
    "serial_number",
    "date",
)


class RunDetails(msgspec.Struct, frozen=True):
    """What is known of a run beside its result."""

    metadata: RunMetadata
    identifier: str
    analysis: int | None = None
    """NNN of the `/entry/analysis_NNN` that was taken; None for a result that is not kept."""
    stale: bool = False  # a newer analysis is kept in the run that does not stand any more
    damaged: tuple[int, ...] = ()  # numbers of kept analyses that are not what was kept
    origin: Document = {}  # of the result, as `analyze --json` gives it


class CollectedRun(msgspec.Struct, frozen=True):
    """What came of one run: its result, or why there is none."""

    path: str
    error: Message = EMPTY
    details: RunDetails | None = None
    """None for a run that cannot be read."""
    result: RunResult | None = None


def collect_run(
    task: AnalysisTask, progress: Progress | None = None, validator: Validator | None = None
) -> CollectedRun:
    """Take what a campaign needs of a run. Never raises: what goes wrong is in the outcome."""
    path, details = Path(task.path), None
    try:
        validate_and_count(path, validator or shared_validator())
        details, document = read_file(path, _read)
        if document is None:
            analysis = analyze_run(path, task.request, save=task.save, progress=progress, trusted=True)
            document = analysis.document
            details = msgspec.structs.replace(details, analysis=analysis.saved_as, origin=document["origin"])
        return CollectedRun(task.path, details=details, result=run_result(path, details.metadata, document))
    except Exception as error:
        return CollectedRun(task.path, error_message(error), details)


def collect_kept(path: Path, validator: Validator | None = None) -> CollectedRun:
    """Take the newest result that is kept in a run and still stands, if there is one. Never raises."""
    try:
        validate_and_count(path, validator or shared_validator())
        details, document = read_file(path, _read)
        result = None if document is None else run_result(path, details.metadata, document)
        return CollectedRun(str(path), details=details, result=result)
    except Exception as error:
        return CollectedRun(str(path), error_message(error))


def _read(file: h5py.File) -> tuple[RunDetails, Document | None]:
    metadata = read_metadata(file)
    saved, stale, damaged = latest_valid_in_file(
        file,
        metadata,
        lambda saved: (
            saved.document["kind"] == "two-mass" and not any(saved.settings.get(name) for name in _MASSES)
        ),
    )
    details = RunDetails(metadata, read_identifier(file), stale=stale, damaged=damaged)
    if saved is None:
        return details, None
    document = kept_document(file, saved, metadata)
    return msgspec.structs.replace(
        details, analysis=saved.number, origin=document.get("origin", {})
    ), document


def run_result(path: Path, metadata: RunMetadata, document: Document) -> RunResult:
    """What a campaign takes of an analysed run."""
    mass_u_kg = metadata.stand.plate_mass_standard_uncertainty_kg
    mass = Quantity.normal(metadata.plate_mass_kg, mass_u_kg, "kg")
    plate_mass_line = BudgetLine(BudgetSource.PLATE_MASS, "plate_mass_kg", mass_u_kg)
    found = document["results"].items()
    results = {name: read_quantity(value) for name, value in found if isinstance(value, dict)}
    lines = _with_nominal_rate(map(read_budget_line, document["budget"]), results.get("period_s"))
    stand, device, model = metadata.stand, metadata.device, document["model"] or {}
    calibrations = (metadata.gauges.table, metadata.gauges.relative)
    return RunResult(
        name=str(path),
        series=series_key(metadata),
        results={"plate_mass_kg": mass} | results,
        budget=(*lines, plate_mass_line),
        calibration_id=content_hash(
            [getattr(gauge, name) for gauge in calibrations for name in _OF_CALIBRATION]
        ),
        stand_id=content_hash(
            [stand.name, stand.gravity_m_per_s2, device.protocol, device.name, device.serial_number]
        ),
        adequate=model.get("adequate"),
        friction_holds=model.get("degree") == Degree.FRICTION.value,
        effects=_effects(model),
        noise_m=model.get("noise_rms_m"),
        msk64_degree=document["results"].get("msk64_degree", ""),
        warnings=tuple(map(read_warning, document["warnings"])),
    )


def _with_nominal_rate(lines: Iterable[BudgetLine], period: Quantity | None) -> Iterator[BudgetLine]:
    """Part the time base: the clock as timed in this run, and the device's nominal rate, alike in all runs.

    With t as timed and p of the nominal rate, u^2 = t^2 p^2 / (t^2 + p^2) of both together holds u^4 / p^2 of
    the nominal rate (docs/decisions/0006). The period has the relative uncertainty of the clock.
    """
    budget = list(lines)
    clock = (
        line.standard_uncertainty
        for line in budget
        if line.source is BudgetSource.TIME_BASE and line.contribution_to == "period_s"
    )
    share = min(1.0, next(clock, 0.0) / period.value / CLOCK_TOLERANCE) if period else 0.0
    for line in budget:
        if line.source is BudgetSource.TIME_BASE and share:
            size = line.standard_uncertainty
            yield replace(line, standard_uncertainty=size * math.sqrt(1.0 - share**2))
            yield replace(line, source=BudgetSource.NOMINAL_RATE, standard_uncertainty=size * share)
        else:
            yield line


def _effects(model: Document) -> tuple[str, ...] | None:
    """Effects of the stand in a model; None of a law that was asked for, and of versions that knew none."""
    looked_for = "parts" in model and len(model["tried"]) > 1
    return tuple(model["parts"]) if looked_for else None


def series_key(metadata: RunMetadata) -> SeriesKey:
    """The series of a run; a contact that is not of the series code is called by its own name."""
    contact = metadata.conditions.contact_id
    with contextlib.suppress(ConfigError):
        contact = metadata.stand.series(metadata.series or "").contact
    return SeriesKey(
        metadata.series or "", contact, metadata.pullback_m, metadata.plate_mass_kg, metadata.table_mass_kg
    )
