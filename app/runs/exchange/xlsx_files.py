"""Excel workbooks: sheets of coefficients, samples and facts. Texts are texts: no cell becomes a formula."""

import itertools
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import msgspec

from app.runs.disk import atomic_write
from app.runs.errors import UnsuitableRunError
from app.runs.exchange.content import (
    COEFFICIENT_COLUMNS,
    ExportedRun,
    coefficient_rows,
    import_optional,
    run_metadata_document,
)

Sheet = tuple[Sequence[str], Iterable[Sequence[Any]]]
"""Header and rows."""

_SHEET_ROWS = 1_048_576
_CELL_CHARACTERS = 32_767
_COLUMN_WIDTH = 22
_CONTROL = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]")
"""What XML cannot hold."""


def write_run(exported: ExportedRun, path: Path, *, replace: bool = False) -> None:
    """Write a workbook with the sheets Coefficients, Samples and Run.

    Raises UnsuitableRunError (more samples than a sheet holds), ExtraMissingError, RunExistsError,
    DiskFullError, WriteError.
    """
    if len(exported.run) >= _SHEET_ROWS and exported.samples:
        raise UnsuitableRunError(
            "{path} has {count} samples, a sheet of xlsx at most {sheet_rows}. Export it as parquet or csv",
            path=exported.run.path,
            count=len(exported.run),
            sheet_rows=_SHEET_ROWS - 1,
        )
    sheets = {
        "Coefficients": (COEFFICIENT_COLUMNS, coefficient_rows(exported)),
        "Samples": (tuple(column.name for column in exported.samples), _sample_rows(exported)),
        "Run": (("fact", "value"), _facts(exported)),
    }
    write_sheets(sheets, path, replace)


def write_coefficients(runs: Iterable[ExportedRun], path: Path, *, replace: bool = False) -> None:
    """Write a workbook with a row a quantity.

    Raises ExtraMissingError, RunExistsError, DiskFullError, WriteError.
    """
    rows = (row for exported in runs for row in coefficient_rows(exported))
    write_sheets({"Coefficients": (COEFFICIENT_COLUMNS, rows)}, path, replace)


def write_sheets(sheets: Mapping[str, Sheet], path: Path, replace: bool) -> None:
    """Write sheet after sheet, row after row: header and rows by the name of the sheet.

    Raises ExtraMissingError, RunExistsError, DiskFullError, WriteError.
    """
    openpyxl = import_optional("openpyxl", "Excel")
    cell_type = import_optional("openpyxl.cell", "Excel").WriteOnlyCell
    letter = import_optional("openpyxl.utils", "Excel").get_column_letter
    with atomic_write(path.absolute(), replace=replace) as made:
        book = openpyxl.Workbook(write_only=True)
        for name, (header, rows) in sheets.items():
            sheet = book.create_sheet(name)
            sheet.freeze_panes = "A2"
            for column in range(1, len(header) + 1):
                sheet.column_dimensions[letter(column)].width = _COLUMN_WIDTH
            for row in itertools.chain((header,), rows):
                sheet.append([_cell(cell_type, sheet, value) for value in row])
        book.save(made)


def _sample_rows(exported: ExportedRun) -> Iterator[tuple[Any, ...]]:
    return zip(*(column.values.tolist() for column in exported.samples), strict=True)


def _facts(exported: ExportedRun) -> Iterator[tuple[str, Any]]:
    """Facts with dotted names, as `metadata.table_mass_kg`."""
    pending: list[tuple[str, Any]] = list(reversed(run_metadata_document(exported.run).items()))
    while pending:
        name, value = pending.pop()
        if isinstance(value, dict):
            pending += [(f"{name}.{key}", value[key]) for key in reversed(value)]
        elif isinstance(value, list | tuple):
            yield name, msgspec.json.encode(value).decode()
        else:
            yield name, value


def _cell(cell_type: Any, sheet: Any, value: Any) -> Any:
    """A number, truth, nothing, or a text that stays one even where it begins with an equals sign."""
    if value is None or value != value:
        return None
    if isinstance(value, bool):
        return value
    is_text = isinstance(value, str)
    cell = cell_type(sheet, _CONTROL.sub("\ufffd", value)[:_CELL_CHARACTERS] if is_text else repr(value))
    cell.data_type = "s" if is_text else "n"  # of itself openpyxl writes 16 digits, which are one too few
    return cell
