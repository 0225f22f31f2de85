"""Processes, seen from outside: which a process has, and whether one has ended."""

import contextlib
import os
import sys
import time
from pathlib import Path

from tests.waiting import PATIENCE_S


def children_of(process_id: int) -> list[int]:
    """Processes that a process has started; empty where the system does not tell so simply."""
    found = []
    for listed in Path("/proc").glob(f"{process_id}/task/*/children"):
        with contextlib.suppress(OSError):  # ended meanwhile
            found += [int(word) for word in listed.read_text().split()]
    return found


def descendants_of(process_id: int) -> list[int]:
    """Processes that a process has started, and those that these have."""
    found = children_of(process_id)
    return found + [further for child in found for further in descendants_of(child)]


def gone(process_id: int, patience_s: float = PATIENCE_S) -> bool:
    """Wait until a process has ended; one that waits to be collected has."""
    deadline = time.perf_counter() + patience_s
    while is_alive(process_id):
        if time.perf_counter() > deadline:
            return False
        time.sleep(0.02)
    return True


def is_alive(process_id: int) -> bool:
    """Tell whether a process runs."""
    if sys.platform == "win32":
        return _is_alive_on_windows(process_id)
    try:
        os.kill(process_id, 0)
    except ProcessLookupError:
        return False
    stat = Path(f"/proc/{process_id}/stat")
    return not stat.exists() or stat.read_text().rpartition(")")[2].split()[0] != "Z"


if sys.platform == "win32":
    import ctypes

    _SYNCHRONIZE = 0x100000
    _STILL_WAITING = 0x102

    def _is_alive_on_windows(process_id: int) -> bool:
        kernel = ctypes.windll.kernel32
        handle = kernel.OpenProcess(_SYNCHRONIZE, False, process_id)
        if not handle:
            return False
        try:
            return bool(kernel.WaitForSingleObject(handle, 0) == _STILL_WAITING)
        finally:
            kernel.CloseHandle(handle)
