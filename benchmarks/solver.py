"""How fast a test is simulated: the exact solver against other ways to the same motion, in one run.

Run it with `python benchmarks/solver.py`; it prints the tables of docs/benchmarks.md. Times are the
shortest of many by processor time, so that other work on the machine counts as little as it can.
"""

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial

import numpy as np
from motion_gradient import sample_with_gradient
from reference_solvers import integrate_with_events, march_like_the_paper

from analysis.laws.stribeck import STRIBECK_TILT
from analysis.motion import paper_method
from analysis.motion.events import integrate_events
from analysis.motion.two_mass import TwoMassParameters
from config.files import load_stand, published_table

DURATION_S = 10.0
EVEN = np.linspace(0.0, DURATION_S, 10_000)
UNEVEN = np.sort(np.random.default_rng(0).uniform(0.0, DURATION_S, 10_000))
FEW = np.linspace(0.0, DURATION_S, 400)
STRIBECK_VELOCITY_M_PER_S = 0.005

START = """
import time
import numpy as np
from analysis.laws.stribeck import STRIBECK_TILT
from analysis.motion import events, paper_method
from analysis.motion.two_mass import TwoMassParameters
from benchmarks.motion_gradient import sample_with_gradient

parameters = TwoMassParameters(
    table_mass_kg=131.6, plate_mass_kg=22.4, stiffness_n_per_m=6e4, damping_coefficient_kg_per_s=37.0,
    friction_dynamic=0.1, pullback_m=0.012,
)
vector, times, stamps = parameters.vector(), np.linspace(0.0, 1.0, 9), [time.process_time()]
parameters.simulate(1.0).sample(times)
stamps.append(time.process_time())
sample_with_gradient(vector, events.integrate_events(vector, 1.0), times, np.eye(10))
stamps.append(time.process_time())
STRIBECK_TILT.solver.simulate(parameters, [0.01], 1.0).sample(times)
stamps.append(time.process_time())
paper_method.simulate(parameters, duration_s=1.0).sample(times)
stamps.append(time.process_time())
print(*np.diff(stamps))
"""


def main() -> None:
    first = table_1()["1FFM0"]
    report_methods(first)
    report_samples(first)
    report_table_1()
    report_accuracy(first)
    report_start()


def table_1() -> dict[str, TwoMassParameters]:
    """The paper's tests by series, f_s = f_d."""
    stand = load_stand()
    return {
        series: TwoMassParameters.from_free_decay(
            period_s=row.period_s,
            damping_n1_per_s=row.damping_n1_per_s,
            table_mass_kg=stand.table_mass_kg,
            plate_mass_kg=stand.series(series).plate_mass_kg,
            friction_dynamic=row.friction_dynamic,
            pullback_m=stand.series(series).pullback_m,
        )
        for series, row in published_table().items()
    }


def report_methods(p: TwoMassParameters) -> None:
    softened = TwoMassParameters(**{**vars(p), "friction_static": 1.2 * p.friction_dynamic})
    ways: dict[str, Callable[[], object]] = {
        "exact, events": lambda: p.simulate(DURATION_S),
        "paper's algorithm compiled, 1e-4 s": lambda: paper_method.simulate(p, duration_s=DURATION_S),
        "paper's algorithm, plain Python loop, 1e-4 s": lambda: march_like_the_paper(p, DURATION_S),
        "DOP853 with events, 1e-12, 1e-14": lambda: integrate_with_events(p, DURATION_S, dense=False),
        "DOP853 with events, steps of 2 ms at most": lambda: integrate_with_events(
            p, DURATION_S, max_step=2e-3, dense=False
        ),
        "Stribeck friction": lambda: STRIBECK_TILT.solver.simulate(
            softened, [STRIBECK_VELOCITY_M_PER_S], DURATION_S
        ),
        "DOP853 with events, Stribeck friction": lambda: integrate_with_events(
            softened, DURATION_S, stribeck_velocity_m_per_s=STRIBECK_VELOCITY_M_PER_S, dense=False
        ),
    }
    best = {name: best_s(way) for name, way in ways.items()}
    print("| 1FFM0, 10 s | ms a run | against the exact solver |")
    print("|---|---|---|")
    for name, seconds in best.items():
        print(f"| {name} | {1e3 * seconds:.3g} | {seconds / best['exact, events']:.3g} x |")
    print()


