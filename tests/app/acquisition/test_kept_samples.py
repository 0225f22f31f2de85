"""Run file and journal hold the samples that the engine reports as stored, wherever the disk fails."""

import errno
import threading
from pathlib import Path

import pytest
from disk_kit import FailingFile
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from app.acquisition.journal.journal import Journal
from app.acquisition.messages import EndReason, RunSettings
from app.runs.errors import DiskFullError
from app.runs.journal import RecordKind, read_journal
from app.runs.lock import is_being_recorded
from drivers.samples import SampleStatus
from tests.app.acquisition.test_recording import RELEASED, Bench, RememberingWriter, answer

pytestmark = pytest.mark.usefixtures("no_thread_is_left")


READ = 5
"""Samples of each read of the bench."""


@pytest.fixture(autouse=True, scope="module")
def small_batches():
    """Hands rows over often, so that a short run has many batches."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("app.acquisition.run_file._BATCH_S", 0.05)
        yield


class FullWriter(RememberingWriter):
    """Takes so many blocks, of which the file gets some, and has no room for the others."""

    def __init__(self, takes: int, stores: int) -> None:
        super().__init__()
        self._takes = takes
        self._stores = stores

    @property
    def error(self) -> DiskFullError:
        error = DiskFullError("the file is full")
        error.stored_samples = self.stored
        return error

    @property
    def stored(self) -> int:
        return sum(len(block) for block in self.blocks[: self._stores])

    def append(self, block):
        if len(self.blocks) >= self._takes:
            raise self.error
        super().append(block)

    def close(self, ending):
        self.ending = ending
        return answer(None, self.error)


def run_of(folder: Path, **more) -> RunSettings:
    return RunSettings(str(folder), series="1FFM0", **{"trigger": "none", "duration_s": 5.0} | more)


def fill(bench: Bench, room: int, fails: threading.Event | None = None) -> None:
    file = bench.journal._file
    file._file = FailingFile(file._file, room, fails=fails)


def held_by_journal(path: Path) -> int:
    """Index after the last sample of which the journal has the read."""
    reads = [record.data for record in read_journal(path) if record.kind is RecordKind.WIRE]
    return int(reads[-1][:-1]) + READ if reads else 0


def test_what_waits_for_a_journal_that_fails_beside_the_writer_is_not_told_as_taken(tmp_path):
    fails = threading.Event()
    bench = Bench(tmp_path, run_of(tmp_path), writer=FullWriter(takes=9, stores=2))
    fill(bench, 1500, fails)
    bench.play(1000)
    fails.set()
    ended = bench.ended()
    path = tmp_path / "run.journal"
    held = max(held_by_journal(path), bench.writer.stored)
    taken = bench.writer.ending.losses.samples
    assert taken > held > 0
    assert (ended.ended, ended.samples) == (EndReason.DISK_FULL, held)
    assert f"the last {taken - held} samples found no room in run or journal" in str(ended.message)
    assert not is_being_recorded(path), "a recovery may take it"


def test_what_a_full_journal_does_not_take_is_in_the_file(tmp_path):
    bench = Bench(tmp_path, run_of(tmp_path))
    fill(bench, 500)
    while not bench.recording.is_ending:
        bench.play(bench.next + READ)
        bench.journal._thread.join(0.001)
    ended = bench.ended()
    assert ended.samples == len(bench.writer.time_s) == bench.next
    assert ended.ended is EndReason.DISK_FULL
    assert "lost" not in str(ended.message)


@settings(deadline=None, max_examples=60, phases=[Phase.explicit, Phase.generate])
@given(
    room=st.integers(0, 9000),
    takes=st.integers(0, 30),
    stores=st.integers(0, 30),
    until=st.integers(READ, 1200),
    sync_fails=st.booleans(),
)
def test_what_is_told_is_what_is_held(tmp_path_factory, room, takes, stores, until, sync_fails):
    folder = tmp_path_factory.mktemp("held")
    writer = FullWriter(takes, stores)
    bench = Bench(folder, run_of(folder), writer=writer)
    fill(bench, room)
    with pytest.MonkeyPatch.context() as patch:
        if sync_fails:
            patch.setattr("app.acquisition.journal.file.os.fsync", fail)
        bench.play(until)
        bench.recording.end(EndReason.STOPPED)
        ended = bench.ended()
    taken = writer.ending.losses.samples
    held = max(held_by_journal(folder / "run.journal"), writer.stored)
    assert ended.samples == min(held, taken)
    assert ("are lost" in str(ended.message)) is (held < taken)
    assert ended.ended is EndReason.DISK_FULL


def fail(_handle) -> None:
    raise OSError(errno.ENOSPC, "injected")


def test_marked_rows_that_are_lost_are_not_told_of_either(tmp_path):
    fails = threading.Event()
    bench = Bench(tmp_path, run_of(tmp_path), writer=FullWriter(takes=4, stores=3))
    bench.status[READ * 10 :] = SampleStatus.OVERLOAD_TABLE
    fill(bench, 0, fails)
    bench.play(1000)
    fails.set()
    ended = bench.ended()
    taken = bench.writer.ending.losses
    assert ended.samples == bench.writer.stored < taken.samples
    assert ended.overloaded == ended.samples - READ * 10 < taken.overloaded


def test_a_run_stopped_while_the_writer_fails_closes_its_journal(tmp_path):
    bench = Bench(tmp_path, run_of(tmp_path), writer=FullWriter(takes=0, stores=0))
    bench.play(10)  # fewer than are handed over at once
    bench.recording.end(EndReason.STOPPED)
    ended = bench.ended()
    path = tmp_path / "run.journal"
    assert held_by_journal(path) == ended.samples == 10
    assert not is_being_recorded(path), "a recovery may take it"


def test_a_journal_that_fails_before_the_release_does_not_take_the_run_with_it(tmp_path):
    bench = Bench(tmp_path, RunSettings(str(tmp_path), series="1FFM0"))
    fill(bench, 3000)
    while not bench.recording.is_ending:
        bench.play(bench.next + READ)
        bench.journal._thread.join(0.001)
    assert bench.next < RELEASED
    ended = bench.ended()
    assert ended.samples == len(bench.writer.time_s) == bench.next
    assert (tmp_path / "run.journal").exists()


def test_a_writer_that_fails_at_once_keeps_the_journal_of_all_that_came(tmp_path):
    run = RunSettings(str(tmp_path), series="1FFM0", pretrigger_s=0.5)
    bench = Bench(tmp_path, run, writer=FullWriter(takes=0, stores=0))
    bench.play(RELEASED + 200)
    ended = bench.ended()
    path = tmp_path / "run.journal"
    assert held_by_journal(path) >= bench.recording._file.next_index
    assert ended.samples == bench.writer.ending.losses.samples
    assert ended.samples >= 0.5 * 500


def test_the_journal_says_how_much_of_it_is_in_its_file(tmp_path, monkeypatch):
    monkeypatch.setattr(Journal, "_SYNC_S", 60.0)
    bench = Bench(tmp_path, run_of(tmp_path))
    fill(bench, 1000)
    before = bench.journal.written
    for number in range(99):
        with_room = bench.journal.append(b"x" * 10, number)
    with pytest.raises(Exception, match="disk is full"):
        bench.journal.close()
    whole = list(read_journal(bench.journal.path))[-1].end
    assert before < bench.journal.written == whole < with_room
    bench.recording.end(EndReason.STOPPED)
    bench.ended()
