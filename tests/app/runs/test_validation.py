import os
import random
import signal
import sys
import tracemalloc
from pathlib import Path

import h5py
import numpy as np
import pytest
from runs_kit import block, small_run

from app.runs import reader
from app.runs import validator as validator_module
from app.runs.errors import (
    BeingRecordedError,
    DamagedRunError,
    NotARunError,
    RunError,
    RunInUseError,
    RunNotFoundError,
    ValidationTimeoutError,
)
from app.runs.reader import check_openable, open_run
from app.runs.validator import Validator
from app.runs.writer import create_run


@pytest.fixture(scope="module")
def validator():
    with Validator.start() as validator:
        yield validator


@pytest.fixture
def run_path(tmp_path, metadata):
    small_run(tmp_path / "run.h5", metadata, rows=9000)
    return tmp_path / "run.h5"


def test_a_good_run_passes_with_its_summary(run_path, metadata, validator):
    summary = validator.validate(run_path)
    assert (summary.title, summary.samples, summary.ended) == (metadata.title, 9000, "rest")
    assert (summary.series, summary.start_time, summary.note) == ("1FFM1", metadata.start_time, metadata.note)
    assert summary.duration_s == pytest.approx(8999 / 500)


def test_without_a_validator_one_is_started_and_stopped(run_path, monkeypatch):
    stopped = []

    class Watched(Validator):
        def stop(self):
            assert self.pid is not None
            super().stop()
            stopped.append(self.pid)

    monkeypatch.setattr(reader, "Validator", Watched)
    assert len(open_run(run_path)) == 9000
    assert stopped == [None]


def test_what_is_no_run_is_told_in_one_line(tmp_path, validator):
    (tmp_path / "text.h5").write_text("time,table\n0,1\n")
    (tmp_path / "empty.h5").write_bytes(b"")
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["data"] = np.arange(3)
    with h5py.File(tmp_path / "later.h5", "w") as file:
        file.attrs["slipstand_schema"] = 99
    expected = {
        "absent.h5": (RunNotFoundError, "there is no such file"),
        ".": (NotARunError, "is a folder"),
        "text.h5": (NotARunError, "not an HDF5 file"),
        "empty.h5": (NotARunError, "not an HDF5 file"),
        "other.h5": (NotARunError, "not a Slipstand run"),
        "later.h5": (NotARunError, "run format 99"),
    }
    for name, (kind, words) in expected.items():
        with pytest.raises(kind, match=words) as caught:
            open_run(tmp_path / name, validator=validator)
        assert "\n" not in str(caught.value)
        assert str(tmp_path) in str(caught.value)


def test_a_file_open_for_writing_elsewhere_is_being_recorded(run_path, validator):
    """Even without our own lock file: HDF5 locks the file too."""
    told = RunInUseError if sys.platform == "win32" else BeingRecordedError
    with h5py.File(run_path, "r+"), pytest.raises(told):
        open_run(run_path, validator=validator)


@pytest.mark.parametrize("number", [32, 33])
def test_a_file_that_another_program_locks_is_not_called_damaged(run_path, monkeypatch, number):
    """Errors of Windows; the validator answers in its own process, so its function is called."""

    def refuse(*_, **__):
        text = f"Unable to synchronously open file (errno = 13, Win32 GetLastError() = {number})"
        raise OSError(text)

    monkeypatch.setattr(h5py, "File", refuse)
    reply = validator_module._validate(str(run_path))
    assert (reply.fault, reply.summary) == ("in-use", None)
    assert str(reply.message) == f"{run_path} is open in another program. Close it there and try again"
    with pytest.raises(RunInUseError, match="open in another program"):
        open_run(run_path, trusted=True)


def test_a_file_that_windows_opens_for_nobody_else_is_not_said_to_lack_rights(run_path, monkeypatch):
    def refuse(*_):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "open", refuse)
    monkeypatch.setattr("config.durable_files.is_held_elsewhere", lambda _: False)
    with pytest.raises(RunNotFoundError, match="Check its rights"):
        check_openable(run_path)
    monkeypatch.setattr("config.durable_files.is_held_elsewhere", lambda _: True)
    with pytest.raises(RunInUseError, match="open in another program"):
        check_openable(run_path)


def _external_link(file):
    file["entry/elsewhere"] = h5py.ExternalLink("/etc/passwd", "/")


def _soft_link(file):
    file["entry/soft"] = h5py.SoftLink("/entry/motion")


def _cycle(file):
    file["entry/motion/again"] = file["entry"]


def _deep(file):
    group = file
    for _ in range(50):
        group = group.create_group("deeper")


def _virtual(file):
    layout = h5py.VirtualLayout(shape=(9000,), dtype="f8")
    layout[:] = h5py.VirtualSource("other.h5", "data", shape=(9000,))
    file.create_virtual_dataset("entry/virtual", layout)


def _external_data(file):
    file.create_dataset("entry/outside", (100,), "u1", external=[("/etc/passwd", 0, 100)])


def _huge_shape(file):
    file.create_dataset("entry/huge", shape=(1 << 50,), dtype="f8", chunks=(1 << 10,))


def _huge_column(file):
    file["entry/motion/time"].resize((1 << 45,))


def _all_columns_huge(file):
    _resize_all(file, 1 << 45)


def _chunks_never_written(file):
    _resize_all(file, 20_000)


def _three_gauges(file):
    file["entry/motion"].attrs["auxiliary_signals"] = ["relative_displacement", "status"]


