"""Odd files in a library folder or in its cache do not stop the listing."""

import datetime
import json
import os
import shutil
import sys
from pathlib import Path

import h5py
import msgspec
import numpy as np
import pytest
from runs_kit import ANALYSIS, small_run

from app.runs import listing as library_module
from app.runs.listing import index_path, list_runs
from app.runs.metadata import IMPORT_PROTOCOL
from app.runs.run_filter import RunFilter
from app.runs.saved_analyses import save_analysis
from drivers.samples import DeviceIdentity
from messages.message import Message

SINCE = RunFilter(since=datetime.date(2020, 1, 1))


@pytest.fixture
def good(tmp_path, metadata):
    """A good run in a folder of its own."""
    path = tmp_path / "good.h5"
    small_run(path, metadata)
    return path


def _names(folder, wanted=None):
    return [Path(run.path).name for run in list_runs(folder, wanted)]


def _replaced_text(file, path, text):
    del file[path]
    file[path] = text


@pytest.mark.usefixtures("symbolic_links")
def test_a_link_that_leads_to_itself_is_left_out(good):
    good.with_name("loop.h5").symlink_to("loop.h5")
    assert _names(good.parent) == ["good.h5"]


@pytest.mark.skipif(sys.platform == "win32", reason="there a listing has the state of each file already")
def test_a_file_that_goes_while_it_is_looked_at_is_left_out(good, monkeypatch):
    small = good.with_name("small.h5")
    shutil.copy(good, small)
    before = library_module._is_file

    def gone_meanwhile(entry):
        there = before(entry)
        if entry.name == "small.h5":
            small.unlink()
        return there

    monkeypatch.setattr(library_module, "_is_file", gone_meanwhile)
    assert _names(good.parent) == ["good.h5"]


def test_a_folder_named_like_a_lock_is_none(good):
    good.with_name("good.h5.recording").mkdir()
    assert [run.fault for run in list_runs(good.parent)] == [Message("")]


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere names of files are always text")
def test_names_that_are_no_text_are_listed(good):
    good.rename(good.with_name("run\udcff.h5"))
    assert _names(good.parent) == ["run\udcff.h5"]
    assert _names(good.parent) == ["run\udcff.h5"]


@pytest.mark.parametrize("begun", ["0001-01-01T00:00:00+23:00", "9999-12-31T23:59:59-23:00"])
def test_a_date_at_the_end_of_the_calendar_is_a_fault_of_its_file_alone(good, begun):
    other = good.with_name("other.h5")
    shutil.copy(good, other)
    with h5py.File(other, "r+") as file:
        _replaced_text(file, "entry/start_time", begun)
    os.utime(other, (0, 0))
    assert _names(good.parent, SINCE) == ["good.h5"]
    assert "start_time" in str(list_runs(good.parent)[-1].fault)


def test_a_time_that_is_no_number_is_a_fault(good):
    with h5py.File(good, "r+") as file:
        file["entry/motion/time"][-1] = np.nan
    assert "duration_s is nan" in str(list_runs(good.parent)[0].fault)


def test_an_analysis_whose_friction_is_a_word_is_damaged(good):
    save_analysis(good, ANALYSIS, "hash")
    document = json.loads(json.dumps(ANALYSIS))
    document["results"]["friction_dynamic"]["value"] = "=1+1"
    with h5py.File(good, "r+") as file:
        _replaced_text(file, "entry/analysis_001/document", json.dumps(document))
        del file["entry/analysis_001/crc32"]
    (listed,) = list_runs(good.parent)
    assert (listed.analyses, listed.damaged_analyses, listed.friction_dynamic) == (0, 1, None)


def test_an_entry_of_the_index_that_cannot_be_read_begins_it_anew(good):
    listed = list_runs(good.parent)
    version, index = msgspec.msgpack.decode(index_path(good.parent).read_bytes())
    damaged = msgspec.msgpack.encode((version, index | {"/gone.h5": ((1, 1), None)}))
    index_path(good.parent).write_bytes(damaged)
    assert list_runs(good.parent) == listed
    assert list(msgspec.msgpack.decode(index_path(good.parent).read_bytes())[1]) == [str(good)]


def test_a_run_whose_start_is_not_known_is_of_no_day(tmp_path, metadata):
    """Its file was written today, which says nothing of the test."""
    of_import = DeviceIdentity(IMPORT_PROTOCOL, "import")
    small_run(tmp_path / "imported.h5", metadata.replace(start_time=None, device=of_import))
    assert _names(tmp_path, RunFilter()) == ["imported.h5"]
    assert _names(tmp_path, SINCE) == []
    assert _names(tmp_path, RunFilter(until=datetime.date(2099, 1, 1))) == []
