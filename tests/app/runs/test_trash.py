"""The trash: nothing is overwritten, and nothing is deleted that is not in it."""

import errno

import pytest
from runs_kit import ENDING, block, small_run

from app.runs import file_operations as trash_module
from app.runs.errors import BeingRecordedError, RunNotFoundError, UnsuitableRunError
from app.runs.file_operations import delete_from_trash, list_trash, move_to_trash, restore_from_trash
from app.runs.listing import find_run_files, list_runs
from app.runs.reader import open_run
from app.runs.writer import create_run


def test_a_run_goes_to_the_trash_and_comes_back_as_it_was(tmp_path, metadata):
    path = tmp_path / "run.h5"
    small_run(path, metadata)
    before = path.read_bytes()
    lies = move_to_trash(path)
    assert list(find_run_files(tmp_path)) == []
    assert list_trash(tmp_path) == [lies]
    assert open_run(lies).metadata == metadata
    assert restore_from_trash(lies) == path
    assert path.read_bytes() == before
    assert list_trash(tmp_path) == []


def test_names_that_meet_are_numbered(tmp_path, metadata):
    path = tmp_path / "run.h5"
    for _ in range(3):
        small_run(path, metadata)
        move_to_trash(path)
    assert {run.name for run in list_trash(tmp_path)} == {"run.h5", "run-2.h5", "run-3.h5"}
    small_run(path, metadata)
    assert restore_from_trash(tmp_path / ".trash" / "run.h5").name == "run-2.h5"


def test_what_cannot_be_moved(tmp_path, metadata):
    with pytest.raises(RunNotFoundError):
        move_to_trash(tmp_path / "absent.h5")
    with pytest.raises(UnsuitableRunError, match="not in a trash"):
        restore_from_trash(tmp_path / "absent.h5")
    writer = create_run(tmp_path / "open.h5", metadata)
    writer.append(block(0, 10))
    with pytest.raises(BeingRecordedError):
        move_to_trash(tmp_path / "open.h5")
    writer.close(ENDING)
    with pytest.raises(UnsuitableRunError, match="already"):
        move_to_trash(move_to_trash(tmp_path / "open.h5"))


def test_a_folder_whose_names_cannot_be_made_to_last_loses_no_run(tmp_path, metadata, monkeypatch):
    path = tmp_path / "run.h5"
    small_run(path, metadata)

    def cannot(_folder):
        raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr(trash_module, "sync_folder", cannot)
    lies = move_to_trash(path)
    assert open_run(lies).metadata == metadata
    assert open_run(restore_from_trash(lies)).metadata == metadata


@pytest.mark.usefixtures("symbolic_links")
def test_what_is_no_run_stays_where_it_is(tmp_path, metadata):
    small_run(tmp_path / "run.h5", metadata)
    link, text = tmp_path / "link.h5", tmp_path / "notes.txt"
    link.symlink_to("run.h5")
    text.write_text("not a run")
    with pytest.raises(UnsuitableRunError, match="is a link to"):
        move_to_trash(link)
    with pytest.raises(UnsuitableRunError, match="not named like a run"):
        move_to_trash(text)
    assert link.is_symlink()
    assert text.exists()


def test_the_trash_of_a_folder_that_is_not_there(tmp_path):
    with pytest.raises(RunNotFoundError, match="no such folder"):
        list_trash(tmp_path / "absent")


def test_only_a_run_in_the_trash_is_deleted(tmp_path, metadata):
    path = tmp_path / "run.h5"
    small_run(path, metadata)
    with pytest.raises(UnsuitableRunError, match="not in a trash"):
        delete_from_trash(path)
    assert path.exists()
    lies = move_to_trash(path)
    (lies.parent / "notes.txt").write_text("kept")
    delete_from_trash(lies)
    assert [kept.name for kept in lies.parent.iterdir()] == ["notes.txt"]
    with pytest.raises(RunNotFoundError):
        delete_from_trash(lies)


def test_the_runs_in_all_trashes_of_a_folder_are_listed(tmp_path, metadata):
    (tmp_path / "below").mkdir()
    for path in (tmp_path / "a.h5", tmp_path / "b.h5", tmp_path / "below" / "c.h5"):
        small_run(path, metadata)
    assert list_runs(tmp_path, in_trash=True) == []
    lie = {str(move_to_trash(tmp_path / "a.h5")), str(move_to_trash(tmp_path / "below" / "c.h5"))}
    for _ in ("read", "indexed"):
        assert {run.path for run in list_runs(tmp_path, in_trash=True)} == lie
        assert [run.path for run in list_runs(tmp_path)] == [str(tmp_path / "b.h5")]
