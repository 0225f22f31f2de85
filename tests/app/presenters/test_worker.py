"""Tasks in a process of their own: answers, errors in words, progress, cancelling, and a clean end."""

import multiprocessing
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from app.presenters.faults import Fault
from app.presenters.screen import Progress
from app.presenters.worker import GIVEN_UP, Done, Failure, Report, Worker, Working
from config.schema import ConfigError
from tests.drills.processes import gone, is_alive


def halve(number: int, report: Report) -> float:
    report(Progress("halving", 0.5))
    if number % 2:
        raise ConfigError(f"{number} is odd.\nGive an even one")
    return number / 2


def stumble(_: Any, _report: Report) -> None:
    {}["nothing"]


def tell_process(_: Any, _report: Report) -> int:
    return os.getpid()


def sleep(seconds: float, report: Report) -> None:
    report(Progress("sleeping"))
    time.sleep(seconds)


def die(_: Any, _report: Report) -> None:
    os._exit(3)


@pytest.fixture
def worker() -> Iterator[Worker]:
    made = Worker()
    yield made
    made.close()


def news_until(worker: Worker, count: int, kind: type | tuple[type, ...] = (Done, Failure)) -> list[Any]:
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
    assert worker.busy
    news = news_until(worker, 3)
    half = Progress("halving", 0.5)
    assert news == [
        Working(8, half),
        Done(8, 4.0),
        Working(3, half),
        Failure(3, "3 is odd. Give an even one"),
        Working(10, half),
        Done(10, 5.0),
    ]
    assert not worker.busy


def test_a_fault_of_the_program_itself_is_told_apart_with_all_that_is_known() -> None:
    faults: list[Fault] = []
    worker = Worker(faults.append)
    try:
        worker.submit(stumble, None)
        worker.submit(halve, 3)
        broken, failed = (news for news in news_until(worker, 2) if isinstance(news, Failure))
    finally:
        worker.close()
    assert broken.message.startswith("Slipstand itself failed (KeyError: 'nothing')")
    assert failed.message == "3 is odd. Give an even one"
    (fault,) = faults
    assert fault.words == broken.message
    assert "in stumble" in fault.details


def test_work_is_done_in_another_process_that_ends_with_the_worker(worker: Worker) -> None:
    worker.submit(tell_process, None)
    (done,) = news_until(worker, 1)
    assert done.answer != os.getpid()
    worker.close()
    assert multiprocessing.active_children() == []


def test_cancelling_ends_the_task_at_once_and_says_so(worker: Worker) -> None:
    worker.submit(sleep, 600.0)
    news_until(worker, 1, Working)
    worker.submit(halve, 2)
    worker.cancel()
    assert worker.poll() == [Failure(600.0, GIVEN_UP), Failure(2, GIVEN_UP)]
    worker.submit(halve, 4)
    assert news_until(worker, 1)[-1] == Done(4, 2.0)


def test_a_process_that_dies_fails_its_task_and_the_next_goes_on(worker: Worker) -> None:
    worker.submit(die, "first")
    worker.submit(halve, 4)
    news = news_until(worker, 2)
    assert isinstance(news[0], Failure)
    assert "ended unexpectedly" in news[0].message
    assert news[-1] == Done(4, 2.0)


OWNER = """
import sys, time
sys.path[:0] = {places!r}
from test_worker import sleep, tell_process
from app.presenters.worker import Worker
if __name__ == "__main__":
    worker = Worker()
    worker.submit(tell_process, None)
    while not (news := worker.poll()):
        time.sleep(0.01)
    worker.submit(sleep, 600.0)
    while not worker.poll():
        time.sleep(0.01)
    print(news[0].answer, flush=True)
    time.sleep(600)
"""


def test_a_worker_whose_owner_was_killed_ends_amid_its_task(tmp_path: Path) -> None:
    script = tmp_path / "owner.py"
    script.write_text(OWNER.format(places=[str(Path(__file__).parents[i]) for i in (0, 3)]))
    with subprocess.Popen([sys.executable, str(script)], stdout=subprocess.PIPE, text=True) as owner:
        assert owner.stdout is not None
        worker_id = int(owner.stdout.readline())
        assert is_alive(worker_id)
        owner.kill()
    assert gone(worker_id)


def test_closing_does_not_wait_for_a_long_task(worker: Worker) -> None:
    worker.submit(sleep, 600.0)
    news_until(worker, 1, Working)
    worker.close()
    assert worker.poll() == []
