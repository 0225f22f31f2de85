"""Executors for work on many runs - here, in processes, on a Dask cluster - and an ordered map over them."""

import importlib
import logging
import multiprocessing
import os
import sys
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import BrokenExecutor, Future, ProcessPoolExecutor, wait
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from multiprocessing import resource_tracker
from multiprocessing.context import BaseContext
from multiprocessing.synchronize import Lock
from typing import Any, ClassVar, Generic, TypeVar

import msgspec

from app.child_process import hold_interrupts
from app.runs.batch.parent_watchdog import PipeEnd, exit_with_parent, is_asked_to_end, leave_at_once
from app.runs.errors import ClusterError, ExtraMissingError, one_line
from app.version import __version__
from messages.i18n import N_
from messages.message import Message, message

Item = TypeVar("Item")
Answer = TypeVar("Answer")

_log = logging.getLogger(__name__)

_SERIAL_RUNS = 8
"""Up to this many runs are done before worker processes would have started (docs/benchmarks.md)."""
_ANALYSIS = "app.runs.batch.loaded_analysis"
_CLUSTER_TIMEOUT_S = 5.0  # a scheduler in the same network answers in less than 1 s
_QUEUED_PER_WORKER = 8  # items handed over for each worker: one slow run must not leave the others idle
_POLL_S = 0.2  # Windows delivers Ctrl-C between two waits only


class Executor:
    """Runs work in this process; subclasses run some items at once elsewhere. Use `open_executor`."""

    in_process: ClassVar[bool] = True

    @property
    def workers(self) -> int:
        """Number of items that are worked on at once."""
        return 1

    def submit(self, work: Callable[[Item], Answer], item: Item) -> "Future[Answer]":
        """Hand over a picklable item; its future fails with BrokenExecutor where a worker died."""
        future: Future[Answer] = Future()
        try:
            future.set_result(work(item))
        except Exception as error:
            future.set_exception(error)
        return future

    def renew(self) -> None:
        """Replace the workers after one died."""

    def close(self, *, now: bool) -> None:
        """End when the work under way is done, or `now`."""


class ExecutorOptions(msgspec.Struct, frozen=True):
    """Choice of executor."""

    jobs: int | None = None
    """Largest number of processes; None uses all processors, and this process alone for few runs."""
    dask: str = ""


@dataclass(frozen=True, slots=True)
class FailedItem(Generic[Item]):
    """An item that killed its worker twice or could not be worked on."""

    item: Item
    message: Message


@contextmanager
def open_executor(options: ExecutorOptions, runs: int) -> Iterator[Executor]:
    """Open an executor; an error in the block cancels its work. Raises ExtraMissingError, ClusterError."""
    executor: Executor
    jobs = options.jobs
    if jobs is None:
        may_have_children = not multiprocessing.current_process().daemon
        jobs = processor_count() if runs > _SERIAL_RUNS and may_have_children else 1
    jobs = min(jobs, runs)
    if options.dask:
        executor = DaskExecutor(options.dask)
    else:
        executor = Executor() if jobs <= 1 else ProcessExecutor(jobs, _ANALYSIS)
    try:
        yield executor
    except BaseException:
        executor.close(now=True)
        raise
    executor.close(now=False)


