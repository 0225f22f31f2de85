"""How long identification takes: whole, refitted, live and by Monte Carlo, and against scipy, in one run.

Run it with `python benchmarks/identification.py`; it prints the tables of docs/benchmarks.md. Records have
2 x 10,000 readings at 1 kHz, with 1 s of hold and noise of 20 um; one of each row of Table 1, every fourth
with a random tilt (up to 2 mrad), every fourth with a random f_s / f_d (up to 2), every fourth with both.
Times are processor time, with one thread of BLAS, as the program sets it.
"""

import argparse
import math
import os
import time
from collections.abc import Callable, Iterable
from functools import partial
from itertools import cycle
from typing import TypeVar

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from reference_solvers import integrate_with_events
from scipy.optimize import least_squares

from analysis.identification import Identification
from analysis.identify import identify
from analysis.laws.stand_parts import stand_displacements
from analysis.live import LiveIdentification
from analysis.motion.two_mass import TwoMassParameters
from analysis.record import GaugeUncertainty, Record, StandMasses
from analysis.refit import Refitter
from analysis.synthetic import TABLE_MASS_KG, Truth, simulate_record
from config.files import load_stand, published_table

Result = TypeVar("Result")

LAWS = ("coulomb", "coulomb+tilt", "static", "static+tilt")
GAUGE = GaugeUncertainty(gain_relative=0.003, delay_s_uncertainty=2e-5)
LIVE_INTERVAL_S = 0.05
NOT_IDEAL = {"release_ramp_s": 0.01, "spring_hardening": 0.02, "film_s_per_m": 1.0, "stand_friction_m": 2e-5}
OFF = 1.001
"""Refits start with both frictions off by this factor."""


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--refits", type=int, default=1000, metavar="N", help="of Monte Carlo (%(default)s)")
    parser.add_argument("--without-scipy", action="store_true", help="leave out the comparison (a minute)")
    chosen = parser.parse_args()
    truths = list(drawn_truths())
    identify(stated(truths[0]))  # compiled code is loaded
    report_whole(truths)
    report_live(truths[:4])
    report_monte_carlo(truths[0], chosen.refits)
    if not chosen.without_scipy:
        report_scipy(truths[0])


def drawn_truths() -> Iterable[Truth]:
    """A test of each row, slipping, with the laws in turn."""
    stand, rng = load_stand(), np.random.default_rng(0)
    for law, row in zip(cycle(LAWS), published_table().values(), strict=False):
        pullback = stand.series(row.series).pullback_m
        # Some printed values could never have slipped; the joint acceleration must exceed g f_s by a tenth.
        most = (2.0 * math.pi / row.period_s) ** 2 * pullback / stand.gravity_m_per_s2 / 1.1 - 2e-3
        dynamic = min(row.friction_dynamic, most / 1.2)
        yield Truth(
            period_s=row.period_s,
            damping_n1_per_s=row.damping_n1_per_s,
            plate_mass_kg=row.plate_mass_kg,
            friction_dynamic=dynamic,
            friction_static=rng.uniform(dynamic, min(2.0 * dynamic, most)) if "static" in law else None,
            tilt_rad=rng.uniform(-2e-3, 2e-3) if "tilt" in law else 0.0,
            pullback_m=pullback,
            duration_s=9.0,
            seed=int(row.number),
        )


def stated(truth: Truth) -> Record:
    """The record with all that is known of a stand: 14 or more parameters are free."""
    masses = StandMasses(TABLE_MASS_KG, truth.plate_mass_kg, 0.3, 0.02, 9.81, 0.005)
    return simulate_record(
        truth, masses=masses, table_gauge=GAUGE, relative_gauge=GAUGE, clock_scale_uncertainty=2e-5
    )


def report_whole(truths: list[Truth]) -> None:
    plain = [seconds(partial(identify, simulate_record(truth))) for truth in truths]
    whole = [seconds(partial(identify, stated(truth))) for truth in truths]
    refits, held = zip(*(refit_seconds(stated(truth)) for truth in truths), strict=True)
    rows = {
        "whole identification, nothing stated of gauges and masses": (plain, "150"),
        "whole identification, everything stated": (whole, "150"),
        "refit from a start": (refits, "15"),
        "refit with f_d held, as a slider does": (held, "15"),
    }
    print("| 2 x 10,000 readings, rows of Table 1 | median, ms | slowest, ms | to reach |")
    print("|---|---|---|---|")
    for name, (taken, reach) in rows.items():
        print(f"| {name} | {1e3 * np.median(taken):.3g} | {1e3 * max(taken):.3g} | {reach} ms |")
    print()


def refit_seconds(made: Record) -> tuple[float, float]:
    found = identify(made)
    again, start, law = Refitter(made), start_of(found), law_of(found)
    return (
        seconds(lambda: again.refit(start, model=law)),
        seconds(lambda: again.refit(start, model=law, hold="friction_dynamic")),
    )


def report_live(truths: list[Truth]) -> None:
    every = f"an update each {1e3 * LIVE_INTERVAL_S:g} ms"
    print(f"| live, {every} of the motion | mean, ms | 99 %, ms | share of a core |")
    print("|---|---|---|---|")
    for truth in truths:
        name = "coulomb" if truth.friction_static is None else "static"
        name += " and tilt" if truth.tilt_rad else ""
        report_live_record(name, stated(truth))
    ideal = Truth(friction_static=0.12, tilt_rad=1e-3)
    for name, size in NOT_IDEAL.items():
        motion = stand_displacements(ideal.parameters(), {name: size}, ideal.duration_s + 1e-3)
        report_live_record(name, simulate_record(ideal, motion))
    print()


