"""Listing a library of thousands of runs, and opening an hour of samples: `python benchmarks/library.py`.

Beside it, the same files opened one by one with h5py, as a program without an index would do. Processor
time is that of the program itself, without the process that examines files.
"""

import argparse
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import h5py
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from analysis.motion.two_mass import TwoMassParameters
from app.runs.decimation import open_decimated
from app.runs.listing import list_runs
from app.runs.reader import open_run
from app.runs.run_filter import RunFilter
from app.runs.simulated import write_simulated_run
from app.runs.validator import Validator

SAMPLED = 200
SPANS = 1500
REPEATS = 9


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=10_000)
    parser.add_argument("--hour-rate", type=float, default=2000.0, help="Hz of the run of an hour")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as place:
        os.environ["XDG_CACHE_HOME"] = f"{place}/cache"
        library = Path(place) / "library"
        library.mkdir()
        fill(library, options.runs)
        listing(library, options.runs)
        hour(Path(place) / "hour.h5", options.hour_rate)


def parameters() -> TwoMassParameters:
    return TwoMassParameters.from_free_decay(
        period_s=0.32,
        damping_n1_per_s=0.12,
        table_mass_kg=131.6,
        plate_mass_kg=22.4,
        friction_dynamic=0.1,
        pullback_m=0.012,
    )


def fill(library: Path, count: int) -> None:
    """Copies of one short run in folders of a thousand, as months of a laboratory make them."""
    first = library / "run_00000.h5"
    write_simulated_run(first, parameters().simulate(5.0), parameters(), series="1FFM0", rate_hz=200.0)
    for number in range(1, count):
        folder = library / f"{number // 1000:02d}"
        folder.mkdir(exist_ok=True)
        shutil.copy(first, folder / f"run_{number:05d}.h5")


def listing(library: Path, count: int) -> None:
    first_s, found = timed(lambda: list_runs(library))
    if len(found) != count or any(run.fault for run in found):
        raise SystemExit(f"{len(found)} runs listed of {count}")
    again_s = middling(lambda: list_runs(library))
    filtered_s = middling(lambda: list_runs(library, RunFilter(series="1FFM0", text="simulated")))
    plain_s = middling(lambda: plain(found[:SAMPLED]), 3) * count / SAMPLED
    command = [sys.executable, "-m", "app", "runs", str(library), "--json"]
    command_s = middling(lambda: subprocess.run(command, stdout=subprocess.DEVNULL, check=True), 3)
    print(f"| {count} runs | s | to reach |")
    print("| --- | --- | --- |")
    print(f"| first listing, every file examined | {first_s:.1f} ({first_s / count * 1e3:.1f} ms a file) | |")
    print(f"| listing | {again_s:.3f} | 0.2 s |")
    print(f"| listing, filtered by series and text | {filtered_s:.3f} | 0.2 s |")
    print(f"| `slipstand runs --json`, start of Python included | {command_s:.2f} | |")
    print(f"| h5py, two texts of each file ({SAMPLED} files, scaled) | {plain_s:.1f} | |")


def plain(runs: list) -> None:
    for run in runs:
        with h5py.File(run.path) as file:
            _ = file["entry/start_time"][()], file["entry/run/series"][()]


def hour(path: Path, rate_hz: float) -> None:
    """As the window opens a run, in its process that has an validator standing by; and in a fresh one."""
    write_simulated_run(path, parameters().simulate(3599.0), parameters(), series="1FFM0", rate_hz=rate_hz)
    with Validator.start() as validator:
        validator.validate(path)
        rows = {
            "first plot, as the window draws it": lambda: open_decimated(
                path, SPANS, between_s=(-1.0, np.inf), validator=validator
            ),
            "the same in a process that has just begun": lambda: open_decimated(
                path, SPANS, between_s=(-1.0, np.inf)
            ),
            "all samples": lambda: open_run(path, validator=validator),
            "its four columns by h5py alone": lambda: columns(path),
        }
        print(f"\n| an hour at {rate_hz:g} Hz, opened | s | processor time, s | to reach |")
        print("| --- | --- | --- | --- |")
        for name, work in rows.items():
            began_s = time.process_time()
            took_s = middling(work)
            processor_s = (time.process_time() - began_s) / REPEATS
            print(f"| {name} | {took_s:.3f} | {processor_s:.3f} | {'0.3 s' if 'plot' in name else ''} |")


def columns(path: Path) -> list:
    with h5py.File(path) as file:
        return [np.asarray(file[f"entry/motion/{name}"]) for name in file["entry/motion"]]


def middling(work, repeats: int = REPEATS) -> float:
    return statistics.median(timed(work)[0] for _ in range(repeats))


def timed(work):
    start = time.perf_counter()
    result = work()
    return time.perf_counter() - start, result


if __name__ == "__main__":
    main()
