"""Many tasks in worker processes: order, bounds, failures, dead workers, interruption."""

import os
import subprocess
import sys
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from functools import partial

import pytest
from batch_kit import doubled, failing, fatal, rewriting_for_ever, waiting, waiting_apart
from runs_kit import small_run

from app.runs.batch.executors import (
    Executor,
    ExecutorOptions,
    FailedItem,
    ProcessExecutor,
    open_executor,
    ordered_map,
)
from app.runs.batch.tasks import AnalysisTask, analyze_runs
from tests.waiting import wait_until


class Unhurried(Executor):
    """A crew whose work is done when somebody looks for the answer; counts what is in flight."""

    workers = 2
    in_process = False

    def __init__(self):
        self.given = []

    def submit(self, work, item):
        self.given.append(item)
        future = Future()
        future.set_result(work(item))
        return future

    def renew(self):
        raise AssertionError("nobody died")


class Broken(Unhurried):
    """One that dies at an item, whatever is in flight then with it."""

    def __init__(self, fatal_item):
        super().__init__()
        self.fatal_item = fatal_item
        self.renewed = 0

    def submit(self, work, item):
        if self.fatal_item in (item, *self.given):
            future = Future()
            future.set_exception(BrokenProcessPool("a process died"))
            self.given.append(item)
            return future
        return super().submit(work, item)

    def renew(self):
        self.renewed += 1
        self.given = []


@pytest.fixture
def processes():
    crew = ProcessExecutor(2)
    yield crew
    crew.close(now=True)


def test_answers_come_in_order_and_few_are_in_flight():
    crew = Unhurried()
    ahead = []
    for number, answer in enumerate(ordered_map(crew, doubled, iter(range(200)))):
        assert answer == 2 * number
        ahead.append(len(crew.given) - number)
    assert len(ahead) == 200
    assert max(ahead) <= 17


def test_in_this_process_each_is_done_when_it_is_asked_for():
    done = []
    answers = ordered_map(Executor(), done.append, range(10))
    next(answers)
    assert done == [0]


def test_work_that_fails_is_told_with_its_item():
    answers = list(ordered_map(Executor(), failing, range(5)))
    assert answers[:3] == [0, 1, 2]
    assert answers[3].item == 3
    assert str(answers[3].message) == "its worker failed (ValueError: three is too many)"
    assert answers[4] == 4


def test_what_was_in_flight_with_a_death_is_done_again_one_by_one():
    crew = Broken(5)
    answers = list(ordered_map(crew, doubled, range(40)))
    assert [answer for answer in answers if not isinstance(answer, FailedItem)] == [
        2 * number for number in range(40) if number != 5
    ]
    assert isinstance(answers[5], FailedItem)
    assert "twice" in str(answers[5].message)
    assert crew.renewed == 2


def test_a_process_that_dies_costs_one_run_at_most(processes, tmp_path):
    items = [(number, str(tmp_path)) for number in range(8)]
    answers = list(ordered_map(processes, fatal, items))
    assert [answer for answer in answers if isinstance(answer, int)] == [0, 1, 2, 3, 5, 6, 7]
    assert answers[4].item == items[4]


def test_work_is_given_up_at_once_and_leaves_nothing(tmp_path):
    crew = ProcessExecutor(2)
    futures = [crew.submit(waiting, str(tmp_path)) for _ in range(2)]
    wait_until(lambda: len(list(tmp_path.glob("*.half"))) == 2)
    running = [int(path.stem) for path in tmp_path.glob("*.half")]
    assert len(running) == 2
    crew.close(now=True)
    assert all(future.done() for future in futures)
    if os.name != "nt":  # Windows wakes no sleeper; real work does not sleep
        assert list(tmp_path.iterdir()) == []
        for pid in running:
            with pytest.raises(ProcessLookupError):
                os.kill(pid, 0)


@pytest.mark.skipif(os.name == "nt", reason="Windows wakes no sleeper; real work does not sleep")
def test_work_that_waits_in_the_queue_is_not_begun_once_it_is_given_up(tmp_path):
    crew = ProcessExecutor(1)
    for _ in range(4):
        crew.submit(waiting_apart, str(tmp_path))
    wait_until(lambda: list(tmp_path.glob("*.half")))
    crew.close(now=True)
    assert [path.suffix for path in tmp_path.iterdir()] == [".begun"]


@pytest.mark.skipif(os.name == "nt", reason="Windows removes no file that is open")
def test_a_change_of_a_run_that_hangs_leaves_nothing_when_it_is_given_up(tmp_path, metadata):
    run = tmp_path / "run.h5"
    small_run(run, metadata)
    crew = ProcessExecutor(1)
    begun = tmp_path / "begun"
    crew.submit(partial(rewriting_for_ever, change_begins=str(begun)), str(run))
    wait_until(begun.exists)
    assert len(list(tmp_path.iterdir())) == 4, "the copy and its lock"
    crew.close(now=True)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["begun", "run.h5"]


def test_few_runs_are_done_here_and_many_in_processes():
    with open_executor(ExecutorOptions(), 3) as crew:
        assert crew.in_process
    with open_executor(ExecutorOptions(jobs=2), 3) as crew:
        assert crew.workers == 2
    with open_executor(ExecutorOptions(jobs=64), 3) as crew:
        assert crew.workers == 3


@pytest.mark.parametrize("debug", ["", "1"])
def test_a_crash_in_a_worker_prints_its_traceback_where_that_is_wanted(
    processes, short_runs, monkeypatch, capfd, debug
):
    monkeypatch.setenv("SLIPSTAND_DEBUG", debug)
    no_request = AnalysisTask(str(short_runs[0]), None)
    (outcome,) = analyze_runs([no_request], processes)
    assert outcome.error.template.startswith("Slipstand itself failed")
    printed = capfd.readouterr().err
    assert ("Traceback (most recent call last)" in printed) == bool(debug)


_ENDED_WHILE_IT_LOADS = """
import multiprocessing, os, signal, sys
from app.runs.batch.parent_watchdog import exit_with_parent

lifeline, _ = multiprocessing.Pipe(duplex=False)
exit_with_parent(lifeline)

class Loading:
    def __del__(self):  # an exception in it is reported and goes no further, as in a callback of LLVM
        try:
            signal.raise_signal(signal.SIGTERM)
        finally:
            os.write(2, b"LLVM ERROR: cut off")

Loading()
"""


@pytest.mark.skipif(os.name == "nt", reason="SIGTERM ends a process at once there")
def test_a_process_that_is_ended_while_it_loads_code_reports_nothing():
    command = [sys.executable, "-c", _ENDED_WHILE_IT_LOADS]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    assert ended.stderr == ""
