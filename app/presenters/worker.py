"""Long tasks in child processes, so that the window does not wait."""

import atexit
import contextlib
import importlib
import logging
import multiprocessing
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from multiprocessing.process import BaseProcess
from typing import Any, TypeVar, TypeVarTuple, overload

from analysis.catalogue import Unit, displacement_unit, use_displacement_unit
from app.log import start_log
from app.presenters.base import ReportProgress, TaskFailure
from app.presenters.error_reports import ErrorReport, error_report, is_user_error
from app.runs.batch.parent_watchdog import PipeEnd, exit_with_parent
from messages.i18n import language, use_language
from messages.message import message, message_of

Answer = TypeVar("Answer")
Arguments = TypeVarTuple("Arguments")
CANCELLED = message("The analysis was given up. Open the recording to repeat it")
_PROCESS_DIED = message(
    "The analysis process ended unexpectedly. Try again; `slipstand doctor` checks the installation"
)
_GRACE_S = 3.0
"""An aborted process has this long to end the processes that it has started itself."""
_END_S = 4.0  # a process that has not ended after this time is killed: a little more than `_GRACE_S`
_log = logging.getLogger(__name__)


def _ignore(_: object) -> None:
    pass


class LazyModule:
    """Module whose functions are imported where they are called: in the child process, not in the window.

    Type checkers see the module itself where it is imported `if TYPE_CHECKING` and made `else`.
    """

    def __init__(self, name: str) -> None:
        self._name = name

    def __getattr__(self, name: str) -> "LazyFunction":
        return LazyFunction(self._name, name)


@dataclass(frozen=True, slots=True)
class LazyFunction:
    """Module-level function that is imported where it is called: in the child process, not in the window."""

    module: str
    name: str

    def __call__(self, *arguments: Any) -> Any:
        return getattr(importlib.import_module(self.module), self.name)(*arguments)


class WorkerPool:
    """Child processes that workers share: a worker holds one only while it has tasks.

    `close` must be called, after the workers are closed. `report_error` as in `Worker`.
    """

    def __init__(self, report_error: Callable[[ErrorReport], None] = _ignore) -> None:
        self._report_error = report_error
        self._idle: list[_TaskProcess] = []

    def make_worker(self) -> "Worker":
        return Worker(self._report_error, self)

    def acquire(self) -> "_TaskProcess":
        while self._idle:
            process = self._idle.pop()
            if process.is_alive:
                return process
            process.detach()
        return _TaskProcess()

    def release(self, process: "_TaskProcess") -> None:
        self._idle.append(process)

    def close(self) -> None:
        processes, self._idle = self._idle, []
        for process in processes:
            process.detach()
        for process in processes:
            process.join()


@dataclass(frozen=True, slots=True)
class _Task:
    function: Callable[..., Any]
    arguments: tuple[Any, ...]
    reports: bool
    done: Callable[[Any], object]
    failed: Callable[[TaskFailure], object]
    progress: Callable[[Any], object]


class Worker:
    """Calls functions in a child process, one after another.

    No method but `close`, which must be called, waits. `report_error` takes errors of the program itself, in
    addition to the failure of the task. Workers with a `pool` share its processes; a worker without one keeps
    a process of its own, with what its tasks have loaded.
    """

    def __init__(
        self, report_error: Callable[[ErrorReport], None] = _ignore, pool: WorkerPool | None = None
    ) -> None:
        self._report_error = report_error
        self._pool = pool
        self._process: _TaskProcess | None = None
        self._ending: list[_TaskProcess] = []
        self._waiting: deque[_Task] = deque()
        self._failed: deque[tuple[_Task, TaskFailure]] = deque()

    @property
    def is_busy(self) -> bool:
        return bool(self._waiting)

    @overload
    def submit(
        self,
        function: Callable[[*Arguments], Answer],
        *arguments: *Arguments,
        done: Callable[[Answer], object] = ...,
        failed: Callable[[TaskFailure], object] = ...,
    ) -> None: ...
    @overload
    def submit(
        self,
        function: Callable[[*Arguments, ReportProgress], Answer],
        *arguments: *Arguments,
        done: Callable[[Answer], object] = ...,
        failed: Callable[[TaskFailure], object] = ...,
        progress: Callable[[Any], object],
    ) -> None: ...
    def submit(
        self,
        function: Callable[..., Answer],
        *arguments: *Arguments,
        done: Callable[[Answer], object] = _ignore,
        failed: Callable[[TaskFailure], object] = _ignore,
        progress: Callable[[Any], object] | None = None,
    ) -> None:
        """Call `function(*arguments)` after the tasks submitted before; all must be picklable.

        `poll` calls `done` with what it returns, or `failed`. With `progress`, the function gets one more
        argument: a function whose argument is passed on to `progress`.
        """
        task = _Task(function, arguments, progress is not None, done, failed, progress or _ignore)
        self._send(task)

    def poll(self) -> None:
        """Call the callbacks of tasks that have ended, failed or reported progress."""
        self._ending = [process for process in self._ending if not process.has_ended()]
        while (callback := self._next_callback()) is not None:
            callback()
        if self._process is not None and self._pool is not None and not self._waiting:
            self._pool.release(self._process)
            self._process = None

    def cancel(self) -> None:
        """Abort all tasks, which fail; the next task starts another process."""
        self._failed += ((task, TaskFailure(CANCELLED, is_cancelled=True)) for task in self._waiting)
        self._waiting.clear()
        self._end(abort=True)

    def close(self) -> None:
        """End the process; a task that is under way is aborted."""
        self._end(abort=bool(self._waiting))
        self._waiting.clear()
        for process in self._ending:
            process.join()
        self._ending.clear()

    def _send(self, task: _Task) -> None:
        if self._process is None:
            try:
                self._process = _TaskProcess() if self._pool is None else self._pool.acquire()
            except OSError as error:
                _log.error("a process could not be started: %s", error)
                self._failed.append((task, TaskFailure(message_of(error))))
                return
        self._waiting.append(task)
        self._process.send(task)

    def _end(self, *, abort: bool) -> None:
        if self._process is not None:
            (self._process.abort if abort else self._process.detach)()
            self._ending.append(self._process)
            self._process = None

    def _next_callback(self) -> Callable[[], object] | None:
        if self._failed:
            task, failure = self._failed.popleft()
            return partial(task.failed, failure)
        if self._process is None:
            return None
        try:
            received = self._process.receive()
        except (EOFError, OSError):
            return self._on_process_death()
        if received is None:
            return None
        kind, content = received
        if kind == "progress":
            return partial(self._waiting[0].progress, content)
        task = self._waiting.popleft()
        if kind == "done":
            return partial(task.done, content)
        if kind == "error":
            self._report_error(content)
        return partial(task.failed, TaskFailure(content.message))

    def _on_process_death(self) -> Callable[[], object] | None:
        self._end(abort=True)
        if not self._waiting:
            return None
        _log.error("process of a worker ended unexpectedly")
        failed, *later = self._waiting
        self._waiting.clear()
        for task in later:
            self._send(task)
        return partial(failed.failed, TaskFailure(_PROCESS_DIED))


