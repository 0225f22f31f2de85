"""Tasks in a process of their own: answers, errors in words, progress, cancelling, and a clean end."""

import ctypes
import errno
import multiprocessing
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import wait
from pathlib import Path
from typing import Any

import pytest

from app.presenters.base import Progress, ReportProgress, TaskFailure
from app.presenters.error_reports import ErrorReport
from app.presenters.worker import CANCELLED, LazyModule, Worker, WorkerPool
from app.runs.batch.executors import ProcessExecutor
from config.schema import ConfigError
from messages.message import message
from tests.drills.processes import gone, is_alive
from tests.waiting import PATIENCE_S, wait_until


def halve(number: int, report: ReportProgress) -> float:
    report(Progress("halving", 0.5))
    if number % 2:
        raise ConfigError(f"{number} is odd.\nGive an even one")
    return number / 2


def stumble() -> None:
    {}["nothing"]


def tell_process() -> int:
    return os.getpid()


def sleep(seconds: float, report: ReportProgress) -> None:
    report(Progress("sleeping"))
    time.sleep(seconds)


def die() -> None:
    os._exit(3)


class Answers:
    """Callbacks of tasks: what came, in order."""

    def __init__(self, worker: Worker) -> None:
        self.worker = worker
        self.done: list[Any] = []
        self.failed: list[TaskFailure] = []
        self.progress: list[Any] = []
        self.all: list[Any] = []

    def submit(self, function: Callable[..., Any], *arguments: Any, reports: bool = False) -> None:
        more = {"progress": self._adding_to(self.progress)} if reports else {}
        done, failed = self._adding_to(self.done), self._adding_to(self.failed)
        self.worker.submit(function, *arguments, done=done, failed=failed, **more)

    def wait(self, *, ended: int = 0, progress: int = 0) -> None:
        """Poll until as many tasks have ended, and as much progress was reported, as wanted."""

        def has_come() -> bool:
            self.worker.poll()
            return len(self.done) + len(self.failed) >= ended and len(self.progress) >= progress

        wait_until(has_come, lambda: self.all)

    def _adding_to(self, answers: list[Any]) -> Callable[[Any], None]:
        def add(answer: Any) -> None:
            answers.append(answer)
            self.all.append(answer)

        return add


@pytest.fixture
def worker() -> Iterator[Worker]:
    made = Worker()
    yield made
    made.close()


@pytest.fixture
def answers(worker: Worker) -> Answers:
    return Answers(worker)


def test_tasks_are_done_in_turn_with_progress_and_errors_in_words(worker: Worker, answers: Answers) -> None:
    for number in (8, 3, 10):
        answers.submit(halve, number, reports=True)
    assert worker.is_busy
    answers.wait(ended=3)
    half = Progress("halving", 0.5)
    odd = TaskFailure(message("{text}", text="3 is odd. Give an even one"))
    assert answers.all == [half, 4.0, half, odd, half, 5.0]
    assert not worker.is_busy


def test_a_task_gets_its_arguments_and_need_have_no_callback(worker: Worker, answers: Answers) -> None:
    worker.submit(tell_process)
    answers.submit(divmod, 7, 2)
    answers.submit(LazyModule("operator").add, 1, 2)
    answers.wait(ended=2)
    assert answers.done == [(3, 1), 3]


def test_a_callback_may_submit_and_cancel(worker: Worker, answers: Answers) -> None:
    def on_done(_: object) -> None:
        worker.cancel()
        answers.submit(divmod, 7, 2)

    worker.submit(tell_process, done=on_done)
    answers.submit(tell_process)
    answers.wait(ended=2)
    assert answers.all == [TaskFailure(CANCELLED, is_cancelled=True), (3, 1)]


def test_a_fault_of_the_program_itself_is_told_apart_with_all_that_is_known() -> None:
    faults: list[ErrorReport] = []
    worker = Worker(faults.append)
    answers = Answers(worker)
    try:
        answers.submit(stumble)
        answers.submit(halve, 3, reports=True)
        answers.wait(ended=2)
    finally:
        worker.close()
    broken, failed = answers.failed
    assert str(broken.message).startswith("Slipstand itself failed (KeyError: 'nothing')")
    assert str(failed.message) == "3 is odd. Give an even one"
    (fault,) = faults
    assert fault.message == broken.message
    assert "in stumble" in fault.details


def test_work_is_done_in_another_process_that_ends_with_the_worker(worker: Worker, answers: Answers) -> None:
    answers.submit(tell_process)
    answers.wait(ended=1)
    assert answers.done != [os.getpid()]
    worker.close()
    assert multiprocessing.active_children() == []


def test_cancelling_ends_the_task_at_once_and_says_so(worker: Worker, answers: Answers) -> None:
    answers.submit(sleep, 600.0, reports=True)
    answers.wait(progress=1)
    answers.submit(halve, 2, reports=True)
    worker.cancel()
    worker.poll()
    assert answers.failed == [TaskFailure(CANCELLED, is_cancelled=True)] * 2
    answers.submit(halve, 4, reports=True)
    answers.wait(ended=3)
    assert answers.done == [2.0]


def test_a_process_that_dies_fails_its_task_and_the_next_goes_on(answers: Answers) -> None:
    answers.submit(die)
    answers.submit(halve, 4, reports=True)
    answers.wait(ended=2)
    assert isinstance(answers.all[0], TaskFailure)
    assert "ended unexpectedly" in str(answers.all[0].message)
    assert answers.done == [2.0]


