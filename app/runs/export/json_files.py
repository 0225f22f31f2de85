"""JSON: one document with facts, samples and analysis."""

import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import msgspec

from app.runs.export.content import Exported, coefficient_documents, run_facts
from app.runs.export.safe_file import new_file

RUN_SCHEMA = "slipstand-run/1"
COEFFICIENTS_SCHEMA = "slipstand-coefficients/1"


def write_run(exported: Exported, path: Path, *, replace: bool = False) -> None:
    """Write a run; numbers that are absent or not finite are null.

    Raises
    ------
    RunExistsError, DiskFullError, WriteError
    """
    samples = {
        column.name: {"unit": column.unit, "values": plain(column.values.tolist())}
        for column in exported.samples
    }
    document = {
        "schema": RUN_SCHEMA,
        "name": exported.name,
        **plain(run_facts(exported.run)),
        "samples": samples,
        "analysis": exported.analysis,
    }
    _write(document, path, replace)


def write_coefficients(runs: Iterable[Exported], path: Path, *, replace: bool = False) -> None:
    """Write a list of objects, one a quantity. Raises RunExistsError, DiskFullError, WriteError."""
    rows = coefficient_documents(runs)
    _write({"schema": COEFFICIENTS_SCHEMA, "coefficients": rows}, path, replace)


def plain(value: Any) -> Any:
    """Values that JSON knows: numbers that are not finite become null."""
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _write(document: dict[str, Any], path: Path, replace: bool) -> None:
    with new_file(path.absolute(), replace=replace) as made:
        made.write_bytes(msgspec.json.format(msgspec.json.encode(document), indent=1) + b"\n")