class _TaskProcess:
    """One child process that carries out tasks in the order in which they are sent.

    It is no daemon, since it may start processes itself. It exits when its parent does (`exit_with_parent`).
    """

    def __init__(self) -> None:
        context = multiprocessing.get_context("spawn")
        with contextlib.ExitStack() as ends:  # they are closed where the process does not start
            self._pipe, child_pipe = (ends.enter_context(end) for end in context.Pipe())
            child_lifeline, self._lifeline = (ends.enter_context(end) for end in context.Pipe(duplex=False))
            arguments = (child_pipe, child_lifeline, language(), displacement_unit())
            self._process: BaseProcess = context.Process(
                target=_serve, args=arguments, name="slipstand-analysis"
            )
            self._process.start()
            ends.pop_all()
        # The interpreter joins its children at exit: they must end even if nobody calls `close`.
        atexit.register(self._lifeline.close)
        child_pipe.close()
        child_lifeline.close()
        self._end_s = float("inf")
        _log.info("started process %s", self._process.pid)

    @property
    def is_alive(self) -> bool:
        try:
            self.receive()
        except (EOFError, OSError):
            return False
        return self._process.is_alive()

    def send(self, task: _Task) -> None:
        with contextlib.suppress(OSError):  # `receive` notices a dead process
            self._pipe.send((task.function, task.arguments, task.reports))

    def receive(self) -> tuple[str, Any] | None:
        """Next message; None without any. Raises EOFError, OSError where the process has died."""
        if not self._pipe.poll():
            return None
        received: tuple[str, Any] = self._pipe.recv()
        return received

    def abort(self) -> None:
        self._drop_lifeline()
        self.detach()

    def detach(self) -> None:
        self._pipe.close()
        self._end_s = time.perf_counter() + _END_S

    def has_ended(self) -> bool:
        """Tell whether the process has ended; one that hangs is killed after `_END_S`."""
        if self._process.is_alive() and time.perf_counter() > self._end_s:
            _log.warning("killed process %s, which did not end", self._process.pid)
            self._process.kill()
            self._process.join()
        if self._process.is_alive():
            return False
        self._drop_lifeline()
        return True

    def join(self) -> None:
        self._process.join(max(0.0, self._end_s - time.perf_counter()))
        self._drop_lifeline()
        while not self.has_ended():
            time.sleep(0.001)

    def _drop_lifeline(self) -> None:
        atexit.unregister(self._lifeline.close)
        self._lifeline.close()


def _serve(pipe: PipeEnd, lifeline: PipeEnd, language_code: str, unit: Unit) -> None:
    start_log("worker")
    use_language(language_code)
    use_displacement_unit(unit)
    exit_with_parent(lifeline, _GRACE_S)
    report = (lambda progress: pipe.send(("progress", progress)),)
    with contextlib.suppress(EOFError, OSError):
        while True:
            function, arguments, reports = pipe.recv()
            name = function.name if isinstance(function, LazyFunction) else function.__name__
            _log.info("task %s starts", name)
            try:
                answer = function(*arguments, *(report if reports else ()))
            except Exception as error:
                _log.warning("task %s failed: %s", name, error)
                pipe.send(("failed" if is_user_error(error) else "error", error_report(error)))
            else:
                _log.info("task %s is done", name)
                pipe.send(("done", answer))
