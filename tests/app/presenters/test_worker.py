"""Tasks in a process of their own: answers, errors in words, progress, cancelling, and a clean end."""

import ctypes
import multiprocessing
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import wait
from pathlib import Path
from typing import Any

import pytest

from app.presenters.base import Progress, ReportProgress
from app.presenters.error_reports import ErrorReport
from app.presenters.events import TaskDone, TaskFailed, TaskProgress
from app.presenters.worker import CANCELLED, Worker, WorkerPool
from app.runs.batch.executors import ProcessExecutor
from config.schema import ConfigError
from messages.message import message
from tests.drills.processes import gone, is_alive


def halve(number: int, report: ReportProgress) -> float:
    report(Progress("halving", 0.5))
    if number % 2:
        raise ConfigError(f"{number} is odd.\nGive an even one")
    return number / 2


def stumble(_: Any, _report: ReportProgress) -> None:
    {}["nothing"]


def tell_process(_: Any, _report: ReportProgress) -> int:
    return os.getpid()


def sleep(seconds: float, report: ReportProgress) -> None:
    report(Progress("sleeping"))
    time.sleep(seconds)


def die(_: Any, _report: ReportProgress) -> None:
    os._exit(3)


@pytest.fixture
def worker() -> Iterator[Worker]:
    made = Worker()
    yield made
    made.close()


def news_until(
    worker: Worker, count: int, kind: type | tuple[type, ...] = (TaskDone, TaskFailed)
) -> list[Any]:
    """News until `count` of a kind have come."""
    news: list[Any] = []
    deadline = time.monotonic() + 20.0
    while sum(isinstance(item, kind) for item in news) < count:
        assert time.monotonic() < deadline, news
        news += worker.poll()
        time.sleep(0.005)
    return news


def test_tasks_are_done_in_turn_with_progress_and_errors_in_words(worker: Worker) -> None:
    assert worker.poll() == []
    for number in (8, 3, 10):
        worker.submit(halve, number)
    assert worker.is_busy
    news = news_until(worker, 3)
    half = Progress("halving", 0.5)
    assert news == [
        TaskProgress(8, half),
        TaskDone(8, 4.0),
        TaskProgress(3, half),
        TaskFailed(3, message("{text}", text="3 is odd. Give an even one")),
        TaskProgress(10, half),
        TaskDone(10, 5.0),
    ]
    assert not worker.is_busy


def test_a_fault_of_the_program_itself_is_told_apart_with_all_that_is_known() -> None:
    faults: list[ErrorReport] = []
    worker = Worker(faults.append)
    try:
        worker.submit(stumble, None)
        worker.submit(halve, 3)
        broken, failed = (news for news in news_until(worker, 2) if isinstance(news, TaskFailed))
    finally:
        worker.close()
    assert str(broken.message).startswith("Slipstand itself failed (KeyError: 'nothing')")
    assert str(failed.message) == "3 is odd. Give an even one"
    (fault,) = faults
    assert fault.message == broken.message
    assert "in stumble" in fault.details


def test_work_is_done_in_another_process_that_ends_with_the_worker(worker: Worker) -> None:
    worker.submit(tell_process, None)
    (done,) = news_until(worker, 1)
    assert done.answer != os.getpid()
    worker.close()
    assert multiprocessing.active_children() == []


def test_cancelling_ends_the_task_at_once_and_says_so(worker: Worker) -> None:
    worker.submit(sleep, 600.0)
    news_until(worker, 1, TaskProgress)
    worker.submit(halve, 2)
    worker.cancel()
    assert worker.poll() == [TaskFailed(argument, CANCELLED, is_cancelled=True) for argument in (600.0, 2)]
    worker.submit(halve, 4)
    assert news_until(worker, 1)[-1] == TaskDone(4, 2.0)


def test_a_process_that_dies_fails_its_task_and_the_next_goes_on(worker: Worker) -> None:
    worker.submit(die, "first")
    worker.submit(halve, 4)
    news = news_until(worker, 2)
    assert isinstance(news[0], TaskFailed)
    assert "ended unexpectedly" in str(news[0].message)
    assert news[-1] == TaskDone(4, 2.0)


