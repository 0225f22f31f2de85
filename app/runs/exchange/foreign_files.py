"""Reads time and gauges from files that are no CSV: MATLAB, Excel, Parquet."""

import contextlib
import math
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.runs.errors import ExtraMissingError, ImportFileError, one_line
from app.runs.exchange.columns import ForeignColumns, cell_fault, find_columns
from app.runs.exchange.content import import_optional
from app.runs.exchange.csv_reading import CsvOptions, read_columns
from messages.i18n import N_
from messages.message import Message, message, option

_LARGEST_BYTES = 4 << 30  # a file that unpacks to more than this is refused before it is unpacked


@dataclass(frozen=True, slots=True)
class _Table:
    """A file that is open."""

    names: list[str]  # of all columns; "" where a column has none
    column: Callable[[int], NDArray[np.float64]]  # reads a column by its number. Raises ImportFileError.
    row_label: Callable[[int], Message] = lambda row: message("row {row}", row=row)


def read_foreign(path: Path, layout: CsvOptions) -> ForeignColumns:
    """Read columns from a .mat, .xlsx or .parquet file, any other as CSV. Raises RunError."""
    if is_csv(path):
        return read_columns(path, layout)
    _check_layout(path, layout)
    with _faults_named(path):
        table = _OPENERS[path.suffix.lower()](path, layout)
        positions = find_columns(path, layout.wanted, table.names, len(table.names))
        columns = {table.names[at] or str(at): table.column(at) for at in positions}
    lengths = {name: len(values) for name, values in columns.items()}
    if len(set(lengths.values())) > 1:
        told = ", ".join(f"{name} {length}" for name, length in lengths.items())
        template = N_("{path}: the columns differ in length ({told}). Choose columns of one record")
        raise ImportFileError(template, path=path, told=told)
    if not any(lengths.values()):
        raise ImportFileError("{path} holds no rows. Give a file with numbers", path=path)
    values = np.column_stack(list(columns.values()))
    found = ForeignColumns(path, values, list(columns), table.row_label)
    found.check()
    return found


def list_columns(path: Path, layout: CsvOptions) -> list[str]:
    """Names of the columns of a .mat, .xlsx or .parquet file, "" where one has none. Raises RunError."""
    with _faults_named(path):
        return _OPENERS[path.suffix.lower()](path, layout).names


def is_csv(path: Path) -> bool:
    """Tell whether `read_foreign` reads a file as CSV."""
    return path.suffix.lower() not in _OPENERS


@contextlib.contextmanager
def _faults_named(path: Path) -> Iterator[None]:
    """Put into words whatever these libraries raise on a damaged file. Raises ImportFileError."""
    if not path.is_file():
        raise ImportFileError(
            "{path}: there is no such file. Give the path of a {suffix} file", path=path, suffix=path.suffix
        )
    try:
        yield
    except (ImportFileError, ExtraMissingError):
        raise
    except Exception as error:
        raise ImportFileError(
            "{path} cannot be read as {suffix} ({fault}). Export it again",
            path=path,
            suffix=path.suffix,
            fault=one_line(error)[:120] or type(error).__name__,
        ) from error


def _check_layout(path: Path, layout: CsvOptions) -> None:
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


def _open_parquet(path: Path, layout: CsvOptions) -> _Table:
    file = import_optional("pyarrow.parquet", "Parquet").ParquetFile(path)
    names = list(file.schema_arrow.names)
    rows = file.metadata.num_rows
    if rows * 8 * len(layout.wanted) > _LARGEST_BYTES:
        raise ImportFileError(
            "{path} holds {num_rows} rows, too many to load. Export a part", path=path, num_rows=rows
        )

    def column(at: int) -> NDArray[np.float64]:
        stored = file.read(columns=[names[at]]).column(names[at])
        values = stored.to_numpy()
        if values.dtype.kind not in "iuf":
            template = N_(
                "{path}, column {name}: {type} is no number. Export plain numbers, times in seconds"
            )
            raise ImportFileError(template, path=path, name=names[at], type=stored.type)
        return np.asarray(values, dtype=np.float64)

    return _Table(names, column)


