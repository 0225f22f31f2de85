"""Records of stands that are not ideal: motion, gauges, noise, and what is stated of them."""

import math
from dataclasses import dataclass, replace
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from analysis.record import GaugeUncertainty, Record, StandMasses
from benchmarks.real_gauges import GRID_HZ, Floats, RealGauge
from benchmarks.real_stand import BASE, REL, RealStand, U
from config.files import load_stand


@dataclass(frozen=True)
class Scene:
    """A test on a stand and what records it."""

    stand: RealStand
    gauges: tuple[RealGauge, ...]
    gauge_1_on_floor: bool = False  # and not on the base
    yaw_share: float = (
        0.0  # of the pullback, in gauge 1 alone: the table turns, and the gauge is off its centre
    )
    yaw_hz: float = 0.0
    hold_creep_m_per_s: float = 0.0  # the pull goes on until the release
    series: str = ""
    rate_hz: float = 1000.0
    noise_m: float = 2e-5
    hold_s: float = 1.0
    duration_s: float = 12.0  # from the release
    gain_uncertainty: float | None = None  # as stated
    seed: int = 0

    def with_stand(self, **values: Any) -> "Scene":
        """Change fields of the stand."""
        return replace(self, stand=replace(self.stand, **values))

    def with_gauge(self, which: int, **values: Any) -> "Scene":
        """Change gauge 1, gauge 2, or both where `which` is 0."""
        changed = (replace(g, **values) if which in (0, n) else g for n, g in enumerate(self.gauges, 1))
        return replace(self, gauges=tuple(changed))


@dataclass(frozen=True, eq=False)
class Simulated:
    """A record and its truth."""

    record: Record
    friction_dynamic: float  # mean over the slid path
    slips_m: Floats


def simulate(scene: Scene, cache: Path | None = None) -> Simulated:
    """Simulate the record of a scene; what is without noise is kept in the folder `cache`."""
    kept = cache / f"{_fingerprint(scene)}.npz" if cache else None
    if kept and kept.exists():
        with np.load(kept) as file:
            readings, mean, slips_m = file["readings"], float(file["mean"]), file["slips_m"]
    else:
        readings, mean, slips_m = _readings(scene)
        if kept:
            np.savez(kept, readings=readings, mean=mean, slips_m=slips_m)
    times_s = np.arange(readings.shape[1]) / scene.rate_hz
    noisy = readings + scene.noise_m * np.random.default_rng((scene.seed, 16)).standard_normal(readings.shape)
    gauge = GaugeUncertainty(gain_relative=scene.gain_uncertainty)
    record = Record(
        times_s, noisy[0], noisy[1],
        StandMasses(scene.stand.table_mass_kg, scene.stand.plate_mass_kg),
        pullback_m=load_stand().series(scene.series).pullback_m,
        table_gauge=gauge, relative_gauge=gauge,
    )  # fmt: skip
    return Simulated(record, mean, slips_m)


def _fingerprint(scene: Scene) -> str:
    """Of the scene and the simulator."""
    sources = (Path(__file__).with_name(f"real_{name}.py") for name in ("stand", "gauges", "record"))
    return sha256(b"".join([repr(scene).encode(), *(path.read_bytes() for path in sources)])).hexdigest()[:20]


def _readings(scene: Scene) -> tuple[Floats, float, Floats]:
    """Both gauges (2, n) without noise, the mean friction, and the slips."""
    margin_s = 2e-2  # what late gauges and the phase of the clock may reach beyond the record
    stand, phase = scene.stand, float(np.random.default_rng((scene.seed, 17)).random())
    times_s = np.arange(round((scene.hold_s + scene.duration_s) * scene.rate_hz)) / scene.rate_hz
    times_s -= scene.hold_s + phase / scene.rate_hz
    since_s = np.arange(-scene.hold_s - margin_s, scene.duration_s + margin_s, 1.0 / GRID_HZ)
    motion = stand.simulate(float(since_s[-1]) + margin_s)
    states = motion.sample(since_s)
    table = states[U] + scene.hold_creep_m_per_s * np.minimum(since_s, 0.0)
    if scene.gauge_1_on_floor:
        table = table + states[BASE]
    if scene.yaw_share:
        after_s, angular = np.maximum(since_s, 0.0), 2.0 * math.pi * scene.yaw_hz
        swing = np.exp(-0.01 * angular * after_s) * np.cos(angular * after_s)
        table = table + scene.yaw_share * stand.pullback_m * swing
    moved = table, states[REL]
    readings = np.array(
        [gauge.read(moved[n], moved[1 - n], since_s, times_s) for n, gauge in enumerate(scene.gauges)]
    )
    return readings, motion.friction_dynamic, motion.slips_m