def processor_count() -> int:
    """Number of processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def ordered_map(
    executor: Executor, work: Callable[[Item], Answer], items: Iterable[Item]
) -> Iterator[Answer | FailedItem[Item]]:
    """Do `work` on each item and yield the answers in the order of the items.

    When a worker dies, the guilty item is unknown: everything under way is done again, one at a time. An item
    that kills its worker again is a `FailedItem`.
    """
    source = iter(items)
    queued: deque[tuple[Item, Future[Answer]]] = deque()
    limit = 1 if executor.in_process else executor.workers * _QUEUED_PER_WORKER
    try:
        while True:
            for item in islice(source, limit - len(queued)):
                queued.append((item, _submit(executor, work, item)))
            if not queued:
                return
            if isinstance(_wait_for_error(queued[0][1]), BrokenExecutor):
                suspects = list(queued)
                queued.clear()
                yield from _one_at_a_time(executor, work, suspects)
            else:
                item, future = queued.popleft()
                answer: Answer | FailedItem[Item] = _answer(item, future)
                yield answer
    finally:
        for _, future in queued:
            future.cancel()


class ProcessExecutor(Executor):
    """Worker processes on this computer, started with the first item. None outlives this process.

    `preload` is a module that each process imports before its first item, one process after another: at the
    very first start one compiles, and the others load the result. On Linux workers are forked from a process
    that imported it, has no thread and stays until this one ends; elsewhere libraries of the system do not
    stand a fork.
    """

    in_process = False

    def __init__(self, workers: int, preload: str = "") -> None:
        self._workers = workers
        self._preload = preload
        self._executor: ProcessPoolExecutor | None = None
        self._lifeline: tuple[PipeEnd, ...] = ()

    @property
    def workers(self) -> int:
        return self._workers

    def submit(self, work: Callable[[Item], Answer], item: Item) -> "Future[Answer]":
        """Hand over one item. Raises BrokenProcessPool after a worker died, until `renew`."""
        if sys.platform != "win32":
            resource_tracker.ensure_running()  # its start would let interrupts through
        with hold_interrupts():
            return self._started().submit(_do, work, item)

    def renew(self) -> None:
        _log.warning("a worker process died; the workers are replaced")
        self.close(now=True)

    def close(self, *, now: bool) -> None:
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
            context = self._context()
            self._lifeline = context.Pipe(duplex=False)
            self._executor = ProcessPoolExecutor(
                self._workers,
                mp_context=context,
                initializer=_begin,
                initargs=(self._lifeline[0], context.Lock(), self._preload),
            )
        return self._executor

    def _context(self) -> BaseContext:
        if sys.platform == "linux" and self._preload:
            context = multiprocessing.get_context("forkserver")
            context.set_forkserver_preload([self._preload])
            from multiprocessing import forkserver  # Windows has none

            try:
                forkserver.ensure_running()
            except OSError as error:  # no folder takes the socket that it is asked by
                _log.warning("workers are not forked: %s", error)
            else:
                return context
        return multiprocessing.get_context("spawn")


class DaskExecutor(Executor):
    """Workers of a Dask cluster, on computers that see the same run files."""

    in_process = False

    def __init__(self, address: str) -> None:
        self._address = address
        self._client = _connect(address)
        try:
            self._check_workers()
            self._executor: Any = self._client.get_executor(pure=False)
        except BaseException:
            self._client.close()
            raise

    @property
    def workers(self) -> int:
        """Number of items that the cluster works on at once, at present."""
        threads: dict[str, int] = self._client.nthreads()
        return max(1, sum(threads.values()))

    def submit(self, work: Callable[[Item], Answer], item: Item) -> "Future[Answer]":
        future: Future[Answer] = self._executor.submit(work, item)
        return future

    def renew(self) -> None:
        """Dask replaces its workers itself."""

    def close(self, *, now: bool) -> None:
        self._executor.shutdown(wait=not now)
        self._client.close()

    def _check_workers(self) -> None:
        try:
            versions: dict[str, str] = self._client.run(program_version)
        except Exception as error:
            raise ClusterError(
                "the workers of {address} cannot run Slipstand ({kind}: {fault})."
                " Install it there, in the same version",
                address=self._address,
                kind=type(error).__name__,
                fault=one_line(error)[:120],
            ) from None
        if not versions:
            template = N_("the cluster at {address} has no workers. Start some: dask worker {address}")
            raise ClusterError(template, address=self._address)
        for worker, version in versions.items():
            if version != __version__:
                template = N_(
                    "worker {worker} has Slipstand {version}, here it is {own_version}."
                    " Install the same version on both"
                )
                raise ClusterError(template, worker=worker, version=version, own_version=__version__)


def program_version() -> str:
    """Version of Slipstand where this is called."""
    return __version__


def _submit(executor: Executor, work: Callable[[Item], Answer], item: Item) -> "Future[Answer]":
    """Hand over one item; the refusal of an executor becomes a failed future."""
    try:
        return executor.submit(work, item)
    except (BrokenExecutor, RuntimeError, OSError) as error:
        future: Future[Answer] = Future()
        future.set_exception(error)
        return future


def _wait_for_error(future: "Future[Answer]") -> BaseException | None:
    while not wait([future], timeout=_POLL_S).done:
        pass
    return future.exception()


def _one_at_a_time(
    executor: Executor, work: Callable[[Item], Answer], suspects: "list[tuple[Item, Future[Answer]]]"
) -> Iterator[Answer | FailedItem[Item]]:
    executor.renew()
    for item, earlier in suspects:
        future = earlier
        if isinstance(_wait_for_error(future), BrokenExecutor):
            future = _submit(executor, work, item)
        if isinstance(_wait_for_error(future), BrokenExecutor):
            executor.renew()
            yield FailedItem(
                item, message("it killed the process that worked on it, twice: out of memory, or killed")
            )
        else:
            answer: Answer | FailedItem[Item] = _answer(item, future)
            yield answer


def _answer(item: Item, future: "Future[Answer]") -> Answer | FailedItem[Item]:
    error = _wait_for_error(future)
    if error is None:
        return future.result()
    if not isinstance(error, Exception):
        raise error
    kind, text = type(error).__name__, one_line(error)[:200]
    return FailedItem(item, message("its worker failed ({kind}: {text})", kind=kind, text=text))


def _begin(lifeline: PipeEnd, one_at_a_time: Lock, preload: str) -> None:
    exit_with_parent(lifeline)
    if preload:
        with one_at_a_time:
            importlib.import_module(preload)


def _do(work: Callable[[Item], Answer], item: Item) -> Answer:
    """Do `work` in a worker process, which begins no more of it once its owner has gone.

    The pool takes SystemExit for an answer, and begins the next item.
    """
    if is_asked_to_end():
        leave_at_once()
    try:
        return work(item)
    except SystemExit:
        leave_at_once()


def _connect(address: str) -> Any:
    try:
        distributed = importlib.import_module("distributed")
    except ImportError:
        raise ExtraMissingError(
            "--dask needs Dask's distributed, which is not installed. Install it:"
            " pip install 'slipstand[cluster]'"
        ) from None
    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # failures are in the answers
    try:
        distributed.comm.get_address_host_port(address)  # the client takes 20 s to find a bad address
        security = distributed.Security()
        shown = security.get_connection_args("client")
        if address.startswith("tls://") and shown.get("ssl_context") is None:
            raise ClusterError(
                "{address} asks for a certificate. State ca-file, client.cert and client.key of Dask's"
                " distributed.comm.tls",
                address=address,
            )
        return distributed.Client(
            address, timeout=_CLUSTER_TIMEOUT_S, set_as_default=False, security=security
        )
    except (OSError, ValueError, TypeError, RuntimeError) as error:
        raise ClusterError(
            "no Dask scheduler answers at {address!r} ({fault})."
            " Start one with `dask scheduler`, and give its address, for example tcp://localhost:8786",
            address=address,
            fault=one_line(error)[:120] or type(error).__name__,
        ) from None
