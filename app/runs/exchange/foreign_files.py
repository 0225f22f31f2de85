"""Reads time and gauges from files of other programs; the format is told by the content, else by the name."""

import contextlib
import gzip
import importlib
import io
import struct
import tempfile
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from app.runs.errors import ImportFileError, RunError, one_line
from app.runs.exchange.columns import DATE, TIME, ForeignColumns, ReportShare, find_columns
from app.runs.exchange.csv_layout import FileLayout
from app.runs.exchange.csv_reading import read_columns
from app.runs.exchange.formats import FORMATS, Format
from app.runs.exchange.stamps import NS, no_date_beside, to_datetime, unwrap_times
from app.runs.exchange.tables import Table, TimeAxis
from messages.i18n import N_
from messages.message import Message, option

_GZIP, _GZIP_SIZE = b"\x1f\x8b", struct.Struct("<I")
_DEFLATE_RATIO = 1032  # highest of deflate (zlib, "Technical details")
_PIECE_BYTES = 1 << 22
_UNPACKED_MOST_BYTES = 2 << 30


def read_foreign(path: Path, layout: FileLayout, report: ReportShare = lambda _: None) -> ForeignColumns:
    """Read columns of a file. Raises RunError. `report` gets the share that is done."""
    found = find_format(path)
    if found is None:
        columns = read_columns(path, layout, report)
    else:
        _check_layout(path, found, layout)
        steps = _Steps(report, 1 + len(list(layout.wanted)))
        with _faults_named(path, found):
            columns = _read(path, _open(found, path, layout, steps), layout, steps)
        columns.check()
    columns.leave_out(layout.missing_values)
    return columns


def open_foreign(path: Path, layout: FileLayout, report: ReportShare = lambda _: None) -> Table:
    """Open a file that is no plain text. Raises RunError."""
    found = find_format(path)
    if found is None:
        raise ImportFileError("{path} is plain text", path=path)
    with _faults_named(path, found):
        return _open(found, path, layout, report)


def is_csv(path: Path) -> bool:
    """Tell whether `read_foreign` reads a file as plain text."""
    return find_format(path) is None


def has_own_time(path: Path) -> bool:
    """Tell whether a file is of a format that always keeps times beside its columns."""
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
    done, size_bytes = 0, max(path.stat().st_size, 1)
    try:
        with path.open("rb") as source, gzip.open(source) as packed, plain.open("wb") as file:
            _check_unpacked(path, _declared_bytes(source))
            while data := packed.read(_PIECE_BYTES):
                done += len(data)
                _check_unpacked(path, done)
                file.write(data)
                report(min(source.tell() / size_bytes, 1.0))
    except (EOFError, gzip.BadGzipFile, struct.error, zlib.error):
        raise ImportFileError("{path} is a damaged gzip file. Pack it again", path=path) from None


def _declared_bytes(source: BinaryIO) -> int:
    """Size of what is packed, less a multiple of 4 GB, as the end of a file says (RFC 1952); 0 if it lies."""
    packed_bytes = source.seek(0, io.SEEK_END)
    source.seek(max(packed_bytes - _GZIP_SIZE.size, 0))
    (size_bytes,) = _GZIP_SIZE.unpack(source.read(_GZIP_SIZE.size))
    source.seek(0)
    return int(size_bytes) if size_bytes <= _DEFLATE_RATIO * packed_bytes else 0


def _check_unpacked(path: Path, size_bytes: int) -> None:
    if size_bytes > _UNPACKED_MOST_BYTES:
        raise ImportFileError(
            "{path} unpacks to more than {gigabytes:g} GB. Unpack it and import a part",
            path=path,
            gigabytes=_UNPACKED_MOST_BYTES / 2**30,
        )


def find_format(path: Path) -> Format | None:
    """Format of a file by its first bytes, else by its name; None of plain text."""
    with contextlib.suppress(OSError), path.open("rb") as file:
        head = file.read(64)
        for one in FORMATS:
            if one.magic and head.startswith(one.magic):
                return one
    suffix = path.suffix.lower()
    return next((one for one in FORMATS if suffix in one.suffixes), None)


def _open(found: Format, path: Path, layout: FileLayout, report: ReportShare) -> Table:
    module: Any = importlib.import_module(found.module_name)
    table: Table = module.open_table(path, layout, report)
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


def _check_layout(path: Path, found: Format, layout: FileLayout) -> None:
    of_text = {"--delimiter": layout.delimiter, "--decimal": layout.decimal, "--encoding": layout.encoding}
    for name, value in of_text.items():
        if value is not None:
            raise ImportFileError(
                "{name} is no text: leave out {option}", name=path.name, option=option(name)
            )
    if not found.has_rows and (layout.skip or not layout.header):
        raise ImportFileError(
            "{name} has no lines: leave out {skip_option} and {header_option}",
            name=path.name,
            skip_option=option("--skip"),
            header_option=option("--no-header"),
        )


class _Steps:
    """Reports the share of steps of equal length: what opens a file, and each of its columns."""

    def __init__(self, report: ReportShare, count: int) -> None:
        self._report = report
        self._count = count
        self._done = 0

    def __call__(self, share: float) -> None:
        self._report((self._done + share) / self._count)

    def end_one(self) -> None:
        self._done += 1
        self(0.0)


def _read(path: Path, table: Table, layout: FileLayout, steps: _Steps) -> ForeignColumns:
    wanted = list(layout.wanted)
    names = list(table.names)
    positions = find_columns(path, wanted, names, len(names))
    table.check_size(path, positions)
    columns: list[NDArray[Any]] = []
    for at in positions:
        steps.end_one()
        columns.append(table.column(at))
    shown = [names[at] or str(at) for at in positions]
    units = [table.unit(at) for at in positions]
    if wanted[0][0] == TIME:
        time, date, columns = columns[0], None, columns[1:]
        if wanted[1][0] == DATE:
            date, columns = columns[0], columns[1:]
            if (time.dtype.kind, date.dtype.kind) != ("m", "M"):
                raise no_date_beside(path, *shown[:2])
            del shown[1], units[1]
        axis = _stamped(time, date, has_zone=table.has_zone)
        is_own = time.dtype.kind in "mM"
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


def _stamped(time: NDArray[Any], date: NDArray[Any] | None, *, has_zone: bool) -> TimeAxis:
    """Times of a column of numbers; of date-times or times of day, since the first."""
    if time.dtype.kind not in "mM":
        return TimeAxis(np.array(time, np.float64))
    if date is not None:
        time = date.astype("M8[ns]") + time
    stamps = time.astype(f"{time.dtype.kind}8[ns]")
    absent, stamps_ns = np.isnat(stamps), stamps.astype(np.int64)
    if stamps.dtype.kind == "m" and not absent.any():
        stamps_ns = unwrap_times(stamps_ns)
    first_ns = int(stamps_ns[~absent][0]) if not absent.all() else 0
    time_s = np.where(absent, np.nan, (stamps_ns - first_ns) / NS)
    start = to_datetime(first_ns, has_zone=has_zone) if stamps.dtype.kind == "M" else None
    return TimeAxis(time_s, start)


def _own_axis(path: Path, table: Table, layout: FileLayout, positions: list[int], rows: int) -> TimeAxis:
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
