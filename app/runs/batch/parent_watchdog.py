"""A pipe whose other end is held by whoever started a process: when that goes, so does the process."""

import contextlib
import io
import os
import signal
import sys
import threading
import time
from _thread import interrupt_main
from multiprocessing import connection
from typing import NoReturn, TypeAlias

if sys.platform == "win32":
    PipeEnd: TypeAlias = connection.PipeConnection
else:
    PipeEnd: TypeAlias = connection.Connection

_GRACE_S = 2.0  # to clear away half-written copies, on a busy computer too


def exit_with_parent(lifeline: PipeEnd, grace_s: float = _GRACE_S) -> None:
    """End this process, whatever it does, when its owner closes the lifeline or dies.

    `SystemExit` is raised in the main thread, which calls this: `grace_s` is left to clear away copies and
    executors.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the owner decides when to end
    signal.signal(signal.SIGTERM, _leave)
    threading.Thread(target=_end_with_owner, args=(lifeline, grace_s), name="owner", daemon=True).start()


def _leave(_number: int, _frame: object) -> NoReturn:
    _discard_stderr()
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
    os._exit(1)
