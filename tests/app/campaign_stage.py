"""A campaign as its worker would return it: runs of three contacts with known friction."""

import datetime
from dataclasses import replace

import numpy as np

from analysis.campaign.series import RunResult, SeriesKey
from analysis.quantities import BudgetLine, BudgetSource, Quantity, ResultWarning
from app.presenters.campaign.formatting import summarise
from app.presenters.campaign.state import CampaignSummary
from app.runs.campaign.collect import CollectedRuns, FailedRun
from app.runs.campaign.run_result import RunDetails
from app.runs.metadata import create_metadata
from config.files import load_stand
from config.schema import Gauge, Gauges
from messages.message import message
from tests.effects_kit import effect_run

FOLDER = "/recordings"
GAUGES = Gauges(*(Gauge(gain_m_per_count=1e-6, zero_count=0.0) for _ in range(2)))
ALL_SERIES = ("1FFM0", "1FFM1", "1SSM0", "1SSM1")
BEGUN = datetime.datetime(2026, 1, 12, tzinfo=datetime.UTC)
TORN = FailedRun(f"{FOLDER}/torn.h5", message("it is no run. Choose another"))
FRICTION = {"1FFM0": 0.100, "1FFM1": 0.100, "1SSM0": 0.150}


def path_of(series: str, number: int) -> str:
    return f"{FOLDER}/{series}_{number:03d}.h5"


def run(series: str, number: int, friction: float) -> RunResult:
    mass_kg = 22.4 if series.endswith("M0") else 27.4
    results = {
        "friction_dynamic": Quantity.normal(friction, 2e-4, "1"),
        "friction_static_lower": Quantity.normal(1.2 * friction, 2e-4, "1"),
        "period_s": Quantity.normal(0.32, 5e-6, "s"),
        "damping_n1_per_s": Quantity.normal(0.12, 3e-4, "1/s"),
        "table_velocity_max_m_per_s": Quantity.normal(0.24, 5e-4, "m/s"),
    }
    budget = tuple(
        BudgetLine(source, name, share * quantity.standard_uncertainty)
        for name, quantity in results.items()
        for source, share in ((BudgetSource.NOISE, 0.8), (BudgetSource.GAUGE_1_GAIN, 0.6))
    )
    key = SeriesKey(series, series[1:-2], 0.012, mass_kg, 131.6)
    return RunResult(path_of(series, number), key, results, budget, "cal", "stand", adequate=True)


def runs(repeats: int = 3, scatter: float = 1e-4) -> list[RunResult]:
    rng = np.random.default_rng(5)
    return [
        run(series, number, friction + rng.normal(scale=scatter))
        for series, friction in FRICTION.items()
        for number in range(1, repeats + 1)
    ]


def found(
    taken: list[RunResult] | None = None,
    excluded: dict[str, str] | None = None,
    unsaved: int = 0,
    failures: tuple[FailedRun, ...] = (TORN,),
) -> CampaignSummary:
    """What `tasks.collect` would bring; runs given as `excluded` were so by an operator."""
    taken = runs() if taken is None else taken
    reasons = excluded or {}
    counted = tuple(replace(one, excluded=reasons.get(one.name, one.excluded)) for one in taken)
    details = {
        one.name: RunDetails(
            create_metadata(load_stand(), GAUGES, BEGUN).replace(
                series=one.series.code, excluded=reasons.get(one.name, "")
            ),
            one.name,
            analysis=None if number < unsaved else 1,
        )
        for number, one in enumerate(counted)
    }
    stale = ResultWarning("stale", message("results of a.h5 were stale: new ones are taken."))
    return summarise(CollectedRuns(counted, failures, (stale,), details), ALL_SERIES)


def runs_with_a_mode() -> list[RunResult]:
    """Two runs of a series with the same second mode, and a long release in one."""
    mode = {"second-mode": (0.019, 8.2, 0.01)}
    return [
        effect_run(path_of("1FFM0", 1), mode),
        effect_run(path_of("1FFM0", 2), mode | {"release-ramp": (0.031,)}),
    ]
