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
from multiprocessing.process import BaseProcess
from typing import Any

from app.log import start_log
from app.presenters.base import ReportProgress
from app.presenters.error_reports import ErrorReport, error_report, is_user_error
from app.presenters.events import TaskDone, TaskFailed, TaskProgress, WorkerEvent
from app.runs.batch.parent_watchdog import PipeEnd, exit_with_parent
from messages.i18n import language, use_language
from messages.message import message

Task = Callable[[Any, ReportProgress], Any]
"""Module-level function that takes its argument and a function to report progress with."""
CANCELLED = message("The analysis was given up. Open the recording to repeat it")
_PROCESS_DIED = message(
    "The analysis process ended unexpectedly. Try again; `slipstand doctor` checks the installation"
)
_GRACE_S = 3.0
"""An aborted process has this long to end the processes that it has started itself."""
_END_S = 4.0
"""A process that has not ended after this time is killed: a little more than `_GRACE_S`."""
_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class LazyFunction:
    """Module-level function that is imported where it is called: in the child process, not in the window."""

    module: str
    name: str

    def __call__(self, *arguments: Any) -> Any:
        return getattr(importlib.import_module(self.module), self.name)(*arguments)


class WorkerPool:
    """Child processes that workers share: a worker holds one only while it has tasks.

    `close` must be called, after the workers are closed.
    """

    def __init__(self) -> None:
        self._idle: list[_TaskProcess] = []

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


class Worker:
    """Carries out tasks in a child process, one after another.

    No method but `close`, which must be called, waits. `report_error` takes errors of the program itself, in
    addition to the failure of the task. Workers with a `pool` share its processes; a worker without one keeps
    a process of its own, with what its tasks have loaded.
    """

    def __init__(
        self,
        report_error: Callable[[ErrorReport], None] = lambda _error: None,
        pool: WorkerPool | None = None,
    ) -> None:
        self._report_error = report_error
        self._pool = pool
        self._process: _TaskProcess | None = None
        self._ending: list[_TaskProcess] = []
        self._waiting: deque[tuple[Task, Any]] = deque()
        self._cancelled: list[WorkerEvent] = []

    @property
    def is_busy(self) -> bool:
        return bool(self._waiting)

    def submit(self, task: Task, argument: Any) -> None:
        """Call `task(argument, report)` after the tasks submitted before; both must be picklable."""
        self._waiting.append((task, argument))
        if self._process is None:
            self._process = _TaskProcess() if self._pool is None else self._pool.acquire()
        self._process.send(task, argument)

    def poll(self) -> list[WorkerEvent]:
        events, self._cancelled = self._cancelled, []
        self._ending = [process for process in self._ending if not process.has_ended()]
        try:
            while self._process is not None and (received := self._process.receive()) is not None:
                events.append(self._event_of(*received))
        except (EOFError, OSError):
            events += self._on_process_death()
        if self._process is not None and self._pool is not None and not self._waiting:
            self._pool.release(self._process)
            self._process = None
        return events

    def cancel(self) -> None:
        """Abort all tasks, which fail; the next task starts another process."""
        for _, argument in self._waiting:
            self._cancelled.append(TaskFailed(argument, CANCELLED, is_cancelled=True))
        self._waiting.clear()
        self._end(abort=True)

    def close(self) -> None:
        """End the process; a task that is under way is aborted."""
        self._end(abort=bool(self._waiting))
        self._waiting.clear()
        for process in self._ending:
            process.join()
        self._ending.clear()

    def _end(self, *, abort: bool) -> None:
        if self._process is not None:
            (self._process.abort if abort else self._process.detach)()
            self._ending.append(self._process)
            self._process = None

    def _event_of(self, kind: str, content: Any) -> WorkerEvent:
        argument = self._waiting[0][1]
        if kind == "progress":
            return TaskProgress(argument, content)
        self._waiting.popleft()
        if kind == "done":
            return TaskDone(argument, content)
        if kind == "error":
            self._report_error(content)
        return TaskFailed(argument, content.message)

    def _on_process_death(self) -> list[WorkerEvent]:
        self._end(abort=True)
        if not self._waiting:
            return []
        _log.error("process of a worker ended unexpectedly")
        _, argument = self._waiting.popleft()
        waiting, self._waiting = self._waiting, deque()
        for task, later in waiting:
            self.submit(task, later)
        return [TaskFailed(argument, _PROCESS_DIED)]


class _TaskProcess:
    """One child process that carries out tasks in the order in which they are sent.

    It is no daemon, since it may start processes itself. It exits when its parent does (`exit_with_parent`).
    """

    def __init__(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._pipe, child_pipe = context.Pipe()
        child_lifeline, self._lifeline = context.Pipe(duplex=False)
        # The interpreter joins its children at exit: they must end even if nobody calls `close`.
        atexit.register(self._lifeline.close)
        arguments = (child_pipe, child_lifeline, language())
        self._process: BaseProcess = context.Process(target=_serve, args=arguments, name="slipstand-analysis")
        self._process.start()
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

    def send(self, task: Task, argument: Any) -> None:
        with contextlib.suppress(OSError):  # `receive` notices a dead process
            self._pipe.send((task, argument))

    def receive(self) -> tuple[str, Any] | None:
        """Next message; None without any. Raises EOFError, OSError where the process has died."""
        if not self._pipe.poll():
            return None
        received: tuple[str, Any] = self._pipe.recv()
        return received

    def abort(self) -> None:
        """End the process at once, with the processes that it has started."""
        self._drop_lifeline()
        self.detach()

    def detach(self) -> None:
        """Let the process exit when its task has ended."""
        self._pipe.close()
        self._end_s = time.monotonic() + _END_S

    def has_ended(self) -> bool:
        """Tell whether the process has ended; one that hangs is killed after `_END_S`."""
        if self._process.is_alive() and time.monotonic() > self._end_s:
            _log.warning("killed process %s, which did not end", self._process.pid)
            self._process.kill()
            self._process.join()
        if self._process.is_alive():
            return False
        self._drop_lifeline()
        return True

    def join(self) -> None:
        self._process.join(max(0.0, self._end_s - time.monotonic()))
        self._drop_lifeline()
        while not self.has_ended():
            time.sleep(0.001)

    def _drop_lifeline(self) -> None:
        atexit.unregister(self._lifeline.close)
        self._lifeline.close()


def _serve(pipe: PipeEnd, lifeline: PipeEnd, language_code: str) -> None:
    start_log("worker")
    use_language(language_code)
    exit_with_parent(lifeline, _GRACE_S)
    with contextlib.suppress(EOFError, OSError):
        while True:
            task, argument = pipe.recv()
            name = task.name if isinstance(task, LazyFunction) else getattr(task, "__name__", "task")
            _log.info("task %s starts", name)
            try:
                answer = task(argument, lambda progress: pipe.send(("progress", progress)))
            except Exception as error:
                _log.warning("task %s failed: %s", name, error)
                pipe.send(("failed" if is_user_error(error) else "error", error_report(error)))
            else:
                _log.info("task %s is done", name)
                pipe.send(("done", answer))
