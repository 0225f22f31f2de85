"""Many runs: `python benchmarks/campaign.py` prints the tables of docs/benchmarks.md.

Runs a second of one process that has loaded the analysis, of two that load it, and of a Dask cluster of two
workers on loopback, each from its start to its end; the command with one and two processes; what a second
pass takes, which finds everything up to date; memory over thousands of runs, by copies of short ones; and a
campaign of 108 runs from files to the PDF of its report.
"""

import argparse
import datetime
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

os.environ["OMP_NUM_THREADS"] = "1"  # as `slipstand` does, before numpy
os.environ["OPENBLAS_NUM_THREADS"] = "1"
sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from app.runs.analysis_request import AnalysisRequest
from app.runs.batch.executors import ExecutorOptions, open_executor
from app.runs.batch.tasks import AnalysisTask, analyze_one, analyze_runs
from app.runs.campaign.collect import CollectOptions, collect_runs
from app.simulated_stand.synthetic_campaign import CampaignOptions, plan_tests, write_test
from config.files import load_gauges, load_stand

REQUEST = AnalysisRequest(classical=False)
START = datetime.datetime(2026, 11, 21, 8, 0, tzinfo=datetime.UTC)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=108, help="of Table 1, for the rates (%(default)s)")
    parser.add_argument("--many", type=int, default=10_000, help="for the memory (%(default)s)")
    parser.add_argument("--only", choices=("rates", "command", "memory", "report"), help="one table alone")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as place:
        if options.only in (None, "rates"):
            rates(Path(place) / "rates", options.runs)
        if options.only in (None, "command"):
            command(Path(place) / "command")
        if options.only in (None, "memory"):
            memory(Path(place) / "many", options.many)
        if options.only in (None, "report"):
            report(Path(place) / "report")


def rates(folder: Path, count: int) -> None:
    paths = campaign(folder)[:count]
    here = timed(paths, ExecutorOptions(jobs=1))
    rows = [("one process", here)]
    rows.append(("two processes", timed(paths, ExecutorOptions(jobs=2))))
    with cluster() as address:
        rows.append(("Dask cluster of two workers", timed(paths, ExecutorOptions(dask=address))))
        rows.append(("the same once they are warm", timed(paths, ExecutorOptions(dask=address))))
    print(f"| {len(paths)} runs of 10 s at 1 kHz | s | runs/s | against one process | processor ms a run |")
    print("|---|---|---|---|---|")
    for name, (took_s, worked_s) in rows:
        worked = f"{worked_s / len(paths) * 1e3:.0f}" if worked_s else ""
        print(f"| {name} | {took_s:.1f} | {len(paths) / took_s:.2f} | {here[0] / took_s:.2f} x | {worked} |")
    saved = pass_of(paths, save=True)
    again = pass_of(paths, save=True)
    print(f"\nWith `--save` {saved / len(paths) * 1e3:.0f} ms a run in two processes;", end=" ")
    print(f"a second pass, all up to date: {again / len(paths) * 1e3:.0f} ms.\n")


def timed(paths: list[Path], options: ExecutorOptions) -> tuple[float, float]:
    """Time from start to end (s), and processor time with that of ended children (s)."""
    tasks = [AnalysisTask(str(path), REQUEST) for path in paths]
    began, worked = time.perf_counter(), processor_s()
    with open_executor(options, len(tasks)) as crew:
        failed = [outcome for outcome in analyze_runs(tasks, crew) if outcome.error]
    if failed:
        raise SystemExit(f"{len(failed)} runs failed: {failed[0].error}")
    return time.perf_counter() - began, 0.0 if options.dask else processor_s() - worked


def pass_of(paths: list[Path], *, save: bool) -> float:
    began = time.perf_counter()
    gathered = collect_runs(paths, CollectOptions(ExecutorOptions(jobs=2), save=save))
    if gathered.failures:
        raise SystemExit(gathered.failures[0].error)
    return time.perf_counter() - began


