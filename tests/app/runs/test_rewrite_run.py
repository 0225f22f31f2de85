import itertools
import shutil
import signal
import sys
import threading

import h5py
import numpy as np
import pytest
from runs_kit import ENDING, block, small_run

from app.runs import rewrite as rewrite_module
from app.runs.batch import parent_watchdog
from app.runs.edits import edit_run
from app.runs.errors import (
    BeingRecordedError,
    MetadataError,
    RunNotFoundError,
    UnsuitableRunError,
    WriteError,
)
from app.runs.lock import FileLock
from app.runs.metadata import Conditions
from app.runs.reader import load_counts, open_run
from app.runs.rewrite import rewrite
from app.runs.writer import create_run
from config.schema import Gauge, Gauges


@pytest.fixture
def run_path(tmp_path, metadata):
    small_run(tmp_path / "run.h5", metadata)
    return tmp_path / "run.h5"


@pytest.mark.skipif(sys.platform == "win32", reason="Windows replaces no file that is open")
def test_a_closed_run_is_replaced_never_written_to(run_path):
    before = run_path.read_bytes()
    with run_path.open("rb") as reader:  # holds the old file, whatever the name comes to mean
        rewrite(run_path, lambda file: file["entry"].attrs.update({"added": 1}))
        assert reader.read() == before
    with h5py.File(run_path) as file:
        assert file["entry"].attrs["added"] == 1
        assert "file_update_time" in file.attrs
    assert [path.name for path in run_path.parent.iterdir()] == ["run.h5"]


def _nothing(file):
    pass


def _fail(file):
    file["entry"].attrs["half"] = True
    raise RuntimeError("broke in the middle")


def _harm(file):
    file["entry/motion/table_displacement"][3] = 1.0


def _break_structure(file):
    file["entry/outside"] = h5py.ExternalLink("/etc/passwd", "/")


@pytest.mark.parametrize("change", [_fail, _harm, _break_structure])
def test_a_change_that_fails_leaves_the_run_as_it_was(run_path, change):
    before = run_path.read_bytes()
    with pytest.raises(Exception, match=r"broke|does not read back|link to elsewhere"):
        rewrite(run_path, change)
    assert run_path.read_bytes() == before
    assert [path.name for path in run_path.parent.iterdir()] == ["run.h5"]


def test_a_replacement_that_fails_leaves_the_run_as_it_was(run_path, monkeypatch):
    before = run_path.read_bytes()

    def no_room(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(rewrite_module, "sync_file", no_room)
    with pytest.raises(Exception, match="disk or its quota is full"):
        rewrite(run_path, _nothing)
    assert run_path.read_bytes() == before
    assert [path.name for path in run_path.parent.iterdir()] == ["run.h5"]


def test_runs_that_may_not_be_changed(tmp_path, run_path, metadata):
    writer = create_run(tmp_path / "open.h5", metadata)
    writer.append(block(0, 10))
    writer.flush()
    shutil.copy(writer.path, tmp_path / "unfinished.h5")
    with pytest.raises(BeingRecordedError):
        rewrite(writer.path, _nothing)
    writer.close(ENDING)
    with pytest.raises(UnsuitableRunError, match="never closed"):
        rewrite(tmp_path / "unfinished.h5", _nothing)
    with pytest.raises(RunNotFoundError):
        rewrite(tmp_path / "absent.h5", _nothing)
    with FileLock(tmp_path / ".run.h5.editing"), pytest.raises(UnsuitableRunError, match="another program"):
        rewrite(run_path, _nothing)


def test_edits_are_added_and_the_last_one_holds(run_path, metadata):
    edit_run(run_path, "Ada", note="first", plate_mass_kg=27.5)
    edit_run(run_path, "Bob", note="second", conditions=Conditions(temperature_c=19.0))

    run = open_run(run_path)

    assert run.metadata == metadata.replace(
        note="second", plate_mass_kg=27.5, conditions=Conditions(temperature_c=19.0)
    )
    assert [(change.author, change.fields["note"]) for change in run.changes] == [
        ("Ada", "first"),
        ("Bob", "second"),
    ]
    with h5py.File(run_path) as file:
        assert file["entry/stand/plate_mass"][()] == 27.4
        assert file["entry/run/notes/note_001/description"].asstr()[()] == metadata.note


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"rate_hz": 1.0}, "'rate_hz' cannot be edited"),
        ({"plate_mass_kg": -1.0}, "above 0"),
        ({"plate_mass_kg": "heavy"}, "plate_mass_kg"),
    ],
)
def test_edits_that_cannot_be(run_path, fields, words):
    before = run_path.read_bytes()
    with pytest.raises(MetadataError, match=words):
        edit_run(run_path, "Ada", **fields)
    assert run_path.read_bytes() == before


