import shutil
import sys

import numpy as np
import pytest
from raw_bytes_kit import load_raw_bytes
from runs_kit import ENDING, block

from app.runs import disk
from app.runs.blocks import BlockLayout, RunBlock
from app.runs.errors import BeingRecordedError, DiskFullError, RunExistsError, RunNotFoundError, WriteError
from app.runs.journal import MAGIC, JournalSpan, RecordKind, encode_record
from app.runs.lock import is_being_recorded
from app.runs.reader import open_run
from app.runs.writer import create_run, create_run_in


def test_names_say_when_and_what_and_count_up(tmp_path, metadata):
    names = []
    for described in (metadata, metadata, metadata.replace(series=None)):
        writer = create_run_in(tmp_path / "new" / "folder", described)
        names.append(writer.path.name)
        writer.close(ENDING)
    assert names == ["20261121T143205_1FFM1_001.h5", "20261121T143205_1FFM1_002.h5", "20261121T143205_001.h5"]


def test_runs_of_a_series_are_numbered_in_their_order(tmp_path, metadata):
    for name in (
        "20261121T143100_1FFM1_001.h5",
        "20261121T143150_1FFM1_007.h5",
        "20261121T143200_1FFM0_009.h5",
    ):
        (tmp_path / name).touch()
    (tmp_path / "20261121T143202_011.h5").touch()
    (tmp_path / "my 1FFM1_800.h5").touch()
    names = []
    for described in (metadata, metadata.replace(series=None), metadata.replace(series="1FFM2")):
        writer = create_run_in(tmp_path, described)
        names.append(writer.path.name)
        writer.close(ENDING)
    assert names == ["20261121T143205_1FFM1_008.h5", "20261121T143205_012.h5", "20261121T143205_1FFM2_001.h5"]


def test_nothing_is_ever_overwritten(tmp_path, metadata):
    path = tmp_path / "run.h5"
    path.write_bytes(b"precious")
    with pytest.raises(RunExistsError, match="exists already"):
        create_run(path, metadata)
    assert path.read_bytes() == b"precious"
    assert list(tmp_path.iterdir()) == [path]


def test_a_run_being_recorded_is_locked(tmp_path, metadata):
    path = tmp_path / "run.h5"
    writer = create_run(path, metadata)
    writer.append(block(0, 10))
    writer.flush()
    try:
        assert is_being_recorded(path)
        with pytest.raises(BeingRecordedError, match="is being recorded"):
            open_run(path)
        with pytest.raises(RunExistsError):
            create_run(path, metadata)
        assert is_being_recorded(path)
    finally:
        writer.close(ENDING)
    assert not is_being_recorded(path)
    assert list(tmp_path.iterdir()) == [path]
    assert len(open_run(path, trusted=True)) == 10


def test_what_is_flushed_is_readable_from_a_copy(tmp_path, metadata):
    """A copy taken while recording is what a crash would leave."""
    writer = create_run(tmp_path / "run.h5", metadata)
    writer.append(block(0, 9000))
    writer.flush()
    writer.append(block(9000, 50))
    shutil.copy(writer.path, tmp_path / "copy.h5")
    writer.close(ENDING)

    run = open_run(tmp_path / "copy.h5")

    assert len(run) == 9000
    assert run.end is None
    assert run.losses.samples == 9000
    assert np.array_equal(run.time_s, block(0, 9000).time_s)


def full(*_):
    raise DiskFullError("full")


def test_a_full_disk_keeps_what_came_before(tmp_path, metadata, monkeypatch):
    writer = create_run(tmp_path / "run.h5", metadata)
    writer.append(block(0, 100))
    with monkeypatch.context() as patch:
        patch.setattr(disk, "reserve_space", full)
        with pytest.raises(DiskFullError):
            writer.append(block(100, 200_000))
    writer.interrupt("disk-full", "no room")

    run = open_run(writer.path, trusted=True)
    assert len(run) == 100
    assert (run.end.ended, run.end.message) == ("disk-full", "no room")


@pytest.mark.skipif(sys.platform != "linux", reason="other systems reserve nothing")
def test_rows_that_come_when_the_disk_is_full_take_what_was_reserved_before(tmp_path, metadata, monkeypatch):
    writer = create_run(tmp_path / "run.h5", metadata)
    writer.append(block(0, 4000))
    monkeypatch.setattr(disk, "reserve_space", full)
    writer.append(block(4000, 4000))
    assert writer._file.id.get_filesize() < writer.path.stat().st_size
    stored = writer.close(ENDING)
    assert (stored.samples, len(open_run(writer.path, trusted=True))) == (8000, 8000)
    assert writer.path.stat().st_size < 1_000_000, "what was not needed is given back"


