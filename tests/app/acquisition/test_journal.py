"""The journal: every byte on disk in order, and damage cut off where it begins."""

import datetime
import errno
import threading
import time
from pathlib import Path

import pytest

from app.acquisition.errors import JournalError, JournalFullError
from app.acquisition.journal.journal import Journal, create_journal
from app.acquisition.journal.records import JournalHeader, Named, decode_metadata_record
from app.acquisition.messages import PortSettings, RunSettings
from app.runs.journal import RecordKind, read_journal
from app.runs.lock import is_being_recorded
from app.runs.metadata import create_metadata
from config.files import load_gauges, load_stand
from tests.waiting import PATIENCE_S, wait_until


def header() -> JournalHeader:
    now = datetime.datetime(2026, 1, 12, 14, 0, tzinfo=datetime.UTC)
    metadata = create_metadata(load_stand(), load_gauges(), now, series="1FFM0", rate_hz=1000.0)
    return JournalHeader(
        PortSettings("/dev/x", "csv"), RunSettings("/runs", series="1FFM0"), metadata, "a-uuid", "test"
    )


READS = [(b"first", 11), (b"", 12), (bytes(range(256)) * 40, 13), (b"\n", 14)]


def written(path):
    journal = create_journal(path, header())
    places = [journal.append(data, arrival_ns) for data, arrival_ns in READS]
    journal.close()
    journal.release()
    return places


def test_what_was_appended_is_read_back_with_its_times(tmp_path):
    path = tmp_path / "new folder" / "run.journal"
    places = written(path)
    note, *records = read_journal(path)
    assert note.kind is RecordKind.NOTE
    assert decode_metadata_record(note.data) == header()
    assert [(record.data, record.arrival_ns) for record in records] == READS
    assert [record.kind for record in records] == [RecordKind.WIRE] * 4
    # Each place is where a record begins: reading may start there.
    for number, place in enumerate(places):
        assert [record.data for record in read_journal(path, place)] == [data for data, _ in READS[number:]]


def test_a_journal_cut_anywhere_gives_all_whole_records_before_the_cut(tmp_path):
    path = tmp_path / "run.journal"
    places = written(path)
    whole = path.read_bytes()
    for cut in [*range(places[0], places[2] + 30), len(whole) - 1]:
        path.write_bytes(whole[:cut])
        expected = [
            data for (data, _), end in zip(READS, [*places[1:], len(whole)], strict=True) if end <= cut
        ]
        assert [record.data for record in read_journal(path)][1:] == expected


def test_a_wrong_byte_ends_the_journal_before_its_record(tmp_path):
    path = tmp_path / "run.journal"
    places = written(path)
    damaged = bytearray(path.read_bytes())
    damaged[places[2] + 500] ^= 0x10
    path.write_bytes(damaged)
    assert [record.data for record in read_journal(path)][1:] == [b"first", b""]


def test_it_is_on_disk_while_the_journal_is_still_open(tmp_path):
    path = tmp_path / "run.journal"
    journal = create_journal(path, header())
    journal.append(b"now", 1)
    wait_until(lambda: [record.data for record in read_journal(path)][1:] == [b"now"])
    journal.close()
    journal.remove()
    journal.remove()
    assert not path.exists()


def test_each_record_is_handed_to_the_system_at_once(tmp_path, monkeypatch):
    """A kill takes no more than what is under way: records do not wait in a buffer of the process."""
    monkeypatch.setattr(Journal, "_SYNC_S", 60.0)
    path = tmp_path / "run.journal"
    journal = create_journal(path, header())
    for number in range(5):
        journal.append(b"%d" % number, number)
        wait_until(lambda count=number + 2: len(list(read_journal(path))) == count)
    assert [record.data for record in read_journal(path)][1:] == [b"0", b"1", b"2", b"3", b"4"]
    journal.close()
    journal.remove()