def _open_mat(path: Path, _layout: CsvOptions) -> _Table:
    """Vectors by their names, columns of a matrix as `name:0`, fields of a struct as `name.field`."""
    from scipy.io import loadmat, whosmat  # a third of a second that only this format needs

    with path.open("rb") as file:
        if file.read(128)[124:128] in (b"\x00\x02IM", b"\x02\x00MI"):
            raise ImportFileError("{path} is a version 7.3 MAT file. Save it with -v7 in MATLAB", path=path)
    if sum(8 * math.prod(shape) for _, shape, _ in whosmat(path)) > _LARGEST_BYTES:
        raise ImportFileError("{path} holds more numbers than can be loaded. Save a part of them", path=path)
    content = loadmat(path, simplify_cells=True)
    vectors = dict(_vectors("", {k: v for k, v in content.items() if not k.startswith("__")}))
    values = list(vectors.values())
    return _Table(list(vectors), values.__getitem__)


def _vectors(name: str, value: Any) -> Iterator[tuple[str, NDArray[np.float64]]]:
    if isinstance(value, dict):
        for key, item in value.items():
            yield from _vectors(f"{name}.{key}" if name else str(key), item)
    elif isinstance(value, np.ndarray) and value.dtype.kind in "iuf" and value.ndim in (1, 2):
        if value.ndim == 1 or 1 in value.shape:
            yield name, value.ravel().astype(np.float64)
        else:
            yield from ((f"{name}:{i}", value[:, i].astype(np.float64)) for i in range(value.shape[1]))


def _open_xlsx(path: Path, layout: CsvOptions) -> _Table:
    with zipfile.ZipFile(path) as archive:
        if sum(entry.file_size for entry in archive.infolist()) > _LARGEST_BYTES:
            raise ImportFileError("{path} unpacks to more than can be loaded. Export it as CSV", path=path)
    book = import_optional("openpyxl", "Excel").load_workbook(path, read_only=True, data_only=True)
    with contextlib.closing(book):
        sheet, header, rows = _sheet(path, book, layout)
    width = max(len(header), *(len(row) for row in rows))
    names = [*header, *[""] * (width - len(header))]
    first = layout.skip + (2 if layout.header else 1)

    def row_label(row: int) -> Message:
        return message("sheet {sheet}, row {row}", sheet=sheet, row=first + row)

    def number(row: int, at: int) -> float:
        cell = rows[row][at] if at < len(rows[row]) else None
        if cell is None:
            return math.nan
        if isinstance(cell, bool) or not isinstance(cell, int | float):
            remedy = message("Correct it, or leave the cell empty if there is no reading")
            fault = message("{cell!r} is not a number. {remedy}", cell=str(cell)[:40], remedy=remedy)
            raise cell_fault(path, row_label(row), names[at] or str(at), fault)
        return float(cell)

    return _Table(names, lambda at: np.array([number(row, at) for row in range(len(rows))]), row_label)


def _sheet(path: Path, book: Any, layout: CsvOptions) -> tuple[str, list[str], list[tuple[Any, ...]]]:
    """Name, header and rows of the first sheet that has the columns, or of the first one."""
    found = []
    for sheet in book.worksheets:
        rows = list(sheet.iter_rows(min_row=layout.skip + 1, values_only=True))
        head = rows[0] if layout.header and rows else ()
        header = ["" if cell is None else str(cell).strip() for cell in head]
        rows = rows[1:] if layout.header else rows
        while rows and all(cell is None for cell in rows[-1]):
            rows.pop()
        if rows:
            found.append((str(sheet.title), header, rows))
        if rows and all(name.strip() in header for name in layout.wanted):
            return found[-1]
    if not found:
        template = N_("{path} holds no rows. Give a workbook with numbers, and check {option}")
        raise ImportFileError(template, path=path, option=option("--skip"))
    return found[0]


_OPENERS: dict[str, Callable[[Path, CsvOptions], _Table]] = {
    ".parquet": _open_parquet,
    ".mat": _open_mat,
    ".xlsx": _open_xlsx,
}
