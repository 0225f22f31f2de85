"""Processes, threads and disks that hang or end in the middle of a message."""

import datetime
import os
import subprocess
import sys
import threading

import pytest

from app.acquisition.engine_client import EngineClient
from app.acquisition.errors import JournalError
from app.acquisition.journal.file import create_journal_file
from app.acquisition.journal.journal import Journal
from app.acquisition.live_client import DIED_NOTE, LiveIdentifier
from app.acquisition.messages import Failed, Health
from app.acquisition.stream.connection import Reconnection
from app.acquisition.stream.monitors import StallDetector
from app.child_process import encode_line
from app.runs.journal import RecordKind, encode_record, read_journal
from app.runs.lock import is_being_recorded
from app.runs.metadata import create_metadata
from config.files import load_gauges, load_stand
from drivers.clock import TimeBase
from drivers.devices.slipstand_binary.source import make_source
from drivers.errors import PortUnavailableError
from tests.drills.processes import gone

FIRST = encode_record(b"{}", 0, RecordKind.NOTE)
HALF = 'import os; os.write(1, b\'{"type": "Hea\'); os._exit(9)'
DEAF = "import time; time.sleep(600)"
S = 1_000_000_000


def python(code: str) -> "subprocess.Popen[bytes]":
    return subprocess.Popen([sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE)


def test_an_engine_killed_in_the_middle_of_a_word_is_told_of():
    with EngineClient(python(HALF)) as engine:
        event = engine.wait(60.0)
        assert isinstance(event, Failed)
        assert "ended by itself (code 9)" in str(event.message)


def test_an_engine_that_still_says_something_is_not_killed(monkeypatch):
    monkeypatch.setattr(EngineClient, "_CLOSE_S", 3.0)
    word = encode_line(Health(1.0, 0, 0, 0, 0, 0, 0, 0.0))
    talks = f"import os, time\nfor _ in range(25): os.write(1, {word!r}); time.sleep(0.2)\nos._exit(4)"
    process = python(talks)
    EngineClient(process).close()
    assert process.returncode == 4


def test_an_engine_that_has_hung_up_on_everybody_is_killed(monkeypatch):
    monkeypatch.setattr(EngineClient, "_CLOSE_S", 0.2)
    process = python(DEAF)
    EngineClient(process).close()
    assert process.returncode != 0


def test_a_live_identification_that_hears_nothing_holds_nobody_up(monkeypatch):
    monkeypatch.setattr(LiveIdentifier, "_STOP_S", 0.1)
    process, start = python(DEAF), datetime.datetime(2026, 11, 21, 12, tzinfo=datetime.UTC)
    metadata = create_metadata(load_stand(), load_gauges(), start)
    identifier = LiveIdentifier("no.ring", lambda _: TimeBase(1.0, 1e-4), lambda: process)
    identifier.prepare()
    for second in range(0, 400_000, 2):  # some megabytes: no pipe holds them
        result = identifier.poll(0, metadata, float(second))
        if result is not None:
            break
    assert result.message == DIED_NOTE
    assert gone(process.pid), "it is given up"


class HangingFile:
    """A file on a disk that takes nothing until it is let go."""

    def __init__(self, file) -> None:
        self.file = file
        self.is_there = threading.Event()

    def write(self, data) -> int:
        self.is_there.wait(60.0)
        return self.file.write(data)

    def fileno(self) -> int:
        return self.file.fileno()

    def close(self) -> None:
        self.file.close()


def test_a_disk_that_hangs_does_not_hold_up_the_end_of_a_run(tmp_path, monkeypatch):
    monkeypatch.setattr(Journal, "_CLOSE_S", 0.1)
    path = tmp_path / "run.journal"
    file = create_journal_file(path, FIRST)
    file._file = disk = HangingFile(file._file)
    journal = Journal(file)
    journal.append(b"came", 1)
    with pytest.raises(JournalError, match="the disk hangs"):
        journal.close()
    journal.release()
    assert is_being_recorded(path), "what may still be written is nobody's to recover"
    disk.is_there.set()
    journal._thread.join(10.0)
    journal.release()
    assert not is_being_recorded(path)
    assert [record.data for record in read_journal(path)][1:] == [b"came"]


def test_whatever_ends_a_journal_is_told(tmp_path, monkeypatch):
    file = create_journal_file(tmp_path / "run.journal", FIRST)
    monkeypatch.setattr(file, "append", lambda _: 1 / 0)
    journal = Journal(file)
    journal.append(b"came", 1)
    with pytest.raises(JournalError, match="ZeroDivisionError"):
        journal.close()
    journal.release()


def test_a_sync_of_the_old_file_that_fails_late_moves_a_journal_only_once(tmp_path, monkeypatch):
    goes_on, sync = threading.Event(), os.fsync
    journal = create_journal_file(tmp_path / "a" / "run.journal", FIRST, [tmp_path / "b"])

    def failing_sync(handle):
        if threading.current_thread().name == "journal sync":
            goes_on.wait(60.0)
            raise OSError(5, "injected")
        sync(handle)

    monkeypatch.setattr(os, "fsync", failing_sync)
    journal.begin_sync()
    old = journal._sync
    journal._move(OSError(28, "injected"))
    goes_on.set()
    old.join()
    monkeypatch.setattr(os, "fsync", sync)
    journal.append(encode_record(b"came", 1))
    journal.begin_sync()
    journal.sync()
    assert journal.path == tmp_path / "b" / "run.journal"
    journal.close()
    journal.release()


class Clock:
    """The host's time, set by hand."""

    def __init__(self) -> None:
        self.now_ns = 100 * S

    def __call__(self) -> int:
        return self.now_ns

    def pass_s(self, duration_s: float) -> int:
        self.now_ns += round(duration_s * S)
        return self.now_ns


@pytest.fixture
def clock(monkeypatch):
    clock = Clock()
    for module in ("monitors", "connection"):
        monkeypatch.setattr(f"app.acquisition.stream.{module}.host_ns", clock)
    return clock


def test_a_port_that_nobody_read_is_not_called_silent(clock):
    silence = StallDetector("port", make_source({}, 1000.0), clock())
    read_ns = clock()
    for _ in range(100):  # this thread looks on, the one that reads gets no processor
        clock.pass_s(0.05)
        assert not silence.is_stalled(read_ns)
    for _ in range(59):  # and then it does
        assert not silence.is_stalled(clock.pass_s(0.05))
    assert silence.is_stalled(clock.pass_s(0.1))


def test_a_device_is_searched_for_as_long_as_anybody_could(clock, monkeypatch):
    def nowhere():
        raise PortUnavailableError("it is not there: plug it in")

    search = Reconnection(nowhere, make_source({}, 1000.0), None)
    try:
        for _ in range(20):
            clock.pass_s(0.1)
            search.elapsed_s()
        clock.pass_s(30.0)
        assert search.elapsed_s() == pytest.approx(2.0)
        clock.pass_s(0.1)
        assert search.elapsed_s() == pytest.approx(2.1)
    finally:
        search.stop()
