"""How often intervals of results hold the truth, and whether the right law is chosen.

Random records over the range of Table 1. Each is identified twice: with everything known exactly, so that
only noise is uncertain (type A), and with gains, masses, lag, time base and gravity off by draws from their
stated distributions (whole budget).
"""

import math
from dataclasses import dataclass
from functools import partial

import numpy as np

from analysis.identify import identify
from analysis.quantities import COVERAGE_FACTOR_95, Quantity
from analysis.record import AnalysisError, GaugeUncertainty, StandMasses
from analysis.synthetic import TABLE_MASS_KG, Truth, simulate_readings, simulate_record
from benchmarks.studies import listed, options, percent, spread_out, table
from config.files import load_stand, published_table

QUANTITIES = {
    "friction_dynamic": "f_d",
    "period_s": "T",
    "damping_n1_per_s": "n1",
    "friction_static": "f_s, where there is one",
    "damping_n2_per_s": "n2",
    "stiffness_n_per_m": "c",
    "tilt_rad": "tilt, where there is one",
    "friction_dynamic_plate": "f_d of the plate",
    "plate_velocity_max_m_per_s": "plate's largest velocity",
}
_NOT_ALWAYS = {"friction_static", "tilt_rad", "friction_dynamic_plate"}
GAIN, LAG_S, CLOCK, GRAVITY = 0.003, 2e-5, 2e-5, 0.005
TABLE_KG, PLATE_KG = 0.3, 0.02


@dataclass(frozen=True)
class Case:
    """What became of one record; `off` and the rest by the names in QUANTITIES, NaN where there is none.

    `width` is that of the 95 % interval over that of a normal distribution.
    """

    seed: int
    failure: str = ""
    law: str = ""
    chosen: str = ""
    clear: bool = True
    adequate: bool = False
    off: tuple[float, ...] = ()
    deviation: tuple[float, ...] = ()
    inside: tuple[bool, ...] = ()
    width: tuple[float, ...] = ()


def draw(seed: int) -> tuple[Truth, str]:
    """A record of a random row of Table 1 with a random law, and that law's name."""
    rng = np.random.default_rng(seed)
    stand, rows = load_stand(), list(published_table().values())
    while True:
        row = rows[rng.integers(len(rows))]
        has_static, has_tilt = rng.random(2) < 0.5
        pullback = stand.series(row.series).pullback_m
        static = row.friction_dynamic * (rng.uniform(1.0, 2.0) if has_static else 1.0)
        if (2.0 * math.pi / row.period_s) ** 2 * pullback > 1.1 * (static + 2e-3) * stand.gravity_m_per_s2:
            break  # it slips
    truth = Truth(
        period_s=row.period_s,
        damping_n1_per_s=row.damping_n1_per_s,
        plate_mass_kg=row.plate_mass_kg,
        friction_dynamic=row.friction_dynamic,
        friction_static=static if has_static else None,
        tilt_rad=float(rng.uniform(-2e-3, 2e-3)) if has_tilt else 0.0,
        pullback_m=pullback,
        rate_hz=float(200.0 * 25.0 ** rng.random()),
        noise_m=float(5e-6 * 20.0 ** rng.random()),
        release_phase=float(rng.random()),
        hold_s=float(rng.uniform(0.5, 1.5)),
        seed=seed,
    )
    return truth, ("static" if has_static else "coulomb") + ("+tilt" if has_tilt else "")


def disturbed(truth: Truth) -> Truth:
    """The same test on a stand that is off its stated values by draws from their distributions."""
    rng = np.random.default_rng((truth.seed, 1))
    gain_1, gain_2, lag, clock, table_kg, plate_kg, gravity = rng.standard_normal(7)
    return truth.replace(
        gain_errors=(GAIN * gain_1, GAIN * gain_2),
        lag_s=LAG_S * lag,
        clock_error=CLOCK * clock,
        table_mass_kg=TABLE_MASS_KG + TABLE_KG * table_kg,
        plate_mass_kg=truth.plate_mass_kg + PLATE_KG * plate_kg,
        gravity_m_per_s2=9.81 + GRAVITY * gravity,
    )


def run(seed: int, whole: bool) -> Case:
    """Make, identify and compare one record."""
    nominal, law = draw(seed)
    truth, known = nominal, {}
    if whole:
        truth = disturbed(nominal)
        gauge = GaugeUncertainty(gain_relative=GAIN, delay_s_uncertainty=LAG_S)
        masses = StandMasses(TABLE_MASS_KG, nominal.plate_mass_kg, TABLE_KG, PLATE_KG, 9.81, GRAVITY)
        known = {
            "masses": masses,
            "clock_scale_uncertainty": CLOCK,
            "table_gauge": GaugeUncertainty(gain_relative=GAIN),
            "relative_gauge": gauge,
        }
    try:
        found = identify(simulate_record(truth, **known))
    except AnalysisError as error:
        return Case(seed, failure=f"refused: {error}", law=law)
    except Exception as error:
        return Case(seed, failure=f"crash: {error!r}", law=law)
    if found.model is None or not QUANTITIES.keys() - _NOT_ALWAYS <= found.results.keys():
        codes = ", ".join(caution.code for caution in found.warnings)
        return Case(seed, failure=f"without a result: {codes}", law=law)
    truths = _truths(truth)
    compared = [_compared(found.results.get(name), truths[name]) for name in QUANTITIES]
    off, deviation, inside, width = zip(*compared, strict=True)
    return Case(
        seed,
        law=law,
        chosen=found.model.name,
        clear=effects_are_clear(truth),
        adequate=found.model.adequate,
        off=off,
        deviation=deviation,
        inside=inside,
        width=width,
    )


