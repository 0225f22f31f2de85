"""Errors of storage in words, and folders that take files or do not."""

import errno

import pytest

from app.runs import disk
from app.runs.disk import atomic_write, is_writable, storage_error
from app.runs.errors import WriteError


def test_a_path_too_long_for_windows_is_told_with_its_length(tmp_path, monkeypatch):
    path = tmp_path / ("x" * 200) / "run.h5"
    absent = FileNotFoundError(errno.ENOENT, "No such file or directory")
    monkeypatch.setattr(disk, "LONGEST_PATH", None)
    assert "Check the folder" in str(storage_error(path, absent))
    monkeypatch.setattr(disk, "LONGEST_PATH", 210)
    assert f"takes no path of {len(str(path))} characters" in str(storage_error(path, absent))
    assert "Check the folder" in str(storage_error(tmp_path / "run.h5", absent))


def test_an_export_that_is_open_in_another_program_is_left_as_it_is(tmp_path, monkeypatch):
    def refuse(*_):
        error = PermissionError(errno.EACCES, "Access is denied")
        error.winerror = 32
        raise error

    path = tmp_path / "table.csv"
    path.write_text("old")
    monkeypatch.setattr("pathlib.Path.replace", refuse)
    monkeypatch.setattr("config.durable_files._PATIENCE_S", 0.1)
    with pytest.raises(WriteError) as raised, atomic_write(path, replace=True) as made:
        made.write_text("new")
    assert str(raised.value) == f"{path} is open in another program. Close it there and try again"
    assert path.read_text() == "old"
    assert [one.name for one in tmp_path.iterdir()] == ["table.csv"]


def test_a_disk_without_room_for_another_file_is_told_from_a_full_one(tmp_path, monkeypatch):
    full = OSError(errno.ENOSPC, "No space left on device")
    for files, said in (
        (1, "takes no more files. Remove some files"),
        (1000, "the disk or its quota is full"),
    ):
        monkeypatch.setattr(disk, "free_files", lambda _, files=files: files)
        assert said in str(storage_error(tmp_path / "run.h5", full))


def test_too_many_open_files_are_no_fault_of_the_folder(tmp_path):
    error = storage_error(tmp_path / "run.h5", OSError(errno.EMFILE, "Too many open files"))
    assert "allow more open files (ulimit -n 256)" in str(error)
    assert "rights" not in str(error)


def test_a_folder_is_writable_if_a_file_can_be_made_in_it(tmp_path):
    assert is_writable(tmp_path)
    assert not is_writable(tmp_path / "absent")
    assert not list(tmp_path.iterdir())