def test_a_folder_that_cannot_be_written_to(tmp_path, metadata):
    (tmp_path / "file").write_text("")
    with pytest.raises(WriteError, match="cannot be written"):
        create_run_in(tmp_path / "file", metadata)
    with pytest.raises(WriteError, match="cannot be written"):
        create_run(tmp_path / "absent" / "run.h5", metadata)


@pytest.mark.parametrize(
    "wrong",
    [
        RunBlock(np.zeros(3), np.zeros((2, 2)), np.zeros(3, np.uint8), np.zeros((3, 2), np.int32)),
        RunBlock(np.zeros(3), np.zeros((3, 1)), np.zeros(3, np.uint8), np.zeros((3, 2), np.int32)),
        RunBlock(np.zeros(3), np.zeros((3, 2)), np.zeros(2, np.uint8), np.zeros((3, 2), np.int32)),
        RunBlock(np.zeros(3), np.zeros((3, 2)), np.zeros(3, np.uint8), None),
        RunBlock(np.zeros(3), np.zeros((3, 2)), np.zeros(3, np.uint8), np.full((3, 2), 0.5)),
    ],
)
def test_blocks_of_another_shape_are_refused(tmp_path, metadata, wrong):
    writer = create_run(tmp_path / "run.h5", metadata, BlockLayout(2, "int32"))
    with pytest.raises(ValueError, match=r"block|counts"):
        writer.append(wrong)
    writer.append(block(0, 4))
    assert writer.close(ENDING).samples == 4


def test_the_wire_is_copied_from_the_journal(tmp_path, metadata):
    chunks = [(bytes([i % 251]) * (i % 700), 10**9 + i) for i in range(5000)]
    journal = tmp_path / "a.journal"
    start = len(MAGIC) + len(encode_record(b"earlier run", 1))
    records = [encode_record(data, at) for data, at in chunks] + [encode_record(b"{}", 0, RecordKind.NOTE)]
    journal.write_bytes(
        MAGIC + encode_record(b"earlier run", 1) + b"".join(records) + encode_record(b"torn", 3)[:-1]
    )

    writer = create_run(tmp_path / "run.h5", metadata, journal=JournalSpan(str(journal), start))
    writer.append(block(0, 10))
    stored = writer.close(ENDING)

    assert stored.raw_bytes_stored
    assert list(load_raw_bytes(open_run(tmp_path / "run.h5")).chunks()) == chunks
    assert journal.exists()


@pytest.mark.parametrize("content", [None, b"no journal at all"])
def test_a_journal_that_cannot_be_read_is_told_not_to_be_stored(tmp_path, metadata, content):
    journal = tmp_path / "a.journal"
    if content:
        journal.write_bytes(content)
    writer = create_run(tmp_path / "run.h5", metadata, journal=JournalSpan(str(journal)))
    writer.append(block(0, 10))
    assert not writer.close(ENDING).raw_bytes_stored
    assert list(load_raw_bytes(open_run(tmp_path / "run.h5", trusted=True)).chunks()) == []


def test_a_disk_that_forgets_is_noticed_at_close(tmp_path, metadata, monkeypatch):
    writer = create_run(tmp_path / "run.h5", metadata)
    written = block(0, 10)
    writer.append(written)

    def corrupt(path, _):
        data = path.read_bytes()
        stored = written.readings[:, 1].tobytes()
        path.write_bytes(data.replace(stored, bytes(len(stored))))

    monkeypatch.setattr(disk, "truncate", corrupt)
    with pytest.raises(WriteError, match="relative_displacement does not read back"):
        writer.close(ENDING)
    assert not is_being_recorded(writer.path)


@pytest.mark.skipif(sys.platform != "linux", reason="room is claimed on Linux alone")
def test_room_is_claimed_before_hdf5_needs_it(tmp_path, metadata):
    """No hole may be left for HDF5 to fill: it would be the one to find the disk full."""
    writer = create_run(tmp_path / "run.h5", metadata)
    for first in range(0, 50_000, 5000):
        stat = writer.path.stat()
        assert stat.st_blocks * 512 >= stat.st_size
        writer.append(block(first, 5000))
        stat = writer.path.stat()
        assert stat.st_blocks * 512 >= stat.st_size > 33 * (first + 5000)
        writer.flush()
    writer.close(ENDING)


def test_room_claimed_ahead_is_given_back(tmp_path, metadata):
    writer = create_run(tmp_path / "run.h5", metadata)
    writer.append(block(0, 10))
    writer.close(ENDING)
    assert writer.path.stat().st_size < 700_000


def test_discard_leaves_nothing(tmp_path, metadata):
    writer = create_run(tmp_path / "run.h5", metadata)
    writer.append(block(0, 10))
    writer.discard()
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(RunNotFoundError):
        open_run(writer.path)
