"""A hundred thousand run files, listed, filtered and analysed: `python benchmarks/many_runs.py`.

Run files of 5 s at 200 Hz, hard links to a few of them, in folders of a thousand. The first listing examines
each file; it is measured on one folder and scaled, since it grows with their number alone. The index of all
of all is then made of those summaries, and the rest is measured on all files. Processor times.

`--analyse 1000,100000`: so many of the runs are analysed and saved on a Dask cluster of two workers, of which
one is killed after a tenth of the runs, and the other stopped for half of each second. Then a hundredth of
the runs is new, and a second pass analyses these alone. Times by the clock.

`--incremental 10000,100000`: so many runs, of which a hundredth is new and the others hold a result, are
given to `slipstand analyze --save --only-new` on such a cluster. Times by the clock, from the start of it.
"""

import argparse
import os
import resource
import signal
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import msgspec
from distributed import Client, LocalCluster
from library import parameters

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from app.runs import listing
from app.runs.analysis_request import AnalysisRequest
from app.runs.batch.executors import ExecutorOptions, open_executor
from app.runs.batch.tasks import AnalysisOutcome, AnalysisTask, analyze_one, analyze_runs
from app.runs.listing import list_runs
from app.runs.run_filter import RunFilter
from app.runs.simulated import write_simulated_run

REPEATS = 3


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--runs", default="10000,100000")
    parser.add_argument("--analyse", help="numbers of runs to analyse; nothing is listed then")
    parser.add_argument(
        "--incremental", help="numbers of runs of which a hundredth is new; nothing else is done"
    )
    chosen = parser.parse_args()
    print(f"load {os.getloadavg()[0]:.1f}, {os.cpu_count()} cores")
    if chosen.analyse:
        print_rows(
            chosen.analyse,
            analysed,
            "first pass, s | ms a run | failed | second pass, s | ms a run | analysed anew",
        )
    elif chosen.incremental:
        print_rows(
            chosen.incremental,
            incremental,
            "analysed | failed | until the new are known, s | until analysed, s",
        )
    else:
        print_rows(
            chosen.runs, row, "first listing, scaled | listed | filtered | one changed | index | memory, MB"
        )


def print_rows(counts: str, measure: Callable[[Path, int], str], header: str) -> None:
    """Print a table with a row for each number of runs, each of a library of its own."""
    print(f"| runs | {header} |\n{'|---' * (header.count('|') + 2)}|")
    for count in map(int, counts.split(",")):
        with tempfile.TemporaryDirectory() as place:
            os.environ["XDG_CACHE_HOME"] = f"{place}/cache"
            print(measure(Path(place) / "library", count), flush=True)


def row(library: Path, count: int) -> str:
    """Measure a library of so many runs; processor times, as cells of a table."""
    files = fill(library, count)
    part = library / "00"
    first_s, found = timed(lambda: list_runs(part))
    first_s *= count / len(found)
    save_index(library, files)
    listed_s = statistics.median(timed(lambda: list_runs(library))[0] for _ in range(REPEATS))
    filtered = RunFilter(series="1FFM0", text="simulated")
    filtered_s = statistics.median(timed(lambda: list_runs(library, filtered))[0] for _ in range(REPEATS))
    files[-1].unlink()
    write_run(files[-1])
    changed_s, _ = timed(lambda: list_runs(library))
    size = listing.index_path(library).stat().st_size
    memory_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    cells = f"{first_s:.0f} | {listed_s:.2f} | {filtered_s:.2f} | {changed_s:.2f} | {size / 1e6:.1f} MB"
    return f"| {count} | {cells} | {memory_mb:.0f} |"


