"""What identification makes of spikes, dropouts, drift, steps, clipping, hum, or a second release.

Every record is sound at first; one or two faults are then put into one or both gauges. A result is bad when
it is off by more than 5 standard uncertainties and by more than 1 %, and yet called adequate.
"""

from collections import Counter
from dataclasses import dataclass

import numpy as np

from analysis.arrays import Floats
from analysis.identify import identify
from analysis.record import AnalysisError, Record
from analysis.synthetic import simulate_record
from benchmarks.studies import listed, options, spread_out, table
from benchmarks.study_coverage import draw


@dataclass(frozen=True)
class Outcome:
    """What became of one record."""

    seed: int
    faults: tuple[str, ...]
    kind: str
    detail: str = ""


def spikes(rng: np.random.Generator, _time_s: Floats, value: Floats) -> Floats:
    """Single readings off by 0.1 to 30 mm."""
    where = rng.integers(0, len(value), int(rng.integers(1, 30)))
    value[where] += rng.choice([-1.0, 1.0], len(where)) * 1e-4 * 300.0 ** rng.random(len(where))
    return value


def dropouts(rng: np.random.Generator, time_s: Floats, value: Floats) -> Floats:
    """Stretches of 5 to 500 ms without a reading, or stuck at the last one."""
    for _ in range(int(rng.integers(1, 6))):
        start_s = rng.uniform(time_s[0], time_s[-1])
        gone = (time_s >= start_s) & (time_s < start_s + 0.005 * 100.0 ** rng.random())
        if gone.any():
            value[gone] = np.nan if rng.random() < 0.5 else value[np.argmax(gone)]
    return value


def drift(rng: np.random.Generator, time_s: Floats, value: Floats) -> Floats:
    """A drift of 10 to 1000 um/s, straight or settling."""
    rate = rng.choice([-1.0, 1.0]) * 1e-5 * 100.0 ** rng.random()
    settling_s = 0.2 * (time_s[-1] - time_s[0])
    shape = time_s if rng.random() < 0.5 else settling_s * (1.0 - np.exp(-time_s / settling_s))
    return np.asarray(value + rate * shape)


def step(rng: np.random.Generator, time_s: Floats, value: Floats) -> Floats:
    """The zero jumps by 20 um to 3 mm."""
    size = rng.choice([-1.0, 1.0]) * 2e-5 * 150.0 ** rng.random()
    return np.asarray(value + size * (time_s > rng.uniform(time_s[0], time_s[-1])))


def clipped(rng: np.random.Generator, _time_s: Floats, value: Floats) -> Floats:
    """Tops beyond 50 to 95 % of the range are cut, and not flagged."""
    low, high = np.nanmin(value), np.nanmax(value)
    share = rng.uniform(0.5, 0.95)
    if rng.random() < 0.5:
        return np.minimum(value, low + share * (high - low))
    return np.clip(value, high - share * (high - low), low + share * (high - low))


def hum(rng: np.random.Generator, time_s: Floats, value: Floats) -> Floats:
    """Mains at 50 or 60 Hz, 10 to 500 um."""
    size = 1e-5 * 50.0 ** rng.random()
    return np.asarray(
        value + size * np.sin(2.0 * np.pi * rng.choice([50.0, 60.0]) * time_s + 6.0 * rng.random())
    )


FAULTS = {f.__name__: f for f in (spikes, dropouts, drift, step, clipped, hum)}


def second_release(rng: np.random.Generator, made: Record, seed: int) -> Record:
    """The same test once more, recorded on into the same record after 2 to 8 s."""
    truth, _ = draw(seed)
    again = simulate_record(truth.replace(seed=seed + 10**9, hold_s=float(rng.uniform(0.2, 1.0))))
    interval_s = 1.0 / truth.rate_hz
    first = made.time_s < truth.hold_s + rng.uniform(2.0, 8.0)
    first_relative, second_relative = made.relative_displacement_m, again.relative_displacement_m
    if first_relative is None or second_relative is None:
        raise TypeError("records of two gauges are needed")
    # The plate stays where the first release left it.
    second_relative = second_relative - second_relative[0] + first_relative[first][-1]
    time_s = np.concatenate((made.time_s[first], made.time_s[first][-1] + interval_s + again.time_s))
    return made.replace(
        time_s=time_s,
        table_displacement_m=np.concatenate((made.table_displacement_m[first], again.table_displacement_m)),
        relative_displacement_m=np.concatenate((first_relative[first], second_relative)),
    )


