"""A Dask cluster of two workers on loopback: the same results, also where one worker is killed."""

import importlib
import os
import signal
import sys
from pathlib import Path

import pytest
from batch_kit import doubled_slowly

from app.runs.analysis_request import AnalysisRequest
from app.runs.batch.executors import ExecutorOptions, open_executor, ordered_map
from app.runs.batch.tasks import AnalysisTask, analyze_runs
from app.runs.errors import ClusterError, ExtraMissingError

distributed = pytest.importorskip("distributed")

pytestmark = [
    pytest.mark.slow,
    # Sockets of a killed worker are closed when they are collected.
    pytest.mark.filterwarnings("ignore:unclosed:ResourceWarning"),
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
]


@pytest.fixture(scope="module")
def address():
    """Scheduler of two worker processes, which find the kit of these tests."""
    before = os.environ.get("PYTHONPATH", "")
    os.environ["PYTHONPATH"] = os.pathsep.join([str(Path(__file__).parent), *sys.path[:1], before])
    try:
        with distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address="127.0.0.1:0"
        ) as cluster:
            yield cluster.scheduler_address
    finally:
        os.environ["PYTHONPATH"] = before


def test_results_are_the_same_in_the_same_order_whoever_works(address, short_runs):
    request = AnalysisRequest(classical=False)
    tasks = [AnalysisTask(str(path), request) for path in (*short_runs, short_runs[0].with_name("nix.h5"))]
    outcomes = []
    for options in (ExecutorOptions(jobs=1), ExecutorOptions(jobs=2), ExecutorOptions(dask=address)):
        with open_executor(options, len(tasks)) as crew:
            outcomes.append(list(analyze_runs(tasks, crew)))
    here, processes, cluster = outcomes
    assert [Path(outcome.run).name for outcome in here] == [*(path.name for path in short_runs), "nix.h5"]
    assert [bool(outcome.error) for outcome in here] == [False, False, True]
    for outcome in (*here, *processes, *cluster):
        if outcome.document is not None:
            del outcome.document["origin"]["date"]
    assert processes == here
    assert cluster == here


def test_a_worker_killed_in_the_middle_costs_nothing(address):
    with open_executor(ExecutorOptions(dask=address), 40) as crew:
        answers = ordered_map(crew, doubled_slowly, range(40))
        found = [next(answers)]
        with distributed.Client(address, set_as_default=False) as client:
            pids = client.run(os.getpid)
        os.kill(next(iter(pids.values())), getattr(signal, "SIGKILL", signal.SIGTERM))
        found += answers
    assert found == [2 * number for number in range(40)]


@pytest.mark.parametrize("address", ["nonsense", "tcp://127.0.0.1:1", "http://127.0.0.1:1"])
def test_nobody_at_the_address_is_said_in_a_line(address, monkeypatch):
    monkeypatch.setattr("app.runs.batch.executors._CLUSTER_TIMEOUT_S", 0.3)
    with (
        pytest.raises(ClusterError, match="no Dask scheduler answers") as fault,
        open_executor(ExecutorOptions(dask=address), 3),
    ):
        pass
    assert "dask scheduler" in str(fault.value)
    assert "\n" not in str(fault.value)


def test_without_distributed_the_extra_is_named(monkeypatch):
    def missing(name):
        raise ImportError(name)

    monkeypatch.setattr(importlib, "import_module", missing)
    with (
        pytest.raises(ExtraMissingError, match=r"slipstand\[cluster\]"),
        open_executor(ExecutorOptions(dask="tcp://x:1"), 3),
    ):
        pass
