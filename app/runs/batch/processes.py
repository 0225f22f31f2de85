"""A crew of processes on this computer: none of them outlives who started it."""

import contextlib
import multiprocessing
import signal
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from multiprocessing.synchronize import Lock
from typing import TypeVar

from app.runs.batch.parent_watchdog import PipeEnd, exit_with_parent



class ProcessExecutor:
    """Worker processes, started as work comes.

    Parameters
    ----------
    workers : int
        How many at most.
    prepare : callable
        What each does before its first work, one after another: on a first start one compiles, and the
        others load what it made.
    """

    def __init__(self, workers: int, prepare: Callable[[], None]) -> None:
        self._workers = workers
        self._prepare = prepare
        self._executor: ProcessPoolExecutor | None = None
        self._lifeline: tuple[PipeEnd, ...] = ()

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
        if not now:
            self._executor.shutdown(wait=True, cancel_futures=True)
        for end in self._lifeline:
            end.close()
        self._executor.shutdown(wait=True, cancel_futures=True)
        self._executor = None

    def _started(self) -> ProcessPoolExecutor:
        if self._executor is None:
            context = multiprocessing.get_context("spawn")
            self._lifeline = context.Pipe(duplex=False)
            self._executor = ProcessPoolExecutor(
                self._workers,
                mp_context=context,
                initializer=_begin,
                initargs=(self._lifeline[0], context.Lock(), self._prepare),
            )
        return self._executor


def load_analysis() -> None:
    """Load what an analysis needs, or compile it."""
    from analysis.identify import warm_up

    warm_up()


@contextlib.contextmanager
def _interrupts_held() -> Iterator[None]:
    """Hold Ctrl-C back, here and in what is started meanwhile, where the system can."""
    if sys.platform == "win32":
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _begin(lifeline: PipeEnd, one_at_a_time: Lock, prepare: Callable[[], None]) -> None:
    """Begin a worker process."""
    exit_with_parent(lifeline)
    with one_at_a_time:
        prepare()
