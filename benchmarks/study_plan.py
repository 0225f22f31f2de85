"""Whether `plan` promises what tests keep: its uncertainty of f_d against simulated tests, identified.

The records are those of `study_coverage`: random rows, laws, rates and noises, once with everything known
exactly and once on a stand that is off its stated values. A plan knows the law, a test has to find it out.
"""

import math
from dataclasses import dataclass
from functools import partial

import numpy as np

from analysis.identify import identify
from analysis.plan import PlannedTest, expected_budget
from analysis.record import AnalysisError, GaugeUncertainty, StandMasses
from analysis.synthetic import TABLE_MASS_KG, Truth, simulate_record
from benchmarks.studies import listed, options, spread_out, table
from benchmarks.study_coverage import CLOCK, GAIN, GRAVITY, LAG_S, PLATE_KG, TABLE_KG, disturbed, draw

_GAUGES = (
    GaugeUncertainty(gain_relative=GAIN),
    GaugeUncertainty(gain_relative=GAIN, delay_s_uncertainty=LAG_S),
)
_FAR = 1.5
"""Reported over expected, or the other way round, from which on a record is named."""


@dataclass(frozen=True)
class Kept:
    """One test beside its plan.

    `reported` and `off` are the reported uncertainty and the error of f_d over the expected uncertainty, NaN
    where the plan or the test tells no f_d; `agrees` whether both tell it or both do not.
    """

    seed: int
    law: str
    reported: float = math.nan
    off: float = math.nan
    agrees: bool = True
    same_law: bool = True


def run(seed: int, whole: bool) -> Kept:
    """Plan, make and identify one test."""
    nominal, law = draw(seed)
    test = _planned(nominal, whole=whole)
    expected = expected_budget(test).results.get("friction_dynamic")
    masses = StandMasses(TABLE_MASS_KG, nominal.plate_mass_kg, TABLE_KG, PLATE_KG, 9.81, GRAVITY)
    known = {
        "masses": masses,
        "clock_scale_uncertainty": CLOCK,
        "table_gauge": _GAUGES[0],
        "relative_gauge": _GAUGES[1],
    }
    try:
        made = simulate_record(disturbed(nominal), **known) if whole else simulate_record(nominal)
        identified = identify(made)
    except AnalysisError:
        return Kept(seed, law, agrees=expected is None)
    found = identified.results.get("friction_dynamic")
    if found is None or expected is None:
        return Kept(seed, law, agrees=found is None and expected is None)
    u = expected.standard_uncertainty
    same = identified.model is not None and identified.model.name == test.law.name
    off = (found.value - nominal.friction_dynamic) / u
    return Kept(seed, law, found.standard_uncertainty / u, off, same_law=same)


def _planned(truth: Truth, *, whole: bool) -> PlannedTest:
    test = PlannedTest(
        parameters=truth.parameters(),
        rate_hz=truth.rate_hz,
        duration_s=truth.duration_s,
        hold_s=truth.hold_s,
        noise_m=truth.noise_m,
        clock_scale_uncertainty=0.0,
    )
    if not whole:
        return test
    return test.replace(
        table_mass_uncertainty_kg=TABLE_KG,
        plate_mass_uncertainty_kg=PLATE_KG,
        gravity_uncertainty_m_per_s2=GRAVITY,
        clock_scale_uncertainty=CLOCK,
        table_gauge=_GAUGES[0],
        relative_gauge=_GAUGES[1],
    )


def report(title: str, cases: list[Kept]) -> str:
    """A row a law."""
    rows = []
    for law in sorted({case.law for case in cases}):
        told = [case for case in cases if case.law == law and math.isfinite(case.reported)]
        reported = np.array([case.reported for case in told])
        off = np.array([case.off for case in told])
        far = [case.seed for case in told if not 1.0 / _FAR < case.reported < _FAR]
        low, middle, high = np.quantile(reported, (0.05, 0.5, 0.95))
        rows.append((
            law, len(told), sum(case.same_law for case in told), f"{middle:.3f} ({low:.3f} to {high:.3f})",
            f"{math.sqrt(float(np.mean(off**2))):.2f} ± {1.0 / math.sqrt(2.0 * len(off)):.2f}", listed(far),
        ))  # fmt: skip
    header = (
        title,
        "tests",
        "law found",
        "reported / expected: median (5 to 95 %)",
        "scatter / expected",
        f"beyond {_FAR:g} (seeds)",
    )
    disagree = [case.seed for case in cases if not case.agrees]
    return (
        table(header, rows)
        + f"\n\n- plan and test do not agree on whether f_d can be told: {listed(disagree)}\n"
    )


def main() -> None:
    """Run both passes and print their tables."""
    chosen = options(__doc__ or "", 400)
    seeds = range(chosen.seed, chosen.seed + chosen.records)
    for title, whole in (("noise alone", False), ("whole budget", True)):
        print(report(title, spread_out(partial(run, whole=whole), seeds, chosen.workers, title)), flush=True)


if __name__ == "__main__":
    main()