def keep_a_crew(report: ReportProgress) -> None:
    """Wait with two processes that wait too; the numbers of all three are the progress."""
    crew = ProcessExecutor(2)
    try:
        crew.submit(nothing_of, 0).result()
        waiting = [crew.submit(time.sleep, 600.0) for _ in range(2)]
        numbers = [child.pid for child in multiprocessing.active_children()]
        report(Progress(" ".join(str(number) for number in (os.getpid(), *numbers))))
        wait(waiting)
    finally:
        crew.close(now=True)


def nothing_of(_: int) -> None:
    pass


def with_a_crew(answers: Answers) -> list[int]:
    """Have a task begin that keeps a crew; the worker's process and those of the crew."""
    answers.submit(keep_a_crew, reports=True)
    answers.wait(progress=1)
    numbers = [int(word) for word in answers.progress[-1].text.split()]
    assert len(set(numbers)) == 3
    return numbers


def test_giving_up_returns_at_once_and_leaves_no_process_of_the_crew(
    worker: Worker, answers: Answers
) -> None:
    running = with_a_crew(answers)
    worker.cancel()
    worker.poll()
    assert answers.failed == [TaskFailure(CANCELLED, is_cancelled=True)]
    assert all(gone(number) for number in running)


def test_closing_leaves_no_process_of_the_crew(worker: Worker, answers: Answers) -> None:
    running = with_a_crew(answers)
    worker.close()
    assert all(gone(number) for number in running)


@pytest.mark.skipif(os.name == "nt", reason="there is no SIGKILL")
def test_a_worker_that_is_killed_takes_its_crew_along(answers: Answers) -> None:
    running = with_a_crew(answers)
    os.kill(running[0], signal.SIGKILL)
    answers.wait(ended=1)
    assert "ended unexpectedly" in str(answers.failed[0].message)
    assert all(gone(number) for number in running)


def hang(report: ReportProgress) -> None:
    """Work that hears nobody, as foreign code can."""
    report(Progress(str(os.getpid())))
    ctypes.PyDLL(None).sleep(600)  # keeps the interpreter lock


@pytest.mark.skipif(os.name == "nt", reason="needs the C library's sleep")
def test_a_process_that_hangs_in_foreign_code_is_killed_in_the_end(worker: Worker, answers: Answers) -> None:
    answers.submit(hang, reports=True)
    answers.wait(progress=1)
    worker.close()
    assert not is_alive(int(answers.progress[0].text))


OWNER = """
import sys, time
sys.path[:0] = {places!r}
from test_worker import Answers, with_a_crew
from app.presenters.worker import Worker
if __name__ == "__main__":
    running = with_a_crew(Answers(Worker()))
    print(*running, flush=True)
    if sys.argv[1] == "stay":
        time.sleep(600)
"""


@pytest.mark.parametrize("end", ["stay", "leave"])
def test_nothing_is_left_of_an_owner_that_was_killed_or_forgot_to_close(tmp_path: Path, end: str) -> None:
    script = tmp_path / "owner.py"
    script.write_text(OWNER.format(places=[str(Path(__file__).parents[i]) for i in (0, 3)]))
    with subprocess.Popen([sys.executable, str(script), end], stdout=subprocess.PIPE, text=True) as owner:
        assert owner.stdout is not None
        running = [int(word) for word in owner.stdout.readline().split()]
        assert len(running) == 3
        if end == "stay":
            assert all(is_alive(number) for number in running)
            owner.kill()
        owner.wait(PATIENCE_S)
    assert all(gone(number) for number in running)


def test_closing_does_not_wait_for_a_long_task(worker: Worker, answers: Answers) -> None:
    answers.submit(sleep, 600.0, reports=True)
    answers.wait(progress=1)
    worker.close()
    worker.poll()
    assert answers.failed == answers.done == []


def test_workers_of_a_pool_share_processes_as_long_as_one_works_at_a_time() -> None:
    pool = WorkerPool()
    first, second = Answers(Worker(pool=pool)), Answers(Worker(pool=pool))
    try:
        for answers in (first, second, first):
            answers.submit(tell_process)
        first.wait(ended=2)
        second.wait(ended=1)
        assert len({*first.done, *second.done}) == 2, "both worked at the same time"
        first.submit(tell_process)
        first.wait(ended=3)
        second.submit(tell_process)
        second.wait(ended=2)
        assert first.done[-1] == second.done[-1]
        first.submit(sleep, 600.0, reports=True)
        first.wait(progress=1)
        second.submit(halve, 4, reports=True)
        first.worker.cancel()
        second.wait(ended=3)
        assert second.done[-1] == 2.0, "only the tasks of one worker are cancelled"
    finally:
        for answers in (first, second):
            answers.worker.close()
        pool.close()
    assert multiprocessing.active_children() == []


def test_a_shared_process_that_died_while_idle_is_replaced() -> None:
    pool = WorkerPool()
    answers = Answers(Worker(pool=pool))
    try:
        answers.submit(tell_process)
        answers.wait(ended=1)
        os.kill(answers.done[0], signal.SIGTERM)
        while multiprocessing.active_children():  # until the system has reaped it
            time.sleep(0.01)
        answers.submit(halve, 4, reports=True)
        answers.wait(ended=2)
        assert answers.done[-1] == 2.0
    finally:
        answers.worker.close()
        pool.close()


def test_a_task_whose_process_does_not_start_fails_and_is_not_waited_for(monkeypatch):
    worker = Worker()
    answers = Answers(worker)
    with monkeypatch.context() as lacking:
        lacking.setattr("multiprocessing.connection.Pipe", _no_pipe)
        answers.submit(tell_process)
        assert not worker.is_busy
        worker.poll()
    (failure,) = answers.failed
    assert "too many files are open" in str(failure.message)
    worker.close()


def _no_pipe(*_: object, **_options: object) -> None:
    raise OSError(errno.EMFILE, "Too many open files")
