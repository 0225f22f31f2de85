"""Foreign files that are larger than they look: refused by their declared sizes, before they are read."""

import gzip
import os
import subprocess
import sys
import time

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from app.runs.errors import ImportFileError
from app.runs.exchange import csv_layout, foreign_files, reading_process
from app.runs.exchange.csv_layout import FileLayout
from app.runs.exchange.formats import matlab
from app.runs.exchange.importing import ImportPlan, read_record
from app.runs.exchange.memory_limit import MEMORY_EXIT
from app.runs.exchange.reading_process import ReadingProcess, ReadingProgress
from app.runs.exchange.recognition import preview_file

PLAN = ImportPlan(FileLayout("t", "u1"))
ROWS = 60


def fault_of(path, plan=PLAN):
    with pytest.raises(ImportFileError) as caught:
        read_record(path, plan)
    return str(caught.value).replace(f"{path.parent}{os.sep}", "")


@pytest.mark.parametrize("chunk", [1 << 20, 1 << 26])
def test_more_numbers_than_can_be_loaded_are_refused(tmp_path, chunk):
    """As the shape of a dataset tells, or that of its chunks, of which one is unpacked at least."""
    path = tmp_path / "huge.h5"
    with h5py.File(path, "w") as file:
        for name in ("t", "u1"):
            shape = (12_500_000_000 if chunk == 1 << 20 else 60,)
            file.create_dataset(name, shape, "f8", chunks=(chunk,), maxshape=(None,), compression="gzip")
    said = fault_of(path)
    assert said.startswith("huge.h5: the columns hold ")
    assert said.endswith("numbers, too many to be loaded: 33554432 at most. Export a part")


def test_cells_and_large_structs_of_matlab_are_not_loaded(tmp_path, monkeypatch):
    path = tmp_path / "workspace.mat"
    content = {
        "cells": np.array([np.zeros(5), "a"], object),
        "S": {"t": np.arange(100_000) * 1.0, "u1": np.arange(100_000) * 2.0},
        "T": {"v": np.arange(100_000) * 3.0},
        "both": np.column_stack([np.arange(ROWS), np.arange(ROWS) * 3.0]),
    }
    of_struct = ImportPlan(FileLayout("S.t", "S.u1"))
    for compressed in (False, True):
        savemat(path, content, do_compression=compressed)
        monkeypatch.setattr(matlab, "_STRUCT_BYTES", 3 << 20)
        assert preview_file(path).columns == ("S.t", "S.u1", "T.v", "both:0", "both:1")
        monkeypatch.setattr(matlab, "_STRUCT_BYTES", 2 << 20)
        assert preview_file(path).columns == ("S.t", "S.u1", "both:0", "both:1")
        assert np.array_equal(read_record(path, of_struct).cells[0], 2.0 * np.arange(100_000))
        monkeypatch.setattr(matlab, "_STRUCT_BYTES", 1 << 20)
        assert preview_file(path).columns == ("T.v", "both:0", "both:1")
        by_matrix = read_record(path, ImportPlan(FileLayout("both:0", "both:1")))
        assert list(by_matrix.cells[0]) == [3.0 * row for row in range(ROWS)]
        assert fault_of(path, of_struct) == (
            "workspace.mat: structs up to S take more than 1 MB. Save its fields as variables"
        )


def test_a_part_of_a_parquet_file_is_unpacked_only_if_it_is_not_too_large(tmp_path, monkeypatch):
    pa, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    path = tmp_path / "log.parquet"
    parquet.write_table(
        pa.table({"t": np.arange(ROWS) * 1.0, "u1": np.ones(ROWS), "note": ["x" * 1000] * ROWS}),
        path,
        use_dictionary=False,
    )
    monkeypatch.setattr("app.runs.exchange.formats.parquet._CHUNK_BYTES", 2000)
    assert preview_file(path).rows[1] == ("1.0", "1.0", "")
    assert len(read_record(path, PLAN)) == ROWS
    assert fault_of(path, ImportPlan(FileLayout("t", "note"))) == (
        "log.parquet, column note: string is no number. Export plain numbers"
    )
    monkeypatch.setattr("app.runs.exchange.formats.parquet._CHUNK_BYTES", 100)
    assert fault_of(path) == (
        "log.parquet, column t: a row group is too large to be loaded. Export smaller ones"
    )


