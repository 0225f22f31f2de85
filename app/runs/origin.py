"""Origin of a result: program, request, inputs, masses, calibrations, and the command that repeats it."""

import datetime
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import msgspec

from analysis.catalogue import ACCELERATION, KILOGRAM
from app.runs.analysis_request import AnalysisRequest
from app.runs.hashes import content_hash
from app.runs.metadata import RunMetadata, RunSource
from app.version import __version__, commit
from config.schema import Filter, Gauge

Document = dict[str, Any]
SIMULATED: Final = "SIMULATED"
"""Stands beside every result of a run that no real stand has made."""
SIMULATED_RUN: Final = f"{SIMULATED}: this run is of a simulated stand, not of a real one"
GAUGES: Final = {"table": "gauge 1", "relative": "gauge 2"}


def program_document() -> Document:
    """Program, its version, its commit where that is known, and the time."""
    now = datetime.datetime.now().astimezone()
    return {
        "program": "slipstand",
        "version": __version__,
        "commit": commit() or None,
        "date": now.isoformat(timespec="seconds"),
    }


def analysis_origin(
    path: Path,
    metadata: RunMetadata,
    identifier: str,
    request: AnalysisRequest,
    inputs: str,
    *,
    has_gauge_2: bool,
) -> Document:
    """Origin of an analysis that is made now; `inputs` is the hash of the record that it takes."""
    stand = metadata.stand
    table_kg, plate_kg = request.table_mass_kg, request.plate_mass_kg
    gauges = [metadata.gauges.table, *([metadata.gauges.relative] if has_gauge_2 else [])]
    return program_document() | {
        "request": {"model": request.model, "kind": request.kind} | request.given,
        "request_hash": request.identity,
        "run_identifier": identifier,
        "source": metadata.source_type.value,
        "source_file": msgspec.to_builtins(metadata.source_file) if metadata.source_file.name else None,
        "inputs_hash": inputs,
        "masses": {
            "table_mass_kg": metadata.table_mass_kg if table_kg is None else table_kg,
            "table_mass_standard_uncertainty_kg": stand.table_mass_standard_uncertainty_kg,
            "plate_mass_kg": metadata.plate_mass_kg if plate_kg is None else plate_kg,
            "plate_mass_standard_uncertainty_kg": stand.plate_mass_standard_uncertainty_kg,
        },
        "gravity_m_per_s2": stand.gravity_m_per_s2,
        "gravity_standard_uncertainty_m_per_s2": stand.gravity_standard_uncertainty_m_per_s2,
        "calibrations": dict(zip(GAUGES, map(calibration_document, gauges), strict=False)),
        "reproduce": request.command(path.absolute()),
    }


def calibration_document(gauge: Gauge) -> Document:
    """What is known of a gauge, its filter included, with the hash of that as its identity."""
    values = msgspec.to_builtins(gauge).items()
    stated = {name: value for name, value in values if value not in (None, "", ())}
    return {"identity": content_hash(stated)} | stated


def is_simulated(origin: Document) -> bool:
    """Tell whether the samples of a result come from a simulated stand."""
    return origin.get("source") == RunSource.SIMULATED


def origin_rows(origin: Document) -> Iterator[tuple[str, str]]:
    """Facts of an origin with their names, for people."""
    yield "program", software_text(origin)
    yield "analysed", origin["date"]
    file = origin["source_file"]
    yield "source", origin["source"] + (f" from {file['name']}, SHA-256 {file['sha256']}" if file else "")
    yield "request", request_text(origin)
    yield "inputs", origin["inputs_hash"]
    yield "masses", masses_text(origin)
    for name, gauge in origin["calibrations"].items():
        yield GAUGES[name], calibration_text(gauge)
    yield "reproduce", origin["reproduce"]


def software_text(origin: Document) -> str:
    """Program with version and commit: `slipstand 0.1.0 (229b00461f68)`."""
    made_of = f" ({origin['commit']})" if origin.get("commit") else ""
    return f"{origin['program']} {origin['version']}{made_of}"


def request_text(origin: Document) -> str:
    """What was asked for, with its identity: `model auto, kind two-mass (01e7b720ff566d53)`."""
    asked = ", ".join(f"{name} {value}" for name, value in origin["request"].items())
    return f"{asked} ({origin['request_hash']})"


def masses_text(origin: Document) -> str:
    """Masses and gravity: `m1 131.6 kg, m2 22.4 kg, g 9.81 m/s²`."""
    masses = origin["masses"]
    table, plate = (f"{masses[f'{body}_mass_kg']:g} {KILOGRAM.symbol}" for body in ("table", "plate"))
    return f"m1 {table}, m2 {plate}, g {origin['gravity_m_per_s2']:g} {ACCELERATION.symbol}"


def calibration_text(gauge: Document) -> str:
    """A calibration with its identity: `SIM-1 of 2026-01-12 (6f0d...), no filter stated`."""
    named = " of ".join(str(gauge[name]) for name in ("serial_number", "date") if name in gauge)
    stated = msgspec.convert(gauge["filter"], Filter) if "filter" in gauge else None
    through = "no filter stated" if stated is None else str(stated.description)
    return f"{named or 'calibration'} ({gauge['identity']}), {through}"
