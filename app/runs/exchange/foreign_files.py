"""Reads time and gauges from files of other programs; the format is told by the content, else by the name."""

import contextlib
import gzip
import importlib
import tempfile
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.runs.errors import ImportFileError, RunError, one_line
from app.runs.exchange.columns import DATE, TIME, ForeignColumns, find_columns
from app.runs.exchange.csv_layout import CsvOptions
from app.runs.exchange.csv_reading import read_columns
from app.runs.exchange.formats import FORMATS, Format
from app.runs.exchange.stamps import to_datetime
from app.runs.exchange.tables import Table, TimeAxis
from messages.i18n import N_
from messages.message import Message, option

ReportShare = Callable[[float], object]
_GZIP = b"\x1f\x8b"
_PIECE_BYTES = 1 << 22
_UNPACKED_MOST_BYTES = 2 << 30


def read_foreign(path: Path, layout: CsvOptions, report: ReportShare = lambda _: None) -> ForeignColumns:
    """Read columns of a file. Raises RunError. `report` gets the share that is done."""
    found = find_format(path)
    if found is None:
        return read_columns(path, layout, report)
    _check_layout(path, found, layout)
    with _faults_named(path, found):
        table = _open(found, path, layout)
        columns = _read(path, table, layout, report)
    columns.check()
    return columns


def list_columns(path: Path, layout: CsvOptions) -> Table:
    """Open a file that is no plain text for the names of its columns. Raises RunError."""
    found = find_format(path)
    if found is None:
        raise ImportFileError("{path} is plain text", path=path)
    with _faults_named(path, found):
        return _open(found, path, layout)


def is_csv(path: Path) -> bool:
    """Tell whether `read_foreign` reads a file as plain text."""
    return find_format(path) is None


def has_own_time(path: Path) -> bool:
    """Tell whether a file is of a format that keeps times beside its columns."""
    found = find_format(path)
    return found is not None and found.has_own_time


@contextlib.contextmanager
def unpacked(path: Path, report: ReportShare = lambda _: None) -> Iterator[Path]:
    """Unpack a gzip file for the time of the context; any other is itself. Raises ImportFileError."""
    is_packed = False
    with contextlib.suppress(OSError), path.open("rb") as file:
        is_packed = file.read(2) == _GZIP
    if not is_packed:
        yield path
        return
    with tempfile.TemporaryDirectory(prefix="slipstand-gzip-") as folder:
        plain = Path(folder) / (path.stem or "unpacked")
        _unpack(path, plain, report)
        try:
            yield plain
        except RunError as error:  # which names the unpacked file
            said = error.message
            values = {
                name: str(path) if value == str(plain) else value for name, value in said.values.items()
            }
            raise type(error)(Message(said.template, values, said.plural)) from None


def _unpack(path: Path, plain: Path, report: ReportShare) -> None:
    done = 0
    try:
        with gzip.open(path) as packed, plain.open("wb") as file:
            while data := packed.read(_PIECE_BYTES):
                done += len(data)
                if done > _UNPACKED_MOST_BYTES:
                    raise ImportFileError(
                        "{path} unpacks to more than {gigabytes:g} GB. Unpack it and import a part",
                        path=path,
                        gigabytes=_UNPACKED_MOST_BYTES / 2**30,
                    )
                file.write(data)
                report(0.0)
    except (EOFError, gzip.BadGzipFile, zlib.error):
        raise ImportFileError("{path} is a damaged gzip file. Pack it again", path=path) from None


def find_format(path: Path) -> Format | None:
    """Format of a file by its first bytes, else by its name; None of plain text."""
    with contextlib.suppress(OSError), path.open("rb") as file:
        head = file.read(64)
        for one in FORMATS:
            if one.magic and head.startswith(one.magic):
                return one
    suffix = path.suffix.lower()
    return next((one for one in FORMATS if suffix in one.suffixes), None)


def _open(found: Format, path: Path, layout: CsvOptions) -> Table:
    module: Any = importlib.import_module(f"app.runs.exchange.formats.{found.module}")
    table: Table = module.open_table(path, layout)
    return table


@contextlib.contextmanager
def _faults_named(path: Path, found: Format) -> Iterator[None]:
    """Put into words whatever these libraries raise on a damaged file. Raises ImportFileError."""
    if not path.is_file():
        raise ImportFileError(
            "{path}: there is no such file. Give the path of a {suffix} file", path=path, suffix=path.suffix
        )
    try:
        yield
    except RunError:
        raise
    except MemoryError:
        raise ImportFileError("{path} needs too much memory. Export a part of it", path=path) from None
    except Exception as error:
        raise ImportFileError(
            "{path} cannot be read as {suffix} ({fault}). Export it again",
            path=path,
            suffix=found.name,
            fault=one_line(error)[:120] or type(error).__name__,
        ) from error


