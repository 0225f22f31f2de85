"""The folder of the live ring: private, and nothing of it stays."""

import os
import stat
import sys
import tempfile
import time
from pathlib import Path

import pytest

from app.acquisition import ring
from app.acquisition.ring import live_folder
from app.runs.lock import FileLock


@pytest.fixture(autouse=True)
def temporary(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr(ring, "MEMORY_FOLDER", tmp_path / "absent")
    return tmp_path


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no folder in memory")
@pytest.mark.parametrize("is_full", [False, True])
def test_it_is_in_memory_where_there_is_room(temporary, monkeypatch, is_full):
    memory = temporary / "memory"
    memory.mkdir()
    monkeypatch.setattr(ring, "MEMORY_FOLDER", memory)
    if is_full:
        monkeypatch.setattr(ring, "_MEMORY_BYTES", 1 << 62)
    left_by_a_killed_engine(temporary, "before")
    with live_folder() as folder:
        assert folder.parent == (temporary if is_full else memory)
    assert [path.name for path in temporary.iterdir()] == ["memory"]
    assert list(memory.iterdir()) == []


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has access lists")
def test_nobody_else_may_enter_it(temporary):
    with live_folder() as folder:
        assert folder.parent == temporary
        assert stat.S_IMODE(folder.stat().st_mode) == 0o700


def test_it_goes_with_all_that_is_in_it(temporary):
    with live_folder() as folder:
        (folder / "live.ring").write_bytes(b"1")
    assert list(temporary.iterdir()) == []


def left_by_a_killed_engine(temporary: Path, name: str, age_s: float = 3600.0) -> Path:
    folder = temporary / f"slipstand-live-{name}"
    folder.mkdir()
    (folder / "live.ring").write_bytes(b"1")
    (folder / "engine.lock").write_bytes(b"")
    then = time.time() - age_s
    os.utime(folder, (then, then))
    return folder


def test_what_killed_engines_left_goes_and_what_lives_stays(temporary):
    dead = left_by_a_killed_engine(temporary, "dead")
    young = left_by_a_killed_engine(temporary, "young", age_s=1.0)
    living = left_by_a_killed_engine(temporary, "living")
    other = temporary / "slipstand-notes"
    other.mkdir()
    lock = FileLock(living / "engine.lock").acquire()
    then = time.time() - 3600.0
    os.utime(living, (then, then))
    with live_folder():
        pass
    assert not dead.exists()
    assert young.exists()
    assert living.exists()
    assert other.exists()
    lock.release()
