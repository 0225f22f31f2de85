"""A disk that takes nothing, and a writer that gives no answer: the run ends, and holds what it has."""

import dataclasses
import threading
from concurrent.futures import Future

import numpy as np
import pytest

from app.acquisition import run_file
from app.acquisition.arming import Arming
from app.acquisition.errors import JournalError
from app.acquisition.journal.file import create_journal_file
from app.acquisition.journal.journal import Journal
from app.acquisition.messages import EndReason, RunSettings, StateChanged
from app.runs import file_operations
from app.runs.blocks import RunBlock
from app.runs.journal import RecordKind, encode_record, read_journal
from app.runs.lock import is_being_recorded, recording_lock
from app.runs.metadata import EndMetadata
from app.runs.reader import open_run
from app.runs.writer import write_run
from messages.message import EMPTY
from tests.app.acquisition.test_recording import Bench, RememberingWriter, answer
from tests.waiting import wait_until

pytestmark = pytest.mark.usefixtures("no_thread_is_left")

FIRST = encode_record(b"{}", 0, RecordKind.NOTE)


class HangingFile:
    """A file on a disk that takes nothing until it is let go."""

    def __init__(self, file) -> None:
        self.file = file
        self.is_asked, self.is_there = threading.Event(), threading.Event()

    def write(self, data) -> int:
        self.is_asked.set()
        self.is_there.wait(60.0)
        return self.file.write(data)

    def fileno(self) -> int:
        return self.file.fileno()

    def close(self) -> None:
        self.file.close()


def data(path):
    return [record.data for record in read_journal(path) if record.kind is RecordKind.WIRE]


def test_a_journal_goes_on_elsewhere_with_what_a_hanging_disk_did_not_take(tmp_path):
    path, other = tmp_path / "run.journal", tmp_path / "other"
    file = create_journal_file(path, FIRST, [other])
    file._file = disk = HangingFile(file._file)
    journal = Journal(file)
    assert not journal.leave_hanging_disk()
    assert journal.stalled_s == 0.0
    journal.append(b"one", 1)
    journal.append(b"two", 2)
    assert disk.is_asked.wait(10.0)
    old = journal._thread
    assert journal.stalled_s > 0.0
    assert journal.leave_hanging_disk()
    assert not journal.leave_hanging_disk()
    journal.append(b"three", 3)
    journal.close()
    assert journal.path == other / "run.journal"
    assert data(journal.path) == [b"one", b"two", b"three"]
    assert "what came before is in" in str(journal.move_message)
    assert is_being_recorded(path), "the disk may still take it"
    disk.is_there.set()
    old.join(10.0)
    assert data(path) == [b"one"]
    assert not is_being_recorded(path)
    journal.release()


def test_a_journal_goes_on_elsewhere_where_syncs_alone_hang(tmp_path, monkeypatch):
    path, other = tmp_path / "run.journal", tmp_path / "other"
    journal = Journal(create_journal_file(path, FIRST, [other]))
    is_asked, is_there, is_left = threading.Event(), threading.Event(), threading.Event()

    def sync(_descriptor: int) -> None:
        if not is_left.is_set():
            is_asked.set()
            is_there.wait(60.0)

    monkeypatch.setattr("app.acquisition.journal.file.sync_descriptor", sync)
    journal.append(b"one", 1)
    assert is_asked.wait(10.0)
    wait_until(lambda: journal._task is None and journal.stalled_s > 0.0)
    assert journal.leave_hanging_disk()
    is_left.set()
    assert journal.stalled_s == 0.0
    journal.append(b"two", 2)
    journal.close()
    assert (data(path), data(journal.path)) == ([b"one"], [b"one", b"two"])
    assert is_being_recorded(path), "the disk may still sync it"
    is_there.set()
    wait_until(lambda: not is_being_recorded(path))
    journal.release()


