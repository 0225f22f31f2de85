"""Run files copied into a library: nothing is overwritten, and only runs are taken."""

import pytest
from runs_kit import small_run

from app.runs.errors import NotARunError, RunExistsError
from app.runs.file_operations import copy_run_into
from app.runs.reader import open_run


@pytest.fixture
def run_path(tmp_path, metadata):
    small_run(tmp_path / "run.h5", metadata)
    return tmp_path / "run.h5"


def test_a_copy_gets_its_name_or_the_next_that_is_free(run_path, tmp_path):
    folder = tmp_path / "library"
    first = copy_run_into(run_path, folder)
    second = copy_run_into(run_path, folder)
    assert first.name == run_path.name
    assert second.name == f"{run_path.stem}-2.h5"
    assert first.read_bytes() == second.read_bytes() == run_path.read_bytes()
    assert open_run(second).identifier == open_run(run_path).identifier
    assert sorted(path.name for path in folder.iterdir()) == sorted([first.name, second.name])


def test_what_is_no_run_is_refused_and_leaves_nothing(tmp_path):
    source = tmp_path / "letter.h5"
    source.write_text("Dear reader")
    with pytest.raises(NotARunError, match="not an HDF5 file"):
        copy_run_into(source, tmp_path / "library")
    assert not (tmp_path / "library").exists()


def test_a_run_of_the_folder_itself_is_not_doubled(run_path):
    with pytest.raises(RunExistsError, match="already"):
        copy_run_into(run_path, run_path.parent)