def test_a_new_calibration_changes_readings_not_counts(run_path, metadata):
    before = open_run(run_path)
    gauges = Gauges(table=Gauge(2e-6, 10.0), relative=Gauge(-3e-6, 0.0))

    edit_run(run_path, "Ada", gauges=gauges)

    run = open_run(run_path)
    counts = load_counts(run)
    assert np.array_equal(counts, load_counts(before))
    assert run.metadata.gauges == gauges
    assert run.table_reading == pytest.approx(2e-6 * (counts[:, 0] - 10.0), abs=1e-18)
    assert run.relative_reading == pytest.approx(-3e-6 * counts[:, 1], abs=1e-18)
    with h5py.File(run_path) as file:
        assert np.array_equal(file["entry/motion/table_displacement"][:], before.table_reading)


def test_a_copy_that_does_not_read_back_is_not_put_in_place(run_path, monkeypatch):
    before = run_path.read_bytes()
    wire = "entry/wire/data"
    sums = iter([{wire: 1}, {wire: 2}])
    monkeypatch.setattr(rewrite_module, "_measured", lambda _: next(sums))
    with pytest.raises(WriteError, match="the run is unharmed"):
        rewrite(run_path, _nothing)
    assert run_path.read_bytes() == before


TRACED = ("rewrite.py", "lock.py", "durable_files.py", "disk.py", "parent_watchdog.py", "contextlib.py")


@pytest.mark.skipif(sys.platform == "win32", reason="signals as Windows has none")
def test_a_process_that_is_ended_at_any_moment_of_a_change_leaves_nothing(run_path, monkeypatch):
    """The signal comes after each line of all that takes part, one after another."""
    monkeypatch.setattr(parent_watchdog, "_asked", threading.Event())
    monkeypatch.setattr(parent_watchdog, "_discard_stderr", lambda: None)
    earlier = signal.signal(signal.SIGTERM, parent_watchdog._leave)
    ends, moment = 0, 0
    try:
        while ended_at(moment, run_path):
            ends, moment = ends + 1, moment + 1
            parent_watchdog._clear()  # what the process does last
            parent_watchdog._asked.clear()
            assert [path.name for path in run_path.parent.iterdir()] == ["run.h5"], f"line {moment}"
            assert not parent_watchdog._holding
    finally:
        sys.settrace(None)
        signal.signal(signal.SIGTERM, earlier)
    assert ends > 50
    assert open_run(run_path).identifier


def ended_at(moment, run_path):
    """Rewrite a run and be told to end at a line; whether so many lines were run."""
    lines = itertools.count()

    def trace(frame, event, _argument):
        if event == "call" and not frame.f_code.co_filename.endswith(TRACED):
            return None
        if event == "line" and next(lines) == moment:
            sys.settrace(None)
            signal.raise_signal(signal.SIGTERM)
        return trace

    sys.settrace(trace)
    try:
        rewrite(run_path, _nothing)
    except SystemExit:
        return True
    finally:
        sys.settrace(None)
    return False
