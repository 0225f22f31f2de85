import datetime
import os
from pathlib import Path

import msgspec
import pytest
from runs_kit import ANALYSIS, ENDING, block, small_run

import config
from app.runs import listing as library_module
from app.runs.analysis_request import AnalysisRequest
from app.runs.edits import edit_run, undo_edit
from app.runs.errors import RunNotFoundError, ValidationTimeoutError
from app.runs.listing import find_run_files, index_path, list_runs
from app.runs.paths import recordings_directory
from app.runs.run_filter import RunFilter
from app.runs.saved_analyses import save_analysis
from app.runs.validator import Validator
from app.runs.writer import create_run
from messages.message import Message


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
    assert "damaged" in str(listed[-1].fault)
    assert [summary.fault for summary in listed[:-1]] == [Message("")] * 3
    assert all(Path(summary.path).is_absolute() for summary in listed)


def test_filters(folder, metadata):
    day = metadata.start_time.date()
    faulty = "20261121T143205_1FFM1_009.h5"
    assert _names(list_runs(folder, RunFilter(series="1ffm1"))) == ["b.h5", faulty]
    assert _names(list_runs(folder, RunFilter(series="2SSM0"))) == ["a.h5"]
    os.utime(folder / faulty, (0, 0))
    assert _names(list_runs(folder, RunFilter(since=day + datetime.timedelta(days=1)))) == ["a.h5"]


def test_a_run_being_recorded_is_listed_as_such(tmp_path, metadata):
    writer = create_run(tmp_path / "run.h5", metadata)
    writer.append(block(0, 10))
    (listed,) = list_runs(tmp_path)
    assert "being recorded" in str(listed.fault)
    writer.close(ENDING)
    assert not list_runs(tmp_path)[0].fault


def test_a_run_that_nobody_came_to_look_over_is_looked_over_again(tmp_path, metadata, monkeypatch):
    small_run(tmp_path / "run.h5", metadata)

    def busy(_validator, path):
        raise ValidationTimeoutError(f"{path} was not looked over")

    with monkeypatch.context() as patched:
        patched.setattr(Validator, "validate", busy)
        assert "not looked over" in str(list_runs(tmp_path)[0].fault)
    assert not list_runs(tmp_path)[0].fault


def test_folders_that_are_not_there(tmp_path, monkeypatch):
    with pytest.raises(RunNotFoundError, match="no such folder"):
        list_runs(tmp_path / "absent")
    monkeypatch.setenv("SLIPSTAND_RECORDINGS", str(tmp_path / "later"))
    assert list_runs() == []


def test_where_runs_are_kept(tmp_path, monkeypatch):
    monkeypatch.delenv("SLIPSTAND_RECORDINGS", raising=False)
    assert recordings_directory() == Path(config.__file__).resolve().parent.parent / "recordings"
    monkeypatch.setattr("app.runs.paths.is_checkout", lambda: False)
    assert recordings_directory().parts[-2:] == ("Slipstand", "recordings")
    monkeypatch.setenv("SLIPSTAND_RECORDINGS", str(tmp_path / "here"))
    assert recordings_directory() == tmp_path / "here"


def test_hidden_files_are_left_out(folder):
    assert {path.name for path in find_run_files(folder)} == {
        "a.h5",
        "b.h5",
        "c.h5",
        "20261121T143205_1FFM1_009.h5",
    }


def test_more_filters(folder, metadata):
    day = metadata.start_time.date()
    assert _names(list_runs(folder, RunFilter(until=day - datetime.timedelta(days=1)))) == ["c.h5"]
    assert _names(list_runs(folder, RunFilter(operator="ada weiß"))) == ["c.h5", "b.h5", "a.h5"]
    assert _names(list_runs(folder, RunFilter(text="2ssm"))) == ["a.h5"]
    assert _names(list_runs(folder, RunFilter(text="nowhere"))) == []


def test_the_second_listing_examines_only_what_changed(folder, monkeypatch):
    first = list_runs(folder)
    examined = []
    before = library_module._summary
    monkeypatch.setattr(
        library_module, "_summary", lambda path, *rest: (examined.append(path.name), before(path, *rest))[1]
    )
    assert list_runs(folder) == first
    assert examined == []

    edit_run(folder / "b.h5", "Ada", note="dusty")
    (folder / "a.h5").unlink()
    again = list_runs(folder)
    assert examined == ["b.h5"]
    assert [run.note for run in again if run.path.endswith("b.h5")] == ["dusty"]
    assert "a.h5" not in _names(again)


@pytest.mark.parametrize("harm", ["gone", "rubbish", "another version", "no folder"])
def test_the_index_can_be_lost_at_any_time(folder, harm):
    first = list_runs(folder)
    path = index_path(folder)
    if harm == "gone":
        path.unlink()
    elif harm == "rubbish":
        path.write_bytes(b"no database" * 1000)
    elif harm == "another version":
        _, index = msgspec.msgpack.decode(path.read_bytes())
        path.write_bytes(msgspec.msgpack.encode(("0.0.1", index)))
    else:
        path.unlink()
        path.parent.rmdir()
        path.parent.write_text("in the way")
    assert list_runs(folder) == first


def test_stale_analyses_are_marked(folder):
    path = folder / "b.h5"
    save_analysis(path, ANALYSIS, "hash", {"table_mass_kg": None})
    assert _stale(folder) == []
    edit_run(path, "Ada", note="changes no number")
    assert _stale(folder) == []
    edit_run(path, "Ada", plate_mass_kg=27.5)
    assert _stale(folder) == ["b.h5"]
    undo_edit(path, "Ada")
    assert _stale(folder) == []


def test_requests_of_valid_analyses_are_listed(folder):
    path = folder / "b.h5"
    default, heavier = AnalysisRequest(), AnalysisRequest(plate_mass_kg=30.0)
    for request in (default, heavier, default):
        save_analysis(path, ANALYSIS, "hash", msgspec.to_builtins(request))
    assert _valid_requests(folder) == {default.key, heavier.key}

    edit_run(path, "Ada", plate_mass_kg=27.5)
    assert _valid_requests(folder) == {heavier.key}
    edit_run(path, "Ada", pullback_m=0.009)
    assert _valid_requests(folder) == set()


def test_an_analysis_with_another_mass_is_not_stale(folder):
    settings = msgspec.to_builtins(AnalysisRequest(plate_mass_kg=30.0))
    save_analysis(folder / "b.h5", ANALYSIS, "hash", settings)
    assert _stale(folder) == []


def _valid_requests(folder):
    (found,) = (run for run in list_runs(folder) if run.path.endswith("b.h5"))
    return set(found.valid_requests)


def _stale(folder):
    return _names(list_runs(folder, RunFilter(stale=True)))
