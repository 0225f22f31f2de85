"""Parquet: samples as columns with their units, facts and analysis as metadata of the table."""

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from app.runs.export.content import COEFFICIENT_COLUMNS, Exported, coefficient_documents, run_facts
from app.runs.export.safe_file import new_file
from app.runs.extras import extra

if TYPE_CHECKING:
    import pyarrow


def write_run(exported: Exported, path: Path, *, replace: bool = False) -> None:
    """Write a run; absent readings are null. The facts are JSON under `slipstand` in the metadata.

    Raises
    ------
    ExtraMissingError, RunExistsError, DiskFullError, WriteError
    """
    pa = extra("pyarrow", "Parquet")
    facts = run_facts(exported.run) | {"analysis": exported.analysis}
    fields = [
        pa.field(column.name, pa.from_numpy_dtype(column.values.dtype), metadata={"units": column.unit})
        for column in exported.samples
    ]
    arrays = [pa.array(column.values, from_pandas=True) for column in exported.samples]
    schema = pa.schema(fields, metadata={"slipstand": msgspec.json.encode(facts)})
    _write(pa.Table.from_arrays(arrays, schema=schema), path, replace)


def write_coefficients(runs: Iterable[Exported], path: Path, *, replace: bool = False) -> None:
    """Write a row a quantity.

    Raises
    ------
    ExtraMissingError, RunExistsError, DiskFullError, WriteError
    """
    pa = extra("pyarrow", "Parquet")
    rows = coefficient_documents(runs)
    kinds = dict.fromkeys(COEFFICIENT_COLUMNS, pa.string())
    kinds |= dict.fromkeys(
        ("value", "standard_uncertainty", "interval_95_low", "interval_95_high"), pa.float64()
    )
    kinds["adequate"] = pa.bool_()
    _write(pa.Table.from_pylist(rows, schema=pa.schema(list(kinds.items()))), path, replace)


def _write(table: "pyarrow.Table", path: Path, replace: bool) -> None:
    parquet = extra("pyarrow.parquet", "Parquet")
    with new_file(path.absolute(), replace=replace) as made:
        parquet.write_table(table, made)
