"""How the process of a simulated stand is told what to do, and when to end."""

import os
import queue
import signal
import threading
from collections.abc import Callable

from drivers.errors import SettingsError
from drivers.simulated.disturbances import Disturbance, parse_disturbance

_LINE_BYTES = 4096


class DisturbanceInput:
    """Disturbances as lines on standard input, read by a thread of its own.

    Parameters
    ----------
    complain : callable, optional
        Takes what is wrong with a line that is none.
    """

    def __init__(self, on_error: Callable[[str], None] = lambda _: None) -> None:
        self._complain = on_error
        self._waiting: queue.SimpleQueue[Disturbance] = queue.SimpleQueue()
        self._over = threading.Event()
        threading.Thread(target=self._read, name="stdin", daemon=True).start()

    @property
    def is_closed(self) -> bool:
        """Tell whether standard input has ended, which is the end of whoever holds its other end."""
        return self._over.is_set()

    def take(self) -> Disturbance | None:
        """Next one; None while there is none."""
        try:
            return self._waiting.get_nowait()
        except queue.Empty:
            return None

    def _read(self) -> None:
        rest = b""
        # Not sys.stdin: its lock would be held for ever, and the interpreter could not finish.
        while data := os.read(0, _LINE_BYTES):
            *lines, rest = (rest + data).split(b"\n")
            for line in lines:
                self._obey(line.decode(errors="replace").strip())
            rest = rest[-_LINE_BYTES:]
        self._over.set()

    def _obey(self, line: str) -> None:
        if not line:
            return
        try:
            self._waiting.put(parse_disturbance(line))
        except SettingsError as error:
            self._complain(str(error))


def stop_on_signal_or_orphaned() -> Callable[[], bool]:
    """Become true with SIGINT or SIGTERM, or when the parent process has gone. For a command line."""
    ended = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: ended.set())
    parent = os.getppid()
    return lambda: ended.is_set() or os.getppid() != parent


def stop_on_sigterm() -> Callable[[], bool]:
    """Become true with SIGTERM.

    SIGINT is ignored: a Ctrl-C reaches all processes of a terminal, and the owner decides what it means.
    """
    ended = threading.Event()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, lambda *_: ended.set())
    return ended.is_set
