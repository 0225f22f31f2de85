import datetime
import os
from pathlib import Path

import pytest
from runs_kit import ENDING, block, small_run

import config
from app.runs.errors import RunNotFoundError
from app.runs.library import find_runs, list_runs
from app.runs.places import recordings_directory
from app.runs.writer import create_run


@pytest.fixture
def folder(tmp_path, metadata):
    """Three good runs, one of them below, and everything that may lie beside them."""
    (tmp_path / "below").mkdir()
    (tmp_path / ".trash").mkdir()
    small_run(tmp_path / "b.h5", metadata)
    small_run(tmp_path / ".trash" / "gone.h5", metadata)
    later = metadata.replace(series="2SSM0", start_time=metadata.start_time + datetime.timedelta(days=3))
    small_run(tmp_path / "a.h5", later)
    earlier = metadata.replace(series=None, start_time=metadata.start_time - datetime.timedelta(days=3))
    small_run(tmp_path / "below" / "c.h5", earlier)
    (tmp_path / "20261121T143205_1FFM1_009.h5").write_bytes(b"\x89HDF\r\n\x1a\n and then nothing")
    (tmp_path / "notes.txt").write_text("not a run")
    return tmp_path


def _names(summaries):
    return [Path(summary.path).name for summary in summaries]


def test_runs_are_listed_oldest_first_and_faults_last(folder):
    listed = list_runs(folder)
    assert _names(listed) == ["c.h5", "b.h5", "a.h5", "20261121T143205_1FFM1_009.h5"]
    assert [summary.samples for summary in listed] == [100, 100, 100, 0]
    assert "damaged" in listed[-1].fault
    assert [summary.fault for summary in listed[:-1]] == ["", "", ""]
    assert all(Path(summary.path).is_absolute() for summary in listed)


def test_filters(folder, metadata):
    day = metadata.start_time.date()
    faulty = "20261121T143205_1FFM1_009.h5"
    assert _names(list_runs(folder, series="1ffm1")) == ["b.h5", faulty]
    assert _names(list_runs(folder, series="2SSM0")) == ["a.h5"]
    os.utime(folder / faulty, (0, 0))
    assert _names(list_runs(folder, since=day + datetime.timedelta(days=1))) == ["a.h5"]


def test_a_run_being_recorded_is_listed_as_such(tmp_path, metadata):
    writer = create_run(tmp_path / "run.h5", metadata)
    writer.append(block(0, 10))
    (listed,) = list_runs(tmp_path)
    assert "being recorded" in listed.fault
    writer.close(ENDING)
    assert not list_runs(tmp_path)[0].fault


def test_folders_that_are_not_there(tmp_path, monkeypatch):
    with pytest.raises(RunNotFoundError, match="no such folder"):
        list_runs(tmp_path / "absent")
    monkeypatch.setenv("SLIPSTAND_RECORDINGS", str(tmp_path / "later"))
    assert list_runs() == []


def test_where_runs_are_kept(tmp_path, monkeypatch):
    monkeypatch.delenv("SLIPSTAND_RECORDINGS", raising=False)
    assert recordings_directory() == Path(config.__file__).resolve().parent.parent / "recordings"
    monkeypatch.setattr("app.runs.places.is_checkout", lambda: False)
    assert recordings_directory().parts[-2:] == ("Slipstand", "recordings")
    monkeypatch.setenv("SLIPSTAND_RECORDINGS", str(tmp_path / "here"))
    assert recordings_directory() == tmp_path / "here"


def test_hidden_files_are_left_out(folder):
    assert {path.name for path in find_runs(folder)} == {
        "a.h5",
        "b.h5",
        "c.h5",
        "20261121T143205_1FFM1_009.h5",
    }