def analysed(library: Path, count: int) -> str:
    """Analyse a library of so many runs twice, the first time with a worker killed and one slow."""
    files = fill(library, count)
    with open_cluster() as (address, killed, slow):
        first_s, outcomes = one_pass(files, address, Disturbance(killed, slow, count // 10))
        for file in files[::100]:  # as a run that was recorded since
            file.unlink()
            write_run(file)
        again_s, again = one_pass(files, address)
    failed = sum(bool(outcome.error) for outcome in (*outcomes, *again))
    anew = sum(not outcome.up_to_date for outcome in again)
    first, second = (f"{took_s:.0f} | {took_s / count * 1e3:.0f}" for took_s in (first_s, again_s))
    return f"| {count} | {first} | {failed} | {second} | {anew} |"


def incremental(library: Path, count: int) -> str:
    """Analyse the new runs of a library of so many, with a worker killed and one slow."""
    files = fill(library, count, with_result=True)
    save_index(library, files)
    new = files[::100]
    for file in new:
        file.unlink()
        write_run(file)
    failed = analysed = 0
    with open_cluster() as (address, killed, slow):
        disturbance = Disturbance(killed, slow, len(new) // 10)
        began_s = time.perf_counter()
        command = [sys.executable, "-m", "app", "analyze", library, "--save", "--only-new", "--dask", address]
        with subprocess.Popen(
            [*command, "--json"], stdout=subprocess.PIPE, stderr=subprocess.PIPE
        ) as process:
            process.stderr.readline()  # how many are up to date
            known_s = time.perf_counter() - began_s
            for line in process.stdout:
                failed += line.startswith(b'    "error":')
                if line.startswith(b'    "run":'):
                    analysed += 1
                    disturbance.on_run(analysed)
        took_s = time.perf_counter() - began_s
        disturbance.end()
    return f"| {count} | {analysed} | {failed} | {known_s:.1f} | {took_s:.1f} |"


@contextmanager
def open_cluster() -> Iterator[tuple[str, int, int]]:
    """Address of a Dask cluster of two workers, and the numbers of their processes."""
    with LocalCluster(n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address=None) as cluster:
        with Client(cluster.scheduler_address, set_as_default=False) as client:
            first, second = client.run(os.getpid).values()
        yield cluster.scheduler_address, first, second


class Disturbance:
    """Kills a process once `after` runs are done, and stops another for half of each second."""

    def __init__(self, killed: int, slow: int, after: int) -> None:
        self._killed, self._slow, self._after = killed, slow, after
        self._has_ended = threading.Event()
        self._thread = threading.Thread(target=self._slow_down)
        self._thread.start()

    def on_run(self, done: int) -> None:
        """Note that so many runs are done."""
        if done == self._after:
            os.kill(self._killed, signal.SIGKILL)

    def end(self) -> None:
        """Leave the slow process alone."""
        self._has_ended.set()
        self._thread.join()

    def _slow_down(self) -> None:
        while not self._has_ended.wait(0.5):
            os.kill(self._slow, signal.SIGSTOP)
            self._has_ended.wait(0.5)
            os.kill(self._slow, signal.SIGCONT)


def one_pass(
    files: list[Path], address: str, disturbance: Disturbance | None = None
) -> tuple[float, list[AnalysisOutcome]]:
    """Time (s) of `slipstand analyze --save --dask`, and what came of each run without its document."""
    tasks = [AnalysisTask(str(path), AnalysisRequest(classical=False), save=True) for path in files]
    outcomes: list[AnalysisOutcome] = []
    began_s = time.perf_counter()
    try:
        with open_executor(ExecutorOptions(dask=address), len(tasks)) as executor:
            for done, outcome in enumerate(analyze_runs(tasks, executor), 1):
                outcomes.append(msgspec.structs.replace(outcome, document=None))
                if disturbance is not None:
                    disturbance.on_run(done)
    finally:
        if disturbance is not None:
            disturbance.end()
    return time.perf_counter() - began_s, outcomes


def save_index(library: Path, files: list[Path]) -> None:
    """Make the index of all files by the summary of one."""
    (model, *_) = list_runs(files[0].parent)
    stamp = (files[0].stat().st_size, files[0].stat().st_mtime_ns)
    index = {str(path): (stamp, msgspec.structs.replace(model, path=str(path))) for path in files}
    listing._save_index(library, index)


def write_run(path: Path) -> None:
    """Write a short run without a result."""
    write_simulated_run(path, parameters().simulate(5.0), parameters(), series="1FFM0", rate_hz=200.0)


def fill(library: Path, count: int, *, with_result: bool = False) -> list[Path]:
    """Paths of hard links to one short run: a file system takes some ten thousand links of a file."""
    files: list[Path] = []
    for number in range(count):
        folder = library / f"{number // 1000:02d}"
        folder.mkdir(parents=True, exist_ok=True)
        path = folder / f"run_{number:06d}.h5"
        if number % 20_000 == 0:
            write_run(path)
            if with_result:
                analyze_one(AnalysisTask(str(path), save=True))
            os.utime(path, ns=(10**18, 10**18))
        else:
            os.link(files[number // 20_000 * 20_000], path)
        files.append(path)
    return files


def timed(work):
    """Processor time of this process and of those that it waited for, and what the work returns."""
    before = used_s()
    result = work()
    return used_s() - before, result


def used_s() -> float:
    own, children = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return own.ru_utime + own.ru_stime + children.ru_utime + children.ru_stime


if __name__ == "__main__":
    main()
