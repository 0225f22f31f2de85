"""The live ring: rows are read as written; overwritten rows are reported."""

import subprocess
import sys
import threading

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.acquisition.errors import RingError
from app.acquisition.ring import create_ring, open_ring
from config.files import load_gauges
from drivers.samples import SampleStatus

GAUGES = load_gauges()


def rows(first: int, count: int):
    """Columns in which each value tells its own row."""
    n = np.arange(first, first + count)
    return np.column_stack((n, -n)), (n % 4 * SampleStatus.OVERLOAD_TABLE).astype(np.uint8)


def check(read) -> None:
    counts, status = rows(read.first_index, len(read))
    np.testing.assert_array_equal(read.time_s, np.arange(read.first_index, read.end_index) / 1000.0)
    np.testing.assert_array_equal(read.counts, counts)
    np.testing.assert_array_equal(read.status, status)
    np.testing.assert_array_equal(read.table_m, GAUGES.table.displacement_m(counts[:, 0].astype(float)))


@given(
    capacity=st.integers(1, 40),
    steps=st.lists(st.tuples(st.integers(0, 60), st.booleans()), min_size=1, max_size=30),
)
@settings(deadline=None, max_examples=100)
def test_a_reader_gets_every_row_or_is_told_how_many_it_missed(tmp_path_factory, capacity, steps):
    path = tmp_path_factory.mktemp("ring") / "live.ring"
    with create_ring(path, capacity, 1000.0, GAUGES) as ring, open_ring(path) as reader:
        written = row = 0
        for count, looks in steps:
            ring.append(*rows(written, count))
            written += count
            if looks:
                read = reader.read_since(row)
                check(read)
                assert read.first_index == max(row, written - capacity)
                assert read.lost == read.first_index - row
                assert read.end_index == reader.written == written
                row = written
    assert not path.exists()


def test_header_says_rate_and_capacity(tmp_path):
    with create_ring(tmp_path / "r", 100, 2500.0, GAUGES) as ring, open_ring(tmp_path / "r") as reader:
        assert (reader.rate_hz, reader.capacity, ring.capacity, reader.written) == (2500.0, 100, 100, 0)
        assert len(reader.read_since(0)) == 0
        assert len(reader.read_since(50)) == 0


def test_rows_read_while_being_written_are_never_mixed(tmp_path):
    ended = threading.Event()
    with create_ring(tmp_path / "r", 500, 1000.0, GAUGES) as ring, open_ring(tmp_path / "r") as reader:

        def write():
            first = 0
            while not ended.is_set():
                ring.append(*rows(first, 37))
                first += 37

        writer = threading.Thread(target=write)
        writer.start()
        try:
            row = 0
            for _ in range(2000):
                read = reader.read_since(row)
                check(read)
                row = read.end_index
        finally:
            ended.set()
            writer.join()
        assert row > 0


def test_another_process_reads_it_and_its_end_leaves_it_alone(tmp_path):
    with create_ring(tmp_path / "r", 1000, 1000.0, GAUGES) as ring:
        ring.append(*rows(0, 700))
        told = subprocess.run(
            [
                sys.executable,
                "-c",
                "import sys; from app.acquisition.ring import open_ring\n"
                "rows = open_ring(sys.argv[1]).read_since(100)\n"
                "print(rows.first_index, len(rows), rows.counts[-1, 0])",
                str(tmp_path / "r"),
            ],
            capture_output=True,
            check=True,
            text=True,
        )
        assert told.stdout.split() == ["100", "600", "699.0"]
        assert told.stderr == ""
        ring.append(*rows(700, 100))
        with open_ring(tmp_path / "r") as reader:
            check(reader.read_since(0))


def test_files_that_are_no_rings_are_refused(tmp_path):
    for name, content in (("short", b"x"), ("empty", b""), ("other", bytes(100_000))):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(RingError, match=name):
            open_ring(tmp_path / name)
    with pytest.raises(RingError, match="absent"):
        open_ring(tmp_path / "absent")
    with pytest.raises(RingError, match="no room"):
        create_ring(tmp_path / "no" / "folder", 10, 1.0, GAUGES)
