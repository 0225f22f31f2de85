"""A pipe whose other end is held by whoever started a process: when that goes, so does the process."""

import atexit
import contextlib
import io
import os
import signal
import sys
import threading
import time
from _thread import interrupt_main
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, NoReturn, TypeAlias

if TYPE_CHECKING:
    from multiprocessing import connection

if sys.platform == "win32":
    PipeEnd: TypeAlias = "connection.PipeConnection"
else:
    PipeEnd: TypeAlias = "connection.Connection"

_GRACE_S = 2.0  # to clear away half-written copies, on a busy computer too
_asked = threading.Event()
"""Set when the process is to end."""
_clearing: dict[object, Callable[[], object]] = {}
_holding: set[object] = set()


def exit_with_parent(lifeline: PipeEnd, grace_s: float = _GRACE_S) -> None:
    """End this process, whatever it does, when its owner closes the lifeline or dies.

    `SystemExit` is raised in the main thread, which calls this: `grace_s` is left to clear away copies and
    executors.
    """
    atexit.register(_clear)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the owner decides when to end
    signal.signal(signal.SIGTERM, _leave)
    threading.Thread(target=_end_with_owner, args=(lifeline, grace_s), name="owner", daemon=True).start()


def is_asked_to_end() -> bool:
    """Tell whether the owner of this process has gone, or wants it to end."""
    return _asked.is_set()


def leave_if_asked() -> None:
    """Raise SystemExit if this process is to end: a good moment inside `end_held`."""
    if _asked.is_set():
        raise SystemExit(1)


def leave_at_once() -> NoReturn:
    """End this process now, with what `cleared_at_end` has to clear away."""
    _clear()
    os._exit(1)


@contextlib.contextmanager
def cleared_at_end(clear: Callable[[], object]) -> Iterator[None]:
    """Call `clear` after the block, and also where this process has to end within it."""
    key = object()
    _clearing[key] = clear
    try:
        yield
    finally:
        clear()
        del _clearing[key]


@contextlib.contextmanager
def end_held() -> Iterator[None]:
    """Let the end of the owner break off the block by `leave_if_asked` alone, or at the end of the block.

    What hangs in it longer than the grace is ended all the same.
    """
    key = object()
    _holding.add(key)
    try:
        yield
    finally:
        _holding.discard(key)
        if not _holding:
            leave_if_asked()


def _leave(_number: int, _frame: object) -> None:
    _asked.set()
    _discard_stderr()
    if not _holding:
        raise SystemExit(1)


def _discard_stderr() -> None:
    """Discard what is written to stderr: that a process was cut off is no news.

    Numba ends a process with a report where the exit comes while it loads a library.
    """
    sys.stderr = io.StringIO()
    with contextlib.suppress(OSError):
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, 2)
        os.close(null)


def _end_with_owner(lifeline: PipeEnd, grace_s: float) -> None:
    with contextlib.suppress(EOFError, OSError):
        lifeline.recv()
    _discard_stderr()
    thread = threading.main_thread().ident
    if thread is not None and hasattr(signal, "pthread_kill"):  # wakes it, whatever it waits for
        signal.pthread_kill(thread, signal.SIGTERM)
    else:
        interrupt_main(signal.SIGTERM)
    time.sleep(grace_s)  # so that files are cleared away
    leave_at_once()


def _clear() -> None:
    for clear in list(_clearing.values()):
        with contextlib.suppress(Exception):
            clear()
