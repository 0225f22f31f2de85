"""How soon and how exactly a release is found, over many random pullbacks: a study of the state machine.

Run it with `python benchmarks/release_detection.py [RECORDS]`; it prints the table of docs/benchmarks.md.
Each record is a row of Table 1 on a stand with random tilt, f_s, side, creep of the held table and noise,
released between two samples at random. The machine is fed sample by sample, or by half a millisecond where
that is more, so that what is measured is its own delay; a device's blocks and the engine's beat come on top.
"""

import sys
from dataclasses import dataclass

import numpy as np

from analysis.motion.two_mass import TwoMassParameters
from app.acquisition.messages import PullbackState
from app.acquisition.pullback.plan import PullbackPlan
from app.acquisition.pullback.state_machine import PullbackStateMachine
from app.simulated_stand.motion import stand_truth
from app.simulated_stand.options import SimulatedStandOptions
from config.files import load_stand, published_table

RATES_HZ = (500.0, 1000.0, 2000.0, 10_000.0)
NOISES_M = (5e-6, 20e-6)
BLOCK_S = 0.5e-3
REST_S, PULL_S, AFTER_S = 1.0, 0.6, 0.7
SERIES = tuple(published_table())


@dataclass(frozen=True)
class Finding:
    """One record: delay of the notice and error of the dated release (s); both NaN where it was missed."""

    delay_s: float
    dated_off_s: float
    is_false: bool


def main() -> None:
    records = int(sys.argv[1]) if len(sys.argv) > 1 else 300
    random = np.random.default_rng(2026)
    print(f"{records} records a row; delays and errors in ms")
    print(f"{'rate Hz':>8} {'noise um':>8} {'median':>7} {'95 %':>7} {'largest':>8}"
          f" {'dated: rms':>11} {'largest':>8} {'missed':>7} {'false':>6}")  # fmt: skip
    for rate_hz in RATES_HZ:
        for noise_m in NOISES_M:
            print(row(rate_hz, noise_m, [one(random, rate_hz, noise_m) for _ in range(records)]), flush=True)


def row(rate_hz: float, noise_m: float, findings: list[Finding]) -> str:
    delay_ms = 1e3 * np.array([finding.delay_s for finding in findings])
    off_ms = 1e3 * np.array([finding.dated_off_s for finding in findings])
    found = np.isfinite(delay_ms)
    median, high, largest = np.percentile(delay_ms[found], [50.0, 95.0, 100.0])
    rms = np.sqrt(np.mean(off_ms[found] ** 2))
    false = sum(finding.is_false for finding in findings)
    return (
        f"{rate_hz:8g} {1e6 * noise_m:8g} {median:7.1f} {high:7.1f} {largest:8.1f} {rms:11.2f}"
        f" {np.abs(off_ms[found]).max():8.2f} {np.count_nonzero(~found):7d} {false:6d}"
    )


def one(random: np.random.Generator, rate_hz: float, noise_m: float) -> Finding:
    """Make a record and follow it."""
    hold_s = random.uniform(0.6, 3.0) + random.uniform(0.0, 1.0 / rate_hz)
    release_s = REST_S + PULL_S + hold_s
    table_m, relative_m, pullback_m = motion(
        random, np.arange(0.0, release_s + AFTER_S, 1.0 / rate_hz), release_s
    )
    noise = noise_m * random.standard_normal((2, len(table_m)))
    return follow(PullbackPlan(rate_hz, pullback_m), table_m + noise[0], relative_m + noise[1], release_s)


def motion(
    random: np.random.Generator, time_s: np.ndarray, release_s: float
) -> tuple[np.ndarray, np.ndarray, float]:
    """Both displacements (m) of a random stand, and its pullback (m)."""
    stand = load_stand()
    options = SimulatedStandOptions(series=str(random.choice(SERIES)), tilt_rad=random.normal(0.0, 5e-4))
    true = stand_truth(options, stand)
    pullback_m = true.pullback_m * random.choice([-1.0, 1.0]) * random.uniform(0.985, 1.015)
    released = TwoMassParameters(
        table_mass_kg=true.table_mass_kg,
        plate_mass_kg=true.plate_mass_kg,
        stiffness_n_per_m=true.stiffness_n_per_m,
        damping_coefficient_kg_per_s=true.damping_coefficient_kg_per_s,
        friction_dynamic=true.friction_dynamic,
        friction_static=true.friction_dynamic * random.uniform(1.0, 1.4),
        tilt_rad=true.tilt_rad,
        pullback_m=pullback_m,
        gravity_m_per_s2=true.gravity_m_per_s2,
    ).simulate(AFTER_S + 0.1)
    pulled = np.clip((time_s - REST_S) / PULL_S, 0.0, 1.0)
    creep = random.uniform(-40e-6, 40e-6) * np.clip(time_s - REST_S - PULL_S, 0.0, None)
    table_m = pullback_m * pulled**2 * (3.0 - 2.0 * pulled) + creep
    relative_m = np.zeros_like(table_m)
    free = time_s > release_s
    table_m[free], relative_m[free] = released.sample_displacements(time_s[free] - release_s)
    table_m[free] += creep[np.flatnonzero(free)[0]]
    return table_m, relative_m, pullback_m


def follow(plan: PullbackPlan, table_m: np.ndarray, relative_m: np.ndarray, release_s: float) -> Finding:
    """Feed a record bit by bit."""
    test, noticed_s = PullbackStateMachine(plan), np.nan
    size = max(1, round(plan.rate_hz * BLOCK_S))
    for index in range(0, len(table_m), size):
        turns = test.add_samples(index, table_m[index : index + size], relative_m[index : index + size])
        if np.isnan(noticed_s) and any(turn.state is PullbackState.RELEASED for turn in turns):
            noticed_s = (index + size - 1) / plan.rate_hz
    if not test.measurement.release_confirmed or test.measurement.release_index is None:
        return Finding(np.nan, np.nan, not np.isnan(noticed_s))
    delay_s = noticed_s - release_s
    return Finding(delay_s, test.measurement.release_index / plan.rate_hz - release_s, delay_s < 0.0)


if __name__ == "__main__":
    main()
