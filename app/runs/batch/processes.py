"""A crew of processes on this computer: none of them outlives who started it."""

import contextlib
import io
import multiprocessing
import os
import signal
import sys
import threading
import time
from _thread import interrupt_main
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from multiprocessing.connection import Connection
from multiprocessing.synchronize import Lock
from typing import NoReturn, TypeVar

Item = TypeVar("Item")
Answer = TypeVar("Answer")

_GRACE_S = 0.5
"""To clear away a half-written copy."""


class Processes:
    """Worker processes, started as work comes.

    Parameters
    ----------
    workers : int
        How many at most.
    """

    def __init__(self, workers: int) -> None:
        self._workers = workers
        self._executor: ProcessPoolExecutor | None = None
        self._lifeline: tuple[Connection, ...] = ()

    @property
    def workers(self) -> int:
        """How many pieces of work are done at once."""
        return self._workers

    def submit(self, work: Callable[[Item], Answer], item: Item) -> "Future[Answer]":
        """Hand over a piece of work. Raises BrokenProcessPool after a worker died, until `renew`."""
        with _interrupts_held():  # a process that is being started must not die of Ctrl-C with a traceback
            return self._started().submit(work, item)

    def renew(self) -> None:
        """Take new processes, after one died."""
        self.close(now=True)

    def close(self, *, now: bool) -> None:
        """End the processes: once they have done what they do, or `now`, in the middle of it."""
        if self._executor is None:
            return
        self._executor.shutdown(wait=not now, cancel_futures=True)
        for end in self._lifeline:
            end.close()
        self._executor.shutdown(wait=True)
        self._executor = None

    def _started(self) -> ProcessPoolExecutor:
        if self._executor is None:
            context = multiprocessing.get_context("spawn")
            self._lifeline = context.Pipe(duplex=False)
            self._executor = ProcessPoolExecutor(
                self._workers,
                mp_context=context,
                initializer=_begin,
                initargs=(self._lifeline[0], context.Lock()),
            )
        return self._executor


@contextlib.contextmanager
def _interrupts_held() -> Iterator[None]:
    """Hold Ctrl-C back, here and in what is started meanwhile, where the system can."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _begin(lifeline: Connection, compiling: Lock) -> None:
    """Prepare a worker process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the owner decides when to end
    signal.signal(signal.SIGTERM, _leave)
    threading.Thread(target=_end_with_owner, args=(lifeline,), name="owner", daemon=True).start()
    from analysis.warm_up import warm_up

    with compiling:  # on a first start one compiles, and the others load what it made
        warm_up()


def _leave(_number: int, _frame: object) -> NoReturn:
    raise SystemExit(1)


def _end_with_owner(lifeline: Connection) -> None:
    """Thread: end this process when its owner closes the lifeline, or dies."""
    with contextlib.suppress(EOFError, OSError):
        lifeline.recv()
    sys.stderr = io.StringIO()  # that it was cut off is no news
    interrupt_main(signal.SIGTERM)  # so that files are cleared away
    time.sleep(_GRACE_S)
    os._exit(1)
