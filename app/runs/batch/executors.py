"""Which crew does the work."""

import multiprocessing
import os
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from typing import Protocol, TypeVar

import msgspec

Item = TypeVar("Item")
Answer = TypeVar("Answer")


class Executor(Protocol):
    """Workers that share one `concurrent.futures.Executor`. Use it in a `with` statement of `crew_of`."""

    @property
    def workers(self) -> int:
        """How many pieces of work are done at once."""

    def submit(self, work: Callable[[Item], Answer], item: Item) -> "Future[Answer]":
        """Hand over a piece of work; both must be picklable, `work` by its name.

        The future fails with `concurrent.futures.BrokenExecutor` where a worker died, with whatever was
        in work then.
        """

    def renew(self) -> None:
        """Take new workers, after one died."""

    def close(self, *, now: bool) -> None:
        """End once all is done that is being done; or `now`, and give it up."""


class SerialExecutor:
    """No crew: work is done in this process, at once."""

    workers = 1

    def submit(self, work: Callable[[Item], Answer], item: Item) -> "Future[Answer]":
        """Do the work. What it raises is in the future, as an interruption is not."""
        future: Future[Answer] = Future()
        try:
            future.set_result(work(item))
        except Exception as error:
            future.set_exception(error)
        return future

    def renew(self) -> None:
        """Nothing can have died."""

    def close(self, *, now: bool) -> None:
        """Nothing is being done."""


_FEW = 8
"""Up to so many runs are done before other processes would have begun (docs/benchmarks.md)."""


class ExecutorOptions(msgspec.Struct, frozen=True):
    """Who is to do the work.

    Attributes
    ----------
    jobs : int or None
        Processes at most; None is as many as there are processors, none of them for few runs.
    dask : str
        Address of a Dask scheduler, whose workers do it all; "" for this computer.
    """

    jobs: int | None = None
    dask: str = ""


@contextmanager
def open_executor(options: ExecutorOptions, runs: int) -> Iterator[Executor]:
    """Open the crew for so many runs; what it does when the block is left by an error is given up.

    Raises
    ------
    ExtraMissingError, ClusterError
    """
    crew = _chosen(options, runs)
    try:
        yield crew
    except BaseException:
        crew.close(now=True)
        raise
    crew.close(now=False)


def processor_count() -> int:
    """How many processors this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _chosen(options: ExecutorOptions, runs: int) -> Executor:
    if options.dask:
        from app.runs.batch.dask_executor import DaskExecutor

        return DaskExecutor(options.dask)
    jobs = options.jobs
    if jobs is None:
        may_have_children = not multiprocessing.current_process().daemon
        jobs = processor_count() if runs > _FEW and may_have_children else 1
    jobs = min(jobs, runs)
    if jobs <= 1:
        return SerialExecutor()
    from app.runs.batch.processes import ProcessExecutor, load_analysis

    return ProcessExecutor(jobs, load_analysis)
