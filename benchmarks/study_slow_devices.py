"""What identification makes of devices that give 31 to 60 readings a second, of which a tenth is missing.

As of a pair that a busy computer polls: each gauge misses readings of its own, before the release too. A
result is bad when it is off by more than 5 standard uncertainties and by more than 1 %, and yet adequate.
"""

from collections import Counter

import numpy as np

from analysis.record import Record
from analysis.synthetic import simulate_record
from benchmarks.studies import listed, options, percent, spread_out
from benchmarks.studies import table as markdown_table
from benchmarks.study_coverage import draw
from benchmarks.study_garbage import KINDS, Outcome, judged

MISSING_SHARE = 0.1
HOLD_MIN_S = 0.6


def slow_record(seed: int) -> tuple[Record, float]:
    """A record of a slow device, and its true f_d."""
    rng = np.random.default_rng((seed, 3))
    truth, _ = draw(seed)
    hold_s = max(truth.hold_s, HOLD_MIN_S)
    made = simulate_record(truth.replace(rate_hz=float(rng.uniform(31.0, 60.0)), hold_s=hold_s))
    table, relative = made.table_displacement_m.copy(), np.array(made.relative_displacement_m)
    for value in (table, relative):
        value[rng.random(len(value)) < MISSING_SHARE] = np.nan
    made = made.replace(table_displacement_m=table, relative_displacement_m=relative)
    return made, truth.friction_dynamic


def run(seed: int) -> Outcome:
    """Identify one record."""
    made, friction = slow_record(seed)
    return judged(seed, made, ("missing",), friction)


def main() -> None:
    """Run and print the table."""
    chosen = options(__doc__ or "", 400)
    seeds = range(chosen.seed, chosen.seed + chosen.records)
    outcomes = spread_out(run, seeds, chosen.workers, "slow devices")
    counts = Counter(outcome.kind for outcome in outcomes)
    late = [outcome.seed for outcome in outcomes if "release-not-recorded" in outcome.detail]
    print(f"### {len(outcomes)} records of 31 to 60 readings a second\n")
    print(
        markdown_table(
            ("outcome", "records"), [(kind, percent(counts[kind], len(outcomes))) for kind in KINDS]
        )
    )
    print(f"\nRelease taken for one before the record, seeds: {listed(late)}")
    bad = [outcome.seed for outcome in outcomes if outcome.kind in ("adequate, off", "crash")]
    print(f"Seeds to look at: {listed(bad)}")


if __name__ == "__main__":
    main()
