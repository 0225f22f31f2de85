import errno
import subprocess
import sys
from pathlib import Path

import pytest

from app.runs.creation import remove_abandoned
from app.runs.lock import FileLock, LockHeldError, is_held

_HOLD = """
import sys
from pathlib import Path
from app.runs.lock import FileLock
lock = FileLock(Path(sys.argv[1])).acquire()
print("held", flush=True)
sys.stdin.read()
"""


def test_one_holder_at_a_time(tmp_path):
    path = tmp_path / "a.lock"
    assert not is_held(path)
    with FileLock(path):
        assert is_held(path)
        with pytest.raises(LockHeldError):
            FileLock(path).acquire()
        assert is_held(path)
    assert not path.exists()
    with FileLock(path):
        assert path.exists()


def test_a_lock_dies_with_its_holder(tmp_path):
    path = tmp_path / "a.lock"
    command = [sys.executable, "-c", _HOLD, str(path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as holder:
        assert holder.stdout.readline().strip() == b"held"
        assert is_held(path)
        holder.kill()
    assert path.exists()
    assert not is_held(path)
    with FileLock(path):
        assert is_held(path)


def test_abandoned_locks_are_removed_and_held_ones_stay(tmp_path):
    (tmp_path / "dead.h5.recording").touch()
    with FileLock(tmp_path / "alive.h5.recording"):
        remove_abandoned(tmp_path)
        assert [path.name for path in tmp_path.iterdir()] == ["alive.h5.recording"]


def test_a_folder_that_is_named_like_a_lock_is_not_held(tmp_path, monkeypatch):
    path = tmp_path / "run.h5.recording"
    path.mkdir()
    assert not is_held(path)

    def refuse(*_):
        raise PermissionError(errno.EACCES, "Permission denied")

    monkeypatch.setattr(Path, "open", refuse)  # as Windows does
    assert not is_held(path)
    assert is_held(tmp_path / "of another user")


def test_a_name_that_no_file_can_have_is_not_held(tmp_path):
    assert not is_held(tmp_path / "run\0.h5.recording")
