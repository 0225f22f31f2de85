"""Parquet files, by pyarrow."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.runs.errors import ImportFileError
from app.runs.exchange.columns import ReportShare
from app.runs.exchange.content import import_optional
from app.runs.exchange.csv_layout import FileLayout
from app.runs.exchange.tables import SHOWN_ROWS, Table
from messages.i18n import N_

_BATCH_ROWS = 1 << 17
_CHUNK_BYTES = 1 << 28
"""Part of a column between two others, unpacked: its pages may be no smaller."""


def open_table(path: Path, _layout: FileLayout, report: ReportShare) -> Table:
    """Columns by their names; timestamps are date-times. Raises ImportFileError, ExtraMissingError."""
    file = import_optional("pyarrow.parquet", "Parquet").ParquetFile(path, pre_buffer=False)
    types = import_optional("pyarrow.types", "Parquet")
    fields = list(file.schema_arrow)
    names, rows = [field.name for field in fields], file.metadata.num_rows
    chunks = _largest_chunks(file.metadata)

    def column(at: int) -> NDArray[Any]:
        kind = fields[at].type
        kind = kind.value_type if types.is_dictionary(kind) else kind
        if not (types.is_integer(kind) or types.is_floating(kind) or types.is_temporal(kind)):
            template = N_("{path}, column {name}: {type} is no number. Export plain numbers")
            raise ImportFileError(template, path=path, name=names[at], type=fields[at].type)
        if chunks.get(names[at], 0) > _CHUNK_BYTES:
            template = N_("{path}, column {name}: a row group is too large to be loaded. Export smaller ones")
            raise ImportFileError(template, path=path, name=names[at])
        parts, done = [np.empty(0)], 0
        for batch in file.iter_batches(_BATCH_ROWS, columns=[names[at]], use_threads=False):
            parts.append(batch.column(0).to_numpy(zero_copy_only=False))
            done += len(parts[-1])
            report(done / rows)
        return np.concatenate(parts[1:] or parts)

    return Table(
        names,
        column,
        has_zone=any(getattr(field.type, "tz", None) for field in fields),
        first_rows=_first_rows(file, names, chunks),
        lengths=[rows] * len(names),
    )


def _largest_chunks(metadata: Any) -> dict[str, int]:
    """Bytes of the largest part of each plain column between two others, unpacked."""
    largest: dict[str, int] = {}
    for group in map(metadata.row_group, range(metadata.num_row_groups)):
        for chunk in map(group.column, range(group.num_columns)):
            name, size_bytes = chunk.path_in_schema, chunk.total_uncompressed_size
            largest[name] = max(largest.get(name, 0), size_bytes)
    return largest


def _first_rows(file: Any, names: list[str], chunks: dict[str, int]) -> tuple[tuple[str, ...], ...]:
    """Cells of the first rows; empty ones of columns that are not plain, or too large."""
    shown = [name for name in names if chunks.get(name, _CHUNK_BYTES + 1) <= _CHUNK_BYTES]
    first = next(file.iter_batches(SHOWN_ROWS, columns=shown, use_threads=False), None)
    rows = [] if first is None else first.to_pylist()
    return tuple(tuple(str(row.get(name, "")) for name in names) for row in rows)
