"""A file is brought to disk by a thread while others write to it."""

import errno
import os
import threading

import pytest

from app.acquisition.journal.file import FileSync


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
    inode = os.fstat(file.fileno()).st_ino
    sync = FileSync(file.fileno())
    sync.begin()
    file.close()
    sync.end()
    assert sync.began_s is not None
    may_go_on.set()
    assert sync.take_failure() is None
    sync.join()
    assert synced == [inode]
    assert sync.began_s is None


def test_a_failure_is_known_afterwards(file, monkeypatch):
    def fsync(handle: int) -> None:
        raise OSError(errno.EIO, "injected")

    monkeypatch.setattr("app.acquisition.journal.file.os.fsync", fsync)
    sync = FileSync(file.fileno())
    sync.begin()
    failure = sync.take_failure()
    assert failure is not None
    assert failure.errno == errno.EIO
    assert sync.take_failure() is None, "it was told"
    sync.end()
    assert not sync.is_alive()
