"""What is exported of a run, before any format: columns of samples, rows of coefficients, facts."""

import importlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from app.runs.errors import ExtraMissingError
from app.runs.reader import Run, load_counts
from app.runs.saved_analyses import Document
from app.runs.schema import signal_path
from messages.i18n import N_

COEFFICIENT_COLUMNS = (
    "run", "series", "start_time", "kind", "model", "adequate",
    "quantity", "value", "standard_uncertainty", "interval_95_low", "interval_95_high", "unit", "label",
)  # fmt: skip
"""Columns of the table of coefficients: a row is one quantity of one run."""


@dataclass(frozen=True, eq=False, slots=True)
class SampleColumn:
    """Samples of one kind."""

    name: str
    """With the unit: `table_displacement_m`."""
    values: NDArray[Any]
    """(n,) float64, int32 or uint8; NaN where a reading is absent."""
    unit: str
    """"1" for flags, "count" for readings as received."""


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

    Named as `time_s`, `table_displacement_m`, `plate_velocity_m_per_s`, `status`, `table_count`.
    """
    unit = run.metadata.unit
    readings = (
        [run.table_reading] if run.relative_reading is None else [run.table_reading, run.relative_reading]
    )
    columns = [SampleColumn("time_s", run.time_s, "s")]
    columns += [SampleColumn(_name(run, gauge), values, unit) for gauge, values in enumerate(readings)]
    columns.append(SampleColumn("status", run.status, "1"))
    counts = load_counts(run)
    if counts is not None:
        names = ("table_count", "relative_count")
        columns += [
            SampleColumn(names[i], np.ascontiguousarray(counts[:, i]), "count")
            for i in range(counts.shape[1])
        ]
    return tuple(columns)


def coefficient_rows(exported: ExportedRun) -> Iterator[tuple[Any, ...]]:
    """Rows of `COEFFICIENT_COLUMNS`: numbers under `value`, words under `label`, None where absent."""
    analysis = exported.analysis
    if analysis is None:
        return
    metadata = exported.run.metadata
    model = analysis["model"] or {}
    about = (
        exported.name,
        metadata.series,
        metadata.start_time.isoformat(),
        analysis["kind"],
        model.get("name"),
        model.get("adequate"),
    )
    for quantity, result in analysis["results"].items():
        if isinstance(result, dict):
            low, high = result["interval_95"] or (None, None)
            numbers: tuple[Any, ...] = (
                result["value"],
                result["standard_uncertainty"],
                low,
                high,
                result["unit"],
                None,
            )
        else:
            numbers = (None, None, None, None, None, str(result))
        yield (*about, quantity, *numbers)


def coefficient_documents(runs: Iterable[ExportedRun]) -> list[dict[str, Any]]:
    """Rows of `coefficient_rows` of several runs, as dicts by column."""
    return [
        dict(zip(COEFFICIENT_COLUMNS, row, strict=True))
        for exported in runs
        for row in coefficient_rows(exported)
    ]


def run_metadata_document(run: Run) -> dict[str, Any]:
    """Everything that a run carries beside its samples, as plain JSON values."""
    ending = None if run.end is None else msgspec.to_builtins(run.end)
    return {
        "identifier": run.identifier,
        "metadata": msgspec.to_builtins(run.metadata),
        "ending": ending,
        "changes": msgspec.to_builtins(list(run.changes)),
    }


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
