"""Samples that differ from their checksum are refused, in whatever column a bit has flipped."""

import h5py
import numpy as np
import pytest
from runs_kit import ENDING, block

from app.runs import file_operations, schema
from app.runs.edits import edit_run
from app.runs.errors import DamagedRunError
from app.runs.file_operations import finished_run
from app.runs.reader import load_counts, open_run
from app.runs.writer import create_run, write_run

ROWS = 20_000
READ = (
    "entry/motion/time", "entry/motion/table_displacement", "entry/motion/relative_displacement",
    "entry/motion/status",
)  # fmt: skip
COUNTS = ("entry/instrument/gauge_table/data", "entry/instrument/gauge_plate/data")


@pytest.fixture
def run(tmp_path, metadata):
    write_run(tmp_path / "run.h5", metadata, block(0, ROWS), ENDING)
    return tmp_path / "run.h5"


def flip(path, column, row=ROWS // 2, bit=0x10):
    """Flip one bit of a stored number, as a disk would: HDF5 has no part in it."""
    with h5py.File(path, "r") as file:
        dataset = file[column]
        (length,) = dataset.chunks
        chunk = dataset.id.get_chunk_info(row // length)
        place = chunk.byte_offset + row % length * dataset.dtype.itemsize
    data = bytearray(path.read_bytes())
    data[place] ^= bit
    path.write_bytes(data)


@pytest.mark.parametrize("column", READ)
def test_a_flipped_bit_in_a_column_is_noticed_when_the_run_is_opened(run, column):
    flip(run, column)
    with pytest.raises(DamagedRunError, match=f"/{column} is not what was stored, by its checksum"):
        open_run(run)


@pytest.mark.parametrize("column", COUNTS)
def test_a_flipped_bit_in_counts_is_noticed_when_they_are_read(run, column):
    flip(run, column)
    opened = open_run(run)
    with pytest.raises(DamagedRunError, match=f"/{column} is not what was stored"):
        load_counts(opened)


@pytest.mark.parametrize("column", READ + COUNTS)
def test_a_run_that_its_writer_left_is_taken_for_whole_only_if_it_is_sound(run, column):
    assert finished_run(run, ROWS - 1) is None
    stored = finished_run(run, ROWS)
    assert stored is not None
    assert stored.samples == ROWS
    flip(run, column)
    assert finished_run(run, ROWS) is None


def test_a_run_that_its_writer_left_is_synced_before_its_journal_goes(run, monkeypatch):
    synced = []
    monkeypatch.setattr(file_operations, "sync_file", synced.append)
    monkeypatch.setattr(file_operations, "sync_folder", synced.append)
    finished_run(run, ROWS)
    assert synced == [run, run.parent]


def test_counts_are_checked_before_they_are_calibrated_anew(run, metadata):
    edit_run(run, "Ada", gauges=metadata.gauges)
    flip(run, COUNTS[1])
    with pytest.raises(DamagedRunError, match="gauge_plate/data is not what was stored"):
        open_run(run)


def test_no_result_is_kept_in_a_run_whose_numbers_have_changed(run):
    flip(run, COUNTS[0])
    before = run.read_bytes()
    with pytest.raises(DamagedRunError, match="gauge_table/data"):
        edit_run(run, "Ada", note="dry")
    assert run.read_bytes() == before


def test_a_run_from_before_there_were_checksums_opens(run):
    with h5py.File(run, "r+") as file:
        del file[schema.CHECKSUMS]
    assert len(open_run(run)) == ROWS


def test_a_checksum_that_is_no_number_is_damage_too(run):
    with h5py.File(run, "r+") as file:
        del file[schema.checksum_path(schema.TIME)]
        file[schema.checksum_path(schema.TIME)] = np.zeros(3)
    with pytest.raises(DamagedRunError, match="is not a number"):
        edit_run(run, "Ada", note="dry")


def test_a_run_that_was_never_closed_opens_without(tmp_path, metadata):
    writer = create_run(tmp_path / "run.h5", metadata)
    writer.append(block(0, 500))
    writer.flush()
    left = tmp_path / "left.h5"
    left.write_bytes((tmp_path / "run.h5").read_bytes())
    writer.close(ENDING)
    opened = open_run(left)
    assert opened.end is None
    assert np.array_equal(opened.time_s, block(0, 500).time_s)
