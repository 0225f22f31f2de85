"""How often the table of a campaign holds its truth; whether effects are found that are there, and no others.

Campaigns of Table 1 as `slipstand demo --campaign` makes them: the stand's errors (gains, non-linearity, lag,
clock, masses, gravity) are drawn once a campaign from what the stand states, each run has its own noise and,
in every other campaign, its own f_d. Runs go through gauges, converter, calibration, identification and the
statistics of a campaign; only the files are left out (`slipstand demo --campaign` goes through them).

The first pass asks for the 95 % intervals of every quantity, on some series of each campaign. The others ask
for effects, on all series: where f_d depends on the contact alone, and where it falls by 0.4 % a kg.
"""

import datetime
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from scipy.stats import binomtest

from analysis.campaign.campaign import summarize
from analysis.campaign.effects import find_effects
from analysis.campaign.series import RunResult
from analysis.catalogue import table_columns
from analysis.identify import identify
from app.runs.analysis_input import build_record
from app.runs.campaign.run_result import run_result
from app.runs.saved_analyses import analysis_document
from app.simulated_stand.synthetic_campaign import (
    CampaignOptions,
    Comparison,
    SyntheticTest,
    compare,
    plan_tests,
    sample_test,
    series_truths,
    test_metadata,
    timed_clock,
)
from benchmarks.studies import options, percent, spread_out, table
from config.files import load_gauges, load_stand, published_table
from drivers.samples import Losses

SERIES, REPEATS = 3, 3
"""Of each campaign of the first pass."""
SCATTER = 0.01
"""Between runs, in every other campaign."""
PER_KG = -0.004
RATE_HZ, DURATION_S = 500.0, 8.0
START = datetime.datetime(2026, 11, 21, 8, 0, tzinfo=datetime.UTC)


@dataclass(frozen=True)
class Outcome:
    """What became of a campaign: its quantities beside their truth, or p-values by cause."""

    seed: int
    scatter: float
    per_kg: float = 0.0
    compared: tuple[Comparison, ...] = ()
    p_values: tuple[tuple[str, float | None], ...] = ()
    change_per_10_kg: tuple[float, float] | None = None
    inadequate: int = 0


def result(test: SyntheticTest) -> RunResult:
    """One run, as it would come out of its file."""
    block, _ = sample_test(test, load_gauges())
    metadata = test_metadata(test)
    readings = block.readings
    record = build_record(metadata, block.time_s, readings[:, 0], readings[:, 1], timed_clock(test))
    path = Path(test.path)
    return run_result(path, metadata, analysis_document(path, test.series, Losses(), identify(record)))


def results(chosen: CampaignOptions) -> list[RunResult]:
    tests = plan_tests(chosen, load_stand(), load_gauges(), Path("campaign").absolute(), START)
    return [result(test) for test in tests]


def coverage(seed: int) -> Outcome:
    """Some series of a campaign, drawn anew for each."""
    rng = np.random.default_rng((seed, 7))
    codes = tuple(rng.choice(list(published_table()), SERIES, replace=False))
    scatter = SCATTER * (seed % 2)
    chosen = CampaignOptions(
        series=codes, repeats=REPEATS, seed=seed, rate_hz=RATE_HZ, duration_s=DURATION_S,
        friction_scatter=scatter,
    )  # fmt: skip
    runs = results(chosen)
    truths = series_truths(chosen, load_stand(), load_gauges(), codes)
    compared = tuple(compare(summarize(runs).rows, truths))
    return Outcome(seed, scatter, 0.0, compared, inadequate=sum(not run.adequate for run in runs))


def effects(seed: int, per_kg: float) -> Outcome:
    """All series twice; f_d scatters from run to run by 1 %."""
    chosen = CampaignOptions(
        repeats=2, seed=seed, rate_hz=RATE_HZ, duration_s=DURATION_S, friction_scatter=SCATTER,
        friction_by_contact=True, friction_per_kg=per_kg,
    )  # fmt: skip
    runs = results(chosen)
    found = find_effects(summarize(runs).rows).effects
    mass = found[0].sizes[0].change.interval_95 if found[0].sizes else None
    p_values = tuple((effect.cause.value, effect.p_value) for effect in found)
    return Outcome(
        seed, SCATTER, per_kg, (), p_values, mass, inadequate=sum(not run.adequate for run in runs)
    )


