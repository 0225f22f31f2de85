"""JSON: one document with facts, samples and analysis."""

import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import msgspec

from app.runs.disk import atomic_write
from app.runs.exchange.content import ExportedRun, coefficient_documents, run_metadata_document

RUN_SCHEMA = "slipstand-run/1"
COEFFICIENTS_SCHEMA = "slipstand-coefficients/1"


def write_run(exported: ExportedRun, path: Path, *, replace: bool = False) -> None:
    """Write a run; numbers that are absent or not finite are null.

    Raises RunExistsError, DiskFullError, WriteError.
    """
    samples = {
        column.name: {"unit": column.unit, "values": json_value(column.values.tolist())}
        for column in exported.samples
    }
    document = {
        "schema": RUN_SCHEMA,
        "name": exported.name,
        **json_value(run_metadata_document(exported.run)),
        "samples": samples,
        "analysis": exported.analysis,
    }
    _write(document, path, replace)


def write_coefficients(runs: Iterable[ExportedRun], path: Path, *, replace: bool = False) -> None:
    """Write a list of objects, one a quantity. Raises RunExistsError, DiskFullError, WriteError."""
    rows = coefficient_documents(runs)
    _write({"schema": COEFFICIENTS_SCHEMA, "coefficients": rows}, path, replace)


def json_value(value: Any) -> Any:
    """Values that JSON knows: numbers that are not finite become null."""
    if isinstance(value, dict):
        return {key: json_value(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [json_value(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _write(document: dict[str, Any], path: Path, replace: bool) -> None:
    with atomic_write(path.absolute(), replace=replace) as made:
        made.write_bytes(msgspec.json.format(msgspec.json.encode(document), indent=1) + b"\n")
