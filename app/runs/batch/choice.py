"""Which crew does the work."""

import multiprocessing
import os
from collections.abc import Iterator
from contextlib import contextmanager

import msgspec

from app.runs.batch.crew import Executor, SerialExecutor

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
        from app.runs.batch.cluster import DaskExecutor

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
