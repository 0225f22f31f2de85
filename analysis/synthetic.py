"""Records of known truth: the exact motion, as a stand with gauges, noise and converters would record it."""

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Any, Self

import numpy as np

from analysis.arrays import Floats
from analysis.motion.two_mass import TwoMassParameters
from analysis.record import Record, StandMasses

Displacements = Callable[[Floats], tuple[Floats, Floats]]
"""u1 and u2 - u1 (n,) at times (n,) from release, negative before it."""

TABLE_MASS_KG = 131.6


@dataclass(frozen=True)
class Truth:
    """One test and the way it is recorded; the values not named here are as in `TwoMassParameters`."""

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
    """Plateau before release (s); with `pull_s`, a rest and a slow pull come before it. A negative hold
    starts the record after the release."""
    pull_s: float = 0.0
    release_phase: float = 0.3  # where between two samples the release lies (0 to 1)
    noise_m: float = 2e-5  # standard deviation of white noise
    step_m: float = 0.0  # of the converter; 0: none
    offsets_m: tuple[float, float] = (3e-4, 6e-3)
    gain_errors: tuple[float, float] = (0.0, 0.0)
    """Errors not stated in the record: relative gain errors, lateness of gauge 2 (s), and by how much true
    time runs faster than the record's."""
    lag_s: float = 0.0
    clock_error: float = 0.0
    drift_m_per_s: float = 0.0
    seed: int = 0

    def parameters(self) -> TwoMassParameters:
        names = {field.name for field in fields(TwoMassParameters)} & {field.name for field in fields(self)}
        values = {name: getattr(self, name) for name in (*names, "period_s", "damping_n1_per_s")}
        return TwoMassParameters.from_free_decay(**values)

    def replace(self, **changes: Any) -> Self:
        return replace(self, **changes)


def simulate_readings(
    truth: Truth, displacements: Displacements | None = None
) -> tuple[Floats, Floats, Floats]:
    """Time and both gauges (n,) as recorded; of other `displacements` than the exact ones where given."""
    rng = np.random.default_rng(truth.seed)
    time_s, since_s = _times(truth)
    if displacements is None:
        motion = truth.parameters().simulate(truth.duration_s + abs(truth.lag_s) + 1e-6)
        displacements = motion.sample_displacements
    table, _ = displacements(since_s)
    _, relative = displacements(since_s - truth.lag_s)
    if truth.pull_s:  # a rest and a slow pull before the hold
        pulled = np.clip((since_s + truth.hold_s + truth.pull_s) / truth.pull_s, 0.0, 1.0)
        table = np.where(since_s < 0.0, table * 0.5 * (1.0 - np.cos(np.pi * pulled)), table)
    first = _gauge(truth, table, 0, rng)
    return time_s, first, _gauge(truth, relative + truth.drift_m_per_s * time_s, 1, rng)


def simulate_record(truth: Truth, displacements: Displacements | None = None, **known: Any) -> Record:
    """The record of `truth` as an analysis gets it; `known` replaces fields of `Record`.

    It states the nominal table mass and the true plate mass unless `known` replaces them.
    """
    masses = StandMasses(TABLE_MASS_KG, truth.plate_mass_kg)
    record = Record(*simulate_readings(truth, displacements), masses, pullback_m=truth.pullback_m)
    return record.replace(**known)


def _times(truth: Truth) -> tuple[Floats, Floats]:
    """Times in the record, and true times since release."""
    before_s = truth.hold_s + (3.0 * truth.pull_s if truth.pull_s else 0.0)
    count = round((before_s + truth.duration_s) * truth.rate_hz)
    time_s = np.arange(count) / truth.rate_hz
    since_s = time_s * (1.0 + truth.clock_error) - before_s - truth.release_phase / truth.rate_hz
    within = since_s <= truth.duration_s
    return time_s[within], since_s[within]


def _gauge(truth: Truth, value: Floats, which: int, rng: np.random.Generator) -> Floats:
    read = truth.offsets_m[which] + (1.0 + truth.gain_errors[which]) * value
    read = read + truth.noise_m * rng.standard_normal(len(value))
    return np.asarray(np.round(read / truth.step_m) * truth.step_m if truth.step_m else read)