@pytest.mark.parametrize("above", ["", "t,u1\n", "t,u1\n" + "".join(f"{row},1\n" for row in range(ROWS))])
def test_a_line_of_more_than_a_megabyte_is_no_row(tmp_path, above):
    path = tmp_path / "line.csv"
    path.write_text(above + "0.1,2," * 400_000, encoding="utf-8")
    line = above.count("\n") + 1
    assert (
        fault_of(path)
        == f"line.csv, line {line}: it has more than 1048576 bytes. Give a file with a row a line"
    )


def test_a_table_of_too_many_columns_is_refused_without_a_look_at_each_cell(tmp_path, monkeypatch):
    """Each cell of each line was looked at once for each delimiter, which took minutes."""
    cells, kind = [], csv_layout._kind
    monkeypatch.setattr(csv_layout, "_kind", lambda *cell: cells.append(cell) or kind(*cell))
    path = tmp_path / "wide.csv"
    path.write_text(("x," * 150_000 + "\n") * 20, encoding="utf-8")
    assert fault_of(path).endswith("Check --skip, --delimiter and --decimal")
    path.write_text(("1," * 150_000 + "\n") * 20, encoding="utf-8")
    assert fault_of(path) == "wide.csv has 150000 columns, more than 16384. Export those of the record"
    assert len(cells) < 100_000


def test_a_message_names_no_more_columns_than_can_be_read(tmp_path):
    names = [f"channel {number} of the laboratory's large amplifier" for number in range(500)]
    path = tmp_path / "many.csv"
    rows = "".join(",".join([str(row)] * 500) + "\n" for row in range(ROWS))
    path.write_text(",".join(names) + "\n" + rows, encoding="utf-8")
    said = fault_of(path)
    assert said.startswith("many.csv has no column 't'. Choose one of 500: channel 0 of the laboratory")
    assert said.endswith("...")
    assert len(said) < 1000


def test_a_packed_file_that_says_to_be_too_large_is_not_unpacked(tmp_path, monkeypatch):
    path, pieces = tmp_path / "zeros.csv.gz", []
    text = b"t,u1\n" + b"".join(b"%d,1\n" % row for row in range(ROWS))
    path.write_bytes(gzip.compress(text + b"#" * 100_000))
    monkeypatch.setattr(foreign_files, "_UNPACKED_MOST_BYTES", 50_000)
    with pytest.raises(ImportFileError, match=r"zeros.csv.gz unpacks to more than"):
        read_record(path, PLAN, pieces.append)
    assert pieces == []
    monkeypatch.setattr(foreign_files, "_UNPACKED_MOST_BYTES", 1 << 30)
    assert len(read_record(path, PLAN)) == ROWS
    for end in (b"\xff" * 4, b""):  # it lies, or it is cut
        path.write_bytes(gzip.compress(text)[:-4] + end)
        with pytest.raises(ImportFileError, match=r"zeros.csv.gz is a damaged gzip file"):
            read_record(path, PLAN)
    path.write_bytes(b"\x1f\x8b")
    with pytest.raises(ImportFileError, match=r"zeros.csv.gz is a damaged gzip file"):
        read_record(path, PLAN)


class RepeatedProgress:
    """A process that says again and again that the same share is read."""

    has_ended, pid = False, None

    def send(self, _request):
        return True

    def receive(self, timeout_s):
        time.sleep(0.01)
        if timeout_s <= 0.0:
            raise TimeoutError
        return ReadingProgress(0.5)


