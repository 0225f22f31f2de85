"""Parquet files, by pyarrow."""

from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from app.runs.errors import ImportFileError
from app.runs.exchange.columns import ReportShare
from app.runs.exchange.content import import_optional
from app.runs.exchange.csv_layout import FileLayout
from app.runs.exchange.tables import LARGEST_BYTES, SHOWN_ROWS, Table
from messages.i18n import N_


def open_table(path: Path, layout: FileLayout, _report: ReportShare) -> Table:
    """Columns by their names; timestamps are date-times. Raises ImportFileError, ExtraMissingError."""
    file = import_optional("pyarrow.parquet", "Parquet").ParquetFile(path)
    names = list(file.schema_arrow.names)
    count = file.metadata.num_rows
    if count * 8 * len(list(layout.wanted)) > LARGEST_BYTES:
        raise ImportFileError(
            "{path} holds {num_rows} rows, too many to load. Export a part", path=path, num_rows=count
        )

    def column(at: int) -> NDArray[Any]:
        stored = file.read(columns=[names[at]]).column(names[at])
        values: NDArray[Any] = stored.to_numpy()
        if values.dtype.kind not in "iufmM":
            template = N_("{path}, column {name}: {type} is no number. Export plain numbers")
            raise ImportFileError(template, path=path, name=names[at], type=stored.type)
        return values

    zones = {getattr(field.type, "tz", None) for field in file.schema_arrow} - {None}
    first = next(file.iter_batches(batch_size=SHOWN_ROWS), None)
    rows = () if first is None else tuple(tuple(map(str, row.values())) for row in first.to_pylist())
    return Table(names, column, has_zone=bool(zones), first_rows=rows)