def report_live_record(name: str, made: Record) -> None:
    taken = list(live_seconds(made))
    share = np.mean(taken) / LIVE_INTERVAL_S
    mean, late = 1e3 * np.mean(taken), 1e3 * np.quantile(taken, 0.99)
    print(f"| {name} | {mean:.3g} | {late:.3g} | {100 * share:.3g} % |")


def live_seconds(made: Record) -> Iterable[float]:
    live = LiveIdentification()
    for end_s in np.arange(1.0, made.time_s[-1], LIVE_INTERVAL_S):
        rows = slice(int(np.searchsorted(made.time_s, end_s)))
        until = made.replace(
            time_s=made.time_s[rows],
            table_displacement_m=made.table_displacement_m[rows],
            relative_displacement_m=made.relative_displacement_m[rows],  # type: ignore[index]
        )
        yield seconds(partial(live.update, until))


def report_monte_carlo(truth: Truth, refits: int) -> None:
    made = stated(truth)
    alone = min(seconds(lambda: identify(made)) for _ in range(3))
    linear = seconds(lambda: identify(made, monte_carlo=0)) - alone
    start = time.perf_counter()
    full = seconds(lambda: identify(made, monte_carlo=refits)) - alone - linear
    elapsed = time.perf_counter() - start
    print("| Monte Carlo | processor time, s | elapsed, s | to reach |")
    print("|---|---|---|---|")
    print(f"| 100,000 draws through the linearised fit | {linear:.3g} | | 5 s |")
    print(f"| {refits} full refits on {os.cpu_count()} cores | {full:.3g} | {elapsed:.3g} | 20 s for 1000 |")
    print()


def report_scipy(truth: Truth) -> None:
    made = simulate_record(truth)
    whole, found = timed(lambda: identify(made))
    law, again = law_of(found), Refitter(made)
    refit = min(seconds(lambda: again.refit(start_of(found), model=law)) for _ in range(3))
    theirs, (friction, evaluations) = timed(lambda: fit_by_scipy(made, start_of(found)))
    deviation = found.results["friction_dynamic"].standard_uncertainty
    off = abs(friction - found.results["friction_dynamic"].value) / deviation
    print(f"| the same record (1FFM0, {law}) | s | against the refit |")
    print("|---|---|---|")
    print(f"| refit from a start | {refit:.3g} | 1 x |")
    print(f"| whole identification | {whole:.3g} | {whole / refit:.3g} x |")
    print(f"| scipy's least_squares over DOP853 with events | {theirs:.3g} | {theirs / refit:.3g} x |")
    print()
    print(f"scipy simulated {evaluations} times, and its f_d is {off:.2g} standard uncertainties from ours.")


def fit_by_scipy(made: Record, start: dict[str, float]) -> tuple[float, int]:
    """f_d of a Coulomb fit from `start` with everything that is not ours, and simulations that it took."""
    names = ("friction_dynamic", "stiffness_n_per_m", "damping_coefficient_kg_per_s", "pullback_m")
    scales = np.array([1e-3, 50.0, 0.5, 1e-5, 1e-4])
    begin = np.array([*(start[name] for name in names), start["release_s"]])
    evaluations = 0

    def residuals(moved: np.ndarray) -> np.ndarray:
        nonlocal evaluations
        evaluations += 1
        *values, release_s = begin + scales * moved
        table, relative = simulated(dict(zip(names, values, strict=True)), start, made.time_s - release_s)
        both = made.table_displacement_m - table, made.relative_displacement_m - relative
        return np.concatenate([each - each.mean() for each in both]) / 2e-5

    found = least_squares(residuals, np.zeros(len(begin)), x_scale=1.0, diff_step=[1e-4], xtol=1e-6)
    return float((begin + scales * found.x)[0]), evaluations


def simulated(
    fitted: dict[str, float], known: dict[str, float], since_s: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    parameters = TwoMassParameters(
        table_mass_kg=known["table_mass_kg"], plate_mass_kg=known["plate_mass_kg"], **fitted
    )
    motion = integrate_with_events(parameters, float(since_s[-1]) + 1e-3, rtol=1e-9, atol=1e-12)
    table, relative = np.full(len(since_s), parameters.pullback_m), np.zeros(len(since_s))
    bounds = [*np.searchsorted(since_s, motion.starts), len(since_s)]
    for first, last, piece in zip(bounds[:-1], bounds[1:], motion.pieces, strict=True):
        if last > first:
            u1, _, u2, _ = piece(since_s[first:last])
            table[first:last], relative[first:last] = u1, u2 - u1
    return table, relative


def start_of(found: Identification) -> dict[str, float]:
    frictions = {name: OFF * found.parameters[name] for name in ("friction_dynamic", "friction_static")}
    return found.parameters | frictions


def law_of(found: Identification) -> str:
    if found.model is None:
        raise ValueError("nothing was fitted")
    return found.model.name


def seconds(way: Callable[[], object]) -> float:
    return timed(way)[0]


def timed(way: Callable[[], Result]) -> tuple[float, Result]:
    start = time.process_time()
    result = way()
    return time.process_time() - start, result


if __name__ == "__main__":
    main()