def report_coverage(cases: list[Outcome]) -> str:
    names = [(column.symbol.text, column.name) for column, _ in table_columns()] + [("**all**", "")]
    header = ("", "intervals", "hold the truth", "no scatter", "1 % in f_d", "mean / u", "spread / u")
    inadequate, runs = sum(case.inadequate for case in cases), len(cases) * SERIES * REPEATS
    lines = [
        f"### 95 % intervals: {len(cases)} campaigns of {SERIES} series x {REPEATS} runs",
        "",
        table(header, [_covered(symbol, cases, name) for symbol, name in names]),
        "",
        f"Runs called inadequate: {percent(inadequate, runs)}",
        "",
    ]
    return "\n".join(lines)


def _covered(symbol: str, cases: list[Outcome], name: str) -> tuple[object, ...]:
    taken = [[one for one in case.compared if name in ("", one.name)] for case in cases]
    off = np.array([one.normalized_error for some in taken for one in some])
    parts = [
        _share([some for some, case in zip(taken, cases, strict=True) if wanted(case)])
        for wanted in (lambda _: True, lambda case: not case.scatter, lambda case: case.scatter)
    ]
    return (symbol, len(off), *parts, f"{off.mean():+.2f}", f"{off.std():.2f}")


def _share(campaigns: list[list[Comparison]]) -> str:
    """Share that holds the truth; series of one campaign err alike, so its error is taken over campaigns."""
    inside = np.array([sum(one.is_covered for one in some) for some in campaigns], float)
    count = np.array([len(some) for some in campaigns], float)
    share = inside.sum() / count.sum()
    error = np.sqrt(np.sum((inside - share * count) ** 2)) / count.sum()
    return f"{100.0 * share:.1f} ± {100.0 * error:.1f} %"


def report_effects(title: str, cases: list[Outcome]) -> str:
    rows = []
    for place, (cause, _) in enumerate(cases[0].p_values):
        p_values = [case.p_values[place][1] for case in cases]
        told = [p for p in p_values if p is not None]
        claimed = sum(p < 0.05 for p in told)
        if told:
            low, high = binomtest(claimed, len(told)).proportion_ci(0.95)
            rows.append((cause, f"{claimed} of {len(told)}", f"{100 * low:.1f} to {100 * high:.1f} %"))
        else:
            rows.append((cause, "cannot be told", ""))
    heading = f"### {title}: {len(cases)} campaigns of 36 series x 2 runs"
    header = ("cause", "claimed at 5 %", "95 % interval of the share")
    return "\n".join([heading, "", table(header, rows), "", _size_covered(cases), ""])


def _size_covered(cases: list[Outcome]) -> str:
    """What is said of the size of the effect of mass."""
    sizes = [case.change_per_10_kg for case in cases if case.change_per_10_kg is not None]
    truth = 10.0 * cases[0].per_kg
    inside = sum(low <= truth <= high for low, high in sizes)
    share = f"{inside} of {len(sizes)}"
    return f"The interval of the change for 10 kg more holds the true {100 * truth:+.1f} % in {share}."


def main() -> None:
    """Run the passes and print their tables."""
    chosen = options(__doc__ or "", 400)
    seeds = range(chosen.seed, chosen.seed + chosen.records)
    print(report_coverage(spread_out(coverage, seeds, chosen.workers, "coverage")), flush=True)
    for title, per_kg, share in (("f_d by contact alone", 0.0, 16), ("f_d falls by 0.4 % a kg", PER_KG, 40)):
        some = seeds[: max(1, chosen.records // share)]
        cases = spread_out(partial(effects, per_kg=per_kg), some, chosen.workers, title)
        print(report_effects(title, cases), flush=True)


if __name__ == "__main__":
    main()