def spoiled(seed: int) -> tuple[Record, tuple[str, ...], float]:
    """A record with one or two faults, their names, and the true f_d."""
    rng = np.random.default_rng((seed, 2))
    truth, _ = draw(seed)
    made = simulate_record(truth)
    names = tuple(rng.choice([*FAULTS, "second_release"], int(rng.integers(1, 3)), replace=False).tolist())
    if "second_release" in names:
        made = second_release(rng, made, seed)
    gauges = [made.table_displacement_m.copy(), np.array(made.relative_displacement_m)]
    for name in names:
        if name in FAULTS:
            for which in {0: (0,), 1: (1,), 2: (0, 1)}[int(rng.integers(3))]:
                gauges[which] = FAULTS[name](rng, made.time_s, gauges[which])
    spoilt = made.replace(table_displacement_m=gauges[0], relative_displacement_m=gauges[1])
    return spoilt, names, truth.friction_dynamic


def run(seed: int) -> Outcome:
    """Identify one spoiled record."""
    return judged(seed, *spoiled(seed))


def judged(seed: int, made: Record, names: tuple[str, ...], friction: float) -> Outcome:
    """Identify a record with faults of these names, and hold f_d against the true one."""
    try:
        found = identify(made)
    except AnalysisError as error:
        return Outcome(seed, names, "refused" if "\n" not in str(error) else "crash", str(error))
    except Exception as error:
        return Outcome(seed, names, "crash", repr(error))
    codes = ", ".join(caution.code for caution in found.warnings)
    result = found.results.get("friction_dynamic")
    if result is None or found.model is None:
        return Outcome(seed, names, "no f_d, with a warning" if codes else "crash", codes)
    off = result.value - friction
    detail = (
        f"{100.0 * off / friction:+.2f} %, u {100.0 * result.standard_uncertainty / friction:.2g} % ({codes})"
    )
    wrong = abs(off) > max(5.0 * result.standard_uncertainty, 0.01 * friction)
    verdict = "adequate" if found.model.adequate else "inadequate"
    return Outcome(seed, names, f"{verdict}, {'off' if wrong else 'right'}", detail)


KINDS = (
    "adequate, right",
    "inadequate, right",
    "inadequate, off",
    "no f_d, with a warning",
    "refused",
    "adequate, off",
    "crash",
)


def main() -> None:
    """Run and print the tables."""
    chosen = options(__doc__ or "", 1000)
    seeds = range(chosen.seed, chosen.seed + chosen.records)
    outcomes = spread_out(run, seeds, chosen.workers, "garbage")
    rows = []
    for name in (*FAULTS, "second_release"):
        counts = Counter(outcome.kind for outcome in outcomes if name in outcome.faults)
        rows.append((name.replace("_", " "), *(counts[kind] for kind in KINDS)))
    total = Counter(outcome.kind for outcome in outcomes)
    rows.append(("**all records**", *(total[kind] for kind in KINDS)))
    print(f"### {len(outcomes)} records with one or two faults\n")
    print(table(("fault", *KINDS), rows))
    bad = [outcome for outcome in outcomes if outcome.kind in ("adequate, off", "crash")]
    print(f"\nSeeds to look at: {listed([outcome.seed for outcome in bad], 40)}\n")
    for outcome in bad:
        print(f"- {outcome.seed} ({', '.join(outcome.faults)}): {outcome.kind}: {outcome.detail}")


if __name__ == "__main__":
    main()