def command(folder: Path) -> None:
    """The same by the command line, with all methods, from the start of the command to its end."""
    campaign(folder)
    print("| `slipstand analyze`, 108 runs | s | against one process |")
    print("|---|---|---|")
    took = []
    for jobs in (1, 2):
        command = [sys.executable, "-m", "app", "analyze", str(folder), "--jobs", str(jobs), "--json"]
        began = time.perf_counter()
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        took.append(time.perf_counter() - began)
        print(f"| processes: {jobs} | {took[-1]:.1f} | {took[0] / took[-1]:.2f} x |")
    print()


def memory(folder: Path, count: int) -> None:
    """Resident memory of this process, which does the work, as the runs go by; then of one that gathers."""
    folder.mkdir()
    options = CampaignOptions(series=("1FFM0",), repeats=1, rate_hz=200.0, duration_s=3.0)
    (test,) = plan_tests(options, load_stand(), load_gauges(), folder, START)
    first = Path(write_test(test).path)
    analyze_one(AnalysisTask(str(first), REQUEST, save=True))
    paths = [first]
    for number in range(1, count):
        copy = folder / f"{number // 1000:03d}" / f"run_{number:06d}.h5"
        copy.parent.mkdir(exist_ok=True)
        shutil.copy(first, copy)
        paths.append(copy)
    print(f"| of {count} runs of 3 s at 200 Hz | resident memory, MB |")
    print("|---|---|")
    tasks = [AnalysisTask(str(path), REQUEST) for path in paths]
    began, shown = time.perf_counter(), {count // 10, count // 2, count}
    with open_executor(ExecutorOptions(jobs=1), len(tasks)) as crew:
        for done, outcome in enumerate(analyze_runs(tasks, crew), 1):
            if outcome.error:
                raise SystemExit(outcome.error)
            if done in shown:
                print(f"| {done} analysed, in this process | {resident_mb():.0f} |", flush=True)
    analysed_s, began = time.perf_counter() - began, time.perf_counter()
    gathered = collect_runs(paths, CollectOptions(ExecutorOptions(jobs=1)))
    print(f"| {len(gathered.runs)} gathered, results held | {resident_mb():.0f} |")
    took_s = time.perf_counter() - began
    print(
        f"\n{analysed_s / count * 1e3:.0f} ms to analyse one, {took_s / count * 1e3:.0f} ms to gather one.\n"
    )


def report(folder: Path) -> None:
    campaign(folder)
    files = [folder.parent / name for name in ("first.pdf", "again.pdf")]
    took = []
    for file in files:
        command = [sys.executable, "-m", "app", "report", str(folder), "-o", str(file)]
        began, worked = time.perf_counter(), processor_s()
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        took.append((time.perf_counter() - began, processor_s() - worked))
        if file == files[0]:
            pass_of(sorted(folder.glob("*.h5")), save=True)
    print("| 108 runs of 10 s at 1 kHz, from files to PDF | s | processor time, s | to reach |")
    print("|---|---|---|---|")
    print(f"| nothing analysed before | {took[0][0]:.1f} | {took[0][1]:.1f} | 30 s |")
    print(f"| all results kept in the runs | {took[1][0]:.1f} | {took[1][1]:.1f} | |")


def campaign(folder: Path) -> list[Path]:
    """The 108 runs of Table 1."""
    folder.mkdir()
    tests = plan_tests(CampaignOptions(), load_stand(), load_gauges(), folder, START)
    return [Path(write_test(test).path) for test in tests]


@contextmanager
def cluster() -> Iterator[str]:
    from distributed import LocalCluster

    options = {"n_workers": 2, "threads_per_worker": 1, "host": "127.0.0.1", "dashboard_address": None}
    with LocalCluster(**options) as running:
        yield running.scheduler_address


def processor_s() -> float:
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(each.ru_utime + each.ru_stime for each in used)


def resident_mb() -> float:
    with Path("/proc/self/statm").open() as file:
        return int(file.read().split()[1]) * resource.getpagesize() / 1e6


if __name__ == "__main__":
    main()
