"""What is exported of a run, before any format: columns of samples, rows of coefficients, facts."""

import importlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from app.runs.errors import ExtraMissingError
from app.runs.metadata import RunSource
from app.runs.origin import GAUGES, masses_text, program_document, software_text
from app.runs.reader import Run, load_counts
from app.runs.saved_analyses import Document
from app.runs.schema import signal_path
from messages.i18n import N_

COEFFICIENT_COLUMNS = (
    "run", "series", "start_time", "kind", "model", "adequate",
    "quantity", "value", "standard_uncertainty", "interval_95_low", "interval_95_high", "unit", "label",
    "source", "program", "date", "request_hash", "inputs_hash", "calibrations", "masses", "reproduce",
)  # fmt: skip
"""Columns of the table of coefficients: a row is one quantity of one run, with the origin of its analysis."""


@dataclass(frozen=True, eq=False, slots=True)
class SampleColumn:
    """Samples of one kind."""

    name: str
    values: NDArray[Any]
    """(n,) float64, int32 or uint8; NaN where a reading is absent."""
    unit: str  # "1" for flags, "count" for readings as received


@dataclass(frozen=True, eq=False, slots=True)
class ExportedRun:
    """A run and what was found in it."""

    run: Run
    analysis: Document | None
    """As `analyze --json` gives it; None leaves the coefficients out."""
    samples: tuple[SampleColumn, ...] = field(default=())
    """Time, readings, status, counts; empty where samples are left out."""

    @property
    def name(self) -> str:
        """Name of the run, without folder and suffix; what is no text in it is replaced."""
        return self.run.path.stem.encode(errors="replace").decode()


def sample_columns(run: Run) -> tuple[SampleColumn, ...]:
    """Time, calibrated readings, status flags and counts of a run, all its samples. Raises RunError.

    Named as `time_s`, `table_displacement_m`, `plate_velocity_m_per_s`, `status`, `table_count`. A simulated
    run has a column `simulated` of ones.
    """
    unit = run.metadata.unit
    readings = [values for values in (run.table_reading, run.relative_reading) if values is not None]
    columns = [SampleColumn("time_s", run.time_s, "s")]
    columns += [SampleColumn(_name(run, gauge), values, unit) for gauge, values in enumerate(readings)]
    columns.append(SampleColumn("status", run.status, "1"))
    counts = load_counts(run)
    if counts is not None:
        named = zip(("table_count", "relative_count"), counts.T, strict=False)
        columns += [SampleColumn(name, np.ascontiguousarray(values), "count") for name, values in named]
    if run.metadata.source_type is RunSource.SIMULATED:
        columns.append(SampleColumn("simulated", np.ones(len(run), np.uint8), "1"))
    return tuple(columns)


def coefficient_rows(runs: Iterable[ExportedRun]) -> Iterator[dict[str, Any]]:
    """A row a quantity, with `COEFFICIENT_COLUMNS`: words stand under `label`; None where absent."""
    for exported in runs:
        metadata, analysis = exported.run.metadata, exported.analysis or {"results": {}}
        start, origin = metadata.start_time, _origin_cells(analysis.get("origin"))
        for quantity, result in analysis["results"].items():
            numbers, model = result if isinstance(result, dict) else {}, analysis["model"] or {}
            low, high = numbers.get("interval_95") or (None, None)
            row = (
                exported.name, metadata.series, start and start.isoformat(), analysis["kind"],
                model.get("name"), model.get("adequate"), quantity,
                numbers.get("value"), numbers.get("standard_uncertainty"), low, high, numbers.get("unit"),
                None if numbers else str(result), *origin,
            )  # fmt: skip
            yield dict(zip(COEFFICIENT_COLUMNS, row, strict=True))


def _origin_cells(origin: Document | None) -> tuple[str | None, ...]:
    """Cells of the last columns; None of an analysis without an origin."""
    if origin is None:
        return (None,) * 8
    gauges = " | ".join(
        f"{GAUGES[name]} {gauge['identity']}" for name, gauge in origin["calibrations"].items()
    )
    hashes = origin["request_hash"], origin["inputs_hash"]
    made = origin["source"], software_text(origin), origin["date"]
    return (*made, *hashes, gauges, masses_text(origin), origin["reproduce"])


def run_metadata_document(run: Run) -> dict[str, Any]:
    """Everything that a run carries beside its samples, as plain JSON values."""
    facts = {"metadata": run.metadata, "ending": run.end, "changes": run.changes}
    known = {"identifier": run.identifier, "source": run.metadata.source_type.value}
    return (
        known
        | {name: msgspec.to_builtins(fact) for name, fact in facts.items()}
        | {"exported_by": program_document()}
    )


def import_optional(module: str, for_what: str) -> Any:
    """Import a library of the extra `exchange`, which few need. Raises ExtraMissingError."""
    try:
        return importlib.import_module(module)
    except ImportError:
        package = module.partition(".")[0]
        template = N_("{for_what} needs {package}, which is not installed. Install it: pip install {package}")
        raise ExtraMissingError(template, for_what=for_what, package=package) from None


def _name(run: Run, gauge: int) -> str:
    metadata = run.metadata
    path = signal_path(gauge, metadata.quantity, metadata.gauges.relative.measures)
    unit = metadata.unit.replace("/", "_per_").replace("^", "")
    return f"{path.rpartition('/')[2]}_{unit}"