def test_what_reads_a_text_is_loaded_before_time_without_progress_counts(tmp_path):
    """On a busy computer it takes longer than `PROGRESS_S`: sound files were called damaged."""
    events = []
    reading_process._load_reader(tmp_path / "a.csv", events.append)
    assert [event.is_loading for event in events] == [True, False]


def test_what_reads_a_file_of_parquet_is_loaded_before_time_without_progress_counts(tmp_path):
    """Pandas too, which pyarrow imports when it gives arrays: a second of processor time."""
    pa, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    path = tmp_path / "a.parquet"
    parquet.write_table(pa.table({name: np.arange(20.0) for name in ("t", "u1", "u2")}), path)
    code = """
import sys
from pathlib import Path
from app.runs.exchange.importing import ImportPlan, read_record
from app.runs.exchange.csv_layout import FileLayout
from app.runs.exchange.reading_process import _load_reader
path = Path(sys.argv[1])
_load_reader(path, lambda _: None)
before = set(sys.modules)
read_record(path, ImportPlan(FileLayout("t", "u1", "u2")), lambda _: None, lambda cells: cells)
print(sorted({name.partition(".")[0] for name in set(sys.modules) - before} - set(sys.stdlib_module_names)))
"""
    done = subprocess.run([sys.executable, "-c", code, path], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_a_folder_that_windows_does_not_remove_yet_is_removed_with_the_next(tmp_path, monkeypatch):
    """While the arrays of its record are in use: each import left its folder among the temporary files."""
    path, process = tmp_path / "a.csv", ReadingProcess()
    path.write_text("t,u1\n" + "".join(f"{row / 1000},{row}\n" for row in range(1, ROWS)))
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(temporary))
    try:
        with monkeypatch.context() as refusing, process.read(path, PLAN):
            refusing.setattr("shutil.rmtree", lambda *_arguments, **_options: None)
            folders = list(temporary.glob("slipstand-import-*"))
        assert len(folders) == 1
        with process.read(path, PLAN):
            pass
        assert list(temporary.glob("slipstand-import-*")) == []
    finally:
        process.stop()


def test_a_text_is_read_without_pandas(tmp_path):
    """Its import takes seconds, and pyarrow's own way to numpy does it."""
    path = tmp_path / "a.csv"
    path.write_text("t,u1\n" + "".join(f"{row / 1000},{row if row % 7 else ''}\n" for row in range(1, ROWS)))
    code = f"""
import sys
from pathlib import Path
from app.runs.exchange.csv_layout import FileLayout
from app.runs.exchange.importing import ImportPlan, read_record
(cells,) = read_record(Path({str(path)!r}), ImportPlan(FileLayout("t", "u1"))).cells
print([str(cell) for cell in cells[5:8]], "pyarrow" in sys.modules, "pandas" in sys.modules)
"""
    told = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout
    assert told.strip() == "['6.0', 'nan', '8.0'] True False"


def test_progress_that_is_none_is_not_waited_for(tmp_path, monkeypatch):
    monkeypatch.setattr(reading_process, "PROGRESS_S", 0.1)
    reader, shares = ReadingProcess(), []
    reader._process = RepeatedProgress()
    fault = pytest.raises(ImportFileError, match=r"a.csv: reading it shows no progress for 0.1 s")
    with fault, reader.read(tmp_path / "a.csv", PLAN, shares.append):
        pass
    assert set(shares) == {0.5}


TAKE = "import numpy as np; held = [np.ones(1 << 22) for _ in range(20)]; time.sleep(5)"


@pytest.mark.parametrize("limit", ["limit_memory", "watch_memory"])
def test_a_process_that_takes_too_much_memory_ends(limit):
    """By the system, or by a thread where the system has no such limit."""
    code = f"import time; from app.runs.exchange.memory_limit import *; {limit}(400_000_000); {TAKE}"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    if limit == "watch_memory" or sys.platform != "linux":
        assert done.returncode == MEMORY_EXIT
    else:
        assert "MemoryError" in done.stderr