def _check_layout(path: Path, found: Format, layout: CsvOptions) -> None:
    if layout.delimiter is not None or layout.decimal is not None:
        raise ImportFileError(
            "{name} is no text: leave out {delimiter_option} and {decimal_option}",
            name=path.name,
            delimiter_option=option("--delimiter"),
            decimal_option=option("--decimal"),
        )
    if not found.has_rows and (layout.skip or not layout.header):
        raise ImportFileError(
            "{name} has no lines: leave out {skip_option} and {header_option}",
            name=path.name,
            skip_option=option("--skip"),
            header_option=option("--no-header"),
        )


def _read(path: Path, table: Table, layout: CsvOptions, report: ReportShare) -> ForeignColumns:
    wanted = [(what, name) for what, name in layout.wanted if what != DATE]
    names = list(table.names)
    positions = find_columns(path, wanted, names, len(names))
    columns: list[NDArray[Any]] = []
    for number, at in enumerate(positions, start=1):
        columns.append(table.column(at))
        report(number / (len(positions) + 1))
    shown = [names[at] or str(at) for at in positions]
    units = [table.units[at] if at < len(table.units) else "" for at in positions]
    if wanted[0][0] == TIME:
        axis = _stamped(columns[0], has_zone=table.has_zone)
        is_own = columns[0].dtype.kind in "mM"
        columns = columns[1:]
    else:
        axis = _own_axis(path, table, layout, positions, len(columns[0]))
        shown, units, is_own = ["time", *shown], ["s", *units], True
    _check_lengths(path, dict(zip(shown, [axis.time_s, *columns], strict=True)))
    for name, column in zip(shown[1:], columns, strict=True):
        if column.dtype.kind not in "iuf":
            raise ImportFileError("{path}, column {name}: it holds no numbers", path=path, name=name)
    cells = [np.asarray(column, np.float64) for column in columns]
    return ForeignColumns(
        path, axis.time_s, cells, shown, table.row_label, units, axis.start, is_own, axis.is_even
    )


def _stamped(column: NDArray[Any], *, has_zone: bool) -> TimeAxis:
    """Times of a column of numbers, of date-times (since the first), or of times of day."""
    if column.dtype.kind not in "mM":
        return TimeAxis(np.array(column, np.float64))
    stamps = column.astype("M8[ns]" if column.dtype.kind == "M" else "m8[ns]")
    absent, stamps_ns = np.isnat(stamps), stamps.astype(np.int64)
    first_ns = int(stamps_ns[~absent][0]) if not absent.all() else 0
    time_s = np.where(absent, np.nan, (stamps_ns - first_ns) / 1e9)
    start = to_datetime(first_ns, has_zone=has_zone) if column.dtype.kind == "M" else None
    return TimeAxis(time_s, start)


def _own_axis(path: Path, table: Table, layout: CsvOptions, positions: list[int], rows: int) -> TimeAxis:
    """Times of rows of the rate that is given, or those that the format keeps. Raises ImportFileError."""
    if layout.rate_hz is not None:
        return TimeAxis(np.arange(rows) / layout.rate_hz, is_even=True)
    axes = [table.axis(at) for at in positions]
    if axes[0] is None:
        raise ImportFileError(
            "{path}: column {name} has no times of its own. Add {time_option} COL, or {rate_option} HZ",
            path=path,
            name=table.names[positions[0]],
            time_option=option("--time"),
            rate_option=option("--rate"),
        )
    for at, other in zip(positions[1:], axes[1:], strict=True):
        if other is None or not np.array_equal(other.time_s, axes[0].time_s):
            raise ImportFileError(
                "{path}: {name} and {other} were not read at the same times. Resample one of them in the"
                " program that recorded them",
                path=path,
                name=table.names[positions[0]],
                other=table.names[at],
            )
    return axes[0]


def _check_lengths(path: Path, columns: dict[str, NDArray[Any]]) -> None:
    lengths = {name: len(values) for name, values in columns.items()}
    if len(set(lengths.values())) > 1:
        told = ", ".join(f"{name} {length}" for name, length in lengths.items())
        template = N_("{path}: the columns differ in length ({told}). Choose columns of one record")
        raise ImportFileError(template, path=path, told=told)
    if not any(lengths.values()):
        raise ImportFileError("{path} holds no rows. Give a file with numbers", path=path)
