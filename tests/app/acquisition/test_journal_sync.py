"""Files are brought to disk one after another by a thread that ends when it is told to."""

import errno
import os
import threading

import pytest

from app.acquisition.journal.file import Syncer


@pytest.fixture
def file(tmp_path):
    with (tmp_path / "file").open("wb") as file:
        yield file


def test_a_file_may_be_closed_while_it_is_synced(file, monkeypatch):
    may_go_on, synced = threading.Event(), []

    def fsync(handle: int) -> None:
        may_go_on.wait(10.0)
        synced.append(os.fstat(handle).st_ino)

    monkeypatch.setattr("app.acquisition.journal.file.os.fsync", fsync)
    syncer, inode = Syncer(), os.fstat(file.fileno()).st_ino
    syncer.begin(file.fileno())
    file.close()
    assert not syncer.is_idle
    may_go_on.set()
    syncer.wait()
    assert syncer.is_idle
    assert synced == [inode]
    assert syncer.take_failure() is None
    syncer.stop()
    assert not any(thread.name == "journal sync" for thread in threading.enumerate())


def test_a_failure_is_told_once_and_the_next_sync_is_tried_all_the_same(file, monkeypatch):
    failures = [OSError(errno.EIO, "injected")]

    def fsync(handle: int) -> None:
        if failures:
            raise failures.pop()

    monkeypatch.setattr("app.acquisition.journal.file.os.fsync", fsync)
    syncer = Syncer()
    syncer.begin(file.fileno())
    syncer.wait()
    failure = syncer.take_failure()
    assert failure is not None
    assert failure.errno == errno.EIO
    syncer.begin(file.fileno())
    syncer.wait()
    assert syncer.take_failure() is None
    syncer.stop()


def test_one_that_never_synced_has_nothing_to_end():
    Syncer().stop()
