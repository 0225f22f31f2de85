"""Columns of numbers of a whole piece of text, by a reader for tables: pyarrow, else numpy."""

import functools
import importlib
import io
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.runs.exchange.csv_layout import CsvText, split_quoted
from app.runs.exchange.stamps import StampColumn, StampError

Values = list[NDArray[Any]]
"""Of each column (n,): float64, or int64 nanoseconds of stamps."""


@dataclass(frozen=True, slots=True)
class TextColumn:
    """A column that is read."""

    position: int
    name: str  # as messages call it
    stamps: StampColumn | None = None


def parse_piece(
    source: CsvText, data: bytes, columns: Sequence[TextColumn], marks: frozenset[str]
) -> Values | None:
    """All numbers of a piece by a reader for tables; None where it finds anything else."""
    if b"#" in data:
        data = re.sub(rb"(?m)^[ \t]*#.*\n", b"", data)
    delimiter = source.delimiter
    if delimiter == " ":
        data = _single_blanks(data)
    if not data.strip():
        return None
    arrow = _arrow()
    read = _by_numpy if arrow is None else functools.partial(_by_arrow, arrow)
    values = read(source, data, columns, marks)
    if values is None or (columns[0].stamps is None and np.isnan(values[0]).any()):
        return None
    return values


def _single_blanks(data: bytes) -> bytes:
    data = data.replace(b"\t", b" ")
    while b"  " in data:
        data = data.replace(b"  ", b" ")
    return data.replace(b"\n ", b"\n").replace(b" \n", b"\n").lstrip(b" ")


LIBRARY = "pyarrow.csv"
"""What reads texts, and takes seconds to load on a busy computer."""


@functools.cache
def _arrow() -> Any:
    """The reader of pyarrow, of the extra `exchange`; None where it is not installed."""
    try:
        return importlib.import_module(LIBRARY)
    except ImportError:
        return None


def _by_arrow(
    arrow: Any, source: CsvText, data: bytes, columns: Sequence[TextColumn], marks: frozenset[str]
) -> Values | None:
    pa = importlib.import_module("pyarrow")
    first = data[: data.find(b"\n")].decode("latin-1")
    width = len(split_quoted(first, source.delimiter))
    if max(column.position for column in columns) >= width:
        return None
    names = [str(number) for number in range(width)]
    types = {
        str(column.position): pa.float64() if column.stamps is None else pa.binary() for column in columns
    }
    spelt = [form for mark in marks for form in {mark, mark.upper(), mark.capitalize(), mark.title()}]
    try:
        table = arrow.read_csv(
            pa.BufferReader(data),
            read_options=arrow.ReadOptions(use_threads=False, column_names=names, block_size=len(data) + 1),
            parse_options=arrow.ParseOptions(delimiter=source.delimiter),
            convert_options=arrow.ConvertOptions(
                check_utf8=False,
                column_types=types,
                include_columns=list(types),
                null_values=[*spelt, "NaN"],
                decimal_point=source.decimal,
            ),
            memory_pool=pa.system_memory_pool(),  # others keep what they have had
        )
    except (pa.ArrowException, ValueError):
        return None
    values = [_of_arrow(table.column(str(column.position)), column.stamps) for column in columns]
    return (
        None if any(value is None for value in values) else [value for value in values if value is not None]
    )


def _of_arrow(column: Any, stamps: StampColumn | None) -> NDArray[Any] | None:
    array = column.combine_chunks()
    if stamps is None:
        return _numbers(array)
    _, offsets, text = array.buffers()
    ends = np.frombuffer(offsets, np.int32)[array.offset : array.offset + len(array) + 1]
    lengths = np.diff(ends)
    if len(lengths) and (lengths == lengths[0]).all() and lengths[0]:
        matrix = np.frombuffer(text, np.uint8)[ends[0] : ends[-1]].reshape(len(array), lengths[0])
        if (found := stamps.parse_matrix(matrix)) is not None:
            return found
    try:
        return stamps.parse_all(array.to_pylist())
    except StampError:
        return None


def _numbers(array: Any) -> NDArray[np.float64]:
    """Numbers of an array of pyarrow, NaN where there is none. Its own `to_numpy` imports pandas."""
    if not len(array):
        return np.empty(0)
    there, values = array.buffers()
    places = slice(array.offset, array.offset + len(array))
    numbers = np.frombuffer(values, np.float64)[places].copy()
    if there is not None:
        numbers[np.unpackbits(np.frombuffer(there, np.uint8), bitorder="little")[places] == 0] = np.nan
    return numbers


def _by_numpy(
    source: CsvText, data: bytes, columns: Sequence[TextColumn], _marks: frozenset[str]
) -> Values | None:
    """Numbers by numpy's own reader, empty cells as NaN."""
    if any(column.stamps is not None for column in columns):
        return None
    body = data.decode("latin-1")
    if source.decimal == ",":
        if "." in body:
            return None
        body = body.replace(",", ".")
    positions = [column.position for column in columns]
    values = _load(body, source.delimiter, positions)
    if values is None and source.delimiter != " ":
        values = _load(_with_nan(body, source.delimiter), source.delimiter, positions)
    return None if values is None else list(np.ascontiguousarray(values.T))


def _load(body: str, delimiter: str, positions: list[int]) -> NDArray[np.float64] | None:
    try:
        return np.loadtxt(
            io.StringIO(body),
            delimiter=None if delimiter == " " else delimiter,
            usecols=positions,
            comments=None,
            quotechar='"' if '"' in body else None,
            ndmin=2,
        )
    except (ValueError, IndexError):
        return None


def _with_nan(body: str, delimiter: str) -> str:
    for _ in range(2):  # the first round leaves every other one of several in a row
        body = body.replace(delimiter * 2, f"{delimiter}nan{delimiter}")
    return f"{body}\n".replace(f"{delimiter}\n", f"{delimiter}nan\n").replace(
        f"\n{delimiter}", f"\nnan{delimiter}"
    )
