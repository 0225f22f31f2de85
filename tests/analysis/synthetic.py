"""Records made from the exact motion, as a stand with gauges, noise and converters would give them."""

import csv
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from analysis.motion.two_mass import TwoMassParameters
from analysis.record import GaugeUncertainty, Record, StandMasses

TABLE_1 = Path(__file__).resolve().parents[2] / "config" / "table1.csv"
PULLBACKS_M = {"1": 0.012, "2": 0.009, "3": 0.006}
TABLE_MASS_KG = 131.6


@dataclass(frozen=True)
class Truth:
    """One test and the way it is recorded.

    `hold_s` is the plateau before release; with `pull_s` a rest and a slow pull come before it. A negative
    hold starts the record after the release. `release_phase` shifts the release between samples (0 to 1).
    Gain errors and the lag are what the record does not know of.
    """

    period_s: float = 0.32
    damping_n1_per_s: float = 0.12
    plate_mass_kg: float = 22.4
    friction_dynamic: float = 0.1
    friction_static: float | None = None
    tilt_rad: float = 0.0
    pullback_m: float = 0.012
    table_mass_kg: float = TABLE_MASS_KG
    gravity_m_per_s2: float = 9.81
    rate_hz: float = 1000.0
    duration_s: float = 10.0
    hold_s: float = 1.0
    pull_s: float = 0.0
    release_phase: float = 0.3
    noise_m: float = 2e-5
    step_m: float = 0.0
    offsets_m: tuple[float, float] = (3e-4, 6e-3)
    gain_errors: tuple[float, float] = (0.0, 0.0)
    lag_s: float = 0.0
    clock_error: float = 0.0
    drift_m_per_s: float = 0.0
    seed: int = 0

    def parameters(self) -> TwoMassParameters:
        return TwoMassParameters.from_free_decay(
            period_s=self.period_s,
            damping_n1_per_s=self.damping_n1_per_s,
            table_mass_kg=self.table_mass_kg,
            plate_mass_kg=self.plate_mass_kg,
            friction_dynamic=self.friction_dynamic,
            friction_static=self.friction_static,
            tilt_rad=self.tilt_rad,
            pullback_m=self.pullback_m,
            gravity_m_per_s2=self.gravity_m_per_s2,
        )

    def but(self, **changes: object) -> "Truth":
        return replace(self, **changes)  # type: ignore[arg-type]


def table_1() -> list[Truth]:
    """The 36 series of the paper's Table 1 with f_s = f_d."""
    return [truth for _, truth in table_1_by_series()]


def table_1_by_series() -> list[tuple[str, Truth]]:
    with TABLE_1.open(newline="") as lines:
        rows = list(csv.DictReader(lines))
    return [(row["series"], _of_row(row)) for row in rows]


def _of_row(row: dict[str, str]) -> Truth:
    return Truth(
        period_s=float(row["period_s"]),
        damping_n1_per_s=float(row["damping_n1_per_s"]),
        plate_mass_kg=float(row["plate_mass_kg"]),
        friction_dynamic=float(row["friction_dynamic"]),
        pullback_m=PULLBACKS_M[row["series"][0]],
    )


def readings(truth: Truth) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Time and both gauges as recorded."""
    rng = np.random.default_rng(truth.seed)
    before = truth.hold_s + (3.0 * truth.pull_s if truth.pull_s else 0.0)
    count = round((before + truth.duration_s) * truth.rate_hz)
    time = np.arange(count) / truth.rate_hz
    since = time * (1.0 + truth.clock_error) - before - truth.release_phase / truth.rate_hz
    since = since[since <= truth.duration_s]
    time = time[: len(since)]
    motion = truth.parameters().simulate(truth.duration_s + 1e-6)
    table, _ = motion.sample_displacements(since)
    _, relative = motion.sample_displacements(since - truth.lag_s)
    if truth.pull_s:
        pulled = np.clip((since + truth.hold_s + truth.pull_s) / truth.pull_s, 0.0, 1.0)
        table = np.where(since < 0.0, table * 0.5 * (1.0 - np.cos(np.pi * pulled)), table)
    both = []
    for value, offset, gain in zip((table, relative), truth.offsets_m, truth.gain_errors, strict=True):
        read = offset + (1.0 + gain) * value + truth.noise_m * rng.standard_normal(len(value))
        both.append(np.round(read / truth.step_m) * truth.step_m if truth.step_m else read)
    both[1] = both[1] + truth.drift_m_per_s * time
    return time, both[0], both[1]


def record(truth: Truth, **known: object) -> Record:
    """The record of `truth` as an analysis gets it; `known` replaces fields of `Record`."""
    time, table, relative = readings(truth)
    masses = StandMasses(TABLE_MASS_KG, truth.plate_mass_kg)
    made = Record(time, table, relative, masses, pullback_m=truth.pullback_m)
    return made.replace(**known)


CALIBRATED = GaugeUncertainty(gain_relative=0.003, nonlinearity_m=5e-6, delay_s_uncertainty=2e-5)