def keep_a_crew(_: Any, report: ReportProgress) -> None:
    """Wait with two processes that wait too; the numbers of all three are the progress."""
    crew = ProcessExecutor(2, nothing)
    try:
        crew.submit(nothing_of, 0).result()
        waiting = [crew.submit(time.sleep, 600.0) for _ in range(2)]
        numbers = [child.pid for child in multiprocessing.active_children()]
        report(Progress(" ".join(str(number) for number in (os.getpid(), *numbers))))
        wait(waiting)
    finally:
        crew.close(now=True)


def nothing() -> None:
    pass


def nothing_of(_: int) -> None:
    pass


def with_a_crew(worker: Worker) -> list[int]:
    """Have a task begin that keeps a crew; the worker's process and those of the crew."""
    worker.submit(keep_a_crew, None)
    (working,) = news_until(worker, 1, TaskProgress)
    numbers = [int(word) for word in working.progress.text.split()]
    assert len(set(numbers)) == 3
    return numbers


def test_giving_up_returns_at_once_and_leaves_no_process_of_the_crew(worker: Worker) -> None:
    running = with_a_crew(worker)
    worker.cancel()
    assert worker.poll() == [TaskFailed(None, CANCELLED, is_cancelled=True)]
    assert all(gone(number) for number in running)


def test_closing_leaves_no_process_of_the_crew(worker: Worker) -> None:
    running = with_a_crew(worker)
    worker.close()
    assert all(gone(number) for number in running)


@pytest.mark.skipif(os.name == "nt", reason="there is no SIGKILL")
def test_a_worker_that_is_killed_takes_its_crew_along(worker: Worker) -> None:
    running = with_a_crew(worker)
    os.kill(running[0], signal.SIGKILL)
    (failure,) = news_until(worker, 1)
    assert "ended unexpectedly" in str(failure.message)
    assert all(gone(number) for number in running)


def hang(_: Any, report: ReportProgress) -> None:
    """Work that hears nobody, as foreign code can."""
    report(Progress(str(os.getpid())))
    ctypes.PyDLL(None).sleep(600)  # keeps the interpreter lock


@pytest.mark.skipif(os.name == "nt", reason="needs the C library's sleep")
def test_a_process_that_hangs_in_foreign_code_is_killed_in_the_end(worker: Worker) -> None:
    worker.submit(hang, None)
    (working,) = news_until(worker, 1, TaskProgress)
    worker.close()
    assert not is_alive(int(working.progress.text))


OWNER = """
import sys, time
sys.path[:0] = {places!r}
from test_worker import with_a_crew
from app.presenters.worker import Worker
if __name__ == "__main__":
    running = with_a_crew(Worker())
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
        owner.wait(20.0)
    assert all(gone(number) for number in running)


def test_closing_does_not_wait_for_a_long_task(worker: Worker) -> None:
    worker.submit(sleep, 600.0)
    news_until(worker, 1, TaskProgress)
    worker.close()
    assert worker.poll() == []


def test_workers_of_a_pool_share_processes_as_long_as_one_works_at_a_time() -> None:
    pool = WorkerPool()
    first, second = Worker(pool=pool), Worker(pool=pool)
    try:
        for worker in (first, second, first):
            worker.submit(tell_process, None)
        used = [*news_until(first, 2), *news_until(second, 1)]
        assert len({done.answer for done in used}) == 2, "both worked at the same time"
        first.submit(tell_process, None)
        (done,) = news_until(first, 1)
        second.submit(tell_process, None)
        (other,) = news_until(second, 1)
        assert done.answer == other.answer
        first.submit(sleep, 600.0)
        news_until(first, 1, TaskProgress)
        second.submit(halve, 4)
        first.cancel()
        assert news_until(second, 1)[-1] == TaskDone(4, 2.0), "only the tasks of one worker are cancelled"
    finally:
        for worker in (first, second):
            worker.close()
        pool.close()
    assert multiprocessing.active_children() == []


def test_a_shared_process_that_died_while_idle_is_replaced() -> None:
    pool = WorkerPool()
    worker = Worker(pool=pool)
    try:
        worker.submit(tell_process, None)
        (done,) = news_until(worker, 1)
        os.kill(done.answer, signal.SIGTERM)
        while multiprocessing.active_children():  # until the system has reaped it
            time.sleep(0.01)
        worker.submit(halve, 4)
        assert news_until(worker, 1)[-1] == TaskDone(4, 2.0)
    finally:
        worker.close()
        pool.close()
