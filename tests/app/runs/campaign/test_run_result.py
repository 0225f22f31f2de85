"""What a campaign takes of an analysis: effects of the stand, where they were looked for."""

import datetime
import math
from pathlib import Path
from typing import Any

import pytest

from analysis.quantities import BudgetSource
from app.runs.campaign.run_result import run_result
from app.runs.metadata import create_metadata
from config.files import load_gauges, load_stand
from tests.app.runs.runs_kit import ANALYSIS

DAY = datetime.datetime(2026, 11, 21, tzinfo=datetime.UTC)
OF_ALL = [{"name": "coulomb"}, {"name": "coulomb+tilt"}]


@pytest.mark.parametrize(
    ("model", "effects"),
    [
        ({"parts": ["second-mode"], "tried": OF_ALL}, ("second-mode",)),
        ({"parts": [], "tried": OF_ALL}, ()),
        ({"parts": [], "tried": OF_ALL[:1]}, None),  # of a law that was asked for
        ({"tried": OF_ALL}, None),  # of a version that knew no effects
    ],
)
def test_effects_are_known_where_they_were_looked_for(
    model: dict[str, Any], effects: tuple[str, ...] | None
) -> None:
    document = ANALYSIS | {"model": ANALYSIS["model"] | model}
    found = run_result(Path("run.h5"), create_metadata(load_stand(), load_gauges(), DAY), document)

    assert found.effects == effects
    assert found.noise_m == 2e-5


def test_a_record_without_a_law_says_nothing_of_effects() -> None:
    document = ANALYSIS | {"model": None}
    found = run_result(Path("run.h5"), create_metadata(load_stand(), load_gauges(), DAY), document)

    assert (found.effects, found.noise_m) == (None, None)


def test_a_clock_timed_badly_takes_of_the_nominal_rate_what_all_runs_share() -> None:
    """With u^2 = t^2 p^2 / (t^2 + p^2) of the period, p = 0.1 %."""
    timed, nominal = 2e-3, 1e-3
    together = timed * nominal / math.hypot(timed, nominal)
    lines = [
        {"source": "time base", "contribution_to": name, "standard_uncertainty": power * together * value}
        for name, value, power in (("period_s", 0.32, 1.0), ("friction_dynamic", 0.1, 2.0))
    ]
    period = {"value": 0.32, "standard_uncertainty": 0.001, "interval_95": None, "unit": "s"}
    document = ANALYSIS | {"budget": lines, "results": ANALYSIS["results"] | {"period_s": period}}
    found = run_result(Path("run.h5"), create_metadata(load_stand(), load_gauges(), DAY), document)

    sizes = {(line.source, line.contribution_to): line.standard_uncertainty for line in found.budget}
    for name, value, power in (("period_s", 0.32, 1.0), ("friction_dynamic", 0.1, 2.0)):
        own = power * value * together**2 / timed
        common = power * value * together**2 / nominal
        assert sizes[BudgetSource.TIME_BASE, name] == pytest.approx(own)
        assert sizes[BudgetSource.NOMINAL_RATE, name] == pytest.approx(common)