def test_a_slow_disk_holds_no_record_up(tmp_path, monkeypatch):
    """While what came before is synced, what comes is handed to the system."""
    may_end = threading.Event()
    monkeypatch.setattr("app.acquisition.journal.file.os.fsync", lambda _: may_end.wait(PATIENCE_S))
    monkeypatch.setattr(Journal, "_SYNC_S", 0.01)
    path = tmp_path / "run.journal"
    may_end.set()
    journal = create_journal(path, header())
    may_end.clear()
    for number in range(20):
        journal.append(b"%d" % number, number)
        time.sleep(0.005)
    wait_until(lambda: len(list(read_journal(path))) == 21)
    assert not may_end.is_set()
    may_end.set()
    journal.close()
    journal.remove()


def test_what_comes_during_a_slow_sync_is_synced_after_it(tmp_path, monkeypatch):
    may_end, begun = threading.Event(), list[int]()
    path = tmp_path / "run.journal"

    def slow_sync(_descriptor):
        begun.append(len(list(read_journal(path))))
        may_end.wait(PATIENCE_S)

    may_end.set()
    monkeypatch.setattr(Journal, "_SYNC_S", 0.01)
    journal = create_journal(path, header())
    monkeypatch.setattr("app.acquisition.journal.file.os.fsync", slow_sync)
    may_end.clear()
    journal.append(b"first", 1)
    wait_until(lambda: begun == [2])
    journal.append(b"second", 2)
    wait_until(lambda: len(list(read_journal(path))) == 3)
    time.sleep(0.05)  # its own sync has been due for a while
    assert begun == [2]
    may_end.set()
    wait_until(lambda: begun == [2, 3])
    journal.close()
    journal.remove()


def test_what_becomes_known_stands_between_the_bytes(tmp_path):
    path = tmp_path / "run.journal"
    journal = create_journal(path, header())
    journal.append(b"bytes", 1)
    journal.append_metadata(Named("/runs/run.h5"))
    journal.close()
    journal.release()
    kinds = [record.kind for record in read_journal(path)]
    assert kinds == [RecordKind.NOTE, RecordKind.WIRE, RecordKind.NOTE]
    assert decode_metadata_record(list(read_journal(path))[-1].data) == Named("/runs/run.h5")


def test_a_lock_tells_that_its_engine_lives(tmp_path):
    path = tmp_path / "run.journal"
    journal = create_journal(path, header())
    assert is_being_recorded(path)
    journal.close()
    assert is_being_recorded(path), "the run is not safe yet"
    journal.release()
    assert not is_being_recorded(path)
    assert list(tmp_path.iterdir()) == [path]


class Disk:
    """The file of a journal whose disk fails."""

    size = 0
    path = Path("/runs/run.journal")

    def __init__(self, error: int) -> None:
        self.error = error

    def append(self, data: bytes) -> None:
        raise OSError(self.error, "it failed")

    def close(self) -> None:
        pass


@pytest.mark.parametrize(("code", "kind"), [(errno.ENOSPC, JournalFullError), (errno.EIO, JournalError)])
def test_a_failing_disk_is_said_at_the_next_append_and_at_closing(code, kind):
    journal = Journal(Disk(code))
    with pytest.raises(kind, match=r"run\.journal"):
        append_often(journal, 1000)
    with pytest.raises(kind):
        journal.close()


def append_often(journal, times):
    for _ in range(times):
        journal.append(b"x", 1)
        time.sleep(0.001)


def test_a_disk_that_is_too_slow_is_said(monkeypatch):
    monkeypatch.setattr(Journal, "_QUEUE_RECORDS", 4)
    monkeypatch.setattr(Journal, "_write", lambda *_: None)
    journal = Journal(Disk(0))
    with pytest.raises(JournalError, match="too slow"):
        append_often(journal, 5)


def test_a_folder_that_cannot_be_is_refused_at_once(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(JournalError, match="folder"):
        create_journal(tmp_path / "file" / "run.journal", header())
    written(tmp_path / "run.journal")
    with pytest.raises(JournalError, match="cannot be written"):
        create_journal(tmp_path / "run.journal", header())
