"""A journal whose disk fails goes on elsewhere, and nothing that was appended is lost."""

import contextlib
import errno
import sys

import pytest
from disk_kit import FailingFile

from app.acquisition.errors import JournalFullError
from app.acquisition.journal.file import JournalFile, create_journal_file
from app.acquisition.journal.journal import Journal
from app.acquisition.journal.records import Continued, decode_metadata_record
from app.runs.journal import RecordKind, encode_record, read_journal
from app.runs.lock import is_being_recorded

FIRST = encode_record(b"{}", 0, RecordKind.NOTE)


def failing(path, refuges=(), room=100, code=errno.ENOSPC) -> JournalFile:
    file = create_journal_file(path, FIRST, refuges)
    file._file = FailingFile(file._file, room, code)
    return file


def wire_of(path) -> list[bytes]:
    return [record.data for record in read_journal(path) if record.kind is RecordKind.WIRE]


READS = [bytes([number]) * 30 for number in range(10)]


def append_all(file: JournalFile) -> None:
    for number, data in enumerate(READS):
        file.append(encode_record(data, number))
    file.sync()
    file.close()


@pytest.mark.parametrize("room", [0, 1, 49, 50, 51, 173, 499])
@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EIO, errno.EROFS])
def test_all_of_it_moves_wherever_the_write_failed(tmp_path, room, code):
    path, refuge = tmp_path / "full" / "run.journal", tmp_path / "refuge"
    file = failing(path, [refuge], room, code)
    append_all(file)
    assert file.path == refuge / "run.journal"
    assert file.move_cause.errno == code
    assert wire_of(file.path) == READS
    assert not path.exists()
    assert not is_being_recorded(path)
    assert is_being_recorded(file.path)
    file.release()
    assert list(refuge.iterdir()) == [file.path]
    assert list(path.parent.iterdir()) == []


@pytest.mark.skipif(sys.platform == "win32", reason="Windows renames no file that is open")
def test_a_journal_that_can_no_longer_be_read_stays_and_the_rest_goes_elsewhere(tmp_path, monkeypatch):
    path, refuge = tmp_path / "share" / "run.journal", tmp_path / "refuge"
    monkeypatch.setattr("app.acquisition.journal.file._REPEATED_BYTES", 60)
    file = failing(path, [refuge], room=4 * 50, code=errno.ESTALE)
    for number, data in enumerate(READS[:4]):
        file.append(encode_record(data, number))
    monkeypatch.setattr("app.acquisition.journal.file._PIECE_BYTES", 60)
    hidden = path.rename(path.with_name("hidden"))
    for number, data in enumerate(READS[4:], 4):
        file.append(encode_record(data, number))
    file.close()
    first, continued, *_ = read_journal(file.path)
    assert first.data == b"{}"
    assert decode_metadata_record(continued.data) == Continued(2)
    assert wire_of(file.path) == READS[2:]
    assert wire_of(hidden) == READS[:4]
    file.release()


def test_a_refuge_that_does_not_work_is_passed_over(tmp_path, monkeypatch):
    (tmp_path / "a file").write_text("")
    taken = tmp_path / "taken" / "run.journal"
    taken.parent.mkdir()
    taken.write_bytes(b"another")
    refuges = [tmp_path / "a file", taken.parent, tmp_path / "refuge"]
    file = failing(tmp_path / "full" / "run.journal", refuges)
    append_all(file)
    assert file.path.parent == tmp_path / "refuge"
    assert wire_of(file.path) == READS
    assert taken.read_bytes() == b"another"
    file.release()


def test_a_refuge_that_takes_the_rest_no_more_is_left_for_the_next(tmp_path, monkeypatch):
    file = failing(tmp_path / "full" / "run.journal", [tmp_path / "first", tmp_path / "second"])
    move_to = file._move_to

    def to_a_disk_that_takes_the_old_only(path):
        move_to(path)
        if path.parent.name == "first":
            file._file = FailingFile(file._file, 0, errno.ENOSPC)

    monkeypatch.setattr(file, "_move_to", to_a_disk_that_takes_the_old_only)
    append_all(file)
    assert file.path == tmp_path / "second" / "run.journal"
    assert wire_of(file.path) == READS
    file.release()


def test_a_refuge_on_a_full_disk_is_none(tmp_path, monkeypatch):
    monkeypatch.setattr("app.acquisition.journal.file.has_free_space", lambda *_: False)
    file = failing(tmp_path / "full" / "run.journal", [tmp_path / "refuge"])
    with pytest.raises(OSError, match="injected"):
        append_all(file)
    assert wire_of(file.path) == READS[:2]
    file.close()
    file.release()


def test_the_journal_says_where_it_went(tmp_path):
    refuge = tmp_path / "refuge"
    journal = Journal(failing(tmp_path / "full" / "run.journal", [refuge]))
    for number, data in enumerate(READS):
        journal.append(data, number)
    journal.close()
    assert str(journal.move_message) == (
        f"the folder of the run is full: the received bytes are kept in {refuge / 'run.journal'}"
    )
    assert wire_of(journal.path) == READS
    journal.remove()
    assert list(refuge.iterdir()) == []


def test_without_a_refuge_a_full_disk_is_said(tmp_path):
    journal = Journal(failing(tmp_path / "run.journal"))
    with contextlib.suppress(JournalFullError):  # said at any append once it is known
        for number, data in enumerate(READS):
            journal.append(data, number)
    with pytest.raises(JournalFullError, match="the disk is full"):
        journal.close()
    assert wire_of(tmp_path / "run.journal") == READS[:2]
    assert not journal.move_message
    journal.release()
