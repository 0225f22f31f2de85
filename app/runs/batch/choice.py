"""Which crew does the work."""

import multiprocessing
import os
from collections.abc import Iterator
from contextlib import contextmanager

import msgspec

from app.runs.batch.crew import Crew, InLine

_FEW = 8
"""Up to so many runs are done before other processes would have begun (docs/benchmarks.md)."""


class CrewOptions(msgspec.Struct, frozen=True):
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
def crew_of(options: CrewOptions, runs: int) -> Iterator[Crew]:
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


def processors() -> int:
    """How many processors this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _chosen(options: CrewOptions, runs: int) -> Crew:
    if options.dask:
        from app.runs.batch.cluster import DaskCluster

        return DaskCluster(options.dask)
    jobs = options.jobs
    if jobs is None:
        may_have_children = not multiprocessing.current_process().daemon
        jobs = processors() if runs > _FEW and may_have_children else 1
    jobs = min(jobs, runs)
    if jobs <= 1:
        return InLine()
    from app.runs.batch.processes import Processes, load_analysis

    return Processes(jobs, load_analysis)