def _resize_all(file, rows):
    for path in ("motion/time", "motion/table_displacement", "motion/relative_displacement", "motion/status"):
        file["entry"][path].resize((rows,))
    for gauge in ("gauge_table", "gauge_plate"):
        file[f"entry/instrument/{gauge}/data"].resize((rows,))
    file["entry/run/samples_stored"][()] = rows


def _compound(file):
    file["entry/compound"] = np.zeros(3, [("a", "f8"), ("b", "i4")])


def _reference(file):
    file.create_dataset("entry/reference", data=file["entry"].ref, dtype=h5py.ref_dtype)


def _time_is_text(file):
    del file["entry/motion/time"]
    file["entry/motion/time"] = "noon"


def _no_motion(file):
    del file["entry/motion"]


def _no_gain(file):
    del file["entry/instrument/gauge_table/calibration/gain"]


def _gain_is_text(file):
    _no_gain(file)
    file["entry/instrument/gauge_table/calibration/gain"] = "much"


def _uneven_columns(file):
    file["entry/motion/status"].resize((17,))


def _bad_date(file):
    del file["entry/start_time"]
    file["entry/start_time"] = "yesterday"


def _bad_analysis(file):
    file["entry"].create_group("analysis_001")


@pytest.mark.parametrize(
    ("harm", "words"),
    [
        (_external_link, "link to elsewhere"),
        (_soft_link, "link to elsewhere"),
        (_cycle, "reached twice"),
        (_deep, "too deep"),
        (_virtual, "in another file"),
        (_external_data, "in another file"),
        (_huge_shape, "does not hold"),
        (_huge_column, "rows instead of"),
        (_all_columns_huge, "rows that the file does not hold"),
        (_chunks_never_written, "lacks a part"),
        (_three_gauges, "3 gauges"),
        (_compound, "of a type"),
        (_reference, "of a type"),
        (_time_is_text, "lacks a part of every run"),
        (_no_motion, "motion"),
        (_no_gain, "gain"),
        (_gain_is_text, "gain is not a number"),
        (_uneven_columns, "rows instead of"),
        (_bad_date, "yesterday"),
        (_bad_analysis, "damaged"),
    ],
)
def test_a_harmful_file_is_refused_in_one_line(run_path, validator, harm, words):
    with h5py.File(run_path, "r+") as file:
        harm(file)
    with pytest.raises(DamagedRunError, match=words) as caught:
        open_run(run_path, validator=validator)
    assert "\n" not in str(caught.value)
    assert str(run_path) in str(caught.value)


@pytest.mark.parametrize("keep", [0.02, 0.3, 0.9, 0.999])
def test_a_truncated_file_is_refused(run_path, validator, keep):
    os.truncate(run_path, int(keep * run_path.stat().st_size))
    with pytest.raises(DamagedRunError):
        open_run(run_path, validator=validator)


def test_flipped_bits_never_get_further_than_one_clear_error(run_path, tmp_path, validator):
    good = run_path.read_bytes()
    dice = random.Random(4)
    refusals = []
    for trial in range(60):
        data = bytearray(good)
        for _ in range(dice.choice([1, 20])):
            data[dice.randrange(min(len(data), 60_000))] ^= 1 << dice.randrange(8)
        path = tmp_path / f"{trial}.h5"
        path.write_bytes(data)
        try:
            open_run(path, validator=validator)
        except RunError as error:
            refusals.append(str(error))
    assert len(refusals) > 10
    assert not any("\n" in refusal for refusal in refusals)


def test_memory_of_this_process_stays_bounded(run_path, validator):
    with h5py.File(run_path, "r+") as file:
        _all_columns_huge(file)
    tracemalloc.start()
    try:
        with pytest.raises(DamagedRunError):
            open_run(run_path, validator=validator)
        assert tracemalloc.get_traced_memory()[1] < 20_000_000
    finally:
        tracemalloc.stop()


@pytest.mark.skipif(sys.platform == "win32", reason="needs signals that Windows does not have")
def test_a_crash_is_the_fault_of_the_file(run_path):
    with Validator.start() as validator:
        validator.validate(run_path)
        os.kill(validator.pid, signal.SIGSEGV)
        with pytest.raises(DamagedRunError, match="crashed or hung"):
            validator.validate(run_path)
        assert validator.validate(run_path).samples == 9000


@pytest.mark.skipif(sys.platform == "win32", reason="needs signals that Windows does not have")
def test_a_computer_that_is_too_busy_is_not_the_fault_of_the_file(run_path, monkeypatch):
    with Validator.start() as validator:
        validator.validate(run_path)
        monkeypatch.setattr(validator_module, "_REPLY_S", 0.5)
        os.kill(validator.pid, signal.SIGSTOP)
        with pytest.raises(ValidationTimeoutError, match="too busy"):
            validator.validate(run_path)
        monkeypatch.undo()
        assert validator.validate(run_path).samples == 9000


def test_an_unfinished_file_is_trusted_up_to_what_was_flushed(tmp_path, metadata, validator):
    writer = create_run(tmp_path / "run.h5", metadata)
    writer.append(block(0, 10_000))
    writer.flush()
    (tmp_path / "copy.h5").write_bytes(writer.path.read_bytes())
    writer.discard()
    with h5py.File(tmp_path / "copy.h5", "r+") as file:
        file["entry/motion/relative_displacement"].resize((9_100,))

    run = open_run(tmp_path / "copy.h5", validator=validator)

    assert len(run) == 9_100
    assert np.array_equal(run.table_reading, block(0, 9_100).readings[:, 0])
