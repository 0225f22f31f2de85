"""Long work in a process of its own, so that the window never waits: one task after another."""

import atexit
import contextlib
import importlib
import multiprocessing
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.process import BaseProcess
from typing import Any, Generic, TypeVar

from app.presenters.base import Progress
from app.presenters.error_reports import ErrorReport, error_report, is_user_error
from app.runs.batch.parent_watchdog import PipeEnd, exit_with_parent
from messages.i18n import N_, language, use_language

Answer = TypeVar("Answer")
ReportProgress = Callable[[Progress], None]
CANCELLED = N_("The analysis was given up. Open the recording to repeat it")
_GRACE_S = 3.0
"""A process that is given up takes leave of its crew."""
Task = Callable[[Any, ReportProgress], Any]
"""Module-level function of one argument; called in the other process."""


@dataclass(frozen=True, slots=True)
class LazyFunction:
    """Module-level function that is imported where it is called: in the worker process, not in the window."""

    module: str
    name: str

    def __call__(self, *arguments: Any) -> Any:
        """Import the function and call it."""
        return getattr(importlib.import_module(self.module), self.name)(*arguments)


@dataclass(frozen=True, slots=True)
class TaskDone(Generic[Answer]):
    """A task has ended well."""

    argument: Any
    answer: Answer


@dataclass(frozen=True, slots=True)
class TaskFailed:
    """A task has failed; `message` is one line for people."""

    argument: Any
    message: str


@dataclass(frozen=True, slots=True)
class TaskProgress:
    """A task reports how far it is."""

    argument: Any
    progress: Progress


WorkerEvent = TaskDone[Any] | TaskFailed | TaskProgress


class Worker:
    """Runs tasks in a child process that is started when first needed and ends with its owner.

    Nothing here waits: `poll` returns what has come. `close` must be called. The process may start others,
    which a daemon may not: a lifeline ends it in place of that.

    Parameters
    ----------
    report_error : callable, optional
        Takes faults of the program itself, beside the failure of the task.
    """

    _END_S = 4.0

    def __init__(self, report_error: Callable[[ErrorReport], None] = lambda _fault: None) -> None:
        self._report_error = report_error
        self._process: BaseProcess | None = None
        self._pipe: PipeEnd | None = None
        self._lifeline: PipeEnd | None = None
        self._ending: list[tuple[BaseProcess, float]] = []
        self._waiting: deque[tuple[Task, Any]] = deque()
        self._cancelled: list[WorkerEvent] = []

    @property
    def is_busy(self) -> bool:
        """Tell whether a task is being done or waits."""
        return bool(self._waiting)

    def submit(self, task: Task, argument: Any) -> None:
        """Do `task(argument, report)` after those submitted before; both must be picklable."""
        self._waiting.append((task, argument))
        self._send(task, argument)

    def poll(self) -> list[WorkerEvent]:
        """What has happened since the last call."""
        news, self._cancelled = self._cancelled, []
        self._reap()
        try:
            while self._pipe is not None and self._pipe.poll():
                news.append(self._event_of(*self._pipe.recv()))
        except (EOFError, OSError):
            news += self._on_process_death()
        return news

    def cancel(self) -> None:
        """Give up all tasks at once, which is news too; the next one starts a new process."""
        self._cancelled += [TaskFailed(argument, CANCELLED) for _, argument in self._waiting]
        self._waiting.clear()
        self._abort()

    def close(self) -> None:
        """End the process: an idle one by itself, one that works in the middle of it."""
        if self._waiting:
            self._waiting.clear()
            self._abort()
        else:
            self._detach()
        for process, until_s in self._ending:
            process.join(max(0.0, until_s - time.monotonic()))
        self._drop_lifeline()
        while self._ending:
            self._reap()

    def _send(self, task: Task, argument: Any) -> None:
        if self._pipe is None:
            self._start()
        if self._pipe is not None:
            with contextlib.suppress(OSError):  # a dead process is noticed by `poll`
                self._pipe.send((task, argument))

    def _start(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._pipe, theirs = context.Pipe()
        held, self._lifeline = context.Pipe(duplex=False)
        # Without `close` too: the interpreter waits for its children in the end.
        atexit.register(self._lifeline.close)
        self._process = context.Process(
            target=_serve, args=(theirs, held, language()), name="slipstand-analysis"
        )
        self._process.start()
        theirs.close()
        held.close()

    def _event_of(self, kind: str, content: Any) -> WorkerEvent:
        argument = self._waiting[0][1]
        if kind == "progress":
            return TaskProgress(argument, content)
        self._waiting.popleft()
        if kind == "done":
            return TaskDone(argument, content)
        if kind == "broken":
            self._report_error(content)
        return TaskFailed(argument, content.message)

    def _on_process_death(self) -> list[WorkerEvent]:
        """Account for a process that died: its task has failed, the others begin in a new one."""
        self._abort()
        if not self._waiting:
            return []
        _, argument = self._waiting.popleft()
        for task, later in self._waiting:
            self._send(task, later)
        message = (
            "The analysis process ended unexpectedly. Try again; `slipstand doctor` checks the installation"
        )
        return [TaskFailed(argument, message)]

    def _abort(self) -> None:
        """Have the process end at once, and those that it has started; nobody waits for it."""
        self._drop_lifeline()
        self._detach()

    def _detach(self) -> None:
        """Let the process end once it has nothing left to do."""
        if self._pipe is not None:
            self._pipe.close()
        if self._process is not None:
            self._ending.append((self._process, time.monotonic() + self._END_S))
        self._process = self._pipe = None

    def _reap(self) -> None:
        """Take leave of processes that have ended; one that hangs in foreign code is killed."""
        for process, until_s in self._ending:
            if process.is_alive() and time.monotonic() > until_s:
                process.kill()
                process.join()
        self._ending = [each for each in self._ending if each[0].is_alive()]

    def _drop_lifeline(self) -> None:
        if self._lifeline is not None:
            atexit.unregister(self._lifeline.close)
            self._lifeline.close()
            self._lifeline = None


def _serve(pipe: PipeEnd, lifeline: PipeEnd, code: str) -> None:
    """Do tasks until the other end is closed; `code` is the language of the window."""
    use_language(code)
    exit_with_parent(lifeline, _GRACE_S)
    with contextlib.suppress(EOFError, OSError):
        while True:
            task, argument = pipe.recv()
            try:
                answer = task(argument, lambda progress: pipe.send(("progress", progress)))
            except Exception as error:
                pipe.send(("failed" if is_user_error(error) else "broken", error_report(error)))
            else:
                pipe.send(("done", answer))
