"""Results that are not finite or not plausible: campaigns and gauge figures use the others."""

import numpy as np
import pytest

from analysis.campaign.campaign import summarize
from analysis.campaign.series import RunResult, SeriesKey
from analysis.gauge_health import GaugeSamples, measure_health
from analysis.one_mass.identify import identify_one_mass, single_channel
from analysis.quantities import BudgetLine, BudgetSource, Quantity
from analysis.record import AnalysisError

ODD = [0.0, -1.0, 0.1, np.nan, np.inf, 1e300, 1e-300]
NAMES = (
    "friction_dynamic",
    "friction_static",
    "friction_static_lower",
    "table_velocity_max_m_per_s",
    "period_s",
    "plate_mass_kg",
)


def odd_run(random: np.random.Generator, name: str) -> RunResult:
    """A run with quantities absent, odd, exact or of absurd uncertainty."""
    key = SeriesKey(
        str(random.choice(["", "A", "B"])),
        str(random.choice(["", "FF", "FM"])),
        random.choice([None, 0.006, 0.012]),
        float(random.choice([22.4, 40.0])),
        131.6,
    )
    results, budget = {}, []
    for quantity in NAMES:
        if random.random() < 0.25:
            continue
        value = float(random.choice([*ODD, *random.normal(0.1, 1e-3, 20)]))
        deviation = float(random.choice([0.0, np.nan, np.inf, 1e300, *[1e-3] * 6]))
        results[quantity] = Quantity.normal(value, deviation, "1")
        budget += [
            BudgetLine(source, quantity, deviation)
            for source in (BudgetSource.NOISE, BudgetSource.GAUGE_1_GAIN)
        ]
    return RunResult(name, key, results, tuple(budget) if random.random() < 0.7 else ())


@pytest.mark.parametrize("seed", range(80))
def test_a_campaign_of_odd_numbers_is_summed_up(seed: int) -> None:
    random = np.random.default_rng(seed)
    runs = [odd_run(random, f"run{number}") for number in range(random.choice([0, 1, 2, 3, 6, 12]))]
    rows = summarize(runs).rows
    assert sum(len(row.runs) for row in rows) == len(runs)


def test_a_gauge_without_a_range_uses_no_share_of_it() -> None:
    samples = GaugeSamples(np.zeros(100), np.zeros(100, bool), 50.0, 0.0)
    assert measure_health(samples).range_fraction is None


def test_a_jump_of_the_clock_does_not_keep_a_decay_waiting() -> None:
    time_s = np.arange(2299) / 500.0
    value = 0.01 * np.exp(-0.3 * time_s) * np.cos(19.0 * time_s)
    time_s[1500:] += 1e12
    with pytest.raises(AnalysisError, match=r"no reading for .* Take the stretch before or after"):
        identify_one_mass(single_channel(time_s, value))
