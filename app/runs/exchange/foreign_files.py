"""Reads time and gauges from files that are no CSV: MATLAB, Excel, Parquet."""

import contextlib
import math
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from app.runs.errors import ExtraMissingError, ImportFileError
from app.runs.exchange.columns import ForeignColumns, column_stack, find_columns
from app.runs.exchange.content import import_optional
from app.runs.exchange.csv_reading import CsvOptions, read_columns
from messages.message import option

Reader = Callable[[Path, CsvOptions], ForeignColumns]
Result = TypeVar("Result")
_LARGEST_BYTES = 4 << 30
"""A file that unpacks to more than this is refused before it is unpacked."""


def read_foreign(path: Path, layout: CsvOptions) -> ForeignColumns:
    """Read the columns of `layout` from a .mat, .xlsx or .parquet file; any other ending is read as CSV.

    Raises ExtraMissingError, and ImportFileError, which names file, row or column, and remedy.
    """
    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        return read_columns(path, layout)
    _check_layout(path, layout)
    columns = _reading(path, lambda: reader(path, layout))
    columns.check()
    return columns


def list_columns(path: Path, layout: CsvOptions) -> list[str]:
    """Names of the columns of a .mat, .xlsx or .parquet file, empty where a column has none.

    Raises ImportFileError, ExtraMissingError.
    """
    return _reading(path, lambda: _LISTERS[path.suffix.lower()](path, layout))


def is_csv(path: Path) -> bool:
    """Tell whether `read_foreign` reads a file as CSV."""
    return path.suffix.lower() not in _READERS


def _reading(path: Path, read: Callable[[], Result]) -> Result:
    """Put into words whatever these libraries raise on a damaged file. Raises ImportFileError."""
    if not path.is_file():
        raise ImportFileError(
            "{path}: there is no such file. Give the path of a {suffix} file", path=path, suffix=path.suffix
        )
    try:
        return read()
    except (ImportFileError, ExtraMissingError):
        raise
    except Exception as error:
        fault = " ".join(str(error).split())[:120] or type(error).__name__
        raise ImportFileError(
            "{path} cannot be read as {suffix} ({fault}). Export it again",
            path=path,
            suffix=path.suffix,
            fault=fault,
        ) from error


def _check_layout(path: Path, layout: CsvOptions) -> None:
    """Refuse what only texts have."""
    if layout.delimiter is not None or layout.decimal != ".":
        raise ImportFileError(
            "{name} is no text: leave out {delimiter_option} and {decimal_option}",
            name=path.name,
            delimiter_option=option("--delimiter"),
            decimal_option=option("--decimal"),
        )
    if path.suffix.lower() != ".xlsx" and (layout.skip or not layout.header):
        raise ImportFileError(
            "{name} has no lines: leave out {skip_option} and {header_option}",
            name=path.name,
            skip_option=option("--skip"),
            header_option=option("--no-header"),
        )


def _wanted(layout: CsvOptions) -> list[str]:
    return [layout.time, layout.table, *([] if layout.second is None else [layout.second])]


# --- Parquet -----------------------------------------------------------------------------


def _read_parquet(path: Path, layout: CsvOptions) -> ForeignColumns:
    file = import_optional("pyarrow.parquet", "Parquet").ParquetFile(path)
    names = list(file.schema_arrow.names)
    chosen = [names[at] for at in find_columns(path, _wanted(layout), names, len(names))]
    if file.metadata.num_rows * 8 * len(chosen) > _LARGEST_BYTES:
        raise ImportFileError(
            "{path} holds {num_rows} rows, too many to load. Export a part",
            path=path,
            num_rows=file.metadata.num_rows,
        )
    table = file.read(columns=chosen)
    columns = {name: _parquet_column(path, name, table.column(name)) for name in chosen}
    return ForeignColumns(path, column_stack(path, columns), chosen, lambda row: f"row {row}")


def _list_parquet(path: Path, _layout: CsvOptions) -> list[str]:
    return list(import_optional("pyarrow.parquet", "Parquet").ParquetFile(path).schema_arrow.names)


def _parquet_column(path: Path, name: str, column: Any) -> NDArray[np.float64]:
    values = column.to_numpy()
    if values.dtype.kind not in "iuf":
        raise ImportFileError(
            "{path}, column {name}: {type} is no number. Export plain numbers, times in seconds",
            path=path,
            name=name,
            type=column.type,
        )
    return np.asarray(values, dtype=np.float64)


# --- MATLAB ------------------------------------------------------------------------------


def _read_mat(path: Path, layout: CsvOptions) -> ForeignColumns:
    """Vectors by their names, columns of a matrix as `name:0`, fields of a struct as `name.field`."""
    vectors = _load_mat(path)
    names = list(vectors)
    chosen = [names[at] for at in find_columns(path, _wanted(layout), names, len(names))]
    columns = {name: vectors[name] for name in chosen}
    return ForeignColumns(path, column_stack(path, columns), chosen, lambda row: f"row {row}")


