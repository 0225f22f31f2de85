"""Parquet: samples as columns with their units, facts and analysis as metadata of the table."""

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from app.runs.disk import atomic_write
from app.runs.exchange.content import (
    COEFFICIENT_COLUMNS,
    ExportedRun,
    coefficient_documents,
    import_optional,
    run_metadata_document,
)

if TYPE_CHECKING:
    import pyarrow


def write_run(exported: ExportedRun, path: Path, *, replace: bool = False) -> None:
    """Write a run; absent readings are null. The facts are JSON under `slipstand` in the metadata.

    Raises ExtraMissingError, RunExistsError, DiskFullError, WriteError.
    """
    pa = import_optional("pyarrow", "Parquet")
    facts = run_metadata_document(exported.run) | {"analysis": exported.analysis}
    fields = [
        pa.field(column.name, pa.from_numpy_dtype(column.values.dtype), metadata={"units": column.unit})
        for column in exported.samples
    ]
    arrays = [pa.array(column.values, from_pandas=True) for column in exported.samples]
    schema = pa.schema(fields, metadata={"slipstand": msgspec.json.encode(facts)})
    _write(pa.Table.from_arrays(arrays, schema=schema), path, replace)


def write_coefficients(runs: Iterable[ExportedRun], path: Path, *, replace: bool = False) -> None:
    """Write a row a quantity. Raises ExtraMissingError, RunExistsError, DiskFullError, WriteError."""
    pa = import_optional("pyarrow", "Parquet")
    rows = coefficient_documents(runs)
    kinds = dict.fromkeys(COEFFICIENT_COLUMNS, pa.string())
    kinds |= dict.fromkeys(
        ("value", "standard_uncertainty", "interval_95_low", "interval_95_high"), pa.float64()
    )
    kinds["adequate"] = pa.bool_()
    _write(pa.Table.from_pylist(rows, schema=pa.schema(list(kinds.items()))), path, replace)


def _write(table: "pyarrow.Table", path: Path, replace: bool) -> None:
    parquet = import_optional("pyarrow.parquet", "Parquet")
    with atomic_write(path.absolute(), replace=replace) as made:
        parquet.write_table(table, made)