def report_samples(p: TwoMassParameters) -> None:
    vector, eight = p.vector(), np.eye(10)[:8].copy()
    eleven = np.append(vector, STRIBECK_VELOCITY_M_PER_S)

    def slopes(times: np.ndarray) -> object:
        return sample_with_gradient(vector, integrate_events(vector, DURATION_S), times, eight)

    ways: dict[str, Callable[[], object]] = {
        "events alone, compiled caller": lambda: integrate_events(vector, DURATION_S),
        "u1 and rel at 10,000 even times": lambda: p.simulate(DURATION_S).sample_displacements(EVEN),
        "u1 and rel at 10,000 uneven times": lambda: p.simulate(DURATION_S).sample_displacements(UNEVEN),
        "all six channels at 10,000 even times": lambda: p.simulate(DURATION_S).sample(EVEN),
        "u1, rel and 8 derivatives at 10,000 even times": lambda: slopes(EVEN),
        "u1, rel and 8 derivatives at 10,000 uneven times": lambda: slopes(UNEVEN),
        "u1, rel and 8 derivatives at 400 even times": lambda: slopes(FEW),
        "Stribeck: u1, rel and 8 differences at 400 even times": lambda: (
            STRIBECK_TILT.solver.kernels.sample_with_gradient(eleven, FEW, np.eye(11)[:8].copy())
        ),
    }
    print("| 1FFM0, 10 s, simulated and sampled | ms |")
    print("|---|---|")
    for name, way in ways.items():
        print(f"| {name} | {1e3 * best_s(way):.3g} |")
    print()


def report_table_1() -> None:
    best = {series: best_s(partial(p.simulate, DURATION_S), 0.05) for series, p in table_1().items()}
    slowest = max(best, key=lambda series: best[series])
    print("| events of the 36 series of Table 1, 10 s | ms |")
    print("|---|---|")
    print(f"| mean | {1e3 * np.mean(list(best.values())):.3g} |")
    print(f"| slowest, {slowest} | {1e3 * best[slowest]:.3g} |")
    print()


def report_accuracy(p: TwoMassParameters) -> None:
    times = np.linspace(0.0, DURATION_S, 2001)[:-1]
    exact = p.simulate(DURATION_S).sample(times)
    ways = {
        "DOP853 with events, steps of 2 ms at most": displacements(p, times, max_step=2e-3),
        "DOP853 with events, 1e-12, 1e-14": displacements(p, times),
        "paper's algorithm, 1e-4 s": paper_method.simulate(p).sample_displacements(times),
    }
    print("| 1FFM0, 10 s: largest difference from the exact solver | u1, m | rel, m |")
    print("|---|---|---|")
    for name, (table, relative) in ways.items():
        worst = np.abs(table - exact.table_displacement_m).max()
        print(f"| {name} | {worst:.1e} | {np.abs(relative - exact.relative_displacement_m).max():.1e} |")
    print()


def displacements(
    p: TwoMassParameters, times: np.ndarray, max_step: float = np.inf
) -> tuple[np.ndarray, np.ndarray]:
    table, _, plate, _ = integrate_with_events(p, DURATION_S, max_step=max_step).sample(times)
    return table, plate - table


def report_start() -> None:
    """Processor time, for a first start is as long as the machine is busy."""
    print("| processor time before the first result, s | exact | derivatives | Stribeck | paper's |")
    print("|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as cache:
        for name in ("compiled, first start after installation", "loaded from the cache"):
            environment = {**os.environ, "NUMBA_CACHE_DIR": cache}
            output = subprocess.run(
                [sys.executable, "-c", START], env=environment, capture_output=True, text=True, check=True
            ).stdout
            print(f"| {name} | {' | '.join(f'{float(seconds):.2g}' for seconds in output.split())} |")


def best_s(way: Callable[[], object], seconds: float = 1.0) -> float:
    """Shortest processor time of a run, in batches of at least 1 ms, as many as fit into `seconds`."""
    way()
    start = time.process_time()
    way()
    batch = max(1, round(1e-3 / max(time.process_time() - start, 1e-6)))
    best, batches, end = np.inf, 0, time.perf_counter() + seconds
    while batches < 3 or time.perf_counter() < end:
        start = time.process_time()
        for _ in range(batch):
            way()
        best, batches = min(best, (time.process_time() - start) / batch), batches + 1
    return float(best)


if __name__ == "__main__":
    main()
