"""Drill: foreign files that are larger than they look; `python -m tests.drills.oversized_files`.

Each is looked into and read, as by the window and the command line. It becomes a record or is refused in one
line, shows progress at least every 10 s, and its reader takes no more than 1 GB.
"""

import contextlib
import struct
import sys
import threading
import time
import zipfile
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Self

from app.runs.errors import RunError
from app.runs.exchange.csv_layout import FileLayout
from app.runs.exchange.importing import ImportPlan
from app.runs.exchange.reading_process import MEMORY_BYTES, PROGRESS_S, ReadingProcess
from app.runs.exchange.recognition import ParseOptions
from tests.drills.report import InputReport, run_ways

LIMIT_S = 60.0
TYPES = "http://schemas.openxmlformats.org"
_PARTS = {
    "[Content_Types].xml": (
        f'<Types xmlns="{TYPES}/package/2006/content-types"><Default Extension="rels"'
        ' ContentType="application/vnd.openxmlformats-package.relationships+xml"/><Override'
        ' PartName="/xl/workbook.xml"'
        ' ContentType="application/vnd.openxmlformats-officedocument.spreadsheetml.sheet.main+xml"/></Types>'
    ),
    "_rels/.rels": (
        f'<Relationships xmlns="{TYPES}/package/2006/relationships"><Relationship Id="r1"'
        f' Type="{TYPES}/officeDocument/2006/relationships/officeDocument" Target="xl/workbook.xml"/>'
        "</Relationships>"
    ),
    "xl/workbook.xml": (
        f'<workbook xmlns="{TYPES}/spreadsheetml/2006/main"'
        f' xmlns:r="{TYPES}/officeDocument/2006/relationships"><sheets>'
        '<sheet name="Data" sheetId="1" r:id="r1"/></sheets></workbook>'
    ),
    "xl/_rels/workbook.xml.rels": (
        f'<Relationships xmlns="{TYPES}/package/2006/relationships"><Relationship Id="r1"'
        f' Type="{TYPES}/officeDocument/2006/relationships/worksheet" Target="worksheets/sheet1.xml"/>'
        "</Relationships>"
    ),
}
"""A workbook of one sheet; openpyxl would need minutes for the largest."""
_NAMES = '<row r="1"><c r="A1" t="inlineStr"><is><t>t</t></is></c><c r="B1" t="str"><v>u1</v></c></row>'
_MATRIX, _INT8, _INT32, _UINT32, _DOUBLE, _COMPRESSED = 14, 1, 5, 6, 9, 15
_CELL_CLASS, _DOUBLE_CLASS = 1, 6
_BLOCK = bytes(1 << 20)