def _load_mat(path: Path) -> dict[str, NDArray[np.float64]]:
    from scipy.io import loadmat, whosmat  # a third of a second that only this format needs

    with path.open("rb") as file:
        if file.read(128)[124:128] in (b"\x00\x02IM", b"\x02\x00MI"):
            raise ImportFileError("{path} is a version 7.3 MAT file. Save it with -v7 in MATLAB", path=path)
    if sum(8 * math.prod(shape) for _, shape, _ in whosmat(path)) > _LARGEST_BYTES:
        raise ImportFileError("{path} holds more numbers than can be loaded. Save a part of them", path=path)
    content = loadmat(path, simplify_cells=True)
    return dict(_vectors("", {k: v for k, v in content.items() if not k.startswith("__")}))


def _vectors(name: str, value: Any) -> Iterator[tuple[str, NDArray[np.float64]]]:
    if isinstance(value, dict):
        for key, item in value.items():
            yield from _vectors(f"{name}.{key}" if name else str(key), item)
    elif isinstance(value, np.ndarray) and value.dtype.kind in "iuf" and value.ndim in (1, 2):
        if value.ndim == 1 or 1 in value.shape:
            yield name, value.ravel().astype(np.float64)
        else:
            yield from ((f"{name}:{i}", value[:, i].astype(np.float64)) for i in range(value.shape[1]))


# --- Excel -------------------------------------------------------------------------------


@contextlib.contextmanager
def _open_book(path: Path) -> Iterator[Any]:
    with zipfile.ZipFile(path) as archive:
        if sum(entry.file_size for entry in archive.infolist()) > _LARGEST_BYTES:
            raise ImportFileError("{path} unpacks to more than can be loaded. Export it as CSV", path=path)
    book = import_optional("openpyxl", "Excel").load_workbook(path, read_only=True, data_only=True)
    try:
        yield book
    finally:
        book.close()


def _list_xlsx(path: Path, layout: CsvOptions) -> list[str]:
    with _open_book(path) as book:
        _, header, rows = _sheet(path, book, layout)
    width = max(len(header), *(len(row) for row in rows))
    return [*header, *[""] * (width - len(header))]


def _read_xlsx(path: Path, layout: CsvOptions) -> ForeignColumns:
    with _open_book(path) as book:
        sheet, header, rows = _sheet(path, book, layout)
        width = max(len(header), *(len(row) for row in rows))
        chosen = find_columns(path, _wanted(layout), header, width)
        names = [header[i] if i < len(header) else str(i) for i in chosen]
        first = layout.skip + (2 if layout.header else 1)
        values = np.array(
            [[_xlsx_number(path, sheet, first + n, i, row) for i in chosen] for n, row in enumerate(rows)]
        )
    return ForeignColumns(path, values, names, lambda row: f"sheet {sheet}, row {first + row}")


def _sheet(path: Path, book: Any, layout: CsvOptions) -> tuple[str, list[str], list[tuple[Any, ...]]]:
    """Name, header and rows of the first sheet that has the columns, or of the first one."""
    found = []
    for sheet in book.worksheets:
        rows = list(sheet.iter_rows(min_row=layout.skip + 1, values_only=True))
        header = (
            ["" if cell is None else str(cell).strip() for cell in rows[0]] if layout.header and rows else []
        )
        rows = rows[1:] if layout.header else rows
        while rows and all(cell is None for cell in rows[-1]):
            rows.pop()
        if rows:
            found.append((str(sheet.title), header, rows))
        if rows and all(name.strip() in header for name in _wanted(layout)):
            return found[-1]
    if not found:
        raise ImportFileError(
            "{path} holds no rows. Give a workbook with numbers, and check {option}",
            path=path,
            option=option("--skip"),
        )
    return found[0]


def _xlsx_number(path: Path, sheet: str, row_number: int, column: int, row: tuple[Any, ...]) -> float:
    cell = row[column] if column < len(row) else None
    if cell is None:
        return math.nan
    if isinstance(cell, bool) or not isinstance(cell, int | float):
        raise ImportFileError(
            "{path}, sheet {sheet}, row {row_number}, column {column}: {cell!r} is not a"
            " number. Correct it, or leave the cell empty if there is no reading",
            path=path,
            sheet=sheet,
            row_number=row_number,
            column=column,
            cell=str(cell)[:40],
        )
    return float(cell)


_READERS: dict[str, Reader] = {".parquet": _read_parquet, ".mat": _read_mat, ".xlsx": _read_xlsx}
_LISTERS: dict[str, Callable[[Path, CsvOptions], list[str]]] = {
    ".parquet": _list_parquet,
    ".mat": lambda path, _layout: list(_load_mat(path)),
    ".xlsx": _list_xlsx,
}
