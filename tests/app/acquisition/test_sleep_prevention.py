"""The computer stays awake while a run is recorded, and only then."""

import ctypes
import os
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import pytest
from engine_kit import FILES, port_of, run_in, stand

from app.acquisition.engine_client import record_runs
from app.acquisition.sleep_prevention import SleepPrevention

posix = pytest.mark.skipif(sys.platform == "win32", reason="Windows has a function for it")
PROGRAM = """#!/bin/sh
echo "begin $@" >> "{log}"
cat
echo end >> "{log}"
"""
HELD = """
import sys
from app.acquisition.sleep_prevention import SleepPrevention
SleepPrevention().begin()
print("held", flush=True)
sys.stdin.read()
"""


@pytest.fixture
def log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """What a program wrote that stands for the one of the system."""
    written = tmp_path / "log"
    name = "caffeinate" if sys.platform == "darwin" else "systemd-inhibit"
    (tmp_path / "bin").mkdir()
    program = tmp_path / "bin" / name
    program.write_text(PROGRAM.format(log=written))
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{program.parent}{os.pathsep}{os.environ['PATH']}")
    return written


def lines_of(log: Path, count: int) -> list[str]:
    """Lines of a log, once there are so many."""
    for _ in range(500):
        lines = log.read_text().splitlines() if log.exists() else []
        if len(lines) >= count:
            return lines
        time.sleep(0.01)
    raise AssertionError(lines)


@posix
def test_a_program_of_the_system_runs_from_begin_to_end(log):
    prevention = SleepPrevention()
    prevention.end()
    prevention.begin()
    prevention.begin()
    (begin,) = lines_of(log, 1)
    assert begin.startswith("begin ")
    assert begin.endswith(" cat")
    prevention.end()
    assert lines_of(log, 2)[1:] == ["end"]
    prevention.begin()
    prevention.end()
    assert len(lines_of(log, 4)) == 4


@posix
def test_it_ends_with_a_process_that_is_killed(log):
    with subprocess.Popen(
        [sys.executable, "-c", HELD], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as holder:
        assert holder.stdout.readline() == b"held\n"
        lines_of(log, 1)
        holder.kill()
    assert lines_of(log, 2)[1] == "end"


@posix
def test_a_system_without_such_a_program_records_all_the_same(monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    prevention = SleepPrevention()
    prevention.begin()
    prevention.end()


def test_windows_is_asked_by_the_thread_that_records(monkeypatch):
    asked = list[int]()
    kernel = SimpleNamespace(SetThreadExecutionState=asked.append)
    monkeypatch.setattr(sys, "platform", "win32")
    monkeypatch.setattr(ctypes, "windll", SimpleNamespace(kernel32=kernel), raising=False)
    prevention = SleepPrevention()
    prevention.begin()
    prevention.end()
    assert asked == [0x8000_0001, 0x8000_0000]


@posix
def test_a_recording_keeps_the_computer_awake_until_it_is_stored(log, tmp_path):
    with stand() as simulated:
        for ended in record_runs(port_of(simulated), run_in(tmp_path), *FILES):
            assert ended.samples
    lines = lines_of(log, 2)
    assert [line.partition(" ")[0] for line in lines] == ["begin", "end"]
