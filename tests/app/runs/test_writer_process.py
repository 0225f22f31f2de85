import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import msgspec
import numpy as np
import pytest
from raw_bytes_kit import load_raw_bytes
from runs_kit import ENDING, block

from app.runs import writer_client
from app.runs.blocks import BlockLayout
from app.runs.errors import DiskFullError, MetadataError, WriteError, WriterBehindError
from app.runs.journal import MAGIC, JournalSpan, encode_record
from app.runs.lock import is_being_recorded
from app.runs.reader import open_run
from app.runs.writer_client import OpenRun, WriterClient

WAIT_S = 60.0
POSIX = pytest.mark.skipif(sys.platform == "win32", reason="needs signals that Windows does not have")
LINUX = pytest.mark.skipif(sys.platform != "linux", reason="needs limits on another process")


@pytest.fixture
def client():
    with WriterClient.start() as client:
        yield client


def test_runs_one_after_another(client, tmp_path, metadata):
    for layout, rows in ((BlockLayout(), 30), (BlockLayout(1, ""), 20)):
        path = client.open(OpenRun(str(tmp_path), metadata, layout)).result(WAIT_S)
        for first in range(0, rows, 10):
            client.append(block(first, 10, layout))
        stored = client.close(ENDING).result(WAIT_S)

        assert (stored.path, stored.samples) == (str(path), rows)
        run = open_run(path, trusted=True)
        assert (run.metadata.conditions, run.end) == (metadata.conditions, ENDING)
        assert np.array_equal(run.table_reading, block(0, rows).readings[:, 0])
    assert client.failure is None


def test_rows_reach_the_disk_while_nothing_more_comes(client, tmp_path, metadata):
    path = client.open(OpenRun(str(tmp_path), metadata)).result(WAIT_S)
    client.append(block(0, 10))
    copy = tmp_path / "copy.h5"
    deadline = time.monotonic() + WAIT_S
    rows = 0
    while rows < 10 and time.monotonic() < deadline:
        time.sleep(0.05)
        copy.write_bytes(path.read_bytes())
        rows = len(open_run(copy, trusted=True))
    assert rows == 10


def test_the_journal_goes_into_the_run(client, tmp_path, metadata):
    journal = tmp_path / "a.journal"
    journal.write_bytes(MAGIC + encode_record(b"abc", 7))
    path = client.open(OpenRun(str(tmp_path), metadata, journal=JournalSpan(str(journal)))).result(WAIT_S)
    assert client.close(ENDING).result(WAIT_S).raw_bytes_stored
    assert list(load_raw_bytes(open_run(path, trusted=True)).chunks()) == [(b"abc", 7)]


def test_a_failure_comes_back_as_its_error(client, tmp_path, metadata):
    (tmp_path / "file").write_text("")
    with pytest.raises(WriteError, match="is a file"):
        client.open(OpenRun(str(tmp_path / "file"), metadata)).result(WAIT_S)
    with pytest.raises(WriteError, match="is a file"):
        client.append(block(0, 1))
    with pytest.raises(WriteError, match="is a file"):
        client.close(ENDING).result(WAIT_S)


def test_metadata_that_cannot_be_stored_comes_back(client, tmp_path, metadata):
    with pytest.raises(MetadataError, match="zero character"):
        client.open(OpenRun(str(tmp_path), metadata.replace(note="a\0"))).result(WAIT_S)
    assert list(tmp_path.iterdir()) == []


def test_stop_closes_an_open_run_as_interrupted(tmp_path, metadata):
    with WriterClient.start() as client:
        path = client.open(OpenRun(str(tmp_path), metadata)).result(WAIT_S)
        client.append(block(0, 10))
    run = open_run(path, trusted=True)
    assert (len(run), run.end.ended) == (10, "interrupted")
    assert not is_being_recorded(path)


_ENGINE = """
import sys, time
sys.path.insert(0, {here!r})
import msgspec
from pathlib import Path
from runs_kit import block
from app.runs.metadata import RunMetadata
from app.runs.writer_client import WriterClient
from app.runs.writer_client import OpenRun
metadata = msgspec.json.decode(Path({metadata!r}).read_bytes(), type=RunMetadata)
client = WriterClient.start()
path = client.open(OpenRun({folder!r}, metadata)).result()
client.append(block(0, 500))
while client._child._commands.qsize():
    time.sleep(0.01)
print(path, flush=True)
time.sleep(600)
"""


def test_the_death_of_the_engine_closes_the_run(tmp_path, metadata):
    folder = tmp_path / "runs"
    (tmp_path / "metadata.json").write_bytes(msgspec.json.encode(metadata))
    code = _ENGINE.format(
        here=str(Path(__file__).parent), metadata=str(tmp_path / "metadata.json"), folder=str(folder)
    )
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as engine:
        path = Path(engine.stdout.readline().strip())
        time.sleep(0.2)
        engine.kill()
    deadline = time.monotonic() + WAIT_S
    while is_being_recorded(path) and time.monotonic() < deadline:
        time.sleep(0.02)
    run = open_run(path, trusted=True)
    assert (len(run), run.end.ended) == (500, "interrupted")
    assert "ended" in run.end.message


