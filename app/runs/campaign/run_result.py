"""What a campaign takes of one run file: its newest result that still stands, else a new one."""

import contextlib
import datetime
import hashlib
from pathlib import Path
from typing import Any

import h5py
import msgspec

from analysis.campaign.series import RunResult, SeriesKey
from analysis.quantities import BudgetLine, BudgetSource, Quantity
from app.runs.analysis_json import read_budget_line, read_quantity, read_warning
from app.runs.analyze import AnalysisRequest, Progress, analyze_run
from app.runs.batch.tasks import error_message, latest_valid_in_file, validate_and_count
from app.runs.metadata import Conditions, RunMetadata
from app.runs.metadata_io import read_identifier, read_metadata
from app.runs.reader import read_file
from app.runs.saved_analyses import Document
from app.runs.validator import Validator, shared_validator
from config.schema import ConfigError, Gauges, Stand
from messages.message import Message

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


class CollectTask(msgspec.Struct, frozen=True):
    """A run to take; where no result is kept in it that still stands it is analysed, and kept with `save`."""

    path: str
    request: AnalysisRequest = AnalysisRequest(classical=False)
    save: bool = False


class RunDetails(msgspec.Struct, frozen=True):
    """What is known of a run beside its result."""

    identifier: str
    """UUID given when it was recorded: the same under every name."""
    start_time: datetime.datetime
    series: str
    """"" where not known."""
    operator: str
    note: str
    source: str
    conditions: Conditions
    table_mass_kg: float
    plate_mass_kg: float
    stand: str
    """Identities, see `CollectedRuns.stands` and `CollectedRuns.gauges`."""
    calibration: str
    analysis: int | None = None
    """NNN of the `/entry/analysis_NNN` that was taken; None for a result that is not kept."""
    stale: bool = False
    """A newer analysis is kept in the run that does not stand any more."""
    truth: dict[str, float | int | str] = {}
    """Of a simulated run."""
    excluded: str = ""
    """Why the run does not count, as kept in it; "" for one that does."""


class CollectedRun(msgspec.Struct, frozen=True):
    """What came of one run: its result with all that goes with it, or why there is none.

    `excluded` is the reason of a run without a result that is excluded in any case.
    """

    path: str
    error: Message = Message("")
    excluded: str = ""
    result: RunResult | None = None
    details: RunDetails | None = None
    stand: Stand | None = None
    gauges: Gauges | None = None


class _Read(msgspec.Struct, frozen=True):
    metadata: RunMetadata
    identifier: str
    document: Document | None
    number: int | None
    stale: bool


def collect_run(
    task: CollectTask, progress: Progress | None = None, validator: Validator | None = None
) -> CollectedRun:
    """Take what a campaign needs of a run. Never raises: what goes wrong is in the account."""
    path, excluded = Path(task.path), ""
    try:
        validate_and_count(path, validator or shared_validator())
        read = read_file(path, _read)
        document, number, excluded = read.document, read.number, read.metadata.excluded
        if document is None:
            analysis = analyze_run(path, task.request, save=task.save, progress=progress, trusted=True)
            document, number = analysis.document, analysis.saved_as
        return _account(path, read, document, number)
    except Exception as error:
        return CollectedRun(task.path, error_message(error), excluded)


def calibration_identity(gauges: Gauges) -> str:
    """What two runs have in common whose readings share the errors of one calibration."""
    pair = (gauges.table, gauges.relative)
    return _hash([getattr(gauge, name) for gauge in pair for name in _OF_CALIBRATION])


def stand_identity(metadata: RunMetadata) -> str:
    """What two runs have in common that share the errors of masses, gravity and clock."""
    stand, device = metadata.stand, metadata.device
    return _hash([stand.name, stand.gravity_m_per_s2, device.protocol, device.name, device.serial_number])


def result_quantities(document: Document) -> dict[str, Quantity]:
    """Results of an analysis; what was not finite is NaN."""
    results = document["results"].items()
    return {name: read_quantity(value) for name, value in results if isinstance(value, dict)}


def _read(file: h5py.File) -> _Read:
    metadata = read_metadata(file)
    saved, stale = latest_valid_in_file(
        file,
        metadata,
        lambda saved: (
            saved.document["kind"] == "two-mass" and not any(saved.settings.get(name) for name in _MASSES)
        ),
    )
    return _Read(
        metadata,
        read_identifier(file),
        saved.document if saved else None,
        saved.number if saved else None,
        stale,
    )


def _account(path: Path, read: _Read, document: Document, number: int | None) -> CollectedRun:
    metadata = read.metadata
    facts = RunDetails(
        read.identifier,
        metadata.start_time,
        metadata.series or "",
        metadata.operator,
        metadata.note,
        metadata.source,
        metadata.conditions,
        metadata.table_mass_kg,
        metadata.plate_mass_kg,
        stand_identity(metadata),
        calibration_identity(metadata.gauges),
        number,
        read.stale,
        metadata.truth,
        metadata.excluded,
    )
    result = run_result(path, metadata, document)
    return CollectedRun(str(path), result=result, details=facts, stand=metadata.stand, gauges=metadata.gauges)


def run_result(path: Path, metadata: RunMetadata, document: Document) -> RunResult:
    """What a campaign takes of an analysed run."""
    mass_u_kg = metadata.stand.plate_mass_standard_uncertainty_kg
    mass = Quantity.normal(metadata.plate_mass_kg, mass_u_kg, "kg")
    plate_mass_line = BudgetLine(BudgetSource.PLATE_MASS, "plate_mass_kg", mass_u_kg)
    return RunResult(
        name=str(path),
        series=series_key(metadata),
        results={"plate_mass_kg": mass} | result_quantities(document),
        budget=(*map(read_budget_line, document["budget"]), plate_mass_line),
        calibration_id=calibration_identity(metadata.gauges),
        stand_id=stand_identity(metadata),
        adequate=(document["model"] or {}).get("adequate"),
        msk64_degree=document["results"].get("msk64_degree", ""),
        warnings=tuple(map(read_warning, document["warnings"])),
    )


def series_key(metadata: RunMetadata) -> SeriesKey:
    """The series of a run; a contact that is not of the series code is called by its own name."""
    contact = metadata.conditions.contact_id
    with contextlib.suppress(ConfigError):
        contact = metadata.stand.series(metadata.series or "").contact
    return SeriesKey(
        metadata.series or "", contact, metadata.pullback_m, metadata.plate_mass_kg, metadata.table_mass_kg
    )


def _hash(facts: list[Any]) -> str:
    return hashlib.blake2b(msgspec.json.encode(facts), digest_size=8).hexdigest()
