"""Limit of the memory of a process, by the system (Linux), else by a thread that ends the process."""

import contextlib
import os
import sys
import threading
import time
from collections.abc import Callable

MEMORY_EXIT = 70
"""Exit code of a process that had more memory than its limit."""
_LOOK_S = 0.02


def limit_memory(limit_bytes: int) -> None:
    """Limit what this process may write to; address space alone costs nothing, and libraries reserve much."""
    if sys.platform == "linux":
        import resource

        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        with contextlib.suppress(ValueError, OSError):
            resource.setrlimit(resource.RLIMIT_DATA, (limit_bytes, limit_bytes))
    else:
        watch_memory(limit_bytes)


def watch_memory(limit_bytes: int) -> None:
    """End this process once it has had more memory than the limit."""
    peak_bytes = _peak_reader()
    threading.Thread(target=_watch, args=(limit_bytes, peak_bytes), name="memory", daemon=True).start()


def _watch(limit_bytes: int, peak_bytes: Callable[[], int]) -> None:
    while peak_bytes() <= limit_bytes:
        time.sleep(_LOOK_S)
    os._exit(MEMORY_EXIT)


def _peak_reader() -> Callable[[], int]:
    """What tells the most memory that this process has had, in bytes."""
    if sys.platform == "win32":
        return _windows_peak_reader()
    import resource

    unit_bytes = 1 if sys.platform == "darwin" else 1024
    return lambda: resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit_bytes


if sys.platform == "win32":
    import ctypes
    from ctypes import wintypes

    class _MemoryCounters(ctypes.Structure):
        """PROCESS_MEMORY_COUNTERS of psapi.h."""

        _fields_ = (
            ("cb", wintypes.DWORD),
            ("PageFaultCount", wintypes.DWORD),
            *((name, ctypes.c_size_t) for name in (
                "PeakWorkingSetSize", "WorkingSetSize", "QuotaPeakPagedPoolUsage", "QuotaPagedPoolUsage",
                "QuotaPeakNonPagedPoolUsage", "QuotaNonPagedPoolUsage", "PagefileUsage", "PeakPagefileUsage",
            )),
        )  # fmt: skip

    def _windows_peak_reader() -> Callable[[], int]:
        kernel = ctypes.WinDLL("kernel32")
        kernel.GetCurrentProcess.restype = wintypes.HANDLE
        read = kernel.K32GetProcessMemoryInfo
        read.argtypes = (wintypes.HANDLE, ctypes.POINTER(_MemoryCounters), wintypes.DWORD)
        process, counters = kernel.GetCurrentProcess(), _MemoryCounters()

        def peak_bytes() -> int:
            read(process, ctypes.byref(counters), ctypes.sizeof(counters))
            return int(counters.PeakPagefileUsage)

        return peak_bytes
