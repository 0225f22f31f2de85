"""Ctrl-C of a command: one line and the exit code 130, whenever it comes."""

import _thread
import os
import signal
import sys
import threading
from typing import Any

EXIT_CODE = 130
LINE = "interrupted\n"

_came, _was_lost = threading.Event(), threading.Event()
_AGAIN_S = 0.05


def follow_interrupts() -> None:
    """Raise KeyboardInterrupt at the first Ctrl-C, and end the process at a second one."""
    _came.clear()
    _was_lost.clear()
    _handle(_interrupt)


def ignore_interrupts() -> None:
    """Leave a program alone that is ending: nothing is left to interrupt."""
    _handle(signal.SIG_IGN)


def was_interrupted() -> bool:
    """Tell whether Ctrl-C came; libraries turn its exception into others."""
    return _came.is_set()


def _interrupt(_number: int, _frame: object) -> None:
    if _came.is_set() and not _was_lost.is_set():
        os.write(2, LINE.encode())
        os._exit(EXIT_CODE)
    _came.set()
    _was_lost.clear()
    sys.unraisablehook = _repeat
    raise KeyboardInterrupt


def _repeat(lost: Any) -> None:
    """Raise again, a moment later, what was lost in a place that cannot pass it on, as a callback of C."""
    if lost.exc_type is KeyboardInterrupt:
        _was_lost.set()
        again = threading.Timer(_AGAIN_S, _interrupt_main)
        again.daemon = True
        again.start()


def _interrupt_main() -> None:
    """Also where it waits for the system: what `interrupt_main` notes is seen after the wait."""
    main = threading.main_thread().ident
    if sys.platform == "win32" or main is None:
        _thread.interrupt_main()
    else:
        signal.pthread_kill(main, signal.SIGINT)


def _handle(handler: Any) -> None:
    if threading.current_thread() is threading.main_thread():  # Python allows it to no other
        signal.signal(signal.SIGINT, handler)
