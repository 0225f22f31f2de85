"""Notes on recordings that nobody followed: found by the folder of their runs, until they are read."""

import datetime

from app.runs.unattended import UnattendedRun, leave_note, read_notes, remove_note

NOON = datetime.datetime(2026, 2, 1, 12, 0, tzinfo=datetime.UTC)


def note(tmp_path, minutes: int, name: str = "") -> UnattendedRun:
    path = str(tmp_path / name) if name else ""
    return UnattendedRun(str(tmp_path), "rest", NOON + datetime.timedelta(minutes=minutes), path, "1FFM0")


def test_notes_are_read_in_their_order_until_they_are_removed(tmp_path):
    (tmp_path / "run.h5").touch()
    later, earlier = note(tmp_path, 2, "run.h5"), note(tmp_path, 1)
    leave_note(later)
    leave_note(earlier)
    found = read_notes(tmp_path)
    assert list(found.values()) == [earlier, later]
    remove_note(next(iter(found)))
    assert list(read_notes(tmp_path).values()) == [later]
    assert read_notes(tmp_path / "other") == {}


def test_a_run_that_is_gone_is_not_told_of(tmp_path):
    leave_note(note(tmp_path, 1, "run.h5"))
    assert read_notes(tmp_path) == {}
    (tmp_path / "run.h5").touch()
    assert read_notes(tmp_path) == {}, "the note was removed"


def test_what_is_no_note_is_passed_over(tmp_path, data_folder):
    leave_note(note(tmp_path, 1))
    (folder,) = data_folder.rglob("unattended")
    (folder / "x.json").write_text("{")
    assert len(read_notes(tmp_path)) == 1


def test_where_no_note_can_be_written_nobody_is_told(tmp_path, data_folder):
    (data_folder / "Slipstand").write_text("a file")
    leave_note(note(tmp_path, 1))
    assert read_notes(tmp_path) == {}
