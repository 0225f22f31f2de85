"""How often one-mass intervals hold the truth, and how often friction is claimed, found or missed.

Random decays read as displacement, velocity or acceleration, half of them with Coulomb friction of 0.01 to
3 % of the first swing: 12 to 150 readings a period, 6 to 30 periods, noise of 0.03 to 2 % of that swing.
"""

import math
from dataclasses import dataclass

import numpy as np

from analysis.motion.one_mass import OneMassDecay, simulate
from analysis.one_mass.identify import MeasuredQuantity, identify_one_mass, single_channel
from analysis.record import AnalysisError
from benchmarks.studies import listed, options, percent, spread_out, table

READINGS: tuple[MeasuredQuantity, ...] = ("displacement", "velocity", "acceleration")
SWING = 0.01
SYMBOLS = ("T", "n", "x_k")


@dataclass(frozen=True)
class Case:
    """What became of one record; deviations of T, n and x_k in standard uncertainties."""

    seed: int
    quantity: str
    coulomb: float
    failure: str = ""
    adequate: bool = False
    claimed: bool = False
    detectable: bool = False
    off: tuple[float, ...] = ()
    deviation: tuple[float, ...] = ()


def draw(seed: int) -> tuple[OneMassDecay, MeasuredQuantity, np.ndarray, np.ndarray]:
    """A decay, what is read of it, and the readings."""
    rng = np.random.default_rng(seed)
    quantity = READINGS[int(rng.integers(3))]
    period_s = float(rng.uniform(0.15, 0.6))
    omega = 2.0 * math.pi / period_s
    coulomb = SWING * 1e-4 * 300.0 ** float(rng.random()) if rng.random() < 0.5 else 0.0
    decay = OneMassDecay(
        period_s,
        omega * float(rng.uniform(0.003, 0.08)),
        coulomb,
        -float(rng.uniform(0.0, 0.5)) * period_s,
        SWING,
    )
    rate_hz = 12.0 * 12.5 ** float(rng.random()) / period_s
    time_s = np.arange(0.0, float(rng.uniform(6.0, 30.0)) * period_s, 1.0 / rate_hz)
    motion = simulate(decay, time_s)
    order = READINGS.index(quantity)
    exact = (motion.displacement_m, motion.velocity_m_per_s, motion.acceleration_m_per_s2)[order]
    size = SWING * omega**order
    noise = size * 3e-4 * 66.0 ** float(rng.random())
    return decay, quantity, time_s, exact + 0.3 * size + noise * rng.standard_normal(len(time_s))


def run(seed: int) -> Case:
    """Make and identify one record."""
    decay, quantity, time_s, value = draw(seed)
    try:
        found = identify_one_mass(single_channel(time_s, value), quantity=quantity)
    except AnalysisError as error:
        return Case(seed, quantity, decay.coulomb_displacement_m, failure=str(error))
    truths = (decay.period_s, decay.damping_n_per_s, decay.coulomb_displacement_m)
    values = (
        *(found.results[k].value for k in ("period_s", "damping_n_per_s")),
        found.parameters["coulomb_displacement_m"],
    )
    names = ("period_s", "damping_n_per_s", "coulomb_displacement_m")
    deviations = [found.results[name].standard_uncertainty for name in names]
    return Case(
        seed,
        quantity,
        decay.coulomb_displacement_m,
        adequate=found.model is not None and found.model.adequate,
        claimed=bool(found.labels["coulomb_significant"]),
        detectable=decay.coulomb_displacement_m > 6.0 * deviations[2],
        off=tuple(v / t - 1.0 if t else 0.0 for v, t in zip(values, truths, strict=True)),
        deviation=tuple((v - t) / u for v, t, u in zip(values, truths, deviations, strict=True)),
    )


def rows_of(quantity: str, cases: list[Case]) -> list[tuple[object, ...]]:
    """A line for each fitted quantity."""
    done = [case for case in cases if case.quantity == quantity and not case.failure]
    rows = []
    for k, symbol in enumerate(SYMBOLS):
        deviation = np.array([case.deviation[k] for case in done])
        mean = f"{deviation.mean():+.3f} ± {deviation.std() / math.sqrt(len(done)):.3f}"
        inside = percent(int((np.abs(deviation) < 1.96).sum()), len(done))
        beyond = listed([case.seed for case in done if abs(case.deviation[k]) > 4.0])
        rows.append((quantity, symbol, len(done), mean, f"{deviation.std():.2f}", inside, beyond))
    return rows


def main() -> None:
    """Run and print the tables."""
    chosen = options(__doc__ or "", 2000)
    cases = spread_out(run, range(chosen.seed, chosen.seed + chosen.records), chosen.workers, "one mass")
    rows = [row for quantity in READINGS for row in rows_of(quantity, cases)]
    print(f"### {len(cases)} decays of one mass\n")
    print(
        table(
            ("read", "", "records", "mean / u", "spread / u", "95 % interval holds", "beyond 4 u (seeds)"),
            rows,
        )
    )
    done = [case for case in cases if not case.failure]
    without = [case for case in done if not case.coulomb]
    clear = [case for case in done if case.detectable]
    falsely, found = sum(case.claimed for case in without), sum(case.claimed for case in clear)
    print(f"\n- friction claimed where there is none: {percent(falsely, len(without))}")
    print(f"- friction claimed where it is above 6 standard uncertainties: {percent(found, len(clear))}")
    doubted = [case.seed for case in done if not case.adequate]
    print(f"- called inadequate: {percent(len(doubted), len(done))}; seeds {listed(doubted)}")
    failed = [f"{case.seed} ({case.failure})" for case in cases if case.failure]
    print(f"- refused: {len(failed)}; {'; '.join(failed[:8])}")


if __name__ == "__main__":
    main()