def _truths(truth: Truth) -> dict[str, float | None]:
    """True values by the names in QUANTITIES."""
    motion = truth.parameters()
    mass_kg = motion.table_mass_kg + motion.plate_mass_kg
    return {
        "friction_dynamic": truth.friction_dynamic,
        "period_s": truth.period_s,
        "damping_n1_per_s": truth.damping_n1_per_s,
        "friction_static": truth.friction_static,
        "damping_n2_per_s": truth.damping_n1_per_s * mass_kg / motion.table_mass_kg,
        "stiffness_n_per_m": motion.stiffness_n_per_m,
        "tilt_rad": truth.tilt_rad or None,
        "friction_dynamic_plate": truth.friction_dynamic,
        "plate_velocity_max_m_per_s": motion.simulate(truth.duration_s).plate_velocity_max_m_per_s,
    }


def _compared(found: Quantity | None, true: float | None) -> tuple[float, float, bool, float]:
    """Relative error, the same in standard uncertainties, and whether the interval holds the truth; width."""
    if found is None or true is None:
        return math.nan, math.nan, False, math.nan
    (low, high), deviation = found.interval_95, found.standard_uncertainty
    off = found.value - true
    return (
        off / true,
        off / deviation,
        low <= true <= high,
        0.5 * (high - low) / (COVERAGE_FACTOR_95 * deviation),
    )


def effects_are_clear(truth: Truth) -> bool:
    """Tell whether each part of the law moves the readings by more than the noise (rms of both gauges)."""
    changes = [{"tilt_rad": 0.0}] if truth.tilt_rad else []
    changes += [{"friction_static": None}] if truth.friction_static else []
    _, *full = simulate_readings(truth.replace(noise_m=0.0))
    for change in changes:
        _, *without = simulate_readings(truth.replace(noise_m=0.0, **change))
        if np.sqrt(np.mean((np.array(full) - np.array(without)) ** 2)) < truth.noise_m:
            return False
    return True


def report(title: str, cases: list[Case]) -> str:
    """The tables of one pass."""
    done = [case for case in cases if not case.failure]
    rows = []
    for k, symbol in enumerate(QUANTITIES.values()):
        told = [case for case in done if math.isfinite(case.deviation[k])]
        off = np.array([case.off[k] for case in told])
        deviation = np.array([case.deviation[k] for case in told])
        outside = [case.seed for case in told if abs(case.deviation[k]) > 4.0]
        rows.append((
            symbol, len(told), f"{100 * off.mean():+.4f} %", f"{100 * np.median(off):+.4f} %",
            f"{deviation.mean():+.3f} ± {deviation.std() / math.sqrt(len(told)):.3f}",
            f"{deviation.std():.2f}",
            percent(sum(case.inside[k] for case in told), len(told)), listed(outside),
        ))  # fmt: skip
    clear = [case for case in done if case.clear]
    wrong = [case.seed for case in clear if case.chosen != case.law]
    doubted = [case.seed for case in done if not case.adequate]
    failed = [case for case in cases if case.failure]
    lines = [
        f"### {title}: {len(cases)} records",
        table(
            (
                "",
                "records",
                "mean bias",
                "median",
                "mean / u",
                "spread / u",
                "95 % interval holds",
                "beyond 4 u (seeds)",
            ),
            rows,
        ),
        "",
        f"- right law where its parts exceed the noise: {percent(len(clear) - len(wrong), len(clear))};"
        f" wrong: {listed(wrong)}",
        f"- called inadequate: {percent(len(doubted), len(done))}; seeds {listed(doubted)}",
        f"- without a result: {len(failed)}; "
        + "; ".join(f"{case.seed} {case.failure}" for case in failed[:8]),
        "",
    ]
    return "\n".join(lines)


def main() -> None:
    """Run both passes and print their tables."""
    chosen = options(__doc__ or "", 2000)
    seeds = range(chosen.seed, chosen.seed + chosen.records)
    for title, whole in (("Noise alone (type A)", False), ("Whole budget", True)):
        print(report(title, spread_out(partial(run, whole=whole), seeds, chosen.workers, title)), flush=True)


if __name__ == "__main__":
    main()
