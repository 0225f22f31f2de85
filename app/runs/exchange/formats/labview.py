"""LabVIEW measurement files (LVM): header by lvm_read, numbers by numpy.

lvm_read takes more than 10 s for the numbers of 60 MB, numpy 2 s. Its `read` also loads a pickle beside
the file, which may hold any code, so only its `read_lines` is called.
"""

import datetime
import functools
import io
import itertools
from collections.abc import Iterator
from pathlib import Path
from typing import Any, TextIO

import numpy as np
from numpy.typing import NDArray

from app.runs.errors import ImportFileError
from app.runs.exchange.columns import ReportShare
from app.runs.exchange.content import import_optional
from app.runs.exchange.csv_layout import FileLayout
from app.runs.exchange.tables import WIDTH_MOST, Table, TimeAxis, check_count, even_axis, too_wide
from app.runs.exchange.text_files import LINE_BYTES, line_too_long

_HEADER_LINES = 1000
_ROWS = 100_000  # read at once


def open_table(path: Path, _layout: FileLayout, report: ReportShare) -> Table:
    """Channels of the first segment by their names, with its time column or its `Delta_X`."""
    file = _File(path, report)
    segment, count = file.segment, file.channels
    labels = [str(name).strip() for name in segment.get("Channel names", [])]
    labels = [name for name in labels if name not in ("X_Value", "Comment")]
    names = [name or f"channel {at}" for at, name in enumerate(labels[:count])]
    names += [f"channel {at}" for at in range(len(names), count)]
    start = _start(file.content, segment)

    def column(at: int) -> NDArray[Any]:
        return file.data[:, file.columns[at]]

    def axis(at: int) -> TimeAxis | None:
        if file.has_x:
            return TimeAxis(file.data[:, file.columns[at] - 1 if file.is_multi else 0].copy(), start)
        step_s, first_s = _number(segment, "Delta_X", at), _number(segment, "X0", at)
        return even_axis(len(file.data), step_s, first_s, start) if step_s > 0.0 else None

    units = [str(unit).strip() for unit in segment.get("Y_Unit_Label", [])]
    return Table(names, column, units=units, axis=axis, has_axis=True)


class _File:
    """A file whose header has been read. Its numbers are read when they are asked for."""

    def __init__(self, path: Path, report: ReportShare) -> None:
        self._path = path
        self._report = report
        self._read_lines = import_optional("lvm_read", "LVM").read_lines
        with _open(path) as file:
            self._header = _header(path, file)
        self._separator = next((line[9] for line in self._header if line.startswith("Separator")), "\t")
        self.content: dict[Any, Any] = self._read_lines(self._header, separator=self._separator)
        self.segment: dict[str, Any] = self.content[0]
        self.channels = int(self.segment["Channels"])
        if self.channels > WIDTH_MOST:
            raise too_wide(path, self.channels)
        x_columns = str(self.content.get("X_Columns", "One")).strip()
        self.has_x, self.is_multi = x_columns != "No", x_columns == "Multi"
        self.columns = [2 * at + 1 if self.is_multi else at + self.has_x for at in range(self.channels)]

    @functools.cached_property
    def data(self) -> NDArray[np.float64]:
        """(n, columns) float64: rows of the first segment, NaN where a cell is empty."""
        size_bytes = max(self._path.stat().st_size, 1)
        parts, numbers = [np.empty((0, self.columns[-1] + 1))], 0
        with _open(self._path) as file:
            rows = self._rows(itertools.islice(_lines(self._path, file), len(self._header), None))
            while lines := list(itertools.islice(rows, _ROWS)):
                parts.append(self._numbers(lines))
                numbers += parts[-1].size
                check_count(self._path, 2 * numbers)  # all parts, and joined
                self._report(min(file.buffer.tell() / size_bytes, 1.0))
        return np.concatenate(parts)

    def _rows(self, lines: Iterator[str]) -> Iterator[str]:
        """Lines up to the blank one that ends the segment."""
        ends = ("\n", f"{self._separator}\n")
        return itertools.takewhile(lambda line: line not in ends, lines)

    def _numbers(self, lines: list[str]) -> NDArray[np.float64]:
        first, width = 0 if self.has_x else 1, self.columns[-1] + 1
        text = "".join(lines)
        if str(self.content.get("Decimal_Separator", ".")).strip() == ",":
            text = text.replace(",", ".")
        try:
            return np.loadtxt(
                io.StringIO(text), delimiter=self._separator, usecols=range(first, first + width),
                comments=None, ndmin=2,
            )  # fmt: skip
        except ValueError:  # an empty cell, a cut line
            data = self._read_lines([*self._header, *lines], separator=self._separator)[0]["data"]
            rows = np.full((len(data), width), np.nan)
            rows[:, : data.shape[1]] = data[:, :width]
            return rows


def _open(path: Path) -> TextIO:
    return path.open(encoding="utf-8", errors="ignore")


def _lines(path: Path, file: TextIO) -> Iterator[str]:
    """Lines of a file. Raises ImportFileError for one that is no row."""
    for number in itertools.count(1):
        line = file.readline(LINE_BYTES)
        if len(line) >= LINE_BYTES:
            raise line_too_long(path, number)
        if not line:
            return
        yield line


def _header(path: Path, file: TextIO) -> list[str]:
    """Lines up to the names of the first segment. Raises ImportFileError."""
    lines: list[str] = []
    for line in itertools.islice(_lines(path, file), _HEADER_LINES):
        lines.append(line)
        if line.startswith("X_Value"):
            return lines
    raise ImportFileError("{path} holds no rows. Give a file with numbers", path=path)


def _number(segment: dict[str, Any], name: str, at: int) -> float:
    values = np.atleast_1d(segment.get(name, 0.0))
    return float(values[min(at, len(values) - 1)]) if len(values) else 0.0


def _start(content: dict[Any, Any], segment: dict[str, Any]) -> datetime.datetime | None:
    """Date and time of the segment's first channel, else of the file; in the zone of this computer."""
    for source in (segment, content):
        date, time = (np.atleast_1d(source.get(name, ""))[0] for name in ("Date", "Time"))
        text = f"{date} {str(time)[:15].replace(',', '.')}"
        for pattern in ("%Y/%m/%d %H:%M:%S.%f", "%Y/%m/%d %H:%M:%S"):
            try:
                return datetime.datetime.strptime(text, pattern).astimezone()
            except ValueError:
                continue
    return None
