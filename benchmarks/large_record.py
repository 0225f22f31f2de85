"""Identification of 2 x 1,000,000 readings: `python benchmarks/large_record.py` (docs/benchmarks.md).

Each law in a process of its own: processor time of `identify`, and the largest memory that the process has
held, with what it held before (compiled code, and the record of 24 MB). Linux only.
Run `python -m tools.compile_all` before.
"""

import multiprocessing
import os
import sys
import time
from pathlib import Path

os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"  # as `slipstand` does, before numpy
sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from analysis.identify import identify, warm_up
from analysis.synthetic import Truth, simulate_record

RATE_HZ, DURATION_S = 1e5, 9.0  # and a second of hold
LAWS: dict[str, dict[str, float]] = {
    "coulomb": {},
    "coulomb+tilt": {"tilt_rad": 1e-3},
    "static": {"friction_static": 0.12},
    "static+tilt": {"friction_static": 0.12, "tilt_rad": 1e-3},
}


def main() -> None:
    print("| 2 x 1,000,000 readings | processor time, s | largest memory, MB | before, MB | to reach |")
    print("|---|---|---|---|---|")
    with multiprocessing.get_context("spawn").Pool(1, maxtasksperchild=1) as pool:
        for law, (taken, largest, before) in zip(LAWS, pool.imap(measured, LAWS, 1), strict=True):
            print(
                f"| {law} | {taken:.2f} | {largest:.0f} | {before:.0f} | 2 s, 300 MB |",
                flush=True,
            )


def measured(law: str) -> tuple[float, float, float]:
    """Processor time (s) of `identify`, the largest memory by its end and the memory before it (MB)."""
    warm_up()
    made = simulate_record(Truth(rate_hz=RATE_HZ, duration_s=DURATION_S, **LAWS[law]))  # type: ignore[arg-type]
    Path("/proc/self/clear_refs").write_text("5")  # forgets the largest memory so far
    before, began_s = memory_mb("VmRSS"), time.process_time()
    identify(made)
    return time.process_time() - began_s, memory_mb("VmHWM"), before


def memory_mb(name: str) -> float:
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith(name)) / 1e3


if __name__ == "__main__":
    main()