def test_the_operator_is_told_of_a_disk_that_hangs_and_the_run_ends(tmp_path, monkeypatch):
    bench = Bench(tmp_path, RunSettings(str(tmp_path), series="1FFM0", trigger="none", duration_s=5.0))
    file = bench.journal._file
    file._file = disk = HangingFile(file._file)
    file._fallback_folders = [tmp_path / "other"]
    old = bench.journal._thread
    bench.play(100)
    assert disk.is_asked.wait(10.0)
    monkeypatch.setattr(Journal, "stalled_s", 1.5)
    bench.recording.poll()
    bench.recording.poll()
    told = [str(event.note) for event in bench.events if isinstance(event, StateChanged)]
    assert len([note for note in told if "takes nothing any more" in note]) == 1
    monkeypatch.setattr(Journal, "stalled_s", 4.5)
    ended = bench.ended()
    assert ended.ended is EndReason.WRITE_ERROR
    assert "has taken nothing for 4 s" in str(ended.message)
    assert len(data(tmp_path / "other" / "run.journal")) == 20
    disk.is_there.set()
    old.join(10.0)


class StoppedWriter(RememberingWriter):
    """Writes a whole file, holds its lock, and gives no answer."""

    def __init__(self, path, *, has_finished) -> None:
        super().__init__()
        self.path = path
        self.has_finished = has_finished
        self.given_up = []
        self.lock = recording_lock(path)

    def open(self, request):
        self.request = request
        return answer(self.path)

    def close(self, ending: EndMetadata):
        if self.has_finished:
            names = [field.name for field in dataclasses.fields(RunBlock)]
            columns = [np.concatenate([getattr(block, name) for block in self.blocks]) for name in names]
            write_run(self.path, self.request.metadata, RunBlock(*columns), ending)
        self.lock.acquire()
        return Future()

    def give_up(self, error):
        self.given_up.append(error)

    def kill(self):
        self.lock._file.close()  # as the system does


@pytest.mark.parametrize("has_finished", [True, False])
def test_a_run_that_a_stopped_writer_had_finished_is_no_fault(tmp_path, monkeypatch, has_finished):
    monkeypatch.setattr(run_file, "_CLOSING_S", 0.2)
    writer = StoppedWriter(tmp_path / "run.h5", has_finished=has_finished)
    run = RunSettings(str(tmp_path), series="1FFM0", trigger="none", duration_s=0.4)
    bench = Bench(tmp_path, run, writer=writer)
    bench.play(400)
    ended = bench.ended()
    assert ended.ended is (EndReason.DURATION if has_finished else EndReason.WRITE_ERROR)
    assert ended.samples > 0
    assert writer.given_up, "the next run has another writer"
    assert ("gives no answer" in str(ended.message)) is not has_finished
    if has_finished:
        assert not writer.lock.path.exists()
        open_run(writer.path)
    writer.lock.release()


def test_a_disk_that_hangs_when_a_finished_run_is_looked_for_does_not_hold_the_end(tmp_path, monkeypatch):
    monkeypatch.setattr(run_file, "_CLOSING_S", 0.2)
    monkeypatch.setattr(run_file, "_INSPECTION_S", 0.2)
    is_there, looked = threading.Event(), threading.Event()

    def hang(*_):
        is_there.wait(60.0)
        looked.set()

    monkeypatch.setattr(file_operations, "sync_file", hang)
    run = RunSettings(str(tmp_path), series="1FFM0", trigger="none", duration_s=0.4)
    writer = StoppedWriter(tmp_path / "run.h5", has_finished=True)
    bench = Bench(tmp_path, run, writer=writer)
    bench.play(400)
    ended = bench.ended()
    is_there.set()
    writer.lock.release()
    assert ended.ended is EndReason.WRITE_ERROR
    assert bench.journal.path.exists()
    assert looked.wait(10.0)


def test_arming_waits_for_no_disk_that_hangs(tmp_path):
    is_there, removed = threading.Event(), threading.Event()

    class LateJournal:
        def close(self):
            pass

        def remove(self):
            removed.set()

    def prepare():
        is_there.wait(10.0)
        return LateJournal(), EMPTY

    arming = Arming(RunSettings(str(tmp_path)), None, prepare)
    arming.wait(0.01)
    assert arming.poll(60.0) is None
    with pytest.raises(JournalError, match="its disk gives no answer"):
        arming.poll(0.0)
    is_there.set()
    assert removed.wait(10.0)
