"""Which test of a campaign to make next, and what it would show."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from app.presenters.results import sentence

if TYPE_CHECKING:
    from analysis.campaign.campaign import Campaign
    from analysis.quantities import Quantity
    from config.schema import Stand

TARGET_REPEATS = 3
"""Tests of each series that a campaign should have."""


@dataclass(frozen=True, eq=False, slots=True)
class PlannedTest:
    """What a test would show.

    Attributes
    ----------
    series : str
    runs : int
        That there are.
    friction : Quantity
        With the uncertainty of a single test.
    known : Quantity or None
        As the runs of the series have it now.
    residual_displacement_m : float
    cautions : tuple of str
    """

    series: str
    runs: int
    friction: "Quantity | None"
    pooled_friction: "Quantity | None"
    residual_displacement_m: float
    warnings: tuple[str, ...]


def plan_next_test(campaign: "Campaign", all_series: tuple[str, ...]) -> PlannedTest | None:
    """The test of the series with the fewest runs; None where every series has enough."""
    from analysis.record import AnalysisError
    from config.files import load_stand
    from config.schema import ConfigError

    counts = dict.fromkeys(all_series, 0)
    for row in campaign.rows:
        if row.series.code in counts:
            counts[row.series.code] += len(row.runs)
    series = min(counts, key=lambda code: counts[code], default=None)
    if series is None or counts[series] >= TARGET_REPEATS:
        return None
    try:
        return _planned(series, counts[series], campaign, load_stand())
    except (AnalysisError, ConfigError):  # a series of a stand that is not described here
        return PlannedTest(series, counts[series], None, None, float("nan"), ())


def _planned(code: str, runs: int, campaign: "Campaign", stand: "Stand") -> PlannedTest:
    """Plan a test by what its series, or else the published table, says of T, n1 and f_d."""
    from analysis.motion.two_mass import TwoMassParameters
    from analysis.plan import plan
    from app.runs.plan_json import build_planned_test
    from config.files import load_gauges, published_row

    series, printed = stand.series(code), published_row(code)
    own = next((row.quantities for row in campaign.rows if row.series.code == code), {})
    found = {name: own[name].quantity for name in own}
    values = {
        name: found[name].value if name in found else getattr(printed, name)
        for name in ("period_s", "damping_n1_per_s", "friction_dynamic")
    }
    parameters = TwoMassParameters.from_free_decay(
        table_mass_kg=stand.table_mass_kg,
        plate_mass_kg=series.plate_mass_kg,
        pullback_m=series.pullback_m,
        **values,
    )
    planned = plan(build_planned_test(parameters, stand, load_gauges()))
    return PlannedTest(
        code,
        runs,
        planned.results.get("friction_dynamic"),
        found.get("friction_dynamic"),
        planned.motion.residual_displacement_m,
        tuple(sentence(caution.message) for caution in planned.warnings),
    )