@POSIX
def test_a_killed_writer_leaves_a_file_that_opens(tmp_path, metadata):
    with WriterClient.start() as client:
        path = client.open(OpenRun(str(tmp_path), metadata)).result(WAIT_S)
        for first in range(0, 60_000, 100):
            client.append(block(first, 100))
        time.sleep(0.3)
        os.kill(client.pid, signal.SIGKILL)
        with pytest.raises(WriteError, match="ended by itself"):
            client.close(ENDING).result(WAIT_S)
    run = open_run(path)
    assert run.end is None
    assert len(run) > 0
    whole = block(0, len(run))
    assert np.array_equal(run.time_s, whole.time_s)
    assert np.array_equal(run.relative_reading, whole.readings[:, 1])


@POSIX
def test_signals_that_end_a_session_do_not_end_a_run(client, tmp_path, metadata):
    path = client.open(OpenRun(str(tmp_path), metadata)).result(WAIT_S)
    for name in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        os.kill(client.pid, name)
    client.append(block(0, 10))
    assert client.close(ENDING).result(WAIT_S).samples == 10
    assert open_run(path, trusted=True).end == ENDING


@LINUX
def test_a_full_disk_ends_the_run_with_its_reason(client, tmp_path, metadata):
    """A limit on the size of files stands in for the full disk: the same call fails, with EFBIG."""
    import resource

    path = client.open(OpenRun(str(tmp_path), metadata)).result(WAIT_S)
    resource.prlimit(client.pid, resource.RLIMIT_FSIZE, (3_000_000, 3_000_000))
    with pytest.raises(DiskFullError, match="disk or its quota is full"):
        _append_slowly(client)
    with pytest.raises(DiskFullError) as told:
        client.close(ENDING).result(WAIT_S)
    client.stop()

    run = open_run(path)
    assert told.value.stored_samples == len(run)
    assert run.end.ended == "disk-full"
    assert len(run) > 5000
    assert np.array_equal(run.table_reading, block(0, len(run)).readings[:, 0])
    assert path.stat().st_size <= 3_000_000


def _append_slowly(client):
    for first in range(0, 10**6, 1000):
        client.append(block(first, 1000))
        time.sleep(0.002)


@POSIX
def test_a_writer_that_falls_behind_is_told_and_can_still_close(tmp_path, metadata, monkeypatch):
    monkeypatch.setattr(writer_client, "_QUEUE_COMMANDS", 20)
    with WriterClient.start() as client:
        client.open(OpenRun(str(tmp_path), metadata)).result(WAIT_S)
        os.kill(client.pid, signal.SIGSTOP)
        taken = []
        try:
            with pytest.raises(WriterBehindError, match="too slow"):
                _append_until_full(client, taken)
        finally:
            os.kill(client.pid, signal.SIGCONT)
        stored = client.close(ENDING).result(WAIT_S)
    assert stored.samples == sum(taken)


def _append_until_full(client, taken):
    while True:
        client.append(block(sum(taken), 1000))
        taken.append(1000)


def test_the_writer_starts_without_heavy_modules():
    code = (
        "import sys, app.runs.writer;"
        "print([m for m in ('numba', 'scipy', 'matplotlib', 'PySide6', 'serial') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def other_process(code: str) -> WriterClient:
    pipe = subprocess.PIPE
    return WriterClient(subprocess.Popen([sys.executable, "-c", code], stdin=pipe, stdout=pipe))


def test_a_writer_killed_in_the_middle_of_a_word_is_told_of(tmp_path, metadata):
    half = "import os; os.write(1, b'{'); os._exit(9)"
    with other_process(half) as client, pytest.raises(WriteError, match=r"ended by itself \(code 9\)"):
        client.open(OpenRun(str(tmp_path), metadata)).result(WAIT_S)


def test_a_writer_that_hangs_is_left_without_waiting(tmp_path, metadata, monkeypatch):
    monkeypatch.setattr(writer_client, "_STOP_S", 0.1)
    client = other_process("import time; time.sleep(600)")
    opening = client.open(OpenRun(str(tmp_path), metadata))
    stopping = threading.Event()
    monkeypatch.setattr(client, "stop", stopping.wait)  # as long as it likes
    client.abandon()
    stopping.set()
    monkeypatch.undo()
    monkeypatch.setattr(writer_client, "_STOP_S", 0.1)
    client.stop()
    with pytest.raises(WriteError, match="ended by itself"):
        opening.result(WAIT_S)