def write_workbook(path: Path, rows: Iterable[str]) -> None:
    """Write a workbook with these rows below the names `t` and `u1`."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for name, text in _PARTS.items():
            archive.writestr(name, text)
        with archive.open("xl/worksheets/sheet1.xml", "w", force_zip64=True) as sheet:
            sheet.write(f'<worksheet xmlns="{TYPES}/spreadsheetml/2006/main"><sheetData>{_NAMES}'.encode())
            for row in rows:
                sheet.write(row.encode())
            sheet.write(b"</sheetData></worksheet>")


def row(number: int, more: str = "") -> str:
    """A row with a time and a reading."""
    cells = f'<c r="A{number}"><v>{number / 1000}</v></c><c r="B{number}"><v>0.01</v></c>'
    return f'<row r="{number}">{cells}{more}</row>'


def write_long_workbook(path: Path, rows: int = 1_500_000) -> None:
    """More rows than a sheet has."""
    write_workbook(path, map(row, range(2, rows + 2)))


def write_far_workbook(path: Path) -> None:
    """A cell at row 900,000,000."""
    write_workbook(path, [*map(row, range(2, 200)), row(900_000_000)])


def write_wide_workbook(path: Path, rows: int = 20_000) -> None:
    """A cell in the last column of every row."""
    write_workbook(path, (row(at, f'<c r="XFD{at}"><v>1</v></c>') for at in range(2, rows + 2)))


def write_matlab(path: Path, variables: Iterable[Iterable[bytes]]) -> None:
    """Write a MATLAB file of version 5 with compressed variables, each given in pieces."""
    with path.open("wb") as file:
        file.write(b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<H", 0x0100) + b"IM")
        for pieces in variables:
            packer = zlib.compressobj()
            data = b"".join(map(packer.compress, pieces)) + packer.flush()
            file.write(struct.pack("<II", _COMPRESSED, len(data)) + data)


def _head(name: bytes, kind: int, count: int, body_bytes: int) -> bytes:
    parts = ((_UINT32, struct.pack("<II", kind, 0)), (_INT32, struct.pack("<ii", count, 1)), (_INT8, name))
    head = b"".join(struct.pack("<II", tag, len(data)) + data + bytes(-len(data) % 8) for tag, data in parts)
    return struct.pack("<II", _MATRIX, len(head) + body_bytes) + head


def zeros(name: bytes, count: int) -> Iterator[bytes]:
    """A vector of zeros."""
    yield _head(name, _DOUBLE_CLASS, count, 8 + 8 * count) + struct.pack("<II", _DOUBLE, 8 * count)
    for left in range(8 * count, 0, -len(_BLOCK)):
        yield _BLOCK[:left]


def cells(name: bytes, count: int) -> Iterator[bytes]:
    """Cells that are empty."""
    one = _head(b"", _DOUBLE_CLASS, 0, 8) + struct.pack("<II", _DOUBLE, 0)
    yield _head(name, _CELL_CLASS, count, count * len(one))
    for left in range(count, 0, -1000):
        yield one * min(left, 1000)


def write_zeros_in_matlab(path: Path, count: int = 60_000_000) -> None:
    """Two vectors of 480 MB."""
    write_matlab(path, (zeros(name, count) for name in (b"t", b"u1")))


def write_cells_in_matlab(path: Path, count: int = 10_000_000) -> None:
    """Two vectors, and cells of which each takes far more memory than in the file."""
    write_matlab(path, [*(zeros(name, 100) for name in (b"t", b"u1")), cells(b"log", count)])


def write_zeros_in_parquet(path: Path, rows: int = 100_000_000, group_rows: int = 2_000_000) -> None:
    """Two columns of 800 MB."""
    import numpy as np
    import pyarrow as pa
    from pyarrow import parquet

    table = pa.table({name: np.zeros(group_rows) for name in ("t", "u1")})
    options = {"compression": "gzip", "use_dictionary": False}
    with parquet.ParquetWriter(path, table.schema, **options) as writer:
        for _ in range(rows // group_rows):
            writer.write_table(table, row_group_size=group_rows)


def write_long_line(path: Path, count: int = 65_000_000, above: bytes = b"t,u1\n") -> None:
    """A line of 390 MB, below others."""
    with path.open("wb") as file:
        file.write(above)
        for left in range(count, 0, -100_000):
            file.write(b"0.1,2," * min(left, 100_000))


def write_late_line(path: Path) -> None:
    """The same, behind a record."""
    write_long_line(path, above=b"t,u1\n" + b"".join(b"%d,1\n" % number for number in range(200_000)))


def write_packed_zeros(path: Path, count: int = 3 << 30) -> None:
    """3 GB of a text in 3 MB."""
    import gzip

    with gzip.open(path, "wb", compresslevel=6) as file:
        for _ in range(count // len(_BLOCK)):
            file.write(_BLOCK)


FILES: dict[str, Callable[[Path], None]] = {
    "long.xlsx": write_long_workbook,
    "far.xlsx": write_far_workbook,
    "wide.xlsx": write_wide_workbook,
    "zeros.mat": write_zeros_in_matlab,
    "cells.mat": write_cells_in_matlab,
    "zeros.parquet": write_zeros_in_parquet,
    "line.csv": write_long_line,
    "late-line.csv": write_late_line,
    "zeros.csv.gz": write_packed_zeros,
}


@dataclass(slots=True)
class OversizedReport(InputReport):
    """What came of it."""

    memory_bytes: int = 0
    silent_s: float = 0.0
    rows: list[str] = field(default_factory=list)

    def figures(self) -> str:
        return "\n".join([
            *self.rows,
            f"{self.tried} files, {self.refused} refused in one line; longest {self.longest_s:.1f} s,"
            f" {self.silent_s:.1f} s without progress, {self.memory_bytes / 1e6:.0f} MB at most",
        ])  # fmt: skip

    def add(self, path: Path, rows: int | None, took_s: float, observed: "Observed") -> None:
        """Add what was seen of one file."""
        silent, megabytes = f"{observed.silent_s:.1f} s without progress", observed.memory_bytes / 1e6
        outcome = "refused" if rows is None else f"{rows} rows"
        size = f"{path.stat().st_size / 1e6:.1f} MB"
        self.rows.append(f"{path.name}, {size}: {took_s:.1f} s, {silent}, {megabytes:.0f} MB, {outcome}")
        if observed.memory_bytes > MEMORY_BYTES or observed.silent_s > PROGRESS_S:
            self.faults.append(self.rows[-1])
        self.memory_bytes = max(self.memory_bytes, observed.memory_bytes)
        self.silent_s = max(self.silent_s, observed.silent_s)


class Observed:
    """A reading process whose memory and progress are watched while it is used with `with`."""

    def __init__(self) -> None:
        self.reader = ReadingProcess()
        self.memory_bytes = 0
        self.silent_s = 0.0
        self._share, self._last_s = -1.0, time.monotonic()
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._watch)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.begin()
        self._ending.set()
        self._thread.join()
        self.reader.stop()

    def read(self, path: Path) -> int:
        """Look into a file, and read two of its columns; count the rows. Raises RunError."""
        self.begin()
        self.reader.survey(path, ParseOptions(), self.on_progress)
        self.begin()
        with self.reader.read(path, ImportPlan(FileLayout("t", "u1")), self.on_progress) as record:
            return len(record)

    def begin(self) -> None:
        """Begin to look for progress anew: that of the last task ends here."""
        self.on_progress(float("inf"))
        self._share = -1.0

    def on_progress(self, share: float) -> None:
        if share > self._share:
            now_s = time.monotonic()
            self.silent_s = max(self.silent_s, now_s - self._last_s)
            self._share, self._last_s = share, now_s

    def _watch(self) -> None:
        while not self._ending.wait(0.01):
            self.memory_bytes = max(self.memory_bytes, peak_bytes(self.reader.pid))


def peak_bytes(process_id: int | None) -> int:
    """Most memory that a process has had; 0 where the system does not tell so simply."""
    with contextlib.suppress(OSError, StopIteration):
        lines = Path(f"/proc/{process_id}/status").read_text(encoding="utf-8").splitlines()
        return 1024 * int(next(line for line in lines if line.startswith("VmHWM")).split()[1])
    return 0


def oversized_files(folder: Path, files: Mapping[str, Callable[[Path], None]] = FILES) -> OversizedReport:
    """Make, look into and read each of the files."""
    report = OversizedReport()
    for name, write in files.items():
        path = folder / name
        write(path)
        start_s = time.monotonic()
        with Observed() as observed:
            rows = report.attempt(
                name,
                partial(observed.read, path),
                (RunError,),
                names=name,
                limit_s=LIMIT_S,
                clock=time.monotonic,
            )
        report.add(path, rows, time.monotonic() - start_s, observed)
        path.unlink()
    return report


def main() -> int:
    """Run the drill, and say what came of it."""
    return run_ways(1, {"oversized files": lambda _count, folder: oversized_files(folder)})


if __name__ == "__main__":
    sys.exit(main())
